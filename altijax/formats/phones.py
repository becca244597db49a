"""What the exports of phone apps have in common: one file a sensor, each with its own times, in the phone's axes."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.mixed_tables import without_held_rows
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, from_first_imu_sample, imu_table, stream_table, with_known_velocity
from altijax.formats.text_tables import layout_of, numbers, read_columns, seconds

AXES = "RFU"
"""Axes of a phone that lies flat, its top forward: x right, y to the top, z out of the screen, on Android and iOS."""

_CACHED = 5.0
"""Seconds before the IMU's start from which on a fix is one the phone had kept: receivers give one a second."""

Series = tuple[np.ndarray, np.ndarray]
"""Times (samples,) and values (samples, columns)."""


def series(
    path: Path, columns: Mapping[str, str], factors: Mapping[str, float], problems: list[str], notes: list[str]
) -> Series | None:
    """Columns of one sensor's file, rows with a time and a value, in order; None where there is none, with a sentence.

    Parameters
    ----------
    path : Path
        File.
    columns : mapping of str to str
        The file's names by ours, ``t`` first.
    factors : mapping of str to float
        By our names, what the file's numbers are multiplied by; 1 for others.
    problems, notes : list of str
        Sentences are added.
    """
    layout = layout_of(path)
    if layout is None:
        problems.append(f"{path.name}: has no row of numbers; it is left out")
        return None
    table = read_columns(path, layout, columns.values())
    t = seconds(table, columns["t"], factors.get("t", 1.0), problems)
    found = [numbers(table, source, problems) for name, source in columns.items() if name != "t"]
    with np.errstate(over="ignore"):
        values = np.stack(found, -1) * [factors.get(name, 1.0) for name in columns if name != "t"]
    usable = np.isfinite(t) & np.isfinite(values).any(1)
    if usable.sum() < len(t):
        notes.append(f"{path.name}: {len(t) - usable.sum()} rows without time or value dropped")
    t, values = t[usable], values[usable]
    order = np.argsort(t, kind="stable")
    if (np.diff(t) < 0).any():
        notes.append(f"{path.name}: rows were not in the order of their times and were sorted")
    t, first = np.unique(t[order], return_index=True)
    if t.size < 2:
        problems.append(f"{path.name}: has {t.size} usable row(s) and needs 2; it is left out")
        return None
    return t, values[order][first]


def added(first: Series, second: Series) -> Series:
    """Sum of two vector series at the times of the first that lie within those of the second."""
    t, values = first
    inside = (t >= second[0][0]) & (t <= second[0][-1])
    others = np.stack([np.interp(t[inside], second[0], column) for column in second[1].T], -1)
    return t[inside], values[inside] + others


def phone_log(
    path: Path,
    app: str,
    accelerometer: Series | None,
    gyro: Series | None,
    location: pd.DataFrame | None,
    problems: list[str],
    notes: list[str],
) -> Log:
    """Streams of a phone's sensors.

    Parameters
    ----------
    path : Path
        What is read.
    app : str
        Name of the app.
    accelerometer, gyro : Series or None
        Specific force in m/s^2 and angular rate in rad/s, in the phone's axes.
    location : DataFrame or None
        Table with t and columns of gnss.
    problems, notes : list of str
        Sentences are added.

    Returns
    -------
    tables, sheet
        As a reader gives them.
    """
    tables = {}
    if accelerometer is not None:
        tables["imu"] = imu_table(accelerometer, gyro, f"{path.name} accelerometer", problems, notes)
        notes.append(
            f"{path.name}: {app} does not say how the phone was mounted; axes are {AXES}, flat with its top forward, "
            "unless axes= says otherwise"
        )
    if location is not None and location.empty:
        problems.append(f"{location.attrs['file']}: has no row with speed and course; the stream is left out")
    elif location is not None:
        if accelerometer is not None:
            cached = location["t"] < accelerometer[0][0] - _CACHED
            if cached.any():
                notes.append(f"{location.attrs['file']}: {cached.sum()} fixes from before the recording dropped")
                location = location[~cached]
        tables["gnss"] = without_held_rows(location, notes)
    if not tables:
        raise RecordingError(
            f"{path.name}: an export of {app} with neither an accelerometer with gravity nor a location; found "
            f"{', '.join(sorted(file.name for file in path.iterdir())) if path.is_dir() else path.name}"
        )
    if "imu" not in tables:
        problems.append(f"{path.name}: there is no usable accelerometer in it; only the location was read")
    return from_first_imu_sample(tables), {"name": path.stem, "description": f"{app} export", "axes": AXES}


def location_table(location: Series, names: list[str], file: str, notes: list[str]) -> pd.DataFrame:
    """Location of a phone, in which a negative speed, course or deviation means that it is not known."""
    table = stream_table(*location, names, file)
    for column in [name for name in ("speed", "course", "sd_e", "sd_n") if name in names]:
        unknown = table[column] < 0
        if unknown.any():
            notes.append(f"{file}: {column} is negative, which means unknown, in {unknown.sum()} rows")
            table[column] = table[column].mask(unknown)
    return with_known_velocity(table, notes)
