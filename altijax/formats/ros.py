"""ROS 1 and ROS 2 bags and MCAP files, as tables in SI units and sensor axes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import (
    ACCELEROMETER,
    GYRO,
    VELOCITY,
    Log,
    attitude_columns,
    first_bytes,
    from_first_imu_sample,
    import_extra,
    rotations_of,
    stream_table,
)

_MAGIC = (b"#ROSBAG V2.0", b"\x89MCAP0\r\n")
_SQLITE = b"SQLite format 3\0"
_POSITION = ["lat", "lon", "alt"]
_DEVIATION = ["sd_e", "sd_n", "sd_u"]

_OWN_CLOCK = 60.0
"""Seconds between stamp and arrival beyond which a stamp is of another clock, no late message."""

_LATE = 1.0
"""Seconds by which messages may overtake each other; more is a clock that was set."""


def _imu(m: Any) -> list[float]:
    f, w = m.linear_acceleration, m.angular_velocity
    # A first covariance of -1 says that there is no such sensor.
    measured = [m.linear_acceleration_covariance[0] != -1, m.angular_velocity_covariance[0] != -1]
    return [x if measured[k] else np.nan for k, v in enumerate((f, w)) for x in (v.x, v.y, v.z)]


def _position(m: Any) -> list[float]:
    return [m.latitude, m.longitude, m.altitude] if m.status.status >= 0 else [np.nan] * 3


def _velocity(m: Any) -> list[float]:
    v = m.twist.linear
    return [v.x, v.y, v.z, np.nan, np.nan, np.nan]


def _velocity_with_covariance(m: Any) -> list[float]:
    v, variances = m.twist.twist.linear, m.twist.covariance[[0, 7, 14]]
    return [v.x, v.y, v.z, *np.sqrt(np.where(variances > 0, variances, np.nan))]


def _odometry(m: Any) -> list[float]:
    q, p, v = m.pose.pose.orientation, m.pose.pose.position, m.twist.twist.linear
    return [q.w, q.x, q.y, q.z, v.x, v.y, v.z, p.z]


# What the name of a topic has, the message, and its numbers; the first row that fits a topic decides.
_KINDS: list[tuple[str, str, tuple[str, ...], Callable[[Any], list[float]]]] = [
    ("imu", "sensor_msgs/msg/Imu", (), _imu),
    ("position", "sensor_msgs/msg/NavSatFix", (), _position),
    ("wheel", "geometry_msgs/msg/TwistStamped", ("wheel", "odom", "speed"), lambda m: [m.twist.linear.x]),
    (
        "wheel",
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        ("wheel", "odom", "speed"),
        lambda m: [m.twist.twist.linear.x],
    ),
    ("wheel", "nav_msgs/msg/Odometry", ("wheel",), lambda m: [m.twist.twist.linear.x]),
    ("wheel", "std_msgs/msg/Float64", ("wheel", "speed"), lambda m: [m.data]),
    ("wheel", "std_msgs/msg/Float32", ("wheel", "speed"), lambda m: [m.data]),
    ("velocity", "geometry_msgs/msg/TwistStamped", ("gps", "gnss", "fix", "vel"), _velocity),
    (
        "velocity",
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        ("gps", "gnss", "fix", "vel"),
        _velocity_with_covariance,
    ),
    ("odometry", "nav_msgs/msg/Odometry", (), _odometry),
]


def reads(path: Path) -> bool:
    """Whether a path is a bag or an MCAP file by its first bytes, or the folder of a ROS 2 bag."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() and any(file.suffix in (".db3", ".mcap") for file in path.iterdir())
    start = first_bytes(path, len(_SQLITE)) if path.is_file() else b""
    return start.startswith(_MAGIC) or (start == _SQLITE and path.suffix == ".db3")


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a bag: Imu, NavSatFix with a velocity in East, North and up, wheel speeds; Odometry as the reference.

    Of several topics of a kind the one with most messages is taken. A speed or velocity is known by the topic's name.
    """
    series = _series(path, problems, notes)
    tables = {}
    if "imu" in series:
        t, values = series["imu"]
        columns = ACCELEROMETER + GYRO
        if not np.isfinite(values[:, 3:]).any():
            columns = ACCELEROMETER
            problems.append(f"{path.name}: its Imu messages say that there is no gyro; only the accelerometer was read")
        tables["imu"] = stream_table(t, values[:, : len(columns)], columns, f"{path.name} Imu")
    if "wheel" in series:
        tables["wheel"] = stream_table(*series["wheel"], ["speed"], f"{path.name} wheel")
    if "velocity" in series:
        tables["gnss"] = _gnss(series["velocity"], series.get("position"), path.name, notes)
    elif "position" in series:
        problems.append(
            f"{path.name}: its positions are left out, there is no velocity to them (a TwistStamped with gps, gnss, "
            "fix or vel in its topic); record the receiver's velocity too"
        )
    if "odometry" in series:
        tables["reference"] = _reference(*series["odometry"], path.name, notes)
    return from_first_imu_sample(tables), {"name": path.stem, "description": "ROS bag", "axes": "FLU"}


def _series(path: Path, problems: list[str], notes: list[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times and numbers of one topic of each kind."""
    rosbags = import_extra("rosbags.highlevel", path, extra="ros")
    typesys = import_extra("rosbags.typesys", path, extra="ros")
    errors = (
        rosbags.AnyReaderError,
        import_extra("rosbags.rosbag1", path, extra="ros").ReaderError,
        import_extra("rosbags.rosbag2", path, extra="ros").ReaderError,
    )
    # ROS 2 before Iron leaves the definitions of messages out; these have been the same in all of its versions.
    known = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with rosbags.AnyReader([path], default_typestore=known) as bag:
            chosen = _chosen(bag.connections, path.name, problems, notes)
            rows: dict[str, list[tuple[float, float, list[float]]]] = {kind: [] for kind, _ in chosen.values()}
            wanted = [connection for connection in bag.connections if connection.topic in chosen]
            for connection, arrival, raw in bag.messages(wanted) if wanted else ():
                kind, numbers = chosen[connection.topic]
                message = bag.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp if hasattr(message, "header") else None
                stamped = np.nan if stamp is None else stamp.sec + stamp.nanosec * 1e-9
                rows[kind].append((stamped, arrival * 1e-9, numbers(message)))
    except errors as error:
        raise RecordingError(
            f"{path.name}: it cannot be read as a bag ({error}); copy it again from its source, or mend it with `ros2 "
            "bag reindex`, `rosbag reindex` or `mcap recover`"
        ) from error
    return {kind: _in_order(rows[kind], f"{path.name} {kind}", notes) for kind in rows if rows[kind]}


def _chosen(
    connections: list[Any], file: str, problems: list[str], notes: list[str]
) -> dict[str, tuple[str, Callable[[Any], list[float]]]]:
    """Kind and reader of the topics that are read; the others of a kind are said."""
    found: dict[str, dict[str, int]] = {}
    readers = {}
    for connection in connections:
        for kind, message, words, numbers in _KINDS:
            name = connection.topic.lower()
            if connection.msgtype == message and (not words or any(word in name for word in words)):
                counts = found.setdefault(kind, {})
                counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
                readers[connection.topic] = (kind, numbers)
                break
    if "imu" not in found:
        topics = ", ".join(sorted(f"{c.topic} ({c.msgtype})" for c in connections)) or "none"
        raise RecordingError(f"{file}: there is no topic with sensor_msgs/Imu; its topics are {topics}")
    taken = {kind: max(sorted(counts), key=counts.__getitem__) for kind, counts in found.items()}
    notes.append(f"{file}: read were " + ", ".join(f"{topic} as {kind}" for kind, topic in taken.items()))
    for kind, counts in found.items():
        others = [topic for topic in counts if topic != taken[kind]]
        if others:
            problems.append(
                f"{file}: {taken[kind]} is taken as {kind}, for it has most messages, and {', '.join(others)} left "
                f"out; to choose, take it out: rosbags-convert --src {file} --dst chosen --exclude-topic {taken[kind]}"
            )
    return {topic: readers[topic] for topic in taken.values()}


def _in_order(
    rows: list[tuple[float, float, list[float]]], file: str, notes: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Times and numbers of a topic, by stamp where that is of the recorder's clock, and in its order."""
    stamps, arrivals, values = (
        np.array([r[0] for r in rows]),
        np.array([r[1] for r in rows]),
        np.array([r[2] for r in rows]),
    )
    t = stamps
    if not abs(np.median(stamps - arrivals)) < _OWN_CLOCK:
        notes.append(f"{file}: dated by arrival in the bag, its stamps are missing or of another clock")
        t = arrivals
    latest = np.maximum.accumulate(t)
    if 0 < (latest - t).max() < _LATE:
        notes.append(f"{file}: {(t < latest).sum()} messages came after later ones; put in the order of their stamps")
        order = np.argsort(t, kind="stable")
        t, values = t[order], values[order]
    return t, values


def _gnss(
    velocity: tuple[np.ndarray, np.ndarray], position: tuple[np.ndarray, np.ndarray] | None, file: str, notes: list[str]
) -> pd.DataFrame:
    """Velocities, with the positions at their times."""
    t, values = velocity
    notes.append(f"{file}: the velocity is taken as East, North and up, as a receiver's driver gives it")
    table = stream_table(t, values, VELOCITY + _DEVIATION, f"{file} velocity").dropna(axis=1, how="all")
    fixed = np.isfinite(position[1]).all(1) if position is not None else np.zeros(0, bool)
    if position is None or not fixed.any():
        return table
    t_fixed, places = position[0][fixed], position[1][fixed]
    columns = {
        name: np.interp(t, t_fixed, column, left=np.nan, right=np.nan)
        for name, column in zip(_POSITION, places.T, strict=True)
    }
    return table.assign(**columns)


def _reference(t: np.ndarray, values: np.ndarray, file: str, notes: list[str]) -> pd.DataFrame:
    """Attitude, velocity and height of Odometry, whose velocity is in body axes."""
    notes.append(
        f"{file}: the reference is Odometry; heading and velocity count from East and North only if its frame does, "
        "and it may have used the same sensors"
    )
    C_nb = rotations_of(values[:, :4])
    columns = attitude_columns(C_nb) | dict(zip(VELOCITY, np.einsum("tij,tj->it", C_nb, values[:, 4:7]), strict=True))
    columns["alt"] = values[:, 7]
    return stream_table(t, np.stack(list(columns.values()), -1), list(columns), f"{file} Odometry")
