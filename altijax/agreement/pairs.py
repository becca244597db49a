"""Pairs of streams that measure the same thing, as series on one grid, and what may be found of them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

STEP = 0.25
"""Of the grid, in s: offsets of clocks matter from some tenths of a second on."""

_RADIUS = 6_371_000.0
_SLOWEST_COURSE = 2.0
# 24 hours; a longer record is compared over its first.
_LONGEST = 24 * 3600.0


Key = tuple[str, str]
"""A pair: its name, and the stream that the series comes from."""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """What two streams say of one quantity: `series` should be a combination of `others`.

    Attributes
    ----------
    name : str
        What is compared.
    first, second : str
        Streams that `others` and `series` come from.
    others : (k, n)
        Changes by the first stream; NaN where it says nothing.
    series : (n,)
        Changes by the second.
    levels : (2, n) or None
        The quantity itself by both, where they have it, for the ratio of their sizes.
    axes : (3, n) or None
        Changes by the first stream about all axes, forward, left and up, where `others` is about up alone.
    """

    name: str
    first: str
    second: str
    others: np.ndarray
    series: np.ndarray
    levels: np.ndarray | None = None
    axes: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A disagreement.

    Attributes
    ----------
    verdict : str
        ``doubtful`` or ``wrong``.
    pairs : tuple
        The pairs that show it.
    stream : str
        The stream that it is in.
    seen, cause, remedy : str
        What was seen, what it looks like, and the call that mends it.
    quantities : tuple of str
        Of the units that it rests on.
    """

    verdict: str
    pairs: tuple[Key, ...]
    stream: str
    seen: str
    cause: str
    remedy: str
    quantities: tuple[str, ...] = field(default=())


def pairs(streams: Mapping[str, pd.DataFrame | None]) -> Iterator[Pair]:
    """Every pair that the streams hold: force, turning, speed, positions, heights."""
    imu, wheel, gnss = (streams.get(name) for name in ("imu", "wheel", "gnss"))
    there = [frame for frame in (imu, wheel, gnss) if frame is not None and len(frame) > 1]
    if not there:
        return
    start, end = min(frame.index[0] for frame in there), max(frame.index[-1] for frame in there)
    grid = np.arange(start, min(end, start + _LONGEST), STEP)
    speeds = {}
    if wheel is not None:
        speeds["wheel"] = _Series(wheel.index, wheel["speed"], grid)
    if gnss is not None:
        velocity = _Series(gnss.index, gnss["v_e"] + 1j * gnss["v_n"], grid)
        speeds["gnss"] = _Series(gnss.index, np.hypot(gnss["v_e"], gnss["v_n"]), grid)
    level = None if imu is None else horizontal_axes(imu)
    if imu is not None and level is not None:
        force = _Series(imu.index, _integral(imu, ["ax", "ay", "az"], level[:2]), grid)
        for name, speed in speeds.items():
            span = max(2.0, 2 * speed.interval)
            yield Pair(
                name="force and change of speed",
                first="imu",
                second=name,
                others=_without_slow(force.change(span)),
                series=_without_slow(speed.change(span))[0],
            )
    if imu is not None and level is not None and gnss is not None:
        span = max(2.0, 2 * velocity.interval)
        turned = _course_change(velocity, span)
        if "gx" in imu.columns:
            rate = _Series(imu.index, _integral(imu, ["gx", "gy", "gz"], level), grid).change(span)
            yield Pair(name="turning and course", first="imu", second="gnss", others=rate[2:], series=turned, axes=rate)
        # A vehicle on a road is pushed to the side by speed times turning.
        sideways = _without_slow(speeds["gnss"].values * turned[None])[0]
        yield Pair(
            name="force to the side and turning",
            first="imu",
            second="gnss",
            others=_without_slow(force.change(span)),
            series=sideways,
        )
    elif imu is not None and level is not None and wheel is not None and "gx" in imu.columns:
        span = max(2.0, 2 * speeds["wheel"].interval)
        rate = _Series(imu.index, _integral(imu, ["gx", "gy", "gz"], level[2:]), grid).change(span)
        yield Pair(
            name="turning and force to the side",
            first="imu",
            second="imu",
            others=_without_slow(speeds["wheel"].values * rate),
            series=_without_slow(force.change(span))[1],
        )
    if wheel is not None and gnss is not None:
        span = max(2.0, 2 * velocity.interval)
        yield Pair(
            name="speeds",
            first="wheel",
            second="gnss",
            others=speeds["wheel"].change(span),
            series=speeds["gnss"].change(span)[0],
            levels=np.concatenate([abs(speeds["wheel"].values), speeds["gnss"].values]),
        )
    if gnss is not None:
        yield from _within_gnss(gnss, velocity, grid)


def _within_gnss(gnss: pd.DataFrame, velocity: "_Series", grid: np.ndarray) -> Iterator[Pair]:
    # Positions in steps of metres tell a speed over ten seconds.
    span = max(10.0, 4 * velocity.interval)
    known = gnss[gnss[["lat", "lon"]].notna().all(axis=1)] if {"lat", "lon"} <= set(gnss.columns) else gnss[:0]
    if len(known) > 1:
        lat, lon = np.radians(known["lat"].to_numpy()), np.radians(known["lon"].to_numpy())
        place = _RADIUS * (np.unwrap(lon - lon[0]) * np.cos(lat) + 1j * (lat - lat[0]))
        moved = _Series(known.index, place, grid).change(span)[0]
        path = _Series(gnss.index, _integral(gnss, ["v_e"]) + 1j * _integral(gnss, ["v_n"]), grid).change(span)[0]
        yield Pair(
            name="velocity and positions",
            first="gnss",
            second="gnss",
            others=path[None],
            series=moved,
            levels=np.stack([abs(path), abs(moved)]),
        )
    if "alt" in gnss.columns and gnss["v_u"].notna().any():
        known = gnss[gnss["alt"].notna() & gnss["v_u"].notna()]
        if len(known) > 1:
            climbed = _Series(known.index, _integral(known, ["v_u"]), grid).change(span)
            yield Pair(
                name="climb and height",
                first="gnss",
                second="gnss",
                others=climbed,
                series=_Series(known.index, known["alt"], grid).change(span)[0],
            )


class _Series:
    """Values on a grid, interpolated between rows that are not far apart; NaN elsewhere."""

    def __init__(self, index: pd.Index, values: object, grid: np.ndarray) -> None:
        t = index.to_numpy(float)
        columns = np.atleast_2d(np.asarray(values))
        self.interval = float(np.median(np.diff(t)))
        after = np.clip(np.searchsorted(t, grid), 1, t.size - 1)
        reachable = (t[after] - t[after - 1] <= max(3 * self.interval, 1.0)) & (grid >= t[0]) & (grid <= t[-1])
        self.values = np.stack([np.where(reachable, np.interp(grid, t, column), np.nan) for column in columns])
        self.count = grid.size

    def change(self, span: float) -> np.ndarray:
        """From half a span before each moment to half a span after it."""
        half = max(round(span / 2 / STEP), 1)
        changes = np.full_like(self.values, np.nan)
        if self.count > 2 * half:
            changes[:, half:-half] = self.values[:, 2 * half :] - self.values[:, : -2 * half]
        return changes


def horizontal_axes(imu: pd.DataFrame) -> np.ndarray | None:
    """Forward, left and up in body axes as gravity shows them, by row; None where the sensor is turned about.

    Forward is the body's x axis, or y where x is upright.
    """
    force = imu[["ax", "ay", "az"]].to_numpy()
    mean = force.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if not size > 0.7 * float(np.linalg.norm(force, axis=1).mean()):
        return None
    up = mean / size
    ahead = np.eye(3)[0 if abs(up[0]) < 0.8 else 1]
    ahead = ahead - up * (ahead @ up)
    ahead /= np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(up, ahead), up])


def _integral(frame: pd.DataFrame, columns: list[str], axes: np.ndarray | None = None) -> np.ndarray:
    t, values = frame.index.to_numpy(float), frame[columns].to_numpy(float).T
    if axes is not None:
        values = axes @ values
        values = values - values.mean(axis=1, keepdims=True)
    steps = np.diff(t) * (values[:, 1:] + values[:, :-1]) / 2
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(steps, axis=1)], axis=1)


def _course_change(velocity: _Series, span: float) -> np.ndarray:
    half = max(round(span / 2 / STEP), 1)
    v, turned = velocity.values[0], np.full(velocity.count, np.nan)
    if v.size > 2 * half:
        before, after = v[: -2 * half], v[2 * half :]
        moving = (abs(before) > _SLOWEST_COURSE) & (abs(after) > _SLOWEST_COURSE)
        turned[half:-half] = np.where(moving, np.angle(after * np.conj(before)), np.nan)
    return turned


def _without_slow(changes: np.ndarray) -> np.ndarray:
    """Changes less their mean over 20 s around, which slopes and biases make."""
    changes = np.atleast_2d(changes)
    there = np.isfinite(changes)
    half = round(10.0 / STEP)

    def total(a: np.ndarray) -> np.ndarray:
        s = np.concatenate([np.zeros((len(a), 1)), np.cumsum(a, axis=1)], axis=1)
        at = np.arange(a.shape[1])
        return s[:, np.minimum(at + half + 1, a.shape[1])] - s[:, np.maximum(at - half, 0)]

    mean = total(np.where(there, changes, 0)) / np.maximum(total(there.astype(float)), 1)
    return np.where(there, changes - mean, np.nan)
