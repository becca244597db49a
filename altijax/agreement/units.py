"""Which units make all sizes agree: the fewest that do, out of those in which people log."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from altijax.constants import KNOT

_SPEEDS = {"km/h": 3.6, "mph": 1 / 0.44704, "kn": 1 / KNOT, "cm/s": 1e2, "mm/s": 1e3}
LOGGED: dict[str, dict[str, float]] = {
    "speed": _SPEEDS,
    "gnss_speed": _SPEEDS,
    "gyro": {
        "deg/s": 180 / np.pi,
        "mrad/s": 1e3,
        "mdeg/s": 180e3 / np.pi,
        "deg/h": 3600 * 180 / np.pi,
    },
    "time": {"min": 1 / 60, "h": 1 / 3600, "d": 1 / 86400, "ms": 1e3, "us": 1e6, "ns": 1e9},
}
"""How many times too large a quantity is that is in this unit and taken for SI."""


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """How many times as large one measurement of a quantity is as another, and the powers of the units in it."""

    low: float
    high: float
    powers: Mapping[str, int]
    tolerance: float
    """Of its logarithm: how far slopes, slip and mounting may take it from one."""

    def misfit(self, factors: Mapping[str, float]) -> float:
        """By how much, in logarithms and beyond the tolerance, the ratio is not what the factors make it."""
        expected = sum(power * np.log(factors.get(name, 1.0)) for name, power in self.powers.items())
        low, high = np.log(self.low) - self.tolerance, np.log(self.high) + self.tolerance
        return float(max(low - expected, expected - high, 0.0))


def fitting_units(ratios: Sequence[Ratio], at_most: int = 2) -> list[dict[str, str]]:
    """The choices of fewest units, of a few quantities at most, under which every ratio is as expected; best first.

    Returns
    -------
    choices : list of dict
        Unit by quantity. ``[{}]`` where all is right as it stands; empty where nothing fits.
    """
    there = [name for name in LOGGED if any(name in ratio.powers for ratio in ratios)]
    for count in range(at_most + 1):
        fitting = []
        for names in itertools.combinations(there, count):
            for units in itertools.product(*(LOGGED[name] for name in names)):
                factors = {name: LOGGED[name][unit] for name, unit in zip(names, units, strict=True)}
                if all(ratio.misfit(factors) == 0 for ratio in ratios):
                    fitting.append((_distance(ratios, factors), dict(zip(names, units, strict=True))))
        if fitting:
            return [choice for _, choice in sorted(fitting, key=lambda item: item[0])]
    return []


def _distance(ratios: Sequence[Ratio], factors: Mapping[str, float]) -> float:
    total = 0.0
    for ratio in ratios:
        expected = sum(power * np.log(factors.get(name, 1.0)) for name, power in ratio.powers.items())
        total += abs(np.log(ratio.low * ratio.high) / 2 - expected) / ratio.tolerance
    return total
