"""Bags that rosbags writes, in every container."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from altijax.recordings import RecordingError, RecordingWarning, read_recording

N, START = 100, 1_700_000_000
HUMBLE, NOETIC = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
IMU, FIX, FLOAT = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "std_msgs/msg/Float64"
TWIST, COVARIANT = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped"
ODOMETRY = "nav_msgs/msg/Odometry"


class Messages:
    """Messages of a drive to the North-West at 5 m/s, nose 0.1 rad up, at times k / 100 s."""

    def __init__(self, store, epoch=START):
        self.store, self.epoch = store, epoch

    def of(self, name, *values):
        return self.store.types[name](*values)

    def header(self, k):
        stamp = self.of("builtin_interfaces/msg/Time", self.epoch + k // 100, k % 100 * 10_000_000)
        fields = self.store.types["std_msgs/msg/Header"].__dataclass_fields__
        return self.of("std_msgs/msg/Header", *([k] if "seq" in fields else []), stamp, "frame")

    def vector(self, *values):
        return self.of("geometry_msgs/msg/Vector3", *map(float, values))

    def quaternion(self):
        yaw, pitch = 0.75 * np.pi / 2, -0.1 / 2
        x, y, z, w = (
            -np.sin(yaw) * np.sin(pitch),
            np.cos(yaw) * np.sin(pitch),
            np.sin(yaw) * np.cos(pitch),
            np.cos(yaw) * np.cos(pitch),
        )
        return self.of("geometry_msgs/msg/Quaternion", x, y, z, w)

    def twist(self, *velocity):
        return self.of("geometry_msgs/msg/Twist", self.vector(*velocity), self.vector(0, 0, 0))

    def imu(self, k, gyro=0.0):
        f, w = self.vector(0.01 * k, 0.2, 9.8), self.vector(0.01, 0.02, 0.03)
        none = np.full(9, gyro)
        return self.of(IMU, self.header(k), self.quaternion(), np.zeros(9), w, none, f, np.zeros(9))

    def fix(self, k):
        status = self.of("sensor_msgs/msg/NavSatStatus", -1 if k < 20 else 0, 1)
        return self.of(FIX, self.header(k), status, 47.0, 8.0 + 1e-4 * k, 500.0, np.zeros(9), 0)

    def velocity(self, k):
        covariance = np.diag([0.04, 0.09, 0.25, 0, 0, 0]).ravel()
        twist = self.of("geometry_msgs/msg/TwistWithCovariance", self.twist(-3, 4, 0.5), covariance)
        return self.of(COVARIANT, self.header(k), twist)

    def odometry(self, k):
        place = self.of("geometry_msgs/msg/Point", 0.0, 0.0, 0.1 * k)
        pose = self.of("geometry_msgs/msg/Pose", place, self.quaternion())
        pose = self.of("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))
        twist = self.of("geometry_msgs/msg/TwistWithCovariance", self.twist(5, 0, 0), np.zeros(36))
        return self.of(ODOMETRY, self.header(k), "base_link", pose, twist)


def drive(m):
    """Topic, type and messages, (time in 0.01 s, message)."""
    steps = range(0, N, 10)
    return [
        ("/imu/data", IMU, [(k, m.imu(k)) for k in range(N)]),
        ("/gps/fix", FIX, [(k, m.fix(k)) for k in steps]),
        ("/gps/fix_velocity", COVARIANT, [(k, m.velocity(k)) for k in steps]),
        ("/vehicle/wheel_speed", FLOAT, [(k, m.of(FLOAT, 5.0)) for k in range(0, N, 2)]),
        ("/odometry/filtered", ODOMETRY, [(k, m.odometry(k)) for k in steps]),
        ("/diagnostics", FLOAT, [(0, m.of(FLOAT, 1.0))]),
    ]


def write(path, topics, storage=StoragePlugin.MCAP):
    """A ROS 2 bag, or a ROS 1 bag where the storage is None; messages arrive 3 ms after their time."""
    store = NOETIC if storage is None else HUMBLE
    serialize = store.serialize_ros1 if storage is None else store.serialize_cdr
    with Writer1(path) if storage is None else Writer2(path, version=9, storage_plugin=storage) as writer:
        for topic, kind, messages in topics:
            connection = writer.add_connection(topic, kind, typestore=store)
            for k, message in messages:
                writer.write(connection, START * 10**9 + k * 10**7 + 3 * 10**6, serialize(message, kind))
    return path


def check(r):
    assert r.axes == "FLU"
    np.testing.assert_allclose(r.imu.index, 0.01 * np.arange(N), atol=1e-6)
    np.testing.assert_allclose(r.imu.iloc[50], [0.5, 0.2, 9.8, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(r.gnss.iloc[3], [-3, 4, 0.5, 47, 8.003, 500, 0.2, 0.3, 0.5])
    # Without a header a message counts from its arrival.
    np.testing.assert_allclose(r.wheel.index, 0.003 + 0.02 * np.arange(N // 2), atol=1e-6)
    heading, level = np.radians(315), 5 * np.cos(0.1) / np.sqrt(2)
    pose = [0, 0.1, heading, -level, level, 5 * np.sin(0.1), 5.0]
    np.testing.assert_allclose(r.reference.iloc[5], pose, atol=1e-12)
    assert any("/gps/fix_velocity as velocity" in note for note in r.notes)


GAPS = pytest.mark.filterwarnings("ignore:.*columns? (lat|lon|alt).*nan is not a number")


@GAPS
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3, None])
def test_every_container(tmp_path, storage):
    m = Messages(NOETIC if storage is None else HUMBLE)
    path = write(tmp_path / ("drive.bag" if storage is None else "drive"), drive(m), storage)
    check(read_recording(path))
    if storage is not None:
        single = shutil.copy(next(file for file in path.iterdir() if file.suffix != ".yaml"), tmp_path)
        check(read_recording(single))


def test_of_several_topics_the_fullest_is_taken_and_said(tmp_path):
    m = Messages(HUMBLE)
    few = [(k, m.imu(k)) for k in range(0, N, 4)]
    write(tmp_path / "b", [("/a", IMU, few), ("/b", IMU, [(k, m.imu(k)) for k in range(N)])])
    with pytest.warns(RecordingWarning, match=r"b: /b is taken as imu, for it has most messages, and /a left out; to"):
        assert len(read_recording(tmp_path / "b").imu) == N


def test_stamps_of_another_clock_and_messages_that_overtake(tmp_path):
    m = Messages(HUMBLE, epoch=77)
    order = [*range(50), 51, 50, *range(52, N)]
    write(tmp_path / "b", [("/imu", IMU, [(k, m.imu(k)) for k in range(N)])])
    r = read_recording(tmp_path / "b")
    assert any("dated by arrival in the bag" in note for note in r.notes) and len(r.imu) == N
    m = Messages(HUMBLE)
    write(tmp_path / "c", [("/imu", IMU, [(k, m.imu(order[k])) for k in range(N)])])
    r = read_recording(tmp_path / "c")
    assert any("1 messages came after later ones" in note for note in r.notes)
    np.testing.assert_allclose(r.imu["ax"], 0.01 * np.arange(N))


def test_a_covariance_of_minus_one_says_that_there_is_no_gyro(tmp_path):
    m = Messages(HUMBLE)
    write(tmp_path / "b", [("/imu", IMU, [(k, m.imu(k, gyro=-1.0)) for k in range(N)])])
    with pytest.warns(RecordingWarning, match="say that there is no gyro"):
        assert list(read_recording(tmp_path / "b").imu) == ["ax", "ay", "az"]


def test_what_is_missing_is_said(tmp_path):
    m = Messages(HUMBLE)
    imu = ("/imu", IMU, [(k, m.imu(k)) for k in range(N)])
    write(tmp_path / "b", [imu, ("/gps/fix", FIX, [(k, m.fix(k)) for k in range(N)])])
    with pytest.warns(RecordingWarning, match="positions are left out, there is no velocity"):
        assert read_recording(tmp_path / "b").gnss is None
    write(tmp_path / "c", [("/speed", FLOAT, [(k, m.of(FLOAT, 5.0)) for k in range(N)])])
    with pytest.raises(RecordingError, match=r"its topics are /speed \(std_msgs/msg/Float64\)"):
        read_recording(tmp_path / "c")


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3, None])
@pytest.mark.parametrize("kept", [40, 2000])
def test_a_bag_that_is_cut_short(tmp_path, storage, kept):
    m = Messages(NOETIC if storage is None else HUMBLE)
    path = write(tmp_path / "x.bag", [("/imu", IMU, [(k, m.imu(k)) for k in range(N)])], storage)
    file = path if storage is None else next(file for file in path.iterdir() if file.suffix != ".yaml")
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(RecordingError, match=r"it cannot be read as a bag .*reindex"):
        read_recording(file)


def test_ros_2_before_iron_leaves_definitions_out(tmp_path):
    m = Messages(HUMBLE)
    path = write(tmp_path / "old", [("/imu", IMU, [(k, m.imu(k)) for k in range(N)])], StoragePlugin.SQLITE3)
    file = next(path.glob("*.db3"))
    with closing(sqlite3.connect(file)) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("DROP TABLE schema")
        database.commit()
    assert len(read_recording(file).imu) == N
