"""Wheel ticks that a u-blox receiver was given: rolling counters with a bit for the direction, as speeds in m/s."""

import numpy as np
import pandas as pd

from altijax.formats.tables import stream_table

_WHEELS = {6: "front_left", 7: "front_right", 8: "rear_left", 9: "rear_right"}
_SINGLE_TICK = 10
TICKS = {*_WHEELS, _SINGLE_TICK}
_BACKWARDS, _COUNT = 0x800000, 0x7FFFFF
"""Bit 23 and the bits of the count."""

_MOVING = 2.0
"""m/s above which the receiver's speed tells the length of a tick to some percent an epoch."""


def wheel_table(
    ticks: dict[int, tuple[np.ndarray, np.ndarray]],
    gnss: pd.DataFrame | None,
    file: str,
    problems: list[str],
    notes: list[str],
) -> pd.DataFrame | None:
    """Wheel speeds between successive counts, or None; the length of a tick is that which the GNSS speed gives.

    `ticks` holds times (s) and 24 bits of each measurement, by its type.
    """
    rates = {kind: tick_rate(t, words) for kind, (t, words) in ticks.items() if len(t) > 1}
    # All wheels are counted alike, so one length serves them, and speeds in bends stay as they are.
    wheels = {kind: rate for kind, rate in rates.items() if kind in _WHEELS} or rates
    length = _tick_length(wheels, gnss)
    if length is None:
        problems.append(
            f"{file}: wheel ticks left out, the log does not say how far one is, nor has it 10 GNSS speeds above "
            f"{_MOVING:g} m/s to tell; put speeds into a wheel.csv"
        )
        return None
    notes.append(
        f"{file}: a wheel tick is {length:.4g} m by the GNSS speed of this log, so the scale of the wheel speed is not "
        "independent of GNSS"
    )
    # Wheels are sent together; a wheel that lacks a time of the first is interpolated.
    t = next(iter(wheels.values()))[0]
    columns = {_WHEELS.get(kind, "speed"): length * np.interp(t, *rate) for kind, rate in sorted(wheels.items())}
    return stream_table(t, np.stack(list(columns.values()), -1), list(columns), file)


def tick_rate(t: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times between successive counts, and ticks per second there, negative backwards.

    A counter starts again at a power of two that is not in the log: the lowest that no count reaches. Where a quarter
    of the changes is down, it is no rolling counter but ticks since the message before.
    """
    count, backwards = words & _COUNT, (words & _BACKWARDS) != 0
    steps = np.diff(count)
    changes = steps[steps != 0]
    if changes.size and (changes < 0).mean() > 0.25:
        steps = count[1:]
    else:
        steps = np.mod(steps, 1 << int(count.max()).bit_length())
    sign = np.where(backwards[1:], -1.0, 1.0)
    return (t[1:] + t[:-1]) / 2, sign * steps / np.diff(t)


def _tick_length(rates: dict[int, tuple[np.ndarray, np.ndarray]], gnss: pd.DataFrame | None) -> float | None:
    """Metres of one tick: the median ratio of GNSS speed to mean tick rate; None where too little moves."""
    if gnss is None or not rates:
        return None
    t, speed = gnss["t"].to_numpy(), np.hypot(gnss["v_e"].to_numpy(), gnss["v_n"].to_numpy())
    rate = np.abs(np.mean([np.interp(t, *wheel, left=0.0, right=0.0) for wheel in rates.values()], axis=0))
    usable = (speed > _MOVING) & (rate > 0)
    return float(np.median(speed[usable] / rate[usable])) if usable.sum() >= 10 else None
