"""MDF files that asammdf writes."""

import gc
import sys

import numpy as np
import pytest
from asammdf import MDF, Signal

from altijax.recordings import RecordingError, RecordingWarning, read_recording

T, SLOW = np.arange(0, 4, 0.01), np.arange(0, 4, 0.04)
IMU = {
    "AccX": (0.01 * T, "g"),
    "Acceleration_Y": (0.2 + 0 * T, "m/s²"),
    "Chassis.AccZ": (9.8 + 0 * T, "m/s2"),
    "RollRate": (1.0 + 0 * T, "deg/s"),
    "PitchRate": (0.02 + 0 * T, "rad/s"),
    "YawRate\\XCP:1": (180 / np.pi + 0 * T, "°/s"),
}
WHEELS = {f"WheelSpeed_{wheel}": (36.0 + k + 0 * SLOW, "km/h") for k, wheel in enumerate(("FL", "FR", "RL", "RR"))}
GNSS = {"GPS_Speed": (10 + 0 * SLOW, "m/s"), "GPS_Course": (90 + 0 * SLOW, "deg"), "Latitude": (47 + 0 * SLOW, "°")}


def write(path, *groups, version="4.10"):
    with MDF(version=version) as file:
        for signals in groups:
            t = T if len(next(iter(signals.values()))[0]) == len(T) else SLOW
            file.append([Signal(values, 100 + t, name=name, unit=unit) for name, (values, unit) in signals.items()])
        file.save(path)
    return path


@pytest.mark.parametrize("name", ["x.mf4", "x.mdf"])
def test_channels_by_their_names_and_units(tmp_path, name):
    version = {"x.mf4": "4.10", "x.mdf": "3.30"}[name]
    r = read_recording(write(tmp_path / name, IMU, WHEELS, GNSS, version=version))
    np.testing.assert_allclose(r.imu.index, T, atol=1e-9)
    np.testing.assert_allclose(r.imu.iloc[200], [0.02 * 9.80665, 0.2, 9.8, np.pi / 180, 0.02, 1.0], rtol=1e-6)
    np.testing.assert_allclose(r.wheel.iloc[3], [10 + 1.5 / 3.6, *(10 + np.arange(4) / 3.6)])
    np.testing.assert_allclose(r.gnss[["v_e", "v_n", "lat"]].iloc[5], [10, 0, 47], atol=1e-9)
    assert any("channel AccX is ax of the accelerometer, in g" in note for note in r.notes)


def test_channels_of_other_times_are_interpolated(tmp_path):
    r = read_recording(
        write(tmp_path / "x.mf4", IMU, {"GPS_Speed": (10 + 0 * T, "m/s")}, {"GPS_Course": (0 * SLOW, "")})
    )
    assert len(r.gnss) == 397 and any(
        "GPS_Course is course of the gnss, in no unit, taken as deg" in n for n in r.notes
    )


def test_what_cannot_be_used_is_said(tmp_path):
    odd = {"VehicleSpeed": (10 + 0 * SLOW, "furlong"), "Latitude": (47 + 0 * SLOW, "deg")}
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(write(tmp_path / "x.mf4", IMU, odd))
    text = " | ".join(str(w.message) for w in seen)
    assert "channel VehicleSpeed: its unit 'furlong' is not known" in text and "lat left out" in text
    assert r.wheel is None and r.gnss is None


def test_a_file_without_an_accelerometer_lists_its_channels(tmp_path):
    with pytest.raises(RecordingError, match=r"no channel for ax, ay, az; its channels are GPS_Course, .*DBC"):
        read_recording(write(tmp_path / "x.mf4", GNSS))


@pytest.mark.parametrize("kept", [20, 100, 3000])
def test_a_file_that_is_cut_short(tmp_path, monkeypatch, kept):
    content = write(tmp_path / "x.mf4", IMU).read_bytes()
    (tmp_path / "x.mf4").write_bytes(content[:kept])
    # What asammdf leaves behind of a file that it cannot open fails once more when Python clears it away.
    monkeypatch.setattr(sys, "unraisablehook", lambda _: None)
    with pytest.raises(RecordingError, match=r"x.mf4: damaged or cut short .*copy it again"):
        read_recording(tmp_path / "x.mf4")
    gc.collect()
