"""Checks of a recording's streams: what is wrong, in which file, line and column, what was seen, and how to mend it.

A stream is read into a table: a DataFrame with a column ``t``, whose index counts lines or rows as its file does and
whose ``attrs["file"]`` names that file. What leaves nothing usable raises `RecordingError`; where the rest is usable, a
sentence is yielded or added to `problems`, which `read_recording` shows as `RecordingWarning`.
"""

from collections.abc import Collection, Iterator

import numpy as np
import pandas as pd

from altijax.constants import KNOT

LETTERS = {"F": (1, 0, 0), "B": (-1, 0, 0), "L": (0, 1, 0), "R": (0, -1, 0), "U": (0, 0, 1), "D": (0, 0, -1)}
"""Directions on the vehicle in body axes (forward, left, up)."""

SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "kn": KNOT}
"""m/s in each unit of speed; the mile is 1609.344 m."""


class RecordingError(ValueError):
    """A recording that cannot be used as it is; the message names file, line, column, what was seen and the fix."""


class RecordingWarning(UserWarning):
    """Part of a recording was left out or looks wrong; the rest is usable."""


def axes_to_matrix(axes: str) -> np.ndarray:
    """Rotation from sensor axes to body axes (forward, left, up).

    Parameters
    ----------
    axes : str
        Where the sensor's x, y and z point on the vehicle, one letter each: F or B (forward, backward), L or R (left,
        right), U or D (up, down).

    Returns
    -------
    C : (3, 3)
        Maps sensor vectors to body vectors.

    Raises
    ------
    ValueError
        If `axes` is not three letters, one of each pair, forming right-handed axes.
    """
    wrong = None
    if len(axes) != 3 or not set(axes) <= set(LETTERS):
        wrong = "needs three letters out of F/B, L/R, U/D"
    else:
        C = np.array([LETTERS[letter] for letter in axes], dtype=float).T
        if np.linalg.matrix_rank(C) < 3:
            wrong = "needs one letter of each pair F/B, L/R, U/D"
        elif np.linalg.det(C) < 0:
            wrong = "is left-handed"
    if wrong:
        likeness = {code: _likeness(code, axes) for code in _right_handed()}
        near = [code for code in likeness if likeness[code] == max(likeness.values())][:3]
        raise ValueError(f"axes {axes!r} {wrong}; right-handed and near it: {', '.join(near)}")
    return C


def clean_rows(table: pd.DataFrame, needed: Collection[str], problems: list[str]) -> pd.DataFrame:
    """The rows of a table that have a value in every needed column, times increasing."""
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
    table = table[keep]
    if table.empty:
        return table
    t = table["t"].to_numpy(float)
    backwards = np.flatnonzero(np.diff(t) < 0)
    if backwards.size:
        k = backwards[0]
        raise RecordingError(
            f"{file}, {line} {table.index[k + 1]}, column t: time runs backwards, from {t[k]:.6f} to {t[k + 1]:.6f} "
            f"({backwards.size} times in all); sort the rows, or cut the file where its clock was set"
        )
    repeated = np.append(False, np.diff(t) == 0)
    if repeated.any():
        problems.append(
            f"{file}, {line} {table.index[repeated][0]}, column t: {t[repeated][0]:.6f} repeats the time of the row "
            f"before; rows like it: {repeated.sum()} of {len(table)}, dropped"
        )
    return table[~repeated]


def check_time_unit(table: pd.DataFrame, slowest: float) -> None:
    """Raise if rows are further apart than `slowest` seconds, as they are when the time is not in seconds."""
    interval = float(np.median(np.diff(table["t"].to_numpy(float))))
    if interval > slowest:
        likely = [unit for unit, s in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)) if interval * s <= slowest]
        unit = likely[0] if likely else "ns"
        raise RecordingError(
            f"{table.attrs['file']}, column t: rows are {interval:g} s apart, as if t were in {unit}; read with "
            f"units={{'time': '{unit}'}}, which holds for every file of the recording ('s' if seconds are meant)"
        )


def check_accelerometer_unit(imu: pd.DataFrame) -> Iterator[str]:
    """Raise if the accelerometer reads in g or gal; yield a sentence if its size is otherwise unlike gravity."""
    size = float(np.median(np.linalg.norm(imu[["ax", "ay", "az"]].to_numpy(), axis=1)))
    seen = f"{imu.attrs['file']}, columns ax, ay, az: the median of |a| is {size:.4g} m/s^2, at rest it is 9.8"
    for unit, low, high, other in (("g", 0.7, 1.4, ""), ("gal", 700, 1400, " or mg")):
        if low < size < high:
            raise RecordingError(
                f"{seen}; that looks like {unit}{other}: read with units={{'accelerometer': '{unit}'}} "
                "('m/s^2' if it is right as it stands)"
            )
    if not 5 < size < 20:
        yield f"{seen}; check the unit, and that gravity was not taken out (specific force is wanted)"


_LARGEST = 1e100
"""No quantity reaches it, and what exceeds its square cannot be told from infinity."""

_IOS = (
    ", if the sensor hangs that way; if it is an iPhone's, it has all three signs reversed, which no axes code mends: "
    "read with units={'accelerometer': '-m/s^2'} ('-g' if it is in g)"
)


def check_gravity(imu: pd.DataFrame, axes: str) -> Iterator[str]:
    """Yield a sentence with a better axes code if gravity does not point up after `axes` was applied."""
    mean = imu[["ax", "ay", "az"]].to_numpy().mean(axis=0)
    if mean[2] == np.abs(mean).max():
        return
    sensor = axes_to_matrix(axes).T @ mean
    k = int(np.abs(sensor).argmax())
    up = [code for code in _right_handed() if code[k] == ("U" if sensor[k] > 0 else "D")]
    ahead = axes.index("F" if "F" in axes else "B")
    best = max(up, key=lambda code: (_likeness(code, axes), code[ahead] == axes[ahead]))
    seen = ", ".join(f"{component:.2f}" for component in mean)
    yield (
        f"{imu.attrs['file']}, columns ax, ay, az: with axes={axes!r} the mean is ({seen}) m/s^2 forward, left, up, "
        f"so gravity is not up; axes={best!r} would put it there"
        f"{_IOS if -mean[2] == np.abs(mean).max() else ''}"
    )


def check_gyro_unit(imu: pd.DataFrame) -> None:
    """Raise if the vehicle would be spinning, as it seems to when the gyro reads in deg/s."""
    rate = np.linalg.norm(imu[["gx", "gy", "gz"]].to_numpy(), axis=1)
    typical, highest = float(np.median(rate)), float(np.quantile(rate, 0.999))
    if typical > 2 or highest > 35:
        raise RecordingError(
            f"{imu.attrs['file']}, columns gx, gy, gz: the median rate is {typical:.3g} rad/s and 0.1 % exceed "
            f"{highest:.3g}; that looks like deg/s: read with units={{'gyro': 'deg/s'}} ('rad/s' if it turns that fast)"
        )


def check_turns(imu: pd.DataFrame, gnss: pd.DataFrame, gyro_unit_stated: bool) -> Iterator[str]:
    """Compare gyro and course over the turns driven: raise for deg/s, yield a sentence for the wrong sign."""
    t, t_gnss = imu.index.to_numpy(float), gnss.index.to_numpy(float)
    v_e, v_n, rate = gnss["v_e"].to_numpy(), gnss["v_n"].to_numpy(), imu["gz"].to_numpy()
    window = max(5.0, 2 * float(np.median(np.diff(t_gnss))))
    edges = np.arange(max(t[0], t_gnss[0]), min(t[-1], t_gnss[-1]), window)
    turned = np.append(0, np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2))
    by_gyro = np.diff(np.interp(edges, t, turned))
    by_course = np.diff(np.interp(edges, t_gnss, np.unwrap(np.arctan2(v_n, v_e))))
    # A slow sample on either side of an edge spoils the course at that edge.
    slow = np.append(0, np.cumsum(np.hypot(v_e, v_n) < 3))
    first = np.maximum(np.searchsorted(t_gnss, edges) - 1, 0)
    last = np.searchsorted(t_gnss, edges, side="right") + 1
    moving = slow[np.minimum(last[1:], len(t_gnss))] == slow[first[:-1]]
    by_gyro, by_course = by_gyro[moving], by_course[moving]
    if by_course.size < 3 or np.sqrt(np.mean(by_course**2)) < 0.1 or np.corrcoef(by_gyro, by_course)[0, 1] ** 2 < 0.5:
        return
    ratio = float(by_gyro @ by_course / (by_course @ by_course))
    seen = f"{imu.attrs['file']}, column gz: the gyro turns {ratio:.2g} times as far as the GNSS course"
    if abs(ratio) > 20 and not gyro_unit_stated:
        raise RecordingError(
            f"{seen}; that looks like deg/s: read with units={{'gyro': 'deg/s'}} ('rad/s' if it is right)"
        )
    if ratio < 0:
        yield f"{seen}, to the other side; a left turn is positive: check the axes code and the signs of gx, gy, gz"


def check_wheel_unit(wheel: pd.DataFrame, gnss: pd.DataFrame) -> None:
    """Raise if wheel and GNSS speeds differ by the ratio of two units of speed."""
    t = wheel.index.to_numpy(float)
    t_gnss, speed = gnss.index.to_numpy(float), np.hypot(gnss["v_e"].to_numpy(), gnss["v_n"].to_numpy())
    by_gnss = np.interp(t, t_gnss, speed, left=0, right=0)
    moving = by_gnss > 2
    if moving.sum() < 10:
        return
    ratio = float(np.median(wheel["speed"].to_numpy()[moving] / by_gnss[moving]))
    for unit, factor in SPEED_UNITS.items():
        for file, key, expected in ((wheel, "speed", 1 / factor), (gnss, "gnss_speed", factor)):
            if unit != "m/s" and abs(ratio / expected - 1) < 0.08:
                raise RecordingError(
                    f"{wheel.attrs['file']} and {gnss.attrs['file']}: the wheels' speed is {ratio:.3g} times that of "
                    f"GNSS; {file.attrs['file']} looks like {unit}: read with units={{'{key}': '{unit}'}} ('m/s' if "
                    "it is right)"
                )


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


def check_together(streams: dict[str, pd.DataFrame | None], stated: Collection[str], problems: list[str]) -> None:
    """Compare streams, indexed by t, with each other; one that shares no moment with the IMU becomes None."""
    imu = streams["imu"]
    if imu is None:
        return
    for name in ("wheel", "gnss", "reference"):
        stream = streams[name]
        apart = [] if stream is None else list(check_overlap(stream, imu))
        if apart:
            problems += apart
            streams[name] = None
    wheel, gnss = streams["wheel"], streams["gnss"]
    if gnss is not None and "gx" in imu.columns:
        problems += check_turns(imu, gnss, "gyro" in stated)
    if gnss is not None and wheel is not None and not {"speed", "gnss_speed"} & set(stated):
        check_wheel_unit(wheel, gnss)


def _right_handed() -> list[str]:
    codes = [x + y + z for x in LETTERS for y in LETTERS for z in LETTERS]
    return [c for c in codes if np.linalg.det(np.array([LETTERS[letter] for letter in c])) > 0.5]


def _likeness(code: str, other: str) -> int:
    return sum(a == b for a, b in zip(code, other, strict=False))
