"""Tables 1 to 5 as printed, and their derived numbers computed again from the printed measurements."""

import csv
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from papers_repro.comparison import (
    Comparison,
    Interval,
    Reading,
    Recomputed,
    compare,
    mean,
    parse,
    ratio,
    recompute,
    rounding_votes,
    rounds_to,
)

# A printed row: text by column, empty where the paper has no number.
Row = dict[str, str]
Formula = Callable[[Reading], Interval]

QUANTITIES = ("way", "horizontal", "elevation")


def read_tables(path: Path) -> list[Row]:
    """Rows of a tables.csv, every number as its printed characters."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def blocks(rows: list[Row]) -> Iterator[tuple[list[Row], Row]]:
    """The runs of each table and course, and the row of their averages."""
    for table, course in dict.fromkeys((row["table"], row["course"]) for row in rows):
        block = [row for row in rows if (row["table"], row["course"]) == (table, course)]
        [average] = [row for row in block if row["experiment"] == "average"]
        yield [row for row in block if row is not average], average


def row_name(row: Row) -> str:
    """Course and experiment, such as "descent 8"."""
    return f"{row['course']} {row['experiment']}"


def number(row: Row, column: str) -> Fraction:
    """A printed number."""
    return parse(row[column]).value


def derive(rows: list[Row]) -> Iterator[tuple[Row, str, Recomputed]]:
    """Every derived number of the tables computed again: averages, errors, accuracies, with their row and column."""
    tables = dict.fromkeys(row["table"] for row in rows)
    votes = {table: accuracy_votes(rows, table) for table in tables}
    followed = {(table, q): followed_quantity(rows, table, q) for table in tables for q in QUANTITIES}
    for runs, average in blocks(rows):
        table = average["table"]
        by_truncation, by_rounding = votes[table]
        for row in [*runs, average]:
            for column, formula in derived_columns(runs, row).items():
                truncating = by_truncation > by_rounding and column.endswith("_accuracy")
                ours = replace(recompute(formula), truncating=truncating)
                quantity = column.partition("_")[0]
                if column.endswith(("_error_m", "_accuracy")) and followed[table, quantity] != quantity:
                    other = derived_columns(runs, row, measured=followed[table, quantity])[column]
                    ours = replace(ours, other_quantity=(followed[table, quantity], recompute(other)))
                yield row, column, ours


def compare_derived(rows: list[Row]) -> list[Comparison]:
    """Every derived number of the tables beside ours."""
    return [
        compare(
            table=row["table"],
            row=row_name(row),
            column=column.removesuffix("_m").removesuffix("_s"),
            unit="s" if column == "time_s" else "m",
            printed=row[column],
            ours=ours,
        )
        for row, column, ours in derive(rows)
    ]


def derived_columns(runs: list[Row], row: Row, *, measured: str | None = None) -> dict[str, Formula]:
    """How the derived numbers of a row follow from the measurements of the runs, by column.

    The row is one of the runs or that of their averages. `measured` is the quantity whose measurement is compared with
    the actual value, by default the one that the error is named after.
    """
    averages = row["experiment"] == "average"
    of = runs if averages else [row]
    formulas: dict[str, Formula] = {}
    if averages:
        # An actual value that all runs share was measured once, not averaged.
        shared = {f"actual_{q}_m" for q in QUANTITIES if len({run[f"actual_{q}_m"] for run in runs}) == 1}
        plain = ("time_s", *(f"actual_{q}_m" for q in QUANTITIES), *(f"{q}_m" for q in QUANTITIES))
        formulas |= {column: _mean_of(runs, column) for column in plain if row[column] and column not in shared}
    for quantity in QUANTITIES:
        if row[f"{quantity}_error_m"]:
            formulas[f"{quantity}_error_m"] = _mean_error(of, quantity, measured or quantity)
    for quantity in QUANTITIES:
        if row[f"{quantity}_accuracy"]:
            formulas[f"{quantity}_accuracy"] = _accuracy(of, row, quantity, measured or quantity)
    return formulas


def followed_quantity(rows: list[Row], table: str, quantity: str) -> str:
    """The measured quantity that reproduces most of a table's errors; on a tie, the one they are named after."""
    runs = [r for r in rows if r["table"] == table and r["experiment"] != "average" and r[f"{quantity}_error_m"]]

    def reproduced(measured: str) -> int:
        return sum(
            rounds_to(parse(run[f"{quantity}_error_m"]), recompute(_mean_error([run], quantity, measured)).value)
            for run in runs
        )

    return max((quantity, *QUANTITIES), key=reproduced)


def accuracy_votes(rows: list[Row], table: str) -> tuple[int, int]:
    """How many accuracies of a table come out by dropping digits alone, and how many by rounding alone."""
    return rounding_votes(
        (parse(row[column]), recompute(formula).value)
        for runs, average in blocks(rows)
        if average["table"] == table
        for row in [*runs, average]
        for column, formula in derived_columns(runs, row).items()
        if column.endswith("_accuracy")
    )


def _mean_of(runs: list[Row], column: str) -> Formula:
    return lambda read: mean([read(run[column]) for run in runs])


def _mean_error(runs: list[Row], quantity: str, measured: str) -> Formula:
    """Mean of |measured - actual|; of one run, its error."""
    return lambda read: mean([abs(read(r[f"{measured}_m"]) - read(r[f"actual_{quantity}_m"])) for r in runs])


def _accuracy(runs: list[Row], row: Row, quantity: str, measured: str) -> Formula:
    """Actual value over mean error. The printed error narrows that mean wherever the two agree at all."""

    def accuracy(read: Reading) -> Interval:
        error = _mean_error(runs, quantity, measured)(read)
        error = error & read(row[f"{quantity}_error_m"]) or error
        return ratio(mean([abs(read(run[f"actual_{quantity}_m"])) for run in runs]), error)

    return accuracy
