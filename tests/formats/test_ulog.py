"""ULog files that the tests write themselves, value by value."""

import struct
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.recordings import RecordingError, RecordingWarning, read_recording

N = 700
# Attitude (forward, right, down) in North, East, down: heading 120, pitch 4, roll -3 degrees.
HEADING, PITCH, ROLL = np.radians([120.0, 4.0, -3.0])
IN_NED = Rotation.from_euler("ZYX", [HEADING, PITCH, ROLL])

TYPES = {"uint64_t": "Q", "int32_t": "i", "float": "f", "double": "d", "bool": "?", "int64_t": "q"}


def write_ulog(path, topics) -> None:
    """A ULog file: topics are (name, fields, rows), fields (type, name), rows of values."""

    def message(kind: str, data: bytes) -> bytes:
        return struct.pack("<HB", len(data), ord(kind)) + data

    out = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    for name, fields, _ in topics:
        out += message("F", f"{name}:{''.join(f'{kind} {field};' for kind, field in fields)}".encode())
    for k, (name, _, _) in enumerate(topics):
        out += message("A", struct.pack("<BH", 0, k) + name.encode())
    for k, (_, fields, rows) in enumerate(topics):
        form = "<H"
        for kind, _ in fields:
            base, _, size = kind.partition("[")
            form += f"{size.rstrip(']')}{TYPES[base]}"
        for row in rows:
            out += message("D", struct.pack(form, k, *row))
    path.write_bytes(out)


START = 5_000_000_000


def combined(relative=lambda k: 0, n=N):
    rng = np.random.default_rng(3)
    values = (rng.normal(size=(n, 6)) * [0.1, 0.1, 0.1, 1, 1, 1] + [0, 0, 0, 0, 0, -9.8]).astype(np.float32)
    rows = [(START + 4000 * k, *map(float, v[:3]), relative(k), *map(float, v[3:])) for k, v in enumerate(values)]
    fields = [
        ("uint64_t", "timestamp"),
        ("float[3]", "gyro_rad"),
        ("int32_t", "accelerometer_timestamp_relative"),
        ("float[3]", "accelerometer_m_s2"),
    ]
    return ("sensor_combined", fields, rows), values


def old_gps():
    fields = [("uint64_t", "timestamp"), ("int32_t", "lat"), ("int32_t", "lon"), ("int32_t", "alt")]
    fields += [("float", "s_variance_m_s"), ("float", "vel_n_m_s"), ("float", "vel_e_m_s"), ("float", "vel_d_m_s")]
    fields += [("bool", "vel_ned_valid")]
    rows = [(START + 200_000 * k, 473977000, 85456000, 488_250, 0.25, 3.0, -4.0, 0.5, k != 2) for k in range(10)]
    return ("vehicle_gps_position", fields, rows)


def test_a_ulog_round_trip_is_exact(tmp_path):
    imu, values = combined()
    q = IN_NED.as_quat(scalar_first=True)
    attitude = (
        "vehicle_attitude",
        [("uint64_t", "timestamp"), ("uint64_t", "timestamp_sample"), ("float[4]", "q")],
        [(START + 20_000 * k + 700, START + 20_000 * k, *q) for k in range(150)],
    )
    names = ["z", "vx", "vy", "vz", "ref_alt"]
    position = (
        "vehicle_local_position",
        [("uint64_t", "timestamp"), *(("float", name) for name in names), ("bool", "z_global")],
        [(START + 100_000 * k, -0.5 * k, 3.0, -4.0 + k, -5.0, 488.25, True) for k in range(25)],
    )
    write_ulog(tmp_path / "flight.ulg", [imu, old_gps(), attitude, position])
    r = read_recording(tmp_path / "flight.ulg")
    assert (r.name, r.axes) == ("flight", "FRD")
    np.testing.assert_allclose(r.imu.index, 0.004 * np.arange(N), atol=1e-9)
    expected = np.concatenate([values[:, 3:], values[:, :3]], -1).astype(float) * [1, -1, -1, 1, -1, -1]
    np.testing.assert_array_equal(r.imu.to_numpy(), expected)
    assert len(r.gnss) == 9 and any("1 rows without a velocity dropped" in note for note in r.notes)
    np.testing.assert_allclose(r.gnss.iloc[0], [-4, 3, -0.5, 47.3977, 8.5456, 488.25, 0.25, 0.25, 0.25], rtol=1e-12)
    # Attitudes hold at the time of their sample, positions are interpolated to them.
    assert r.reference.index[-1] == pytest.approx(2.4)
    np.testing.assert_allclose(
        r.reference[["roll", "pitch", "heading"]], np.tile([ROLL, PITCH, HEADING], (len(r.reference), 1)), atol=1e-6
    )
    np.testing.assert_allclose(r.reference["v_e"], -4 + r.reference.index / 0.1, atol=1e-9)
    np.testing.assert_allclose(r.reference["alt"], 488.25 + 5 * r.reference.index, atol=1e-9)
    assert (r.reference["v_n"] == 3).all() and (r.reference["v_u"] == 5).all()


def test_a_slower_accelerometer_sets_the_times_of_a_ulog(tmp_path):
    # Of each three gyro samples two repeat the accelerometer sample of the first; one has none at all.
    imu, values = combined(lambda k: 0x7FFFFFFF if k == 4 else -4000 * (k % 3) - 1000)
    write_ulog(tmp_path / "log.ulg", [imu])
    r = read_recording(tmp_path / "log.ulg")
    assert any("1 rows without an accelerometer sample" in note for note in r.notes)
    assert any("interpolated to the accelerometer's times" in note for note in r.notes)
    np.testing.assert_allclose(np.diff(r.imu.index), 0.012, atol=1e-9)
    np.testing.assert_array_equal(r.imu["ax"], values[3::3, 3].astype(float))
    between = 0.25 * values[2:-1:3, 0] + 0.75 * values[3::3, 0].astype(float)
    np.testing.assert_allclose(r.imu["gx"], between, atol=1e-9)


def test_newer_gps_and_parts_that_cannot_be_used(tmp_path):
    fields = [("uint64_t", "timestamp"), ("double", "latitude_deg"), ("double", "longitude_deg")]
    fields += [("double", "altitude_msl_m"), ("float", "s_variance_m_s")]
    fields += [("float", "vel_n_m_s"), ("float", "vel_e_m_s"), ("float", "vel_d_m_s"), ("bool", "vel_ned_valid")]
    gps = ("sensor_gps", fields, [(START + 100_000 * k, 47.5, 8.5, 500.125, 0.5, 1, 2, 3, True) for k in range(9)])
    wheels = ("wheel_encoders", [("uint64_t", "timestamp"), ("float[2]", "wheel_speed")], [(START, 1.0, 1.0)])
    write_ulog(tmp_path / "log.ulg", [combined()[0], gps, wheels])
    with pytest.warns(RecordingWarning, match=r"log.ulg: wheel_encoders left out, in rad/s and without a radius"):
        r = read_recording(tmp_path / "log.ulg")
    assert r.wheel is None and r.reference is None
    np.testing.assert_array_equal(r.gnss.iloc[0], [2, 1, -3, 47.5, 8.5, 500.125, 0.5, 0.5, 0.5])


def test_bad_ulogs(tmp_path):
    path = tmp_path / "log.ulg"
    path.write_bytes(b"not a log at all, but long enough")
    with pytest.raises(RecordingError, match=r"log.ulg: not a ULog file"):
        read_recording(path)
    write_ulog(path, [old_gps()])
    with pytest.raises(RecordingError, match=r"topic sensor_combined is missing; found vehicle_gps_position"):
        read_recording(path)


def test_a_missing_extra_says_how_to_install_it(tmp_path, monkeypatch):
    (tmp_path / "a.ulg").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(ModuleNotFoundError, match=r"a.ulg: reading it needs pyulog: pip install 'altijax\[logs\]'"):
        read_recording(tmp_path / "a.ulg")
