"""Where the printed tables contradict themselves."""

from math import ceil, sqrt

from papers_repro.comparison import (
    Comparison,
    Finding,
    Recomputed,
    before_rounding,
    compare,
    parse,
    rounds_to,
    write_like,
)
from papers_repro.shirai2000.tables import Row, accuracy_votes, derive, number, row_name

# What an explained or differing number breaks, by the outcome of its comparison.
RULES = {
    "differs": "A derived number follows from the printed measurements to its last printed digit.",
    "repeated digit": "A derived number follows from the printed measurements, each digit set once.",
    "other quantity": "An error is that of the quantity it is named after: |measured - actual| of the same quantity.",
    "fewer digits": "The numbers of a column are printed to the same precision.",
    "unrounded inputs": "A derived number follows from the measurements as printed, no further digits.",
}


def audit(rows: list[Row]) -> list[Finding]:
    """All contradictions that the printed numbers of the tables hold among themselves."""
    derived = list(derive(rows))
    return [
        *numbers_not_following(derived),
        *accuracies_truncated(rows),
        *accuracies_rounded_exceptionally(derived),
        *accuracies_below_one(derived),
        *horizontals_longer_than_way(rows),
        *horizontals_longer_than_chord(rows),
        *horizontals_not_of_vertical_speed(rows),
    ]


def place(row: Row, column: str = "") -> str:
    """Where a number stands, such as "table 5, ascent 14, way_accuracy"."""
    return f"table {row['table']}, {row_name(row)}" + (f", {column}" if column else "")


def numbers_not_following(derived: list[tuple[Row, str, Recomputed]]) -> list[Finding]:
    """Derived numbers that the printed measurements do not give as they stand, by the reason found."""
    findings = []
    for row, column, ours in derived:
        verdict = _compare(row, column, ours)
        kind = verdict.explanation or verdict.verdict
        if kind in RULES:
            printed = parse(row[column])
            evidence = f"{write_like(printed, ours.value, 2)}; {verdict.note}"
            if kind == "differs" and printed.value == ceil(ours.value):
                evidence += "; only rounding up prints it"
            truncate = kind == "repeated digit" and ours.truncating
            findings.append(
                Finding(
                    kind=kind,
                    inconsistency=True,
                    rule=RULES[kind],
                    where=place(row, column.removesuffix("_m")),
                    printed=printed.text,
                    expected=write_like(printed, int(ours.value) if truncate else ours.value),
                    evidence=evidence,
                )
            )
    return sorted(findings, key=lambda finding: list(RULES).index(finding.kind))


def accuracies_truncated(rows: list[Row]) -> list[Finding]:
    """Tables that drop the digits of accuracies although others round them."""
    votes = {table: accuracy_votes(rows, table) for table in dict.fromkeys(row["table"] for row in rows)}
    rounding = [table for table, (by_truncation, by_rounding) in votes.items() if by_truncation <= by_rounding]
    return [
        Finding(
            kind="truncated accuracies",
            inconsistency=True,
            rule="One paper rounds in one way.",
            where=f"table {table}",
            printed="digits dropped",
            expected="rounded" + (f", as in tables {', '.join(rounding)}" if rounding else ""),
            evidence=f"{by_truncation} accuracies come out by dropping digits alone, {by_rounding} by rounding alone",
        )
        for table, (by_truncation, by_rounding) in votes.items()
        if by_truncation > by_rounding
    ]


def accuracies_rounded_exceptionally(derived: list[tuple[Row, str, Recomputed]]) -> list[Finding]:
    """Accuracies rounded in a table that drops digits, whatever further digits the inputs had."""
    findings = []
    for row, column, ours in derived:
        printed = parse(row[column])
        by_truncation = ours.reach.low < printed.value + printed.unit and ours.reach.high >= printed.value
        if ours.truncating and ours.value >= 1 and rounds_to(printed, ours.value) and not by_truncation:
            findings.append(
                Finding(
                    kind="rounded accuracy",
                    inconsistency=True,
                    rule="One table rounds in one way: this one drops the digits of its accuracies.",
                    where=place(row, column),
                    printed=printed.text,
                    expected=write_like(printed, int(ours.value)),
                    evidence=write_like(printed, ours.value, 2),
                )
            )
    return findings


def accuracies_below_one(derived: list[tuple[Row, str, Recomputed]]) -> list[Finding]:
    """Errors larger than the quantity itself, printed as an accuracy of 1/1."""
    return [
        Finding(
            kind="accuracy below 1/1",
            inconsistency=True,
            rule="An error larger than the actual value is not an accuracy of 1/1.",
            where=place(row, column),
            printed=row[column],
            expected=write_like(parse(row[column]), ours.value, 2),
            evidence=f"the error is {1 / float(ours.value):.2f} times the actual value",
        )
        for row, column, ours in derived
        if column.endswith("_accuracy") and parse(row[column]).value == 1 and ours.reach.high < 1
    ]


def horizontals_longer_than_way(rows: list[Row]) -> list[Finding]:
    """Rows whose horizontal distance is longer than the way."""
    findings = []
    for row in rows:
        excess = number(row, "horizontal_m") - number(row, "way_m")
        if excess > 0:
            rounding = before_rounding(row["horizontal_m"]).low <= before_rounding(row["way_m"]).high
            findings.append(
                Finding(
                    kind="horizontal over way",
                    inconsistency=True,
                    rule="The horizontal distance of a path is not longer than its way.",
                    where=place(row),
                    printed=f"horizontal {row['horizontal_m']}",
                    expected=f"at most {row['way_m']}",
                    evidence=f"{float(excess):.3f} m too long" + (", which rounding could make" if rounding else ""),
                )
            )
    return findings


def horizontals_longer_than_chord(rows: list[Row]) -> list[Finding]:
    """Rows whose horizontal distance, though within the way, leaves no room for their difference of elevation."""
    return [
        Finding(
            kind="horizontal over chord",
            inconsistency=True,
            rule="A path of this way and difference of elevation has at most sqrt(way^2 - elevation^2) horizontally.",
            where=place(row),
            printed=f"horizontal {row['horizontal_m']}",
            expected=f"at most {_chord(row):.3f}",
            evidence=f"{float(number(row, 'horizontal_m')) - _chord(row):.3f} m too long",
        )
        for row in rows
        if _excess_over_chord(row) > 0 and number(row, "horizontal_m") <= number(row, "way_m")
    ]


def horizontals_not_of_vertical_speed(rows: list[Row]) -> list[Finding]:
    """Tables in which the horizontal distance cannot be the integral of sqrt(speed^2 - vertical speed^2)."""
    tables = dict.fromkeys(row["table"] for row in rows)
    runs = {t: [r for r in rows if r["table"] == t and r["experiment"] != "average"] for t in tables}
    possible = {table: [run for run in runs[table] if _excess_over_chord(run) <= 0] for table in tables}
    sound = [table for table in tables if len(possible[table]) == len(runs[table])]
    findings = []
    for table in tables:
        if table not in sound:
            excess = [float(number(run, "way_m") - number(run, "horizontal_m")) for run in runs[table]]
            slopes = [100 * _rms_slope(run) for run in possible[table]]
            findings.append(
                Finding(
                    kind="horizontal not from vertical speed",
                    inconsistency=True,
                    rule="Way, horizontal distance and elevation are integrals of one velocity: "
                    "horizontal speed^2 = speed^2 - vertical speed^2.",
                    where=f"table {table}",
                    printed=f"way - horizontal {min(excess):.3f}..{max(excess):.3f} m",
                    expected="at least elevation^2 / (2 way)" + (f", as in tables {', '.join(sound)}" if sound else ""),
                    evidence=f"impossible in {len(runs[table]) - len(slopes)} of {len(runs[table])} runs"
                    + (f", the others need an rms slope of {min(slopes):.1f}..{max(slopes):.1f} %" if slopes else ""),
                )
            )
    return findings


def _compare(row: Row, column: str, ours: Recomputed) -> Comparison:
    return compare(table=row["table"], row=row_name(row), column=column, unit="", printed=row[column], ours=ours)


def _chord(row: Row) -> float:
    return sqrt(number(row, "way_m") ** 2 - number(row, "elevation_m") ** 2)


def _rms_slope(row: Row) -> float:
    """Root-mean-square slope of a path whose horizontal distance is this much shorter than its way."""
    excess = float(number(row, "way_m") - number(row, "horizontal_m"))
    return sqrt(2 * max(excess, 0.0) / float(number(row, "way_m")))


def _excess_over_chord(row: Row) -> float:
    """How much the horizontal distance exceeds sqrt(way^2 - elevation^2), rounding in its favour; m."""
    way = float(before_rounding(row["way_m"]).high)
    rise = float(abs(before_rounding(row["elevation_m"])).low)
    return float(before_rounding(row["horizontal_m"]).low) - sqrt(way**2 - rise**2)
