"""The report of agreement: one row a pair of streams, judged, with the likely cause and what mends it."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from altijax.agreement.axes import FORWARD, GRAVITY, SIDE, TURNING, judge_axes, judge_gyro_axes, told, wrapped
from altijax.agreement.clocks import LARGEST_DELAY, drift, judge_clocks
from altijax.agreement.correlation import Match, match
from altijax.agreement.pairs import STEP, Finding, Key, Pair, horizontal_axes, pairs
from altijax.agreement.units import LOGGED, Ratio, fitting_units
from altijax.agreement.velocities import judge_velocity, velocity_match

COLUMNS = ("offset", "scale", "sign", "axis", "drift", "correlation", "sure", "verdict", "cause", "remedy")
_WORSE = {"ok": 0, "undecidable": 0, "doubtful": 1, "wrong": 2}

# Powers of units in a ratio, and how far its logarithm may be from none on a good recording: slopes and suspension
# take a third from a force, slip and scale some percent from a speed.
_POWERS: dict[Key, tuple[dict[str, int], float]] = {
    ("force and change of speed", "wheel"): ({"speed": 1, "time": -1}, 0.5),
    ("force and change of speed", "gnss"): ({"gnss_speed": 1, "time": -1}, 0.5),
    ("turning and course", "gnss"): ({"gyro": -1, "time": -1}, 0.3),
    ("turning and force to the side", "imu"): ({"speed": -1, "gyro": -1}, 0.5),
    ("speeds", "gnss"): ({"gnss_speed": 1, "speed": -1}, 0.07),
    ("velocity and positions", "gnss"): ({"gnss_speed": -1, "time": -1}, 0.1),
    ("climb and height", "gnss"): ({"gnss_speed": -1, "time": -1}, 0.4),
}
_FILES = {"speed": "wheel", "gnss_speed": "gnss", "gyro": "imu", "time": "imu"}
_SI = {"speed": "m/s", "gnss_speed": "m/s", "gyro": "rad/s", "time": "s"}


def agreement_report(
    streams: Mapping[str, pd.DataFrame | None], axes: str = "FLU"
) -> tuple[pd.DataFrame, list[Finding]]:
    """What the streams of a recording say of each other.

    Parameters
    ----------
    streams : mapping of str to DataFrame or None
        imu, wheel and gnss, indexed by t in s, in SI units and body axes.
    axes : str, optional
        The code by which sensor axes became body axes.

    Returns
    -------
    report : DataFrame
        One row a pair. offset (s): how late the second is; scale: size of the second in the first; sign; axis (deg): of
        forward or left, how far to the left of where it should be; drift: change of the offset over the record, in s;
        correlation, and how sure, in standard deviations of chance; verdict: ok, doubtful, wrong, or undecidable where
        there is too little motion; likely cause and what mends it.
    findings : list of Finding
        What disagrees.
    """
    rows: dict[Key, dict[str, Any]] = {}
    matches: dict[Key, Match] = {}
    ratios: dict[Key, Ratio] = {}
    findings: list[Finding] = []
    for pair in pairs(streams):
        key = (pair.name, pair.second)
        if np.iscomplexobj(pair.series):
            found = velocity_match(pair)
            findings += judge_velocity(key, found)
        else:
            found = match(pair.others, pair.series, STEP)
        if pair.axes is not None and (found is None or not told(found)):
            findings += judge_gyro_axes(match(pair.axes, pair.series, STEP))
        level_ratio = _level_ratio(pair.levels)
        if found is not None:
            matches[key] = found
        rows[key] = _row(pair, found, level_ratio)
        ratio = _ratio(key, found, level_ratio)
        if ratio is not None:
            ratios[key] = ratio
    clocks = list(judge_clocks(matches))
    if clocks:
        # Of clocks that are apart only clear matches compare the same moments.
        ratios = {key: ratio for key, ratio in ratios.items() if key not in matches or matches[key].score > 5}
    mirrored = any(finding.quantities == ("gnss_velocity",) for finding in findings)
    findings += [*clocks, *_judge_units(ratios)]
    imu = streams.get("imu")
    if imu is not None and len(imu):
        level = horizontal_axes(imu)
        upright = level is None or bool(level[2, 2] == np.abs(level[2]).max())
        rows[GRAVITY] = _gravity_row(level)
        by_course = () if not mirrored else (SIDE, TURNING)
        findings += judge_axes(
            {key: found for key, found in matches.items() if key not in by_course}, level, upright, axes
        )
    for finding in findings:
        _enter(rows, finding)
    named = {f"{name} ({second})": row for (name, second), row in rows.items()}
    return pd.DataFrame.from_dict(named, orient="index", columns=list(COLUMNS)).rename_axis("pair"), findings


def _level_ratio(levels: np.ndarray | None) -> tuple[float, float] | None:
    """Quartiles of the size of the second in the first, where both move; None where they do not for 10 s."""
    if levels is None:
        return None
    first, second = levels
    moving = np.isfinite(first + second) & (first > 0.5) & (second > 0.5) & (np.maximum(first, second) > 2)
    if moving.sum() * STEP < 10:
        return None
    low, high = np.quantile(second[moving] / first[moving], [0.25, 0.75])
    return float(low), float(high)


def _row(pair: Pair, found: Match | None, levels: tuple[float, float] | None) -> dict[str, Any]:
    row: dict[str, Any] = {"verdict": "undecidable", "cause": "too little motion to tell", "remedy": ""}
    if found is None and levels is None:
        return row
    if levels is not None:
        row |= {"scale": float(np.sqrt(levels[0] * levels[1])), "verdict": "ok", "cause": ""}
    if found is None:
        return row
    row |= {"correlation": found.correlation, "sure": found.score}
    if not told(found):
        return row
    key = (pair.name, pair.second)
    size = found.coefficients[0]
    row |= {"verdict": "ok", "cause": "", "offset": found.lag, "drift": drift(found)[0]}
    row = {"scale": found.scale[0]} | row
    if key in FORWARD or key == SIDE:
        expected = 90.0 if key == SIDE else 0.0
        if key == SIDE and not 0.5 < found.scale[0] < found.scale[1] < 2.5:
            return row | {"verdict": "undecidable", "cause": "whatever leans into its turns is not pushed to the side"}
        row["axis"] = wrapped(float(np.degrees(np.arctan2(*found.coefficients[::-1]))) - expected)
    else:
        row["sign"] = float(np.sign(size))
    return row


def _ratio(key: Key, found: Match | None, levels: tuple[float, float] | None) -> Ratio | None:
    if key not in _POWERS:
        return None
    powers, tolerance = _POWERS[key]
    if levels is not None:
        middle = float(np.sqrt(levels[0] * levels[1]))
        return Ratio(low=middle, high=middle, powers=powers, tolerance=tolerance)
    # At a lag that is none, sizes that chance made alike are compared.
    if found is None or not told(found) or (abs(found.lag) > LARGEST_DELAY and found.score < 5):
        return None
    low, high = found.scale
    spread = 2 * float(np.linalg.norm(found.coefficient_std)) / low
    return Ratio(low=low * max(1 - spread, 0.2), high=high * (1 + spread), powers=powers, tolerance=tolerance)


def _judge_units(ratios: Mapping[Key, Ratio]) -> Iterator[Finding]:
    """The fewest units in which the sizes agree, where they do not as they stand."""
    # Between the units of speed there is room for wheels that slip and scales that are off.
    off = {key: ratio for key, ratio in ratios.items() if ratio.misfit({}) > 0.15}
    if not off:
        return
    choices = fitting_units(list(ratios.values()), at_most=min(len(off), 2))
    if not choices or not choices[0]:
        key = max(off, key=lambda key: off[key].misfit({}))
        times = float(np.sqrt(off[key].low * off[key].high))
        yield Finding(
            verdict="doubtful",
            pairs=tuple(off),
            stream=key[1],
            seen=f"{key[0]}: the second is {times:.3g} times the first",
            cause="no unit that we know explains it",
            remedy="check the unit and scale of both, and divide one of them in the file",
            quantities=tuple(off[key].powers),
        )
        return
    # Two units that explain all alike are both named, the better one first.
    for quantity, unit in choices[0].items():
        also = {choice[quantity] for choice in choices[1:] if choice.keys() == choices[0].keys()} - {unit}
        shown = max(
            (key for key in off if quantity in off[key].powers),
            key=lambda key: off[key].misfit({}),
            default=next(iter(off)),
        )
        ratio = off[shown]
        size = float(np.sqrt(ratio.low * ratio.high)) ** ratio.powers.get(quantity, 1)
        factor = LOGGED[quantity][unit]
        beyond = max(ratio.misfit({}) for ratio in off.values())
        yield Finding(
            verdict="wrong" if beyond > 0.2 and not also else "doubtful",
            pairs=tuple(off),
            stream=_FILES[quantity],
            seen=f"by '{shown[0]}' its {quantity.replace('_', ' ')} is {size:.3g} times what it should be",
            cause=f"looks like {unit} ({factor:.4g} times)" + (f", or {', '.join(sorted(also))}" if also else ""),
            remedy=f"read with units={{'{quantity}': '{unit}'}} ('{_SI[quantity]}' if it is right)",
            quantities=(quantity,),
        )


def _gravity_row(level: np.ndarray | None) -> dict[str, Any]:
    if level is None:
        return {"verdict": "undecidable", "cause": "the sensor is turned about", "remedy": ""}
    tilt = float(np.degrees(np.arccos(np.clip(level[2, 2], -1, 1))))
    return {"axis": tilt, "sign": float(np.sign(level[2, 2])), "verdict": "ok", "cause": "", "remedy": ""}


def _enter(rows: dict[Key, dict[str, Any]], finding: Finding) -> None:
    for key in finding.pairs:
        row = rows.get(key)
        if row is not None and _WORSE[finding.verdict] > _WORSE[row["verdict"]]:
            row |= {"verdict": finding.verdict, "cause": finding.cause, "remedy": finding.remedy}
