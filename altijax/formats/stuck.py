"""Sensors that stand still, stretches that were filled in, ranges that were too small, wheels that are dead."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError

_TRIADS = (("ax", "ay", "az"), ("gx", "gy", "gz"))


def without_filled_stretches(imu: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """An IMU table less stretches in which all axes of a sensor hold or follow straight lines.

    A sensor that lives has noise in each row; one whose rows have none throughout is simulated, and left as it is.
    """
    out = np.zeros(len(imu), bool)
    for triad in _TRIADS:
        if triad[0] not in imu.columns or len(imu) < 100:
            continue
        values = imu[list(triad)].to_numpy(float)
        bends = np.abs(np.diff(values, 2, axis=0))
        usual = np.median(bends, axis=0)
        if not (usual > (1e-3 if triad[0] == "ax" else 1e-5)).all():
            continue
        straight = np.concatenate([[False], (bends < 5e-3 * usual).all(axis=1), [False]])
        for first, last in _runs(straight):
            lasting = imu["t"].iloc[last] - imu["t"].iloc[first]
            if last - first >= 10 and lasting > 0.3:
                held = (values[first] == values[last]).all()
                problems.append(
                    f"{imu.attrs['file']}, {imu.index.name} {imu.index[first]}, columns {', '.join(triad)}: they "
                    f"{'repeat to the last digit' if held else 'follow straight lines'} for {lasting:.2f} s to "
                    f"{imu.index.name} {imu.index[last]}, as "
                    f"{'a sensor that hangs' if held else 'lost rows that were filled in'}; "
                    "left out"
                )
                out[first : last + 1] = True
    return imu[~out] if (~out).sum() > 1 else imu


def without_frozen_fixes(gnss: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """A receiver's table, velocities in v_e and v_n, less fixes that repeat the last one while it moves."""
    if len(gnss) < 5:
        return gnss
    t = gnss["t"].to_numpy(float)
    velocity = gnss[["v_e", "v_n"]].to_numpy(float)
    speed = np.hypot(*velocity.T)
    same = np.append(False, (velocity[1:] == velocity[:-1]).all(axis=1))
    if {"lat", "lon"} <= set(gnss.columns):
        place = gnss[["lat", "lon"]].to_numpy(float)
        here = np.append(False, ((place[1:] == place[:-1]) | np.isnan(place[1:])).all(axis=1))
        least_rows, least_time = 3, 2.0
        same = same & here
    else:
        least_rows, least_time = 10, 5.0
    moving = speed > 1.0
    if (moving & ~same).sum() < 5:
        return gnss
    if (same & moving).sum() > 0.4 * max(moving.sum(), 1) and moving.sum() > 10:
        problems.append(
            f"{gnss.attrs['file']}, {gnss.index.name} {gnss.index[same & moving][0]}, columns v_e, v_n: "
            f"{(same & moving).sum()} of {len(gnss)} rows repeat the fix before to the last digit while it moves, "
            f"as a log does "
            "that is faster than its receiver; left out"
        )
        return without_frozen_fixes(gnss[~(same & moving)], problems)
    out = np.zeros(t.size, bool)
    for first, last in _runs(same):
        begin = max(first - 1, 0)
        lasting = t[last] - t[begin]
        if last - begin + 1 < least_rows or lasting < least_time:
            continue
        around = np.concatenate([speed[max(begin - 1, 0) : begin], speed[last + 1 : last + 2]])
        if speed[last] <= 1.0 and not (speed[last] == 0 and around.max(initial=0.0) > 5):
            continue
        out[begin + (speed[last] > 1.0) : last + 1] = True
        problems.append(
            f"{gnss.attrs['file']}, {gnss.index.name} {gnss.index[begin]}, columns v_e, v_n: the fix repeats to the "
            f"last digit "
            f"for {lasting:.1f} s, at {speed[last]:.3g} m/s, up to {gnss.index.name} {gnss.index[last]}, as where a "
            f"receiver "
            "lost its satellites; left out"
        )
    return gnss[~out]


def without_frozen_speeds(wheel: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """A wheel's table less stretches of 5 s and more that repeat a speed to the last digit, where others never do."""
    speed, t = wheel["speed"].to_numpy(float), wheel["t"].to_numpy(float)
    same = np.append(False, (np.diff(speed) == 0) & (np.abs(speed[1:]) > 1.0))
    runs = [(first, last) for first, last in _runs(same) if t[last] - t[first] > 5 and last - first > 20]
    elsewhere = same.copy()
    for first, last in runs:
        elsewhere[first : last + 1] = False
    # A speed in whole steps repeats itself everywhere.
    if not runs or elsewhere.sum() > 0.05 * len(wheel):
        return wheel
    first, last = runs[0]
    out = np.zeros(t.size, bool)
    for begin, end in runs:
        out[begin : end + 1] = True
    if out.mean() > 0.9:
        return wheel
    problems.append(
        f"{wheel.attrs['file']}, {wheel.index.name} {wheel.index[first]}, column speed: {speed[first]:.6g} m/s to "
        f"the last digit "
        f"for {t[last] - t[first]:.1f} s, as a sensor that hangs; {out.sum()} rows left out"
    )
    return wheel[~out]


def check_ranges(imu: pd.DataFrame) -> Iterator[str]:
    """Yield a sentence for each axis that runs into its limit, or that says nothing at all."""
    for triad in _TRIADS:
        if triad[0] not in imu.columns:
            continue
        values = imu[list(triad)].to_numpy(float)
        noise = np.median(np.abs(np.diff(values, 2, axis=0)), axis=0) if len(imu) > 100 else np.ones(3)
        still = (values == 0).all(axis=0)
        if still.sum() == 1 and (noise[~still] > (1e-3 if triad[0] == "ax" else 1e-5)).all() and len(imu) > 100:
            yield (
                f"{imu.attrs['file']}, column {triad[int(still.argmax())]}: 0 in every row, while the other axes move; "
                "the axis is dead: mend it, or take the columns of its sensor out"
            )
        odd = next((k for k in range(3) if _odd(noise[k], np.delete(noise, k), triad)), None)
        if odd is not None and noise.min() > 0 and noise.max() > 1e-4:
            yield (
                f"{imu.attrs['file']}, column {triad[odd]}: its noise is {noise[odd]:.2g}, that of the other axes "
                f"{np.delete(noise, odd).min():.2g} and {np.delete(noise, odd).max():.2g}; it seems to be in "
                f"another unit: give all "
                "three in one"
            )
        for k, name in enumerate(triad):
            for end in (values[:, k].max(), values[:, k].min()):
                at = values[:, k] == end
                near = (np.abs(values[:, k] - end) < 0.02 * np.ptp(values[:, k])) & ~at
                runs = sum(last > first for first, last in _runs(at))
                if 10 <= at.sum() < 0.4 * len(imu) and runs >= 3 and at.sum() > 5 * near.sum():
                    yield (
                        f"{imu.attrs['file']}, {imu.index.name} {imu.index[at][0]}, column {name}: "
                        f"{100 * at.mean():.2g} % of the rows "
                        f"are at {end:.6g}, where the sensor's range ends; motion beyond it is lost: set a larger range"
                    )


def _odd(noise: float, others: np.ndarray, triad: tuple[str, ...]) -> bool:
    # On roads axes differ by up to 4 in an accelerometer, 15 in a gyro.
    factor = 8.0 if triad[0] == "ax" else 25.0
    return noise > factor * others.max() or noise * factor < others.min()


def without_dead_wheels(wheel: pd.DataFrame, wheels: list[str], problems: list[str]) -> pd.DataFrame:
    """The table less wheels that stand while the others turn; a sentence where wheels are in different units."""
    if len(wheels) < 2:
        return wheel
    speeds = wheel[wheels].abs()
    fastest = speeds.max(axis=1).to_numpy()
    moving = fastest > 2.0
    if moving.sum() < 10:
        return wheel
    dead = [name for name in wheels if (speeds[name].to_numpy()[moving] < 0.02 * fastest[moving]).mean() > 0.5]
    if dead and len(dead) < len(wheels):
        problems.append(
            f"{wheel.attrs['file']}, {wheel.index.name} {wheel.index[moving][0]}, column {', '.join(dead)}: stands "
            f"while the other "
            "wheels turn; left out of the speed, so mend its sensor or take the column out"
        )
        return wheel.drop(columns=dead)
    medians = speeds[moving].median()
    ratio = float(medians.max() / medians.min())
    if ratio > 1.5:
        raise RecordingError(
            f"{wheel.attrs['file']}, columns {medians.idxmax()}, {medians.idxmin()}: the first is {ratio:.3g} times "
            f"the second; "
            "they are in different units, or one of them misses pulses or counts twice: give all columns in one "
            "unit, or take "
            "the wrong one out"
        )
    return wheel


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each stretch of True."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))
