"""Each stream in the form that a recording has: rows that can be used, SI units, body axes, one velocity, one speed."""

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from altijax.formats.axes import axes_to_matrix
from altijax.formats.packets import without_shared_stamps
from altijax.formats.quantities import WHEELS
from altijax.formats.sentinels import without_impossible_values
from altijax.formats.stamps import UnusableStreamError, check_time_unit, steady
from altijax.formats.stream_checks import (
    RecordingError,
    check_accelerometer_unit,
    check_attitude_unit,
    check_course_unit,
    check_gyro_unit,
    check_position,
    clean_rows,
)
from altijax.formats.stuck import (
    check_ranges,
    without_dead_wheels,
    without_filled_stretches,
    without_frozen_fixes,
    without_frozen_speeds,
)
from altijax.formats.tables import at_accelerometer_times

_ACCELEROMETER, _GYRO, _VELOCITY = ["ax", "ay", "az"], ["gx", "gy", "gz"], ["v_e", "v_n", "v_u"]
_NEEDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "imu": (("ax", "ay", "az"),),
    "wheel": (("speed",), *((name,) for name in WHEELS)),
    "gnss": (("v_e", "v_n"), ("speed", "course")),
    "reference": ((),),
}
_OPTIONAL: dict[str, set[str]] = {
    "imu": {"temperature"},
    "wheel": set(),
    "gnss": {"v_u", "climb", "lat", "lon", "alt", "sd_e", "sd_n", "sd_u"},
    "reference": {"roll", "pitch", "heading", "v_e", "v_n", "v_u", "lat", "lon", "alt"},
}


def final_stream(
    stream: str,
    table: pd.DataFrame,
    stated: Collection[str],
    axes: str,
    problems: list[str],
    notes: list[str],
    tables: Mapping[str, pd.DataFrame],
) -> pd.DataFrame | None:
    """One stream in its final form, or None where nothing usable is left.

    Parameters
    ----------
    stream : str
        Which one: imu, wheel, gnss or reference.
    table : DataFrame
        As `stream_checks` has tables, in SI units.
    stated : collection of str
        Quantities whose units somebody has stated: they are not doubted.
    axes : str
        Where the sensor's x, y and z point.
    problems, notes : list of str
        Grow by what is left out or changed.
    tables : mapping of str to DataFrame
        All streams, for what one says of the clock of another.

    Returns
    -------
    table : DataFrame or None
        Indexed by t, as a `Recording` has it.

    Raises
    ------
    RecordingError
        If the IMU has nothing usable, or a unit cannot be what it should.
    """
    file = table.attrs["file"]
    reason = None
    if not any(set(choice) <= set(table.columns) for choice in _NEEDED[stream]):
        wanted = ", or ".join(" and ".join(choice) for choice in _NEEDED[stream])
        reason = f"{file}: needs the columns {wanted} besides t and has {', '.join(table.columns)}; name them so"
    else:
        if stream == "imu":
            table = at_accelerometer_times(_with_whole_gyro(table, problems), problems, notes)
        elif stream == "gnss":
            table = _with_one_velocity(table, problems)
        try:
            table = _clean(stream, table, problems)
        except UnusableStreamError as error:
            reason = str(error)
        if not reason and len(table) < 2:
            reason = f"{file}: has {len(table)} usable row(s) and needs 2; record it again"
    if reason and stream == "imu":
        raise RecordingError(reason)
    if reason:
        problems.append(f"{reason}; the stream is left out")
        return None
    if "time" not in stated:
        check_time_unit(table, stream, tables)
    if stream == "imu":
        table = _in_body_axes(without_filled_stretches(table, problems), stated, axes, problems)
    elif stream == "wheel":
        table = _with_one_speed(table, problems)
    elif stream == "gnss":
        table = without_frozen_fixes(_with_velocity(table, stated), problems)
    elif stream == "reference" and "attitude" not in stated:
        check_attitude_unit(table)
    return table.set_index("t")


def _clean(stream: str, table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    table = without_impossible_values(table, stream, problems)
    table = clean_rows(table, set(table.columns) - _OPTIONAL[stream], problems)
    if len(table) < 2:
        return table
    return without_shared_stamps(steady(table, problems), stream, problems)


def _with_one_speed(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    if "speed" not in table.columns:
        wheels = [name for name in WHEELS if name in table.columns]
        table = without_dead_wheels(table, wheels, problems)
        table.insert(1, "speed", table[[name for name in wheels if name in table.columns]].mean(axis=1))
    return without_frozen_speeds(table, problems)


def _with_whole_gyro(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    there = [name for name in _GYRO if name in table.columns]
    if 0 < len(there) < 3:
        problems.append(
            f"{table.attrs['file']}: of the gyro only {', '.join(there)} there; left out, gx, gy, gz go together"
        )
        return table.drop(columns=there)
    return table


def _with_one_velocity(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """The table with either v_e, v_n or speed, course; where nothing moves a missing course does not matter."""
    table = check_position(table, problems)
    if {"v_e", "v_n"} <= set(table.columns):
        return table.drop(columns=["speed", "course"], errors="ignore")
    return table.assign(course=table["course"].where(table["speed"] != 0, 0.0))


def _with_velocity(table: pd.DataFrame, stated: Collection[str]) -> pd.DataFrame:
    if "course" in table.columns:
        if "course" not in stated:
            check_course_unit(table)
        course = np.radians(table["course"])
        table = table.assign(v_e=table["speed"] * np.sin(course), v_n=table["speed"] * np.cos(course))
    if "v_u" not in table.columns:
        table = table.assign(v_u=table["climb"] if "climb" in table.columns else np.nan)
    others = [name for name in table.columns if name not in ("t", *_VELOCITY, "speed", "course", "climb")]
    return table[["t", *_VELOCITY, *others]]


def _in_body_axes(table: pd.DataFrame, stated: Collection[str], axes: str, problems: list[str]) -> pd.DataFrame:
    C = axes_to_matrix(axes)
    for triad in (_ACCELEROMETER, _GYRO):
        if triad[0] in table.columns:
            # + 0.0 makes zeros positive that a reversed axis made negative.
            rotated = C @ table[triad].to_numpy().T + 0.0
            table = table.assign(**dict(zip(triad, rotated, strict=True)))
    if "accelerometer" not in stated:
        problems += check_accelerometer_unit(table)
    if "gx" in table.columns and "gyro" not in stated:
        check_gyro_unit(table)
    problems += check_ranges(table)
    return table
