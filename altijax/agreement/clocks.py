"""Offsets between the clocks of streams, and their drift, judged by the lags of all pairs together."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from altijax.agreement.axes import told
from altijax.agreement.correlation import Match
from altijax.agreement.pairs import Finding, Key

_FORCE, _TURNING, _SPEEDS = "force and change of speed", "turning and course", "speeds"
LARGEST_DELAY = 2.0
"""Of receivers, in s, and the blur of a lag that slow motion tells."""

_LEAP_SECONDS = {18.0: "GPS time less UTC", 37.0: "atomic time less UTC", 19.0: "atomic time less GPS time"}


def judge_clocks(matches: Mapping[Key, Match]) -> Iterator[Finding]:
    """Clocks that are apart by more than a receiver's delay, or that run away from each other."""
    lags = {key: found for key, found in matches.items() if key[0] in (_FORCE, _TURNING, _SPEEDS) and told(found)}
    drifts = list(_drifts({key: found for key, found in matches.items() if key[0] in (_FORCE, _TURNING, _SPEEDS)}))
    yield from drifts
    late: dict[str, _Late] = {}
    for name, keys in (("gnss", [(_TURNING, "gnss"), (_FORCE, "gnss")]), ("wheel", [(_FORCE, "wheel")])):
        told_by = {key: lags[key] for key in keys if key in lags}
        if told_by:
            best = max(told_by.values(), key=lambda found: found.score)
            late[name] = _Late(best.lag, best.score, best.correlation, told_by)
    between = lags.get((_SPEEDS, "gnss"))
    if between is not None:
        # By way of the other speed a clock may be told better than by the IMU itself.
        there = dict(late)
        for name, other, sign in (("gnss", "wheel", 1), ("wheel", "gnss", -1)):
            base = there.get(other, _Late(0.0, between.score, 1.0, {}))
            through = _Late(
                base.lag + sign * between.lag,
                min(base.score, between.score),
                min(base.correlation, between.correlation),
                {(_SPEEDS, "gnss"): between} | dict(base.pairs),
            )
            # Two speeds alone do not say whose clock is off: the receiver's is taken.
            if (name not in there and (other in there or name == "gnss")) or (
                name in there and other in there and there[name].score < through.score
            ):
                late[name] = through
    adrift = {finding.stream for finding in drifts}
    if {"gnss", "wheel"} <= set(late) and abs(late["gnss"].lag - late["wheel"].lag) < 1.0:
        common = max(late.values(), key=lambda found: found.score)
        late = {"imu": common._replace(lag=-common.lag, pairs={**late["wheel"].pairs, **late["gnss"].pairs})}
    for name, found in late.items():
        if name not in adrift and abs(found.lag) > LARGEST_DELAY:
            yield _offset(name, found)


class _Late(NamedTuple):
    lag: float
    score: float
    correlation: float
    pairs: Mapping[Key, Match]


def _offset(stream: str, found: _Late) -> Finding:
    lag = found.lag
    agreeing = sum(abs(abs(pair.lag) - abs(lag)) < 1.0 for pair in found.pairs.values())
    sure = found.correlation > 0.8 and (found.score > 5 or (agreeing > 1 and found.score > 4))
    known = [why for size, why in _LEAP_SECONDS.items() if abs(abs(lag) - size) < 0.7]
    cause = f"that is {known[0]}: one clock counts leap seconds" if known else "the clocks are not set alike"
    return Finding(
        verdict="wrong" if sure else "doubtful",
        pairs=tuple(found.pairs),
        stream=stream,
        seen=f"its motion is {abs(lag):.1f} s {'later' if lag > 0 else 'earlier'} than that of the other streams "
        f"(correlation {found.correlation:.2f} there)",
        cause=cause,
        remedy=f"read with clock={{'{stream}': {-lag:.2f}}}, which is added to its times (0 if they are right)",
        quantities=(f"clock {stream}",),
    )


def _drifts(lags: Mapping[Key, Match]) -> Iterator[Finding]:
    for key, found in lags.items():
        change, std = drift(found)
        # Slopes are force too, and move the lag of a force by a second.
        least, times = (2.0, 6.0) if key[0] == _FORCE else (0.8, 3.5)
        if abs(change) < max(least, times * std):
            continue
        rate = change / (found.lags[-1, 0] - found.lags[0, 0])
        stream = key[1]
        yield Finding(
            verdict="doubtful",
            pairs=(key,),
            stream=stream,
            seen=f"from the first part of the record to the last it gets {abs(change):.1f} s "
            f"{'later' if change > 0 else 'earlier'} against the other streams",
            cause=f"its clock runs {100 * abs(rate):.2g} % {'slow' if rate > 0 else 'fast'}, or was set in between",
            remedy=f"divide its times by {1 + rate:.5f} if it drifts, or cut the recording where it was set",
            quantities=(f"clock {stream}",),
        )
        return


def drift(found: Match) -> tuple[float, float]:
    """Change of the lag from the first part of the record to the last, in s, and its standard deviation."""
    if len(found.lags) < 2:
        return 0.0, np.inf
    first, last = found.lags[0], found.lags[-1]
    return float(last[1] - first[1]), float(np.hypot(first[2], last[2]))
