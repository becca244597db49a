"""comma2k19 segments and ULog files that the tests write themselves, value by value."""

import struct
import sys

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from altijax.recordings import RecordingError, RecordingWarning, read_recording

N = 700
T = 1000.0 + 0.01 * np.arange(N)


def save(path, array) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.save(file, array)


def cut(path, elements: int, size: int = 8) -> None:
    """Leave only the first elements of an array of which `size` bytes are one."""
    content = path.read_bytes()
    path.write_bytes(content[: 128 + elements * size])


# Attitude of the camera (forward, right, down) in North, East, down: heading 120, pitch 4, roll -3 degrees.
HEADING, PITCH, ROLL = np.radians([120.0, 4.0, -3.0])
IN_NED = Rotation.from_euler("ZYX", [HEADING, PITCH, ROLL])
SITE = (37.7, -122.4, 30.0)
V_NED = np.array([-9.0, 15.0, 0.7])


@pytest.fixture
def segment(tmp_path):
    """A comma2k19 segment; its arrays are in column order, as the originals are."""
    rng = np.random.default_rng(0)
    log = tmp_path / "processed_log"
    f = np.asfortranarray(np.array([0.1, 0.2, -9.8]) + rng.normal(size=(N, 3)))
    w = np.asfortranarray(0.1 * rng.normal(size=(N, 3)))
    save(log / "IMU/accelerometer/t", T)
    save(log / "IMU/accelerometer/value", f)
    save(log / "IMU/gyro/t", T)
    save(log / "IMU/gyro/value", w)
    save(log / "CAN/wheel_speed/t", T[::2] + 0.001)
    save(log / "CAN/wheel_speed/value", np.asfortranarray(17 + rng.normal(size=(N // 2, 4))))
    fix = np.tile([*SITE[:2], 17.5, 1.5e12, 30, 120.0], (60, 1))
    save(log / "GNSS/live_gnss_ublox/t", T[0] + 0.1 * np.arange(60))
    save(log / "GNSS/live_gnss_ublox/value", fix)
    north, east, up = ([0, 1, 0], [1, 0, 0], [0, 0, 1])
    to_ecef = np.stack([pymap3d.enu2ecefv(*axis, *SITE[:2]) for axis in (north, east, np.negative(up))], -1)
    turn = (Rotation.from_matrix(to_ecef) * IN_NED).as_quat(scalar_first=True)
    pose = tmp_path / "global_pose"
    save(pose / "frame_times", T[::5])
    save(pose / "frame_positions", np.tile(pymap3d.geodetic2ecef(*SITE), (N // 5, 1)))
    save(pose / "frame_velocities", np.tile(to_ecef @ V_NED, (N // 5, 1)))
    save(pose / "frame_orientations", np.tile(turn, (N // 5, 1)))
    return tmp_path, f, w


def test_a_segment_is_read_into_body_and_navigation_axes(segment):
    folder, f, w = segment
    r = read_recording(folder)
    assert r.axes == "FRD" and r.notes == () and r.name == folder.name
    np.testing.assert_allclose(r.imu.index, 0.01 * np.arange(N), atol=1e-9)
    np.testing.assert_array_equal(r.imu[["ax", "ay", "az"]], f * [1, -1, -1])
    np.testing.assert_array_equal(r.imu[["gx", "gy", "gz"]], w * [1, -1, -1])
    assert list(r.wheel.columns) == ["speed", "front_left", "front_right", "rear_left", "rear_right"]
    assert r.wheel.index[0] == pytest.approx(0.001)
    np.testing.assert_allclose(r.gnss["v_e"], 17.5 * np.sin(np.radians(120)))
    np.testing.assert_allclose(r.gnss["v_n"], 17.5 * np.cos(np.radians(120)))
    assert r.gnss["v_u"].isna().all() and "utc" not in r.gnss
    first = r.reference.iloc[0]
    np.testing.assert_allclose(first[["roll", "pitch", "heading"]], [ROLL, PITCH, HEADING], atol=1e-12)
    np.testing.assert_allclose(first[["v_e", "v_n", "v_u"]], [V_NED[1], V_NED[0], -V_NED[2]], atol=1e-12)
    np.testing.assert_allclose(first[["lat", "lon", "alt"]], SITE, rtol=1e-9)
    assert read_recording(folder, axes="BLD").imu["ax"].iloc[0] == -f[0, 0]


def test_one_truncated_array_does_not_stop_the_rest(segment):
    folder, _, _ = segment
    save(folder / "processed_log/IMU/magnetometer/value", np.asfortranarray(np.zeros((N, 3))))
    cut(folder / "processed_log/IMU/magnetometer/value", 3 * N - 10)
    with pytest.warns(RecordingWarning, match=r"magnetometer/value: cut short, 2100 elements expected and 2090 got"):
        r = read_recording(folder)
    assert len(r.imu) == N and r.wheel is not None and r.gnss is not None and r.reference is not None


def test_the_whole_rows_of_a_truncated_array_are_used(segment):
    folder, f, _ = segment
    cut(folder / "processed_log/IMU/accelerometer/value", 3 * N - 10)
    cut(folder / "processed_log/IMU/accelerometer/t", N - 3)
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(folder)
    text = [str(w.message) for w in seen]
    assert any("accelerometer/value: cut short" in m and f"only its first {N - 10} rows are whole" in m for m in text)
    assert any(f"they have [{N - 3}, {N - 10}] rows; the first {N - 10} of each are used" in m for m in text)
    np.testing.assert_array_equal(r.imu[["ax", "ay", "az"]], f[: N - 10] * [1, -1, -1])


def test_a_stream_without_a_whole_row_is_left_out(segment):
    folder, _, _ = segment
    cut(folder / "processed_log/CAN/wheel_speed/value", 5)
    (folder / "processed_log/GNSS/live_gnss_ublox/value").write_bytes(b"nothing of the kind")
    (folder / "global_pose/frame_orientations").unlink()
    with pytest.warns(RecordingWarning) as seen:
        r = read_recording(folder)
    text = " | ".join(str(w.message) for w in seen)
    assert r.wheel is None and r.gnss is None and r.reference is None and len(r.imu) == N
    for sentence in (
        "wheel_speed/value: cut short, 1400 elements expected and 5 got; left out",
        "live_gnss_ublox/value: not a NumPy array",
        "global_pose/frame_orientations: missing, rows of 4 wanted; its stream is left out",
    ):
        assert sentence in text


def test_without_an_accelerometer_nothing_can_be_read(segment):
    folder, _, _ = segment
    cut(folder / "processed_log/IMU/accelerometer/value", 0)
    with pytest.raises(
        RecordingError, match=r"processed_log/IMU/accelerometer/t and value .* are needed; found .*gyro"
    ):
        read_recording(folder)


def test_a_gyro_with_its_own_stamps_is_interpolated(segment):
    folder, _, _ = segment
    save(folder / "processed_log/IMU/gyro/t", T + 0.004)
    save(folder / "processed_log/IMU/gyro/value", np.tile(T[:, None] - T[0] + 0.004, 3) * [0.01, 0.02, 0.03])
    r = read_recording(folder)
    assert len(r.imu) == N - 1 and "interpolated" in r.notes[0] and r.notes[0].endswith("dropped: 1")
    np.testing.assert_allclose(r.imu["gz"], -0.03 * np.arange(1, N) * 0.01, atol=1e-12)
    assert r.imu.index[0] == 0


def test_units_are_not_for_formats_that_fix_theirs(segment):
    with pytest.raises(ValueError, match="units is for a tidy folder"):
        read_recording(segment[0], units={"gyro": "deg/s"})


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
    for name, file in (("pyulog", "a.ulg"), ("pyubx2", "a.ubx")):
        (tmp_path / file).write_bytes(b"")
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(
            ModuleNotFoundError, match=rf"{file}: reading it needs {name}: pip install 'altijax\[logs\]'"
        ):
            read_recording(tmp_path / file)
