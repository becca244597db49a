"""Checks of a recording's streams: what is wrong, in which file, line and column, what was seen, and how to mend it.

A stream is read into a table: a DataFrame with a column ``t``, whose index counts lines or rows as its file does and
whose ``attrs["file"]`` names that file. What leaves nothing usable raises `RecordingError`; where the rest is usable, a
sentence is yielded or added to `problems`, which `read_recording` shows as `RecordingWarning`.
"""

from collections.abc import Collection, Iterator

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from altijax.constants import KNOT, STANDARD_GRAVITY

SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "kn": KNOT, "cm/s": 1e-2, "mm/s": 1e-3}
"""m/s in each unit of speed; the mile is 1609.344 m."""


class RecordingError(ValueError):
    """A recording that cannot be used as it is; the message names file, line, column, what was seen and the fix."""


class RecordingWarning(UserWarning):
    """Part of a recording was left out or looks wrong; the rest is usable."""


def clean_rows(table: pd.DataFrame, needed: Collection[str], problems: list[str]) -> pd.DataFrame:
    """The rows of a table that have a value in every needed column."""
    file, line = table.attrs["file"], table.index.name
    keep = np.ones(len(table), bool)
    for column in table.columns:
        values = table[column].to_numpy(float)
        bad = ~(np.abs(values) < _LARGEST)
        # An optional column that is empty throughout was never recorded.
        if bad.any() and (column in needed or not bad.all()):
            fate = "dropped" if column in needed else "kept as missing"
            problems.append(
                f"{file}, {line} {table.index[bad][0]}, column {column}: {values[bad][0]} is not a number; "
                f"rows like it: {bad.sum()} of {len(table)}, {fate}"
            )
            if column in needed:
                keep &= ~bad
            else:
                table = table.assign(**{column: np.where(bad, np.nan, values)})
    return table[keep]


_LARGEST = 1e100
"""No quantity reaches it, and what exceeds its square cannot be told from infinity."""


def check_accelerometer_unit(imu: pd.DataFrame) -> Iterator[str]:
    """Raise if the accelerometer reads in g, mg, gal or counts; yield a sentence if it is otherwise unlike gravity.

    At rest it reads 9.8 m/s^2, on the road about so in the median.
    """
    force = imu[["ax", "ay", "az"]].to_numpy()
    size = float(np.median(np.linalg.norm(force, axis=1)))
    seen = f"{imu.attrs['file']}, columns ax, ay, az: the median of |a| is {size:.4g} m/s^2, at rest it is 9.8"
    if 7.5 < size < 13:
        return
    if np.linalg.norm(force.mean(axis=0)) < 0.5 * size:
        # Gravity does not change; what is left without it, or turns about, has no lasting direction.
        if size < 7.5:
            yield (
                f"{seen}, and they have no lasting direction: gravity was taken out; specific force is wanted, so "
                f"log the "
                "acceleration with gravity"
            )
        elif size > 20:
            yield f"{seen}, and they have no lasting direction; check the unit"
        return
    # A sensor's scale is within some percent, so mg and gal, 2 % apart, are told by the nearer.
    for unit, low, high in (("g", 0.7, 1.4), ("gal", 700, 990), ("mg", 990, 1400)):
        if low < size < high:
            raise RecordingError(
                f"{seen}; that looks like {unit}: read with units={{'accelerometer': '{unit}'}} ('m/s^2' if it is "
                f"right as "
                "it stands)"
            )
    if size > 200:
        raise RecordingError(
            f"{seen}; that looks like raw counts, {size:.5g} of them in 1 g: divide ax, ay, az by "
            f"{_counts(size):.5g} and read "
            "with units={'accelerometer': 'g'} ('m/s^2' if it is right as it stands)"
        )
    times = size / STANDARD_GRAVITY
    yield (
        f"{seen}: it reads {times:.3g} g; the range of the sensor was taken for another: divide ax, ay, az by "
        f"{times:.3g}, or "
        "check that gravity was not taken out (specific force is wanted)"
    )


def _counts(size: float) -> float:
    """Counts in one g: of the usual ones the nearest, within 5 %."""
    usual = min((2.0**k for k in range(8, 17)), key=lambda counts: abs(np.log(size / counts)))
    return usual if abs(np.log(size / usual)) < 0.05 else size


def check_gyro_unit(imu: pd.DataFrame) -> None:
    """Raise if the vehicle spins, as it seems to where the gyro reads in deg/s, and gravity does not turn so."""
    rate = np.linalg.norm(imu[["gx", "gy", "gz"]].to_numpy(), axis=1)
    typical, highest = float(np.median(rate)), float(np.quantile(rate, 0.999))
    if (typical > 2 or highest > 35) and not _turns_gravity(imu):
        likely = "deg/s" if typical < 60 else "deg/s, mrad/s or counts"
        raise RecordingError(
            f"{imu.attrs['file']}, columns gx, gy, gz: the median rate is {typical:.3g} rad/s and 0.1 % exceed "
            f"{highest:.3g}, but gravity does not turn so; that looks like {likely}: read with "
            f"units={{'gyro': 'deg/s'}} "
            "('rad/s' if it turns that fast)"
        )


def _turns_gravity(imu: pd.DataFrame) -> bool:
    """Whether gravity stands still if the gyro is followed as it is, better than if it were in deg/s."""
    t = imu["t"].to_numpy(float)
    dt = np.diff(t, prepend=t[0])[:, None]
    # In three seconds accelerations are averaged, and a gyro's bias turns nothing away.
    rows = max(round(3.0 / float(np.median(np.diff(t)))), 2)
    windows = t.size // rows
    if windows < 5:
        return False
    f = imu[["ax", "ay", "az"]].to_numpy()[: windows * rows].reshape(windows, rows, 3)
    spreads = []
    for factor in (1.0, np.pi / 180):
        turns = Rotation.from_rotvec(factor * (imu[["gx", "gy", "gz"]].to_numpy() * dt)[: windows * rows]).as_matrix()
        turns = turns.reshape(windows, rows, 3, 3)
        C, total = np.broadcast_to(np.eye(3), (windows, 3, 3)), np.zeros((windows, 3))
        for k in range(rows):
            C = C @ turns[:, k]
            total += (C @ f[:, k, :, None])[..., 0]
        size = np.linalg.norm(total / rows, axis=1)
        spreads.append(float(np.median(np.abs(size - np.median(size)))))
    return spreads[0] < spreads[1]


def check_position(gnss: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """The table without lat, lon if they cannot be degrees."""
    if not {"lat", "lon"} <= set(gnss.columns):
        return gnss
    lat, lon = np.nanmax(np.abs(gnss["lat"]), initial=0), np.nanmax(np.abs(gnss["lon"]), initial=0)
    if lat <= 90 and lon <= 360:
        return gnss
    if max(lat, lon) > 1e4:
        likely = "as if in 1e-7 deg: divide them by 1e7"
    else:
        likely = "swapped: rename them" if lon <= 90 else "not in degrees"
    problems.append(
        f"{gnss.attrs['file']}, columns lat, lon: they reach {lat:g} and {lon:g} deg and are left out; they look "
        f"{likely}"
    )
    return gnss.drop(columns=["lat", "lon"])


def check_course_unit(gnss: pd.DataFrame) -> None:
    """Raise if course, speed and positions agree with a course in radians only."""
    if not {"lat", "lon", "speed", "course"} <= set(gnss.columns):
        return
    lat, lon = np.radians(gnss["lat"].to_numpy()), np.radians(gnss["lon"].to_numpy())
    bearing = np.arctan2(np.diff(lon) * np.cos(lat[1:]), np.diff(lat))
    course = gnss["course"].to_numpy()[1:]
    moving = (gnss["speed"].to_numpy()[1:] > 3) & np.isfinite(bearing + course)
    if moving.sum() < 3:
        return
    deg, rad = (
        float(np.median(np.abs(np.angle(np.exp(1j * (angle - bearing)[moving])))))
        for angle in (np.radians(course), course)
    )
    if rad < 0.3 < deg:
        raise RecordingError(
            f"{gnss.attrs['file']}, column course: values up to {np.nanmax(course):.3g} do not follow the positions as "
            "degrees but do as radians: read with units={'course': 'rad'} ('deg' if it is right)"
        )


def check_attitude_unit(reference: pd.DataFrame) -> None:
    """Raise if an angle of the reference is beyond a turn, as angles in degrees are."""
    for column in [name for name in ("roll", "pitch", "heading") if name in reference.columns]:
        largest = float(np.nanmax(np.abs(reference[column]), initial=0))
        if largest > 2 * np.pi + 0.01:
            raise RecordingError(
                f"{reference.attrs['file']}, column {column}: it reaches {largest:.4g} rad, more than a turn; that "
                "looks like degrees: read with units={'attitude': 'deg'} ('rad' if it is right)"
            )


def check_overlap(stream: pd.DataFrame, imu: pd.DataFrame) -> Iterator[str]:
    """Yield a sentence with both intervals if a stream and the IMU have no moment in common."""
    ours, theirs = stream.index, imu.index
    if ours[-1] < theirs[0] or ours[0] > theirs[-1]:
        yield (
            f"{stream.attrs['file']}: its times {ours[0]:.3f} to {ours[-1]:.3f} s do not overlap those of "
            f"{imu.attrs['file']}, {theirs[0]:.3f} to {theirs[-1]:.3f} s; the stream is left out: give both one clock"
        )


def check_together(streams: dict[str, pd.DataFrame | None], problems: list[str]) -> None:
    """A stream, indexed by t, that shares no moment with the IMU becomes None."""
    imu = streams["imu"]
    if imu is None:
        return
    for name in ("wheel", "gnss", "reference"):
        stream = streams[name]
        apart = [] if stream is None else list(check_overlap(stream, imu))
        if apart:
            problems += apart
            streams[name] = None
