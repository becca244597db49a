"""comma2k19 segments that the tests write themselves, value by value."""

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
