"""What readers of logs share: tables of streams, their common time axis, attitudes, packages that only some need."""

import importlib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

Log = tuple[dict[str, pd.DataFrame], dict[str, Any]]
"""What a reader gives: tables of streams in SI units and sensor axes, and what a recording.toml would say."""

ACCELEROMETER, GYRO, VELOCITY = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["v_e", "v_n", "v_u"]
DOWN_TO_UP = np.diag([1.0, -1.0, -1.0])
"""Forward, right, down to forward, left, up."""


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
        return stream_table(t, f, ACCELEROMETER, file)
    t_gyro, w = gyro
    if not np.array_equal(t, t_gyro):
        inside = (t >= t_gyro[0]) & (t <= t_gyro[-1])
        notes.append(
            f"{file}: the gyro is interpolated to the accelerometer's times; samples outside the gyro's times dropped: "
            f"{(~inside).sum()}"
        )
        t, f = t[inside], f[inside]
        w = np.stack([np.interp(t, t_gyro, axis) for axis in w.T], -1)
    return stream_table(t, np.concatenate([f, w], -1), ACCELEROMETER + GYRO, file)


def at_accelerometer_times(table: pd.DataFrame, problems: list[str], notes: list[str]) -> pd.DataFrame:
    """An IMU's table in which accelerometer and gyro hold different rows, with the gyro at the accelerometer's times.

    So they stand after an outer merge of two files. A table that has both in half of the accelerometer's rows is
    returned as it is.
    """
    if not set(GYRO) <= set(table.columns):
        return table
    moving, turning = (table[triad].notna().all(axis=1).to_numpy() for triad in (ACCELEROMETER, GYRO))
    if 2 * (moving & turning).sum() >= moving.sum() or turning.sum() < 2:
        return table
    table, file = table.sort_values("t", kind="stable"), table.attrs["file"]
    moving, turning = (table[triad].notna().all(axis=1).to_numpy() for triad in (ACCELEROMETER, GYRO))
    series = [
        (table.loc[rows, "t"].to_numpy(), table.loc[rows, triad].to_numpy())
        for rows, triad in ((moving, ACCELEROMETER), (turning, GYRO))
    ]
    notes.append(f"{file}: accelerometer and gyro stand in different rows, as after an outer merge")
    merged = imu_table(series[0], series[1], file, problems, notes)
    if "temperature" in table.columns and table["temperature"].notna().any():
        known = table[["t", "temperature"]].dropna()
        merged["temperature"] = np.interp(merged["t"], known["t"], known["temperature"])
    return merged


def with_known_velocity(table: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    """The rows of a receiver that have speed and course; where it rests a course does not matter, and often is none."""
    known = table["speed"].notna() & (table["course"].notna() | (table["speed"] == 0))
    if not known.all():
        notes.append(f"{table.attrs['file']}: {(~known).sum()} rows without speed or course dropped")
    return table[known]


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


def first_bytes(path: Path, count: int = 65536) -> bytes:
    """The beginning of a file, by which its format is known; 64 KiB are more than any header here."""
    with path.open("rb") as stream:
        return stream.read(count)


def import_extra(name: str, path: Path, *, doing: str = "reading", extra: str = "logs") -> ModuleType:
    """A module of a package that only some formats need, or which extra installs it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        package = name.partition(".")[0]
        raise ModuleNotFoundError(f"{path.name}: {doing} it needs {package}: pip install 'altijax[{extra}]'") from error


def rotations_of(quaternions: np.ndarray) -> np.ndarray:
    """Rotations (time, 3, 3) of quaternions (time, 4), scalar first; NaN where a quaternion is none."""
    matrices = np.full((len(quaternions), 3, 3), np.nan)
    usable = np.isfinite(quaternions).all(1) & quaternions.any(1)
    matrices[usable] = Rotation.from_quat(quaternions[usable], scalar_first=True).as_matrix()
    return matrices


def attitude_columns(C_nb: np.ndarray) -> dict[str, np.ndarray]:
    """Columns roll, pitch and heading in rad of rotations (time, 3, 3) from body to navigation axes."""
    yaw = np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0])
    return {
        "roll": np.arctan2(C_nb[:, 2, 1], C_nb[:, 2, 2]),
        "pitch": np.arcsin(np.clip(C_nb[:, 2, 0], -1, 1)),
        "heading": np.mod(np.pi / 2 - yaw, 2 * np.pi),
    }
