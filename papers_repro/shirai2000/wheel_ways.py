"""What the ways printed for the speed sensor say about its wheel and its pulses."""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import pi

import numpy as np

from papers_repro.comparison import Finding, Interval, before_rounding, parse, ratio
from papers_repro.shirai2000.tables import Row

DRAWS = 1000

# No cart has a smaller wheel.
SMALLEST_RADIUS = 0.05


def wheel_findings(rows: list[Row], *, wheel_sensor: str, pulses_per_turn: int) -> list[Finding]:
    """Everything below, in order."""
    return [
        *wheel_scale(rows, wheel_sensor),
        *repeated_ways(rows, wheel_sensor, pulses_per_turn),
        *distance_quantum(rows, wheel_sensor, pulses_per_turn),
    ]


def wheel_scale(rows: list[Row], wheel_sensor: str) -> list[Finding]:
    """Printed over actual way of the wheels: one wheel radius makes one ratio."""
    ratios: dict[str, list[Interval]] = {}
    for row in rows:
        if row["sensor"] == wheel_sensor and row["experiment"] != "average":
            one = ratio(before_rounding(row["way_m"]), before_rounding(row["actual_way_m"]))
            ratios.setdefault(row["table"], []).append(one)
    ends = {t: (min(float(i.low) for i in r), max(float(i.high) for i in r)) for t, r in ratios.items()}
    return [
        Finding(
            kind="wheel scale",
            inconsistency=False,
            rule="One wheel radius makes one ratio of wheel way to actual way.",
            where=", ".join(f"table {table}" for table in ends),
            printed="; ".join(f"table {t}: {low:.4f}..{high:.4f}" for t, (low, high) in ends.items()),
            expected=(
                "one radius fits"
                if max(low for low, _ in ends.values()) <= min(high for _, high in ends.values())
                else "no radius fits both"
            ),
            evidence=f"ratios apart by {max(h for _, h in ends.values()) - min(low for low, _ in ends.values()):.4f}",
        )
    ]


def repeated_ways(rows: list[Row], wheel_sensor: str, pulses_per_turn: int) -> list[Finding]:
    """Wheel ways that several runs share to the last digit, and pairs that nearly do."""
    ways = Counter(r["way_m"] for r in rows if r["sensor"] == wheel_sensor and r["experiment"] != "average")
    several = {way: n for way, n in ways.items() if n > 1}
    pulse = _shortest_pulse(pulses_per_turn)
    ordered = sorted(ways, key=_metres)
    findings = [
        Finding(
            kind="ways closer than a pulse",
            inconsistency=True,
            rule=f"Ways counted in pulses are equal or a pulse apart: {1000 * pulse:.0f} mm for wheels of "
            f"{SMALLEST_RADIUS} m radius, {pulses_per_turn} pulses a turn, mean of two wheels.",
            where=f"{wheel_sensor} ways",
            printed=f"{one} m and {other} m",
            expected="the same way",
            evidence=f"{1000 * (_metres(other) - _metres(one)):.0f} mm apart",
        )
        for one, other in pairwise(ordered)
        if _metres(other) - _metres(one) < pulse
    ]
    if several:
        findings.append(
            Finding(
                kind="repeated way",
                inconsistency=False,
                rule="A continuous quantity does not repeat to the millimetre; what comes in steps does.",
                where=f"{wheel_sensor} ways",
                printed=", ".join(f"{way} m {n} times" for way, n in several.items()),
                expected="the ways come in steps",
                evidence=f"{sum(several.values())} of {sum(ways.values())} runs share their way with another",
            )
        )
    return findings


def distance_quantum(rows: list[Row], wheel_sensor: str, pulses_per_turn: int) -> list[Finding]:
    """The largest distance of which all wheel ways are whole multiples, and whether chance gives as large a one."""
    pulse = _shortest_pulse(pulses_per_turn)
    by_table: dict[str, Counter[str]] = {}
    for row in rows:
        if row["sensor"] == wheel_sensor and row["experiment"] != "average":
            by_table.setdefault(row["table"], Counter())[row["way_m"]] += 1
    findings = []
    for tables in ([table for table, ways in by_table.items() if len(ways) > 1], list(by_table)):
        # Ways closer than a pulse are one count: the most frequent of them stands for it.
        counts: list[float] = []
        for text, _ in sum((by_table[table] for table in tables), Counter()).most_common():
            if all(abs(_metres(text) - other) >= pulse for other in counts):
                counts.append(_metres(text))
        quantum = largest_quantum(counts)
        random = np.random.default_rng(0)
        draws = ([round(random.uniform(0.98, 1.02) * way, 3) for way in counts] for _ in range(DRAWS))
        as_large = sum(largest_quantum(draw, smallest=quantum) > 0 for draw in draws)
        radius = quantum * pulses_per_turn / (2 * pi)
        findings.append(
            Finding(
                kind="distance quantum",
                inconsistency=False,
                rule="Ways counted in pulses are whole multiples of the distance between two pulses.",
                where=" and ".join(f"table {table}" for table in tables),
                printed=", ".join(f"{way:.3f}" for way in sorted(counts)) + " m",
                expected=f"largest common divisor {1000 * quantum:.2f} mm, a radius of {1000 * radius:.1f} mm at "
                f"{pulses_per_turn} pulses a turn" + (": not whole pulses" if quantum < pulse else ""),
                evidence=f"as large or larger in {100 * as_large / DRAWS:.0f} % of random draws",
            )
        )
    return findings


def _metres(text: str) -> float:
    return float(parse(text).value)


def _shortest_pulse(pulses_per_turn: int) -> float:
    """Way between two pulses at the smallest radius, as the mean of two wheels; m."""
    return 2 * pi * SMALLEST_RADIUS / pulses_per_turn / 2


def largest_quantum(ways: Sequence[float], *, half_unit: float = 0.0005, smallest: float = 0.001) -> float:
    """The largest distance that divides all ways to within their rounding; zero if none from `smallest` on does."""
    *others, longest = sorted(ways)
    counts = np.arange(1, int(longest / smallest) + 2)
    low, high = (longest - half_unit) / counts, (longest + half_unit) / counts
    for way in others:
        whole = np.maximum(np.round(way * counts / longest), 1)
        low, high = np.maximum(low, (way - half_unit) / whole), np.minimum(high, (way + half_unit) / whole)
    possible = np.flatnonzero((low <= high) & (high >= smallest))
    return float(high[possible[0]]) if possible.size else 0.0
