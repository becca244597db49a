"""Logs as others write them: a comma2k19 segment and PX4's ULog, as tables in SI units and sensor axes.

Time starts at zero at the first IMU sample. The second result is what a recording.toml would say.
"""

import importlib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
from pymap3d import ecef2enuv, ecef2geodetic
from scipy.spatial.transform import Rotation

from altijax.formats.stream_checks import RecordingError

Log = tuple[dict[str, pd.DataFrame], dict[str, Any]]

_ACCELEROMETER, _GYRO, _VELOCITY = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["v_e", "v_n", "v_u"]
_DOWN_TO_UP = np.diag([1.0, -1.0, -1.0])
_NED_TO_ENU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def is_comma2k19(folder: Path) -> bool:
    """Whether a folder is a segment of comma2k19."""
    return (folder / "processed_log").is_dir()


def read_comma2k19(folder: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a comma2k19 segment: IMU, four wheel speeds, u-blox receiver, and its pose as the reference."""
    arrays = {
        file.relative_to(folder).as_posix(): _read_array(file, file.relative_to(folder).as_posix(), problems)
        for part in ("processed_log", "global_pose")
        for file in sorted((folder / part).rglob("*"))
        if file.is_file() and not file.suffix
    }

    def series(name: str, width: int) -> list[np.ndarray] | None:
        """The arrays t and value under a name, or None."""
        return _matching(arrays, [f"{name}/t", f"{name}/value"], [0, width], problems)

    accelerometer = series("processed_log/IMU/accelerometer", 3)
    if accelerometer is None:
        found = ", ".join(arrays) or "nothing"
        raise RecordingError(
            f"{folder}: processed_log/IMU/accelerometer/t and value (rows of 3) are needed; found {found}"
        )
    gyro = series("processed_log/IMU/gyro", 3)
    tables = {"imu": imu_table(accelerometer, gyro, "processed_log/IMU", problems, notes)}
    wheel = series("processed_log/CAN/wheel_speed", 4)
    if wheel:
        columns = ["front_left", "front_right", "rear_left", "rear_right"]
        tables["wheel"] = stream_table(wheel[0], wheel[1], columns, "processed_log/CAN/wheel_speed")
    gnss = series("processed_log/GNSS/live_gnss_ublox", 6)
    if gnss:
        columns = ["lat", "lon", "speed", "utc", "alt", "course"]
        table = stream_table(gnss[0], gnss[1], columns, "processed_log/GNSS/live_gnss_ublox")
        tables["gnss"] = table.drop(columns="utc")
    names = [f"global_pose/frame_{name}" for name in ("times", "positions", "velocities", "orientations")]
    pose = _matching(arrays, names, [0, 3, 3, 4], problems)
    if pose:
        tables["reference"] = _comma2k19_reference(*pose)
    return from_first_imu_sample(tables), {
        "name": folder.name,
        "description": "comma2k19 segment; the reference is a fusion that used the same IMU",
        "axes": "FRD",
    }


def read_ulog(path: Path, problems: list[str], notes: list[str]) -> Log:
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


def imu_table(
    accelerometer: Sequence[np.ndarray],
    gyro: Sequence[np.ndarray] | None,
    file: str,
    problems: list[str],
    notes: list[str],
) -> pd.DataFrame:
    """Accelerometer and gyro, each times and vectors, at the accelerometer's times."""
    t, f = accelerometer
    if gyro is None:
        problems.append(f"{file}: there is no gyro; only the accelerometer was read")
        return stream_table(t, f, _ACCELEROMETER, file)
    t_gyro, w = gyro
    if not np.array_equal(t, t_gyro):
        inside = (t >= t_gyro[0]) & (t <= t_gyro[-1])
        notes.append(
            f"{file}: the gyro is interpolated to the accelerometer's times; samples outside the gyro's times dropped: "
            f"{(~inside).sum()}"
        )
        t, f = t[inside], f[inside]
        w = np.stack([np.interp(t, t_gyro, axis) for axis in w.T], -1)
    return stream_table(t, np.concatenate([f, w], -1), _ACCELEROMETER + _GYRO, file)


def stream_table(t: np.ndarray, values: np.ndarray, columns: Sequence[str], file: str) -> pd.DataFrame:
    """Table of a stream that counts its rows from 1."""
    table = pd.DataFrame(values, columns=list(columns), index=pd.RangeIndex(1, len(t) + 1, name="row"))
    table.insert(0, "t", t)
    table.attrs["file"] = file
    return table


def from_first_imu_sample(tables: dict[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """The tables on a time axis that starts with the IMU, or with the first stream where there is none."""
    first = tables["imu"] if "imu" in tables else next(iter(tables.values()), None)
    if first is None or first.empty:
        return tables
    start = first["t"].iloc[0]
    return {stream: table.assign(t=table["t"] - start) for stream, table in tables.items()}


def import_extra(name: str, path: Path) -> ModuleType:
    """A package that only some formats need, or how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{path.name}: reading it needs {name}: pip install 'altijax[logs]'") from error


def _read_array(path: Path, name: str, problems: list[str]) -> np.ndarray | None:
    """The complete rows of a NumPy file; None where there are none, or no numbers."""
    with path.open("rb") as stream:
        try:
            version = np.lib.format.read_magic(stream)
            read_header = (
                np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            )
            shape, fortran_order, dtype = read_header(stream)
        except ValueError as error:
            problems.append(f"{name}: not a NumPy array ({error}); left out, copy it again from its source")
            return None
        if dtype.hasobject or not shape:
            return None
        content = stream.read()
    expected = int(np.prod(shape))
    got = min(len(content) // dtype.itemsize, expected)
    # In column order a row is complete when the last column has it.
    rows = max(got - (expected - shape[0]), 0) if fortran_order else got // max(expected // max(shape[0], 1), 1)
    if got < expected:
        fate = f"only its first {rows} rows are whole" if rows else "left out"
        problems.append(
            f"{name}: cut short, {expected} elements expected and {got} got; {fate}, copy it again from its source"
        )
    if dtype.kind not in "iuf" or not rows:
        return None
    values = np.zeros(expected)
    values[:got] = np.frombuffer(content, dtype, got)
    return values.reshape(shape, order="F" if fortran_order else "C")[:rows]


def _matching(
    arrays: dict[str, np.ndarray | None], names: Sequence[str], widths: Sequence[int], problems: list[str]
) -> list[np.ndarray] | None:
    """Arrays that belong together, as many rows of each as all have; None where one is missing or misshapen."""
    found: list[np.ndarray] = []
    for name, width in zip(names, widths, strict=True):
        array = arrays.get(name)
        if array is not None and array.shape[1:] == ((width,) if width else ()):
            found.append(array)
            continue
        if any(other in arrays for other in names):
            seen = "missing" if name not in arrays else "empty" if array is None else f"of shape {array.shape}"
            problems.append(
                f"{name}: {seen}, {f'rows of {width}' if width else 'a plain series'} wanted; its stream is left out"
            )
        return None
    rows = [len(array) for array in found]
    if min(rows) < max(rows):
        problems.append(f"{', '.join(names)}: they have {rows} rows; the first {min(rows)} of each are used")
    return [array[: min(rows)] for array in found]


def _comma2k19_reference(
    t: np.ndarray, positions: np.ndarray, velocities: np.ndarray, orientations: np.ndarray
) -> pd.DataFrame:
    lat, lon, alt = ecef2geodetic(*positions.T)
    C_ne = np.stack([ecef2enuv(*axis, lat, lon) for axis in np.eye(3)], -1).swapaxes(0, 1)
    C_nb = C_ne @ _matrices(orientations) @ _DOWN_TO_UP
    columns = _attitude(C_nb) | dict(zip(_VELOCITY, np.einsum("tij,tj->it", C_ne, velocities), strict=True))
    columns |= {"lat": lat, "lon": lon, "alt": alt}
    return stream_table(t, np.stack(list(columns.values()), -1), list(columns), "global_pose")


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
        columns = _attitude(_NED_TO_ENU @ _matrices(quaternion) @ _DOWN_TO_UP)
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


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotations (time, 3, 3) of quaternions (time, 4), scalar first; NaN where a quaternion is none."""
    matrices = np.full((len(quaternions), 3, 3), np.nan)
    usable = np.isfinite(quaternions).all(1) & quaternions.any(1)
    matrices[usable] = Rotation.from_quat(quaternions[usable], scalar_first=True).as_matrix()
    return matrices


def _attitude(C_nb: np.ndarray) -> dict[str, np.ndarray]:
    yaw = np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0])
    return {
        "roll": np.arctan2(C_nb[:, 2, 1], C_nb[:, 2, 2]),
        "pitch": np.arcsin(np.clip(C_nb[:, 2, 0], -1, 1)),
        "heading": np.mod(np.pi / 2 - yaw, 2 * np.pi),
    }
