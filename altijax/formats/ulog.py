"""PX4's ULog, as tables in SI units and sensor axes."""

from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import (
    DOWN_TO_UP,
    Log,
    attitude_columns,
    first_bytes,
    from_first_imu_sample,
    import_extra,
    imu_table,
    rotations_of,
    stream_table,
)

_MAGIC = b"ULog\x01\x12\x35"
_NED_TO_ENU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def reads(path: Path) -> bool:
    """Whether a path is a ULog, by its first bytes, or says so by its name."""
    return path.is_file() and (path.suffix.lower() == ".ulg" or first_bytes(path).startswith(_MAGIC))


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a PX4 ULog: sensor_combined, the GNSS receiver, and PX4's own estimate as the reference."""
    pyulog = import_extra("pyulog", path)
    wanted = [
        "sensor_combined",
        "vehicle_gps_position",
        "sensor_gps",
        "vehicle_attitude",
        "vehicle_local_position",
        "wheel_encoders",
    ]
    try:
        with path.open("rb") as stream:
            log = pyulog.ULog(stream, wanted)
    except pyulog.core.ULogException as error:
        raise RecordingError(f"{path.name}: not a ULog file ({error}); copy it again from its source") from error
    if log.file_corruption:
        problems.append(
            f"{path.name}: damaged in places, where messages are lost; copy it again if its source is whole"
        )
    # Of several instances of a topic the first is taken.
    topics = {item.name: item.data for item in reversed(log.data_list) if item.data["timestamp"].size}
    if "sensor_combined" not in topics:
        found = ", ".join(topics) or "none that we read"
        raise RecordingError(f"{path.name}: the topic sensor_combined is missing; found {found}; switch its logging on")
    tables = {"imu": _ulog_imu(topics["sensor_combined"], path.name, problems, notes)}
    receiver = next((name for name in ("vehicle_gps_position", "sensor_gps") if name in topics), None)
    if receiver:
        tables["gnss"] = _ulog_gnss(topics[receiver], f"{path.name} {receiver}", notes)
    reference = _ulog_reference(topics, path.name, notes)
    if reference is not None:
        tables["reference"] = reference
    if "wheel_encoders" in topics:
        problems.append(
            f"{path.name}: wheel_encoders left out, in rad/s and without a radius; put speeds in m/s into a wheel.csv"
        )
    return from_first_imu_sample(tables), {
        "name": path.stem,
        "description": "PX4 log; the reference is its own estimate, which used the same sensors",
        "axes": "FRD",
    }


def _ulog_imu(data: dict[str, np.ndarray], file: str, problems: list[str], notes: list[str]) -> pd.DataFrame:
    t = data["timestamp"].astype(np.int64)
    delay = data["accelerometer_timestamp_relative"].astype(np.int64)
    valid = delay != 0x7FFFFFFF
    if not valid.all():
        notes.append(f"{file} sensor_combined: {(~valid).sum()} rows without an accelerometer sample dropped")
    accelerometer = np.stack([data[f"accelerometer_m_s2[{k}]"] for k in range(3)], -1).astype(float)
    gyro = np.stack([data[f"gyro_rad[{k}]"] for k in range(3)], -1).astype(float)
    # PX4 repeats the accelerometer's last sample with its own time when the gyro is faster.
    t_accelerometer, first = np.unique((t + delay)[valid], return_index=True)
    by_time = (t_accelerometer * 1e-6, accelerometer[valid][first])
    return imu_table(by_time, (t * 1e-6, gyro), f"{file} sensor_combined", problems, notes)


def _ulog_gnss(data: dict[str, np.ndarray], file: str, notes: list[str]) -> pd.DataFrame:
    valid = data["vel_ned_valid"].astype(bool) if "vel_ned_valid" in data else np.ones(len(data["timestamp"]), bool)
    if not valid.all():
        notes.append(f"{file}: {(~valid).sum()} rows without a velocity dropped")
    columns = {"v_e": data["vel_e_m_s"], "v_n": data["vel_n_m_s"], "v_u": -data["vel_d_m_s"]}
    # PX4 1.14 changed scaled integers into degrees and metres.
    if "latitude_deg" in data:
        columns |= {"lat": data["latitude_deg"], "lon": data["longitude_deg"], "alt": data["altitude_msl_m"]}
    else:
        columns |= {"lat": data["lat"] * 1e-7, "lon": data["lon"] * 1e-7, "alt": data["alt"] * 1e-3}
    columns |= {name: data["s_variance_m_s"] for name in ("sd_e", "sd_n", "sd_u")}
    values = np.stack([column.astype(float) for column in columns.values()], -1)
    return stream_table(data["timestamp"].astype(np.int64)[valid] * 1e-6, values[valid], list(columns), file)


def _ulog_reference(topics: dict[str, dict[str, np.ndarray]], file: str, notes: list[str]) -> pd.DataFrame | None:
    tables = []
    attitude, position = topics.get("vehicle_attitude"), topics.get("vehicle_local_position")
    if attitude:
        quaternion = np.stack([attitude[f"q[{k}]"] for k in range(4)], -1).astype(float)
        columns = attitude_columns(_NED_TO_ENU @ rotations_of(quaternion) @ DOWN_TO_UP)
        tables.append(
            stream_table(
                _sampled(attitude), np.stack(list(columns.values()), -1), list(columns), f"{file} vehicle_attitude"
            )
        )
    if position:
        columns = {"v_e": position["vy"], "v_n": position["vx"], "v_u": -position["vz"]}
        if position["z_global"].all():
            columns["alt"] = position["ref_alt"] - position["z"].astype(float)
        values = np.stack([column.astype(float) for column in columns.values()], -1)
        tables.append(stream_table(_sampled(position), values, list(columns), f"{file} vehicle_local_position"))
    if len(tables) < 2:
        return tables[0] if tables else None
    first, second = tables
    inside = (first["t"] >= second["t"].iloc[0]) & (first["t"] <= second["t"].iloc[-1])
    notes.append(f"{file}: the reference has vehicle_local_position interpolated to the times of vehicle_attitude")
    merged = first[inside].assign(
        **{name: np.interp(first["t"][inside], second["t"], second[name]) for name in second.columns if name != "t"}
    )
    merged.attrs["file"] = f"{file} vehicle_attitude, vehicle_local_position"
    return merged


def _sampled(topic: dict[str, np.ndarray]) -> np.ndarray:
    """Times in s at which a topic holds; newer PX4 tells the time of the IMU sample from that of publication."""
    return topic.get("timestamp_sample", topic["timestamp"]).astype(np.int64) * 1e-6
