"""Racelogic's .vbo, written here as three programs write it."""

import numpy as np
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

G = 9.80665


def write(path, header, names, rows):
    lines = ["File created on 11/04/2026 @ 11:32", "", "[header]", *header, "", "[comments]", "x, y", ""]
    path.write_text("\r\n".join([*lines, "[column names]", names, "", "[data]", *rows]) + "\r\n")
    return path


def packed(k):
    t = 23 * 3600 + 59 * 60 + 58 + 0.5 * k
    return f"{int(t // 3600 % 24):02d}{int(t // 60 % 60):02d}{t % 60:05.2f}"


HEADER = ["satellites", "time", "latitude", "longitude", "velocity kmh", "heading", "height", "vertical velocity kmh"]
NAMES = "sats time lat long velocity heading height vertvel"


def test_minutes_of_arc_kilometres_an_hour_and_packed_times(tmp_path):
    rows = [
        f"{0 if k == 1 else 137:03d} {packed(k)} +03119.09973 +00058.49277 036.000 090.00 +0152.5 -003.600"
        for k in range(20)
    ]
    with pytest.warns(RecordingWarning, match="there is no accelerometer with three axes"):
        r = read_recording(write(tmp_path / "a.vbo", HEADER, NAMES, rows))
    np.testing.assert_allclose(r.gnss.index, 0.5 * np.delete(np.arange(20), 1))
    np.testing.assert_allclose(r.gnss[["v_e", "v_u"]], np.tile([10, -1], (19, 1)))
    np.testing.assert_allclose(r.gnss[["lat", "lon", "alt"]], np.tile([51.9849955, -0.9748795, 152.5], (19, 1)))
    assert r.imu is None and any("1 rows without a satellite" in note for note in r.notes)


def test_the_unit_of_climb_is_told_by_the_header(tmp_path):
    header = [name.replace("vertical velocity kmh", "vertical velocity m/s") for name in HEADER]
    rows = [f"008 {packed(k)} +0 +0 036,000 090,00 +0152,5 -001,5" for k in range(4)]
    with pytest.warns(RecordingWarning, match="there is no accelerometer"):
        r = read_recording(write(tmp_path / "a.vbo", header, NAMES, rows))
    assert (r.gnss["v_u"] == -1.5).all() and (r.gnss["alt"] == 152.5).all()


@pytest.mark.parametrize(
    ("acceleration", "rates"),
    [
        ("LongAcc LatAcc VertAcc", "x-rotation-gyroscope y-rotation-gyroscope z-rotation-gyroscope"),
        ("x_acc-acc y_acc-acc z_acc-acc", "x_rate_of_rotation-gyro y_rate_of_rotation-gyro z_rate_of_rotation-gyro"),
    ],
)
def test_an_imu_of_three_axes(acceleration, rates, tmp_path):
    names = f"time lat lng velocity heading height latacc-calc {acceleration} {rates}"
    rows = [f"{packed(k)} 1 1 36 90 10 0.5 +0.1 -0.2 +1.0 +1.0 +2.0 -{k}" for k in range(20)]
    rows.insert(3, "12 too short")
    with pytest.warns(RecordingWarning, match=r"1 rows under \[data\] have other than 13 values"):
        r = read_recording(write(tmp_path / "a.vbo", [], names, rows))
    np.testing.assert_allclose(r.imu[["ax", "ay", "az"]], np.tile([0.1 * G, -0.2 * G, G], (20, 1)))
    np.testing.assert_allclose(r.imu["gz"], -np.radians(np.arange(20)))
    assert len(r.gnss) == 20


def test_files_without_rows_or_without_velocity(tmp_path):
    with pytest.raises(RecordingError, match=r"a.vbo: has no rows with a time under \[data\]"):
        read_recording(write(tmp_path / "a.vbo", HEADER, NAMES, []))
    with pytest.raises(
        RecordingError, match=r"neither velocity and heading nor an accelerometer; its columns are time, x"
    ):
        read_recording(write(tmp_path / "a.vbo", [], "time x", [f"{packed(k)} 1" for k in range(3)]))
