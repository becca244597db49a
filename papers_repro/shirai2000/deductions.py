"""What the printed tables say that the paper does not: how they were made, and what limits the method."""

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from math import inf, sqrt

from papers_repro.comparison import Finding, Interval, before_rounding, parse, rounds_to, truncates_to
from papers_repro.shirai2000.audit import place
from papers_repro.shirai2000.tables import QUANTITIES, Row, blocks, derive, followed_quantity, number, row_name


def deductions(rows: list[Row]) -> list[Finding]:
    """Everything below, in order."""
    return [
        *slope_of_site(rows),
        *unrounded_actual_values(rows),
        *meaning_of_averages(rows),
        *ties(rows),
        *shared_runs(rows),
        *elevations_of_wrong_sign(rows),
        *constant_error(rows),
    ]


def slope_of_site(rows: list[Row]) -> list[Finding]:
    """Mean and root-mean-square slope, from actual way, horizontal distance and elevation."""
    sites = dict.fromkeys(
        (row["actual_way_m"], row["actual_horizontal_m"], row["actual_elevation_m"].lstrip("-"))
        for row in rows
        if row["actual_horizontal_m"]
    )
    findings = []
    for site in sites:
        way, horizontal, rise = (float(parse(text).value) for text in site)
        uniform = way - sqrt(way**2 - rise**2)
        findings.append(
            Finding(
                kind="varying slope",
                inconsistency=False,
                rule="On a uniform slope, way - horizontal = way - sqrt(way^2 - rise^2); more: it varies.",
                where=f"actual way / horizontal / elevation {' / '.join(site)}",
                printed=f"way - horizontal = {way - horizontal:.3f} m",
                expected=f"{uniform:.3f} m for a uniform slope",
                evidence=f"rms slope {100 * sqrt(2 * (way - horizontal) / way):.1f} %, mean slope "
                f"{100 * rise / horizontal:.1f} %",
            )
        )
    return findings


def unrounded_actual_values(rows: list[Row]) -> list[Finding]:
    """Where the actual values lay before they were rounded, so that all printed errors can follow from them."""
    possible: dict[tuple[str, str], list[Interval]] = {}
    inexact: Counter[tuple[str, str]] = Counter()
    for row in rows:
        for quantity in QUANTITIES:
            if row["experiment"] == "average" or not row[f"{quantity}_error_m"]:
                continue
            measured = followed_quantity(rows, row["table"], quantity)
            actual = row[f"actual_{quantity}_m"]
            signed = number(row, f"{measured}_m") - parse(actual).value
            error = before_rounding(row[f"{quantity}_error_m"])
            if signed < 0:
                error = Interval(-error.high, -error.low)
            possible.setdefault((quantity, actual), []).append(before_rounding(row[f"{measured}_m"]) - error)
            inexact[quantity, actual] += abs(signed) != number(row, f"{quantity}_error_m")
    findings = []
    for (quantity, actual), intervals in possible.items():
        if inexact[quantity, actual]:
            common: Interval | None = before_rounding(actual)
            for interval in intervals:
                common = common and common & interval
            findings.append(
                Finding(
                    kind="unrounded actual value",
                    inconsistency=common is None,
                    rule="One actual value, before it was rounded, gives all printed errors.",
                    where=f"actual {quantity} {actual}",
                    printed=f"{inexact[quantity, actual]} of {len(intervals)} errors are not the printed difference",
                    expected="no value fits"
                    if common is None
                    else f"{float(common.low):.4f}..{float(common.high):.4f} m",
                    evidence=f"{len(intervals)} errors together",
                )
            )
    return findings


def meaning_of_averages(rows: list[Row]) -> list[Finding]:
    """Which of the possible averages of errors and accuracies were printed."""
    readings: Counter[tuple[str, str]] = Counter()
    count: Counter[str] = Counter()
    for runs, average in blocks(rows):
        for quantity in QUANTITIES:
            if not average[f"{quantity}_error_m"]:
                continue
            measured = followed_quantity(rows, average["table"], quantity)
            signed = [number(r, f"{measured}_m") - number(r, f"actual_{quantity}_m") for r in runs]
            actual = _mean([abs(number(r, f"actual_{quantity}_m")) for r in runs])
            of_errors = _mean([abs(error) for error in signed])
            of_mean = abs(_mean(signed))
            accuracies = _mean([number(r, f"{quantity}_accuracy") for r in runs])
            printed_error, printed_accuracy = (parse(average[f"{quantity}_{c}"]) for c in ("error_m", "accuracy"))
            for name, error in (("mean of |errors|", of_errors), ("|error of the mean|", of_mean)):
                readings["error", name] += abs(error - printed_error.value) <= printed_error.unit
            for name, accuracy in (
                ("actual / mean |error|", actual / of_errors if of_errors else inf),
                ("actual / |error of the mean|", actual / of_mean if of_mean else inf),
                ("mean of the accuracies", accuracies),
            ):
                readings["accuracy", name] += (
                    rounds_to(printed_accuracy, accuracy)
                    or truncates_to(printed_accuracy, accuracy)
                    or (printed_accuracy.value == 1 and accuracy < 1)
                )
            count["error"] += 1
            count["accuracy"] += 1
    return [
        Finding(
            kind="meaning of average",
            inconsistency=False,
            rule="What reproduces most printed averages is what was averaged.",
            where=f"average {column}",
            printed=f"{count[column]} averages",
            expected=max((r for r in readings if r[0] == column), key=readings.__getitem__)[1],
            evidence=", ".join(f"{name}: {n}" for (of, name), n in readings.items() if of == column),
        )
        for column in count
    ]


def ties(rows: list[Row]) -> list[Finding]:
    """Derived numbers exactly between two printable ones, and where they went."""
    up: list[str] = []
    down: list[str] = []
    for row, column, ours in derive(rows):
        printed = parse(row[column])
        excess = printed.value - ours.value
        if max(excess, -excess) * 2 == printed.unit:
            (up if excess * printed.value > 0 else down).append(printed.text)
    even = [text for text in up + down if int(text[-1]) % 2 == 0]
    return [
        Finding(
            kind="ties",
            inconsistency=False,
            rule="Numbers exactly between two printable ones are rounded by one rule, if they are the whole truth.",
            where="all tables",
            printed=f"up {', '.join(up) or 'none'}; down {', '.join(down) or 'none'}",
            expected=(
                "computed from inputs with more digits"
                if up and down and 0 < len(even) < len(up + down)
                else "one rule rounds them all"
            ),
            evidence=f"{len(up)} up, {len(down)} down, {len(even)} of {len(up + down)} to the even digit",
        )
    ] * bool(up + down)


def shared_runs(rows: list[Row]) -> list[Finding]:
    """Tables evaluating the same runs: the same experiments with the same times."""
    times: dict[str, dict[str, str]] = {}
    for row in rows:
        if row["experiment"] != "average":
            times.setdefault(row["table"], {})[row_name(row)] = row["time_s"]
    tables = list(times)
    return [
        Finding(
            kind="shared runs",
            inconsistency=False,
            rule="Same experiment and same time in two tables: one run, evaluated with two sensors.",
            where=f"tables {one} and {other}",
            printed=f"times {', '.join(times[one].values())} s",
            expected="errors are to be compared run by run",
            evidence=f"{len(times[one])} of {len(times[one])} times equal",
        )
        for i, one in enumerate(tables)
        for other in tables[i + 1 :]
        if times[one] == times[other]
    ]


def elevations_of_wrong_sign(rows: list[Row]) -> list[Finding]:
    """Runs that found a climb for a descent or the reverse."""
    return [
        Finding(
            kind="wrong direction",
            inconsistency=False,
            rule="A descent goes down, an ascent up; an accuracy of 1/n does not show it.",
            where=place(row),
            printed=row["elevation_m"],
            expected=row["actual_elevation_m"],
            evidence=f"error {row['elevation_error_m']} m, accuracy {row['elevation_accuracy']}",
        )
        for row in rows
        if row["experiment"] != "average"
        and row["actual_elevation_m"]
        and number(row, "elevation_m") * number(row, "actual_elevation_m") < 0
    ]


def constant_error(rows: list[Row]) -> list[Finding]:
    """The constant error of vertical acceleration that would make the elevation errors: 2 error / time^2."""
    by_table: dict[str, list[float]] = {}
    for row in rows:
        if row["experiment"] != "average" and row["elevation_error_m"]:
            error = float(number(row, "elevation_error_m")) * 2 / float(number(row, "time_s")) ** 2
            by_table.setdefault(row["table"], []).append(error)
    return [
        Finding(
            kind="constant error of h",
            inconsistency=False,
            rule="A constant error b of the vertical acceleration makes an error of elevation of b time^2 / 2.",
            where=f"table {table}",
            printed=f"{len(errors)} elevation errors",
            expected=f"|b| from {min(errors):.1e} to {max(errors):.1e} m/s^2",
            evidence=f"mean |b| {sum(errors) / len(errors):.1e} m/s^2",
        )
        for table, errors in by_table.items()
    ]


def _mean(values: Sequence[Fraction]) -> Fraction:
    return sum(values, Fraction(0)) / len(values)
