"""What the paper's text says about its tables, decided from the printed rows.

The statements are in paper.toml. A sensor is ranked by its mean absolute error per quantity and place, formed from the
printed measurements: indoors the floor is level, so the horizontal distance is the way and the elevation zero.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

from papers_repro.comparison import Finding, parse, rounds_to, write_like
from papers_repro.shirai2000.tables import QUANTITIES, Row, number

# Mean absolute error (m) by sensor, best first.
Ranking = dict[str, float]


def rankings(rows: list[Row], places: dict[str, str]) -> dict[tuple[str, str], Ranking]:
    """Mean absolute error of every sensor by place and quantity, the best sensor first."""
    runs = [row for row in rows if row["experiment"] != "average"]
    result = {}
    for where in dict.fromkeys(places.values()):
        here = [row for row in runs if places[row["course"]] == where]
        for quantity in QUANTITIES:
            errors: dict[str, list[float]] = {}
            for row in here:
                errors.setdefault(row["sensor"], []).append(_absolute_error(row, quantity))
            means = {sensor: sum(values) / len(values) for sensor, values in errors.items()}
            result[where, quantity] = dict(sorted(means.items(), key=lambda item: item[1]))
    return result


def statements(rows: list[Row], paper: dict[str, Any]) -> list[Finding]:
    """Orders, ratios and round numbers of the text that the tables contradict, and the orders they do give."""
    ranked = rankings(rows, paper["places"])
    return [
        *_orders(ranked, paper["orders"]),
        *_ratios(ranked, paper["ratios"]),
        *_round_numbers(rows, paper["round_numbers"]),
        *_found_orders(ranked, paper["orders"]),
        *_found_ratios(ranked, paper["ratios"]),
    ]


def holds(ranking: Ranking, order: list[list[str]]) -> bool:
    """Whether every sensor of an earlier group is better than every sensor of a later one, absent sensors left out."""
    groups = [[ranking[sensor] for sensor in group if sensor in ranking] for group in order]
    groups = [group for group in groups if group]
    return all(max(better) < min(worse) for better, worse in pairwise(groups))


def _orders(ranked: dict[tuple[str, str], Ranking], orders: list[dict[str, Any]]) -> list[Finding]:
    return [
        Finding(
            kind="stated order",
            inconsistency=True,
            rule="A stated order of accuracy is that of the mean absolute errors in the tables.",
            where=f"{order['where']}: {quantity} {place}",
            printed=" > ".join(" = ".join(group) for group in order["best_first"]),
            expected=" > ".join(ranked[place, quantity]),
            evidence=_errors(ranked[place, quantity]),
        )
        for order in orders
        for place in order["places"]
        for quantity in order["quantities"]
        if not holds(ranked[place, quantity], order["best_first"])
    ]


def _ratios(ranked: dict[tuple[str, str], Ranking], ratios: list[dict[str, Any]]) -> list[Finding]:
    findings = []
    for stated in ratios:
        for quantity in QUANTITIES:
            errors = ranked[stated["place"], quantity]
            ratio = errors[stated["worse"]] / errors[stated["better"]]
            if not rounds_to(parse(stated["ratio"]), ratio):
                findings.append(
                    Finding(
                        kind="stated ratio",
                        inconsistency=True,
                        rule="A stated ratio of accuracies is that of the mean absolute errors in the tables.",
                        where=f"{stated['where']}: {quantity} {stated['place']}",
                        printed=f"about {stated['ratio']} times",
                        expected=f"{ratio:.2f} times",
                        evidence=_errors(errors),
                    )
                )
    return findings


def _round_numbers(rows: list[Row], round_numbers: list[dict[str, Any]]) -> list[Finding]:
    findings = []
    for stated in round_numbers:
        printed = parse(stated["text"])
        zeros = len(printed.text) - len(printed.text.rstrip("0")) if printed.unit == 1 else 0
        coarse = replace(printed, unit=printed.unit * 10**zeros)
        column = f"actual_{stated['quantity']}_m"
        [actual, *_] = [abs(number(row, column)) for row in rows if row[column] and row["course"] in stated["courses"]]
        if not rounds_to(coarse, actual):
            twice = [
                f"; {other['where']} says {other['text']}, which rounds to it"
                for other in round_numbers
                if other is not stated
                and (other["quantity"], other["courses"]) == (stated["quantity"], stated["courses"])
                and rounds_to(coarse, parse(other["text"]).value)
            ]
            findings.append(
                Finding(
                    kind="stated site",
                    inconsistency=True,
                    rule="A round number in the text is the measured one, rounded.",
                    where=f"{stated['where']}: {stated['quantity']}",
                    printed=f"{printed.text} m",
                    expected=f"{write_like(printed, actual)} m",
                    evidence=f"{float(actual):.3f} m was measured{''.join(twice)}",
                )
            )
    return findings


def _found_orders(ranked: dict[tuple[str, str], Ranking], orders: list[dict[str, Any]]) -> list[Finding]:
    findings = []
    for (place, quantity), ranking in ranked.items():
        about = [order for order in orders if place in order["places"] and quantity in order["quantities"]]
        right = [order["where"] for order in about if holds(ranking, order["best_first"])]
        wrong = [order["where"] for order in about if not holds(ranking, order["best_first"])]
        findings.append(
            Finding(
                kind="order",
                inconsistency=False,
                rule="Order of the sensors by mean absolute error, per quantity and place.",
                where=f"{quantity} {place}",
                printed="; ".join(
                    [*(f"{where}: right" for where in right), *(f"{where}: wrong" for where in wrong)]
                    or ["no statement"]
                ),
                expected=" > ".join(ranking),
                evidence=_errors(ranking),
            )
        )
    return findings


def _found_ratios(ranked: dict[tuple[str, str], Ranking], ratios: list[dict[str, Any]]) -> list[Finding]:
    return [
        Finding(
            kind="ratio",
            inconsistency=False,
            rule="Mean absolute error of the worse sensor over that of the better one, per quantity.",
            where=f"{stated['where']}: {stated['worse']} / {stated['better']} {stated['place']}",
            printed=f"about {stated['ratio']} times",
            expected=", ".join(
                f"{quantity} {errors[stated['worse']] / errors[stated['better']]:.2f}"
                for quantity, errors in ((q, ranked[stated["place"], q]) for q in QUANTITIES)
            ),
            evidence="from the printed measurements, no printed error used",
        )
        for stated in ratios
    ]


def _absolute_error(row: Row, quantity: str) -> float:
    column = f"actual_{quantity}_m"
    if row[column]:
        actual = number(row, column)
    else:
        actual = number(row, "actual_way_m") if quantity == "horizontal" else parse("0").value
    return float(abs(number(row, f"{quantity}_m") - actual))


def _errors(ranking: Ranking) -> str:
    return "mean |error| " + ", ".join(f"{sensor} {mean:.3f} m" for sensor, mean in ranking.items())
