"""What the paper says about accuracy, each with the probability that repeated experiments bear it out.

A repetition has the paper's numbers of runs and its durations. Every run of it is drawn with sensors that the printed
rows allow, so the probability has both parts: the luck of few runs, and what is not known of the sensors.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from papers_repro.comparison import Finding
from papers_repro.shirai2000.experiments import CHAINS, OUTPUTS
from papers_repro.shirai2000.inference import Experiments
from papers_repro.shirai2000.statements import Ranking, holds
from papers_repro.shirai2000.tables import QUANTITIES

# Mean absolute errors (repetitions,) by place and quantity, and by sensor.
Errors = dict[tuple[str, str], dict[str, np.ndarray]]


def repeated_errors(experiments: Experiments, arrivals: np.ndarray) -> Errors:
    """Mean |error| of every repetition, over the runs in which the paper used a sensor.

    `arrivals` (experiments, repetitions, chains, outputs).
    """
    course = experiments.course
    true = np.stack([course.way, course.horizontal, course.rise], -1)
    absolute = np.abs(arrivals - true[:, None, None])
    indoors, used = np.asarray(experiments.indoors), np.isfinite(experiments.way)
    return {
        (place, quantity): {
            chain: absolute[here & used[:, i], :, i, OUTPUTS.index(quantity)].mean(0)
            for i, chain in enumerate(CHAINS)
            if (here & used[:, i]).any()
        }
        for place, here in (("indoors", indoors), ("outdoors", ~indoors))
        for quantity in QUANTITIES
    }


def verdict(probability: float) -> str:
    """A probability in words."""
    for least, words in ((0.95, "almost certain"), (0.75, "likely"), (0.25, "open"), (0.05, "unlikely")):
        if probability >= least:
            return words
    return "almost excluded"


def claims(errors: Errors, paper: dict[str, Any]) -> list[Finding]:
    """The orders and ratios that the paper states, and what decides between its introduction and its conclusions."""
    return [*_orders(errors, paper["orders"]), *_ratios(errors, paper["ratios"]), *_contradiction(errors)]


def _share(errors: dict[str, np.ndarray], order: Sequence[list[str]]) -> float:
    return float(np.mean([holds(ranking, list(order)) for ranking in _rankings(errors)]))


def _rankings(errors: dict[str, np.ndarray]) -> list[Ranking]:
    return [dict(zip(errors, means, strict=True)) for means in np.stack(list(errors.values()), 1).tolist()]


def _orders(errors: Errors, orders: list[dict[str, Any]]) -> list[Finding]:
    findings = []
    for order in orders:
        for place in order["places"]:
            for quantity in order["quantities"]:
                probability = _share(errors[place, quantity], order["best_first"])
                findings.append(
                    Finding(
                        kind="claim repeated",
                        inconsistency=False,
                        rule="A stated order of accuracy holds in repetitions of the experiments.",
                        where=f"{order['where']}: {quantity} {place}",
                        printed=" > ".join(" = ".join(group) for group in order["best_first"]),
                        expected=verdict(probability),
                        evidence=f"probability {probability:.2f}; median of mean |error| "
                        + _medians(errors[place, quantity]),
                    )
                )
    return findings


def _ratios(errors: Errors, ratios: list[dict[str, Any]]) -> list[Finding]:
    findings = []
    for stated in ratios:
        about = float(stated["ratio"])
        for quantity in QUANTITIES:
            of = errors[stated["place"], quantity]
            ratio = of[stated["worse"]] / of[stated["better"]]
            probability = float(np.mean((ratio >= about - 0.5) & (ratio < about + 0.5)))
            low, median, high = np.quantile(ratio, [0.05, 0.5, 0.95])
            findings.append(
                Finding(
                    kind="ratio repeated",
                    inconsistency=False,
                    rule="A stated ratio of mean |errors| comes out within a half in repetitions of the experiments.",
                    where=f"{stated['where']}: {quantity} {stated['place']}",
                    printed=f"about {stated['ratio']} times",
                    expected=verdict(probability),
                    evidence=f"probability {probability:.2f}; median {median:.1f}, 5 to 95 % {low:.1f} to {high:.1f}",
                )
            )
    return findings


def _contradiction(errors: Errors) -> list[Finding]:
    """Who is right outdoors: the introduction (speed sensor best in all) or the conclusions (gyros in elevation)."""
    findings = []
    for quantity in QUANTITIES:
        of = errors["outdoors", quantity]
        gyros = np.stack([of[chain] for chain in CHAINS[:2]])
        speed = of["vehicle_speed"]
        best, worst = np.mean(speed < gyros.min(0)), np.mean(speed > gyros.max(0))
        better = [float(np.mean(speed < gyro)) for gyro in gyros]
        findings.append(
            Finding(
                kind="contradiction resolved",
                inconsistency=False,
                rule="The speed sensor is best (introduction), or the gyros are (conclusions, of elevation).",
                where=f"{quantity} outdoors",
                printed="introduction: the speed sensor is best"
                + ("; conclusions: the gyros are" if quantity == "elevation" else "; conclusions: so too"),
                expected=f"speed sensor best: {verdict(float(best))}; worst: {verdict(float(worst))}",
                evidence=f"best {best:.2f}, worst {worst:.2f}; better than the vibration gyro {better[0]:.2f}, than "
                f"the fibre-optic gyro {better[1]:.2f}",
            )
        )
    return findings


def _medians(errors: dict[str, np.ndarray]) -> str:
    return ", ".join(f"{sensor} {np.median(of):.2f} m" for sensor, of in errors.items())
