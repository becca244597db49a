"""Time stamps of streams: counters that start again, packed clock times, wild stamps, packets, and the unit of time.

What is known for sure is mended and told; what is not raises `UnusableStreamError` with the line.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError

_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
# Rates in Hz: slower and faster than any such stream is, and the usual ones.
_RATES = {"imu": (2.0, 2500.0), "wheel": (1.0, 500.0), "gnss": (1 / 60, 50.0), "reference": (1 / 60, 2500.0)}
_USUAL_RATES = {"imu": (20.0, 500.0), "wheel": (1.0, 200.0), "gnss": (0.1, 25.0), "reference": (0.1, 500.0)}


class UnusableStreamError(RecordingError):
    """A stream whose times cannot be used; the others may be."""


def mended_clocks(tables: dict[str, pd.DataFrame], problems: list[str]) -> dict[str, pd.DataFrame]:
    """The tables with clock times unpacked and counters going on where they start again, all streams alike."""
    packed = {scale for table in tables.values() for scale in [_packed_scale(_finite(table)[1])] if scale}
    if packed:
        scale = packed.pop()
        told = [table.attrs["file"] for table in tables.values() if _fits_packed(_finite(table)[1], scale)]
        problems.append(
            f"{', '.join(told)}, column t: the values jump by 40 at every full minute, so they are clock times "
            f"packed as "
            "HHMMSS; read as seconds of the day"
        )
        tables = {stream: _unpacked(table, scale) for stream, table in tables.items()}
    periods: dict[str, float] = {}
    for stream, table in tables.items():
        tables[stream] = _unwrapped(stream, table, periods, problems)
    return _same_turn(tables, periods)


def _finite(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Which rows have a time, and those times."""
    t = table["t"].to_numpy(float)
    there = np.isfinite(t)
    return there, t[there]


def _packed_scale(t: np.ndarray) -> float | None:
    """Values in one second of a packed clock time; None where it is none or crosses no minute."""
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    for scale in _UNITS.values():
        if usual > 20 * scale or not _fits_packed(t, scale):
            continue
        # From 59.9 of a minute to the full one, and of an hour to the full one.
        rests = (steps - 40 * scale, steps - 4040 * scale)
        minutes = np.flatnonzero(np.any([(rest > 0) & (rest < 20 * usual) for rest in rests], axis=0))
        seconds = (t / scale) % 100
        # A minute ends before the jump and another begins after it.
        full = (seconds[minutes] > 60 - 20 * usual / scale) & (seconds[minutes + 1] < 20 * usual / scale)
        if minutes.size and full.all():
            return scale
    return None


def _fits_packed(t: np.ndarray, scale: float) -> bool:
    value = t / scale
    return bool(
        t.size
        and (value >= 0).all()
        and (value % 100 < 60.0001).all()
        and (value // 100 % 100 < 60).all()
        and (value // 10000 % 100 < 24).all()
    )


def _unpacked(table: pd.DataFrame, scale: float) -> pd.DataFrame:
    there, t = _finite(table)
    if not _fits_packed(t, scale):
        return table
    value = t / scale
    seconds = table["t"].to_numpy(float).copy()
    seconds[there] = (value // 10000 % 100 * 3600 + value // 100 % 100 * 60 + value % 100) * scale
    return table.assign(t=seconds)


def _periods() -> Iterator[tuple[float, str]]:
    for bits in (16, 24, 32, 64):
        # A counter counts in its unit; the file may give it in that unit or in seconds.
        yield 2.0**bits, f"a counter of {bits} bits"
        for unit in ("ms", "us", "ns"):
            yield 2.0**bits / _UNITS[unit], f"a counter of {bits} bits in {unit}"
    for seconds, name in (
        (604800.0, "the GPS week"),
        (86400.0, "the time of day, at midnight"),
        (43200.0, "a clock of 12 hours"),
        (3600.0, "minutes and seconds of the hour"),
        (60.0, "seconds of the minute"),
    ):
        for scale in _UNITS.values():
            yield seconds * scale, name


def _unwrapped(stream: str, table: pd.DataFrame, periods: dict[str, float], problems: list[str]) -> pd.DataFrame:
    if stream == "pulses":
        return table
    there, t = _finite(table)
    steps = np.diff(t)
    back = np.flatnonzero(steps < 0)
    if not back.size or not (steps > 0).any():
        return table
    usual = float(np.median(steps[steps > 0]))
    for period, name in _periods():
        over = steps[back] + period
        # Where the period is long, rows may be missing at the turn.
        most = 1.6 * usual if period < 100 * usual else min(50 * usual, 0.02 * period)
        lasting = t[-1] - t[0] + period * back.size
        # It turns as often as the time it lasts has periods.
        if not ((over > 0) & (over < most)).all() or abs(back.size - lasting / period) > 1:
            continue
        k = back[0]
        problems.append(
            f"{table.attrs['file']}, {table.index.name} {table.index[there][k + 1]}, column t: falls from "
            f"{t[k]:.9g} to "
            f"{t[k + 1]:.9g}, as {name} does that starts again (after {period:.10g}; {back.size} time(s)); the "
            f"times go on "
            "counting instead"
        )
        values = table["t"].to_numpy(float).copy()
        values[there] = t + period * np.append(0, np.cumsum(steps < 0))
        periods[stream] = period
        return table.assign(t=values)
    return table


def _same_turn(tables: dict[str, pd.DataFrame], periods: dict[str, float]) -> dict[str, pd.DataFrame]:
    """The tables, streams that begin after a turn of the others' counter on the same count."""
    if not periods:
        return tables
    stream, period = next(iter(periods.items()))
    low, high = np.nanmin(tables[stream]["t"]), np.nanmax(tables[stream]["t"])
    for other, table in tables.items():
        t = _finite(table)[1]
        if other not in periods and t.size:
            outside = [
                turn for turn in (0, 1, -1, 2) if t.max() + turn * period >= low and t.min() + turn * period <= high
            ]
            if outside and outside[0] != 0:
                tables[other] = table.assign(t=table["t"] + outside[0] * period)
    return tables


def steady(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    """The rows of a table with times in order, those of wild stamps left out; raise where the clock starts again."""
    table = _in_order(table, problems)
    t = table["t"].to_numpy(float)
    steps = np.diff(t)
    if not (steps > 0).any():
        return table
    usual = float(np.median(steps[steps > 0]))
    # Pauses are no fault; what is ten recordings away from the recording is not of it.
    far = np.flatnonzero(steps > max(1000 * usual, 60.0))
    lasting = t[-1] - t[0] - steps[far].sum()
    far = far[steps[far] > 10 * lasting]
    if not far.size:
        return table
    pieces = np.split(np.arange(t.size), far + 1)
    body = max(pieces, key=len)
    out = np.setdiff1d(np.arange(t.size), body)
    k = out[0]
    why = "a wild stamp" if out.size <= 3 else "as when a clock is set"
    problems.append(
        f"{table.attrs['file']}, {table.index.name} {table.index[k]}, column t: {t[k]:.9g} is "
        f"{np.abs(t[k] - t[body[[0, -1]]]).min():.6g} s away from the {body.size} rows that belong together, {why}; "
        f"left out, "
        f"with {out.size - 1} like it"
    )
    return table.iloc[body]


def _in_order(table: pd.DataFrame, problems: list[str]) -> pd.DataFrame:
    t = table["t"].to_numpy(float)
    back = np.flatnonzero(np.diff(t) < 0)
    if not back.size:
        return table
    file, k = f"{table.attrs['file']}, {table.index.name}", back[0]
    seen = f"{file} {table.index[k + 1]}, column t: time runs backwards, from {t[k]:.6f} to {t[k + 1]:.6f}"
    if back.size <= max(3, 0.01 * t.size):
        kept = _longest_increase(t)
        out = np.setdiff1d(np.arange(t.size), kept)
        runs = np.split(out, np.flatnonzero(np.diff(out) > 1) + 1)
        if max(map(len, runs)) <= 3:
            first = out[0]
            problems.append(
                f"{file} {table.index[first]}, column t: {t[first]:.9g} is out of order among the rows around it; "
                f"left out, "
                f"with {out.size - 1} like it"
            )
            return table.iloc[kept]
        fall = t[k] - t[k + 1]
        if t[k + 1] - t.min() < 0.02 * (t.max() - t.min()) or t[k + 1] < 0.01 * t[k]:
            raise UnusableStreamError(
                f"{seen} ({back.size} time(s)): the clock starts again, as after a restart; cut the file there and "
                f"read "
                "each part by itself"
            )
        raise UnusableStreamError(
            f"{seen} ({back.size} time(s)): the clock was set back by about {fall:.3f} s; add that to the times "
            f"from there "
            "on, or cut the file there"
        )
    raise UnusableStreamError(f"{seen} ({back.size} times in all): the rows are not in order; sort the rows by t")


def _longest_increase(t: np.ndarray) -> np.ndarray:
    """Indices of a longest series of rows whose times do not fall."""
    tails: list[float] = []
    ends: list[int] = []
    before = np.full(t.size, -1)
    for k, value in enumerate(t.tolist()):
        at = bisect_right(tails, value)
        before[k] = ends[at - 1] if at else -1
        tails[at:] = [value] if at == len(tails) else [value, *tails[at + 1 :]]
        ends[at:] = [k] if at == len(ends) else [k, *ends[at + 1 :]]
    chain, k = [], ends[-1]
    while k >= 0:
        chain.append(k)
        k = int(before[k])
    return np.array(chain[::-1])


def _interval(table: pd.DataFrame) -> float:
    steps = np.diff(_finite(table)[1])
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def check_time_unit(table: pd.DataFrame, stream: str, tables: Mapping[str, pd.DataFrame]) -> None:
    """Raise if rows come slower or faster than they do where t is in seconds, as in which of all tables they do."""
    t = table["t"].to_numpy(float)
    interval = float(np.median(np.diff(t)))
    low, high = _RATES[stream]
    if 1 / high <= interval <= 1 / low or interval <= 0:
        return
    intervals = {name: _interval(other) for name, other in tables.items() if name != stream and name in _RATES}
    if interval < 1 / high and any(abs(other / interval - 1) < 0.2 for other in intervals.values()):
        # One table for all, each row with the latest of every sensor.
        return
    others = [name for name, other in intervals.items() if 1 / _RATES[name][1] <= other <= 1 / _RATES[name][0]]
    factors = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9} if interval > 1 / low else {"min": 60.0, "h": 3600.0, "d": 86400.0}
    least, most = _USUAL_RATES[stream]
    likely = [unit for unit, s in factors.items() if least * 0.99 <= 1 / (interval * s) <= most * 1.01]
    likely = likely or [unit for unit, s in factors.items() if low <= 1 / (interval * s) <= high] or ["ns"]
    seen = f"{table.attrs['file']}, column t: rows are {interval:g} s apart"
    if stream == "imu" and (np.diff(t) == 1).all():
        raise RecordingError(
            f"{seen}, each by exactly 1: t counts samples; write t = number / rate of the sensor "
            f"(units={{'time': 'ms'}} "
            "if these are ms of a sensor of 1 kHz, 's' if seconds are meant)"
        )
    if others:
        factor = factors[likely[0]]
        raise RecordingError(
            f"{seen}, as if t were in {likely[0]}, in which {' and '.join(others)} are not; "
            f"{'divide' if factor < 1 else 'multiply'} its t by {max(factor, 1 / factor):g} in the file, so that "
            f"all are in s"
        )
    other = f" (or {', '.join(likely[1:])})" if likely[1:] else ""
    raise RecordingError(
        f"{seen}, as if t were in {likely[0]}{other}; read with units={{'time': '{likely[0]}'}}, which holds for every "
        "file of the recording ('s' if seconds are meant)"
    )
