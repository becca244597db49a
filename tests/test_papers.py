"""The papers' numbers computed again: recorded verdicts and findings, planted errors, and the command line."""

import json
import random
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator
from decimal import ROUND_HALF_DOWN, ROUND_HALF_UP, Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import papers_repro
from papers_repro import __main__ as command_line, comparison as engine, progress
from papers_repro.comparison import (
    Comparison,
    Finding,
    Interval,
    Output,
    Recomputed,
    Report,
    compare,
    compare_bound,
    parse,
    whole,
)
from papers_repro.report import deviations, format_report, number_key, outcome, write_index, write_report
from papers_repro.shirai2000 import reproduce as shirai2000, simulated
from papers_repro.shirai2000.statements import statements
from papers_repro.shirai2000.tables import compare_derived, derive, read_tables
from papers_repro.shirai2000.wheel_ways import largest_quantum

ROOT = Path(papers_repro.__file__).parent
PAPER = tomllib.loads((ROOT / "shirai2000/paper.toml").read_text())
ROWS = read_tables(ROOT / "shirai2000/tables.csv")
COMPARISONS = compare_derived(ROWS)
RECORDED = {key: name for name, keys in PAPER["verdicts"].items() for key in keys}

# Numbers that the paper derived from others: two in each run of tables 1 and 2 and seven averages, six in each run of
# tables 3 to 5 and ten averages for each course.
DERIVED = {"1": 5 * 2 + 7, "2": 5 * 2 + 7, "3": 7 * 6 + 20, "4": 8 * 6 + 20, "5": 8 * 6 + 20}


# What simulations add to a report; tests/test_shirai2000.py has those.
SIMULATED = (
    "inferred",
    "inferred together",
    "claim repeated",
    "ratio repeated",
    "contradiction resolved",
    "error budget",
    "sensitivity of Eq. (1)",
    "model of Eq. (1)",
    "future development",
)
SIMULATED_TABLES = tuple(PAPER["simulated_tables"])


@pytest.fixture(scope="module", autouse=True)
def simulations() -> Iterator[None]:
    """In the place of two minutes of simulation stands what is recorded of it."""
    numbers = [key.split("/") for key in RECORDED if key.startswith(SIMULATED_TABLES)]
    comparisons = [
        Comparison(
            table=table, row=row, column=column, unit="m", printed="0", ours=9.0, difference=9.0, verdict="differs"
        )
        for table, row, column in numbers
    ]
    findings = [
        Finding(kind=kind, inconsistency=False, rule="", where=where, printed="0", expected=expected, evidence="0")
        for kind in SIMULATED
        for where, expected in PAPER["findings"].get(kind, {}).items()
    ]
    with pytest.MonkeyPatch.context() as patch:
        part = Report(title="simulated", comparisons=comparisons, findings=findings, tables=PAPER["simulated_tables"])
        patch.setattr(simulated, "simulated", lambda *_: iter([part]))
        yield


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    return whole(shirai2000.reproduce(tmp_path_factory.mktemp("results")))


def judge(printed: str, value: str, reach: tuple[str, str] | None = None, **rest: object) -> Comparison:
    low, high = reach or (value, value)
    ours = Recomputed(value=Fraction(value), reach=Interval(Fraction(low), Fraction(high)), **rest)
    return compare(table="t", row="r", column="c", unit="m", printed=printed, ours=ours)


# --- every derived number ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("comparison", COMPARISONS, ids=number_key)
def test_verdict_is_the_recorded_one(comparison: Comparison) -> None:
    assert outcome(comparison) == RECORDED.get(number_key(comparison), "match")


def test_every_derived_number_has_one_verdict() -> None:
    assert Counter(c.table for c in COMPARISONS) == DERIVED
    assert len({number_key(c) for c in COMPARISONS}) == sum(DERIVED.values()) == 232
    printed = sum(
        bool(row[column])
        for row in ROWS
        for column in row
        if column.endswith(("error_m", "accuracy"))
        or (row["experiment"] == "average" and column.endswith(("_m", "_s")))
    )
    # An actual value that all runs of tables 3 to 5 share stands in the row of averages without being one.
    assert printed - 6 * 3 == 232


def test_recorded_numbers_exist() -> None:
    of_tables = {key for key in RECORDED if not key.startswith(SIMULATED_TABLES)}
    assert of_tables <= {number_key(c) for c in COMPARISONS}
    assert set(PAPER["verdicts"]) <= {*engine.HYPOTHESES, "differs"}
    assert Fraction(PAPER["tolerance"]["*"]["units_of_last_digit"]) == engine.HALF


def test_ours_against_pandas() -> None:
    """The same numbers from floating-point columns, by group."""
    frame = pd.DataFrame(ROWS)
    columns = [c for c in frame if c.endswith(("_m", "_s"))]
    frame[columns] = frame[columns].apply(pd.to_numeric)
    frame["row"] = frame["course"] + " " + frame["experiment"]
    expected = {}
    for (table, course), block in frame.groupby(["table", "course"]):
        runs = block[block["experiment"] != "average"]
        means = runs[columns].mean()
        for quantity in ("way", "horizontal", "elevation"):
            error = (runs[f"{quantity}_m"] - runs[f"actual_{quantity}_m"]).abs()
            actual = runs[f"actual_{quantity}_m"].abs()
            for row, e, a in zip(runs["row"], error, actual, strict=True):
                expected[f"{table}/{row}/{quantity}_error"] = e
                expected[f"{table}/{row}/{quantity}_accuracy"] = a / e
            expected[f"{table}/{course} average/{quantity}_error"] = error.mean()
            expected[f"{table}/{course} average/{quantity}_accuracy"] = actual.mean() / error.mean()
            expected[f"{table}/{course} average/{quantity}"] = means[f"{quantity}_m"]
        expected[f"{table}/{course} average/time"] = means["time_s"]
        expected[f"{table}/{course} average/actual_way"] = means["actual_way_m"]
    for c in COMPARISONS:
        np.testing.assert_allclose(c.ours, expected[number_key(c)], rtol=1e-9, err_msg=number_key(c))


def test_match_is_decimal_rounding() -> None:
    for c in COMPARISONS:
        digits = Decimal(c.printed.removeprefix("1/"))
        # Averages of up to eight numbers terminate within nine decimals of what float holds here.
        ours = Decimal(repr(round(c.ours, 9)))
        rounded = {ours.quantize(digits, rounding) for rounding in (ROUND_HALF_UP, ROUND_HALF_DOWN)}
        assert (c.verdict == "match") == (digits in rounded), c


def test_difference_and_unit() -> None:
    for c in COMPARISONS:
        assert c.difference == pytest.approx(c.ours - float(c.printed.removeprefix("1/")), abs=1e-9)
        assert c.unit == ("1/n" if c.column.endswith("accuracy") else "s" if c.column == "time" else "m")


# --- the hypotheses ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("printed", "value", "rest", "expected"),
    [
        ("10.384", "10.3844", {}, "match"),
        ("10.384", "10.3845", {}, "match"),
        ("10.385", "10.3845", {}, "match"),
        ("10.384", "10.38451", {}, "differs"),
        ("-0.099", "-0.0985", {}, "match"),
        ("-0.099", "0.099", {}, "differs"),
        ("1/27", "26.5", {}, "match"),
        ("1/27", "26.4", {}, "differs"),
        ("1/1", "0.3", {}, "below one"),
        ("1/1", "0.7", {}, "match"),
        ("1/2", "0.3", {}, "differs"),
        ("1/2", "2.85", {"truncating": True}, "truncated"),
        ("1/2", "2.85", {}, "differs"),
        ("1/2", "3.0", {"truncating": True}, "differs"),
        ("1/3", "2.4", {"truncating": True}, "differs"),
        ("1/2800", "2824.6", {}, "fewer digits"),
        ("1/2800", "2851", {}, "differs"),
        ("1/2840", "2824.6", {}, "differs"),
        ("1/200", "210", {}, "differs"),
        ("0.00", "0.1", {}, "differs"),
        ("0.100", "0.2", {}, "differs"),
        ("0.056", "0.033", {"other_quantity": ("horizontal", "0.0564")}, "other quantity"),
        ("0.056", "0.033", {"other_quantity": ("horizontal", "0.0566")}, "differs"),
        ("0.243", "0.242", {"reach": ("0.241", "0.243")}, "unrounded inputs"),
        ("0.244", "0.242", {"reach": ("0.241", "0.243")}, "differs"),
        ("0.2442", "0.242", {}, "differs"),
        ("0.055", "0.056", {"reach": ("0.055", "0.057"), "other_quantity": ("horizontal", "0.033")}, "differs"),
        ("1/28", "26.9", {"reach": ("26.8", "27.4")}, "differs"),
        ("1/27", "26.4", {"reach": ("26.3", "26.6"), "truncating": True}, "differs"),
        ("1/115", "15.2", {}, "repeated digit"),
        ("1/115", "15.8", {"truncating": True}, "repeated digit"),
        ("1/115", "15.8", {}, "differs"),
        ("1/155", "15.2", {}, "repeated digit"),
        ("1/125", "15.2", {}, "differs"),
        ("1/125", "12.2", {}, "differs"),
    ],
)
def test_hypothesis(printed: str, value: str, rest: dict, expected: str) -> None:
    rest = dict(rest)
    if "other_quantity" in rest:
        name, other = rest["other_quantity"]
        number = Fraction(other)
        rest["other_quantity"] = (name, Recomputed(value=number, reach=Interval(number, number)))
    assert outcome(judge(printed, value, **rest)) == expected


def test_repeated_digit_tells_what_was_meant() -> None:
    assert "1/15 must have been meant" in judge("1/115", "15.2").note


def test_accuracy_of_an_error_of_zero_differs() -> None:
    rows = [dict(row) for row in ROWS if row["table"] == "1"]
    rows[0]["way_m"] = rows[0]["actual_way_m"]
    [accuracy] = [c for c in compare_derived(rows) if number_key(c) == "1/level 1/way_accuracy"]
    assert (accuracy.ours, accuracy.verdict) == (float("inf"), "differs")


@pytest.mark.parametrize("text", ["", "27/1", "1/", "1.2.3", "1e3", "+1", "1/2.5"])
def test_only_printed_numbers_are_parsed(text: str) -> None:
    with pytest.raises(ValueError, match="text must be a decimal or 1/n as printed, got"):
        parse(text)


def test_bound() -> None:
    held, broken = (
        compare_bound(table="t", row="r", column="rms", unit="m", bound="1.6", ours=ours) for ours in (1.6, 1.61)
    )
    assert (held.verdict, held.printed, held.difference) == ("match", "<= 1.6", 0)
    assert broken.verdict == "differs"


# --- planted errors ---------------------------------------------------------------------------------------------------


def plants(text: str) -> list[str]:
    """All texts with one digit changed."""
    digits = [i for i, character in enumerate(text) if character.isdigit() and not text[: i + 1] == "1" * ("/" in text)]
    return [text[:i] + new + text[i + 1 :] for i in digits for new in "0123456789" if new != text[i]]


def could_be_honest(text: str, row: dict[str, str], column: str, ours: Recomputed) -> bool:
    """Whether rounding of the inputs and of the result could print a planted number; bounds by hand.

    Inputs have three decimals. Half a unit in each moves a mean by half a unit, a difference by one; an accuracy n is
    the actual value over an error that far off. Then the result is rounded, or cut where the table does that.
    """
    printed = parse(text)
    n, unit = float(printed.value), float(printed.unit)
    value = float(ours.other_quantity[1].value if ours.other_quantity else ours.value)
    below, above = (1.0, 0.0) if ours.truncating else (0.5, 0.5)
    low, high = value - 0.0005, value + 0.0005
    if column == "time_s":
        low, high = value - 0.05, value + 0.05
    elif column.endswith("_error_m"):
        low, high = value - 0.001, value + 0.001
    elif column.endswith("_accuracy"):
        quantity = column.partition("_")[0]
        actual = abs(float(row[f"actual_{quantity}_m"]))
        low, high = ((actual + s * 0.0005) / (actual / value - s * 0.001) for s in (-1, 1))
    if low - below * unit - 1e-9 <= n <= high + above * unit + 1e-9:
        return True
    # The right number, in a table where other ways of rounding or another quantity are usual.
    if abs(n - float(ours.value)) <= 0.5 * unit + 1e-9:
        return True
    # The right number with a digit set twice, as 1/115 for 1/15 and so 1/116 for 1/16.
    return any(
        abs(float(text[2:i] + text[i + 1 :]) - value) < 1 for i in range(2, len(text)) if "1/115" in row.values()
    )


def test_every_planted_digit_is_caught_or_could_be_honest() -> None:
    """Each digit of each derived number replaced by each other digit: what is not caught, no reader could catch."""
    verdicts: Counter[str] = Counter()
    for row, column, ours in derive(ROWS):
        for text in plants(row[column]):
            verdict = compare(table="", row="", column="", unit="", printed=text, ours=ours).verdict
            if verdict != "differs":
                assert could_be_honest(text, row, column, ours), (row["table"], row["experiment"], column, text)
            verdicts["last digit " * (text[:-1] == row[column][:-1]) + verdict] += 1
    # 6457 of 6795 planted digits are caught; of the 4707 outside the last place all but 16: ten in 1/1940 and four in
    # 1/2800, whose errors have one or two digits, and 1/015 and 1/155 for 1/115, which mean 1/15 as well.
    higher = verdicts["match"] + verdicts["explained"]
    assert higher / (higher + verdicts["differs"]) < 0.005
    assert verdicts["differs"] + verdicts["last digit differs"] > 0.94 * verdicts.total() > 6000


def test_planted_digits_through_the_whole_recomputation() -> None:
    """One digit of the printed tables changed: votes, narrowed errors and verdicts all see the planted text."""
    draw = random.Random(0)
    for row, column, ours in draw.sample(list(derive(ROWS)), 120):
        text = draw.choice([text for text in plants(row[column]) if not could_be_honest(text, row, column, ours)])
        assert planted_verdict(row, column, text, column) == "differs", (row["table"], row["experiment"], column, text)


def planted_verdict(row: dict[str, str], column: str, text: str, judged: str) -> str:
    """The verdict on one column of a row whose table has a planted text in that row."""
    table = [{**other, column: text} if other is row else other for other in ROWS if other["table"] == row["table"]]
    key = f"{row['table']}/{row['course']} {row['experiment']}/{judged.removesuffix('_m').removesuffix('_s')}"
    [verdict] = [c.verdict for c in compare_derived(table) if number_key(c) == key]
    return verdict


def test_planted_measurements_are_seen() -> None:
    """A digit changed in a measured way, horizontal distance or elevation of tables 3 to 5 shows in its own error."""
    draw = random.Random(1)
    measured = [
        (row, quantity, text)
        for row in ROWS
        if row["table"] in "345" and row["experiment"] != "average"
        for quantity in ("way", "horizontal", "elevation")
        for text in plants(row[f"{quantity}_m"])
        if abs(parse(text).value - parse(row[f"{quantity}_m"]).value) > Fraction(2, 1000)
    ]
    for row, quantity, text in draw.sample(measured, 60):
        verdict = planted_verdict(row, f"{quantity}_m", text, f"{quantity}_error_m")
        assert verdict == "differs", (row["table"], row["experiment"], quantity, text)


# --- findings ---------------------------------------------------------------------------------------------------------

# What the reading notes name, and where it must be found.
NOTED = [
    *(("other quantity", f"table 2, level {i}, way_error", e) for i, e in enumerate("033 056 099 051 057".split(), 1)),
    ("repeated digit", "table 4, descent 8, elevation_accuracy", "1/15"),
    *(("truncated accuracies", f"table {table}", "rounded, as in tables 1, 2") for table in "345"),
    ("rounded accuracy", "table 4, ascent 13, horizontal_accuracy", "1/27"),
    ("rounded accuracy", "table 5, ascent 13, horizontal_accuracy", "1/21"),
    ("differs", "table 1, level 5, way_accuracy", "1/56"),
    ("unrounded inputs", "table 1, level 4, way_accuracy", "1/2006"),
    ("unrounded inputs", "table 1, level average, elevation", "-0.098"),
    ("differs", "table 4, descent average, elevation_error", "6.329"),
    ("differs", "table 5, ascent 14, horizontal_accuracy", "1/81"),
    ("fewer digits", "table 5, ascent 12, horizontal_accuracy", "1/2825"),
    ("unrounded inputs", "table 3, ascent average, horizontal", "164.765"),
    ("unrounded inputs", "table 3, ascent average, horizontal_error", "44.671"),
    ("meaning of average", "average accuracy", "actual / mean |error|"),
    ("horizontal over way", "table 2, level 3", "9.979"),
    ("horizontal over way", "table 2, level 5", "9.979"),
    *(("horizontal over way", f"table 5, {run}", "at most") for run in ("descent 9", "descent 10", "descent 11")),
    ("horizontal over way", "table 5, ascent 13", "at most 166.224"),
    ("horizontal not from vertical speed", "table 2", "as in tables 1, 3, 4"),
    ("horizontal not from vertical speed", "table 5", "as in tables 1, 3, 4"),
    ("stated order", "introduction: elevation outdoors", "vibration_gyro > fiber_optic_gyro > vehicle_speed"),
    ("stated order", "conclusions on elevation: elevation indoors", "vehicle_speed > vibration_gyro"),
    ("stated ratio", "section 4.1: way indoors", "2.58"),
    ("order", "way outdoors", "vehicle_speed > fiber_optic_gyro > vibration_gyro"),
    ("order", "elevation outdoors", "vibration_gyro > fiber_optic_gyro > vehicle_speed"),
    ("stated site", "introduction: elevation", "5 m"),
    ("varying slope", "actual way / horizontal / elevation 163.969 / 163.824 / 5.459", "0.091 m for a uniform slope"),
    ("constant error of h", "table 5", "1.5e-05 to 2.0e-03"),
]


@pytest.mark.parametrize(("kind", "where", "expected"), NOTED, ids=lambda value: value)
def test_finding_of_the_reading_notes(report: Report, kind: str, where: str, expected: str) -> None:
    [finding] = [f for f in report.findings if (f.kind, f.where) == (kind, where)]
    assert expected in finding.expected
    assert finding.rule and finding.printed
    assert re.search(r"\d", finding.evidence)


def test_findings_are_the_recorded_ones(report: Report) -> None:
    assert deviations(report, ROOT / "shirai2000/paper.toml") == []
    recorded = {(kind, where) for kind, places in PAPER["findings"].items() for where in places}
    assert recorded == {(f.kind, f.where) for f in report.findings}
    assert len(report.findings) == len(recorded)


def test_site_slope_evidence(report: Report) -> None:
    [finding] = [f for f in report.findings if f.kind == "varying slope"]
    assert finding.evidence == "rms slope 4.2 %, mean slope 3.3 %"


def test_findings_vanish_where_the_tables_are_sound() -> None:
    """A table made by the rules has no inconsistency, whatever its numbers: nothing is found because it is listed."""
    draw = np.random.default_rng(0)
    rows = []
    for course, sign in (("descent", -1), ("ascent", 1)):
        runs = []
        for i in range(5):
            way = round(100 + draw.uniform(1, 20), 3)
            numbers = {"time": round(draw.uniform(60, 90), 1), "way": way, "horizontal": round(way - 0.5, 3)}
            numbers["elevation"] = round(sign * (4 + draw.uniform(0, 1)), 3)
            runs.append(sound_row(course, str(i), numbers, sign))
        average = {
            name: round(
                float(np.mean([float(run[f"{name}_{'s' if name == 'time' else 'm'}"]) for run in runs])), digits
            )
            for name, digits in (("time", 1), ("way", 3), ("horizontal", 3), ("elevation", 3))
        }
        mean = sound_row(course, "average", average, sign)
        for q in ("way", "horizontal", "elevation"):
            error = np.mean([float(run[f"{q}_error_m"]) for run in runs])
            mean |= {f"{q}_error_m": f"{error:.3f}", f"{q}_accuracy": f"1/{abs(ACTUAL[q]) / error:.0f}"}
        rows += [*runs, mean]
    assert {c.verdict for c in compare_derived(rows)} <= {"match"}
    findings = [f for f in shirai2000.audit(rows) if f.inconsistency]
    assert findings == []


ACTUAL = {"way": 100.0, "horizontal": 99.5, "elevation": 3.0}


def sound_row(course: str, experiment: str, numbers: dict[str, float], sign: int) -> dict[str, str]:
    row = {
        "table": "9",
        "sensor": "any",
        "course": course,
        "experiment": experiment,
        "time_s": f"{numbers['time']:.1f}",
    }
    for q, actual in ACTUAL.items():
        error = abs(numbers[q] - (sign * actual if q == "elevation" else actual))
        row |= {
            f"actual_{q}_m": f"{sign * actual if q == 'elevation' else actual:.3f}",
            f"{q}_m": f"{numbers[q]:.3f}",
            f"{q}_error_m": f"{error:.3f}",
            f"{q}_accuracy": f"1/{actual / error:.0f}",
        }
    return row


def test_stated_order_follows_the_rows() -> None:
    """With the wheels' elevations replaced by the true ones, the introduction is right and the conclusions wrong."""
    rows = [
        {**row, "elevation_m": row["actual_elevation_m"]} if row["table"] == "5" and row["actual_elevation_m"] else row
        for row in ROWS
    ]
    wrong = {f.where for f in statements(rows, PAPER) if f.kind == "stated order"}
    assert "conclusions on elevation: elevation outdoors" in wrong
    # The fibre-optic gyro is still behind the vibration gyro.
    assert "introduction: elevation outdoors" in wrong


@pytest.mark.parametrize("quantum", [0.9979, 0.5236, 0.2617])
def test_quantum_of_pulses_is_found(quantum: float) -> None:
    """Ways made of whole pulses, printed to the millimetre, give their pulse back."""
    ways = [round(count * quantum, 3) for count in (10, 313, 317, 318, 322)]
    assert largest_quantum(ways) == pytest.approx(quantum, abs=2e-6)


# --- command line -----------------------------------------------------------------------------------------------------


def test_command_line_writes_the_same_rows_as_csv_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], report: Report
) -> None:
    assert command_line.main(["shirai2000", "--output", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    # the last line names the folder, as long as that may be
    assert max(map(len, printed.splitlines()[:-1])) <= 120
    outside = len(report.comparisons) - len(COMPARISONS)
    assert f"{232 + outside} numbers: 164 match, 65 explained, {3 + outside} differ" in printed
    assert printed.isascii()
    for name, rows in (("comparison", report.comparisons), ("findings", report.findings)):
        table = pd.read_csv(tmp_path / f"shirai2000/{name}.csv", dtype=str, keep_default_na=False)
        records = json.loads((tmp_path / f"shirai2000/{name}.json").read_text())
        assert len(table) == len(records) == len(rows)
        assert [{key: str(value) for key, value in record.items()} for record in records] == table.to_dict("records")
    numbers = pd.read_json(tmp_path / "shirai2000/comparison.json", dtype={"printed": str})
    assert "10.030" not in set(numbers["printed"]) and "44.670" in set(numbers["printed"])


def test_shows_every_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["shirai2000", "--all", "--output", str(tmp_path)]) == 0
    numbers = capsys.readouterr().out.partition("Inconsistencies found")[0]
    assert all(comparison.printed in numbers for comparison in COMPARISONS)


def test_runs_from_a_shell() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "papers_repro", "--help"], cwd=ROOT.parent, capture_output=True, text=True
    )
    assert run.returncode == 0 and "shirai2000" in run.stdout


def test_unknown_paper_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        command_line.main(["shirai2001"])
    assert stop.value.code == 2
    assert re.search(r"unknown paper: shirai2001; known: .*shirai2000", capsys.readouterr().err)


def test_a_regression_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(ROOT / "shirai2000/paper.toml", tmp_path)
    table = (ROOT / "shirai2000/tables.csv").read_text()
    assert table.count("1/107") == 1
    (tmp_path / "tables.csv").write_text(table.replace("1/107", "1/167"))
    monkeypatch.setattr(shirai2000, "FOLDER", tmp_path)
    assert command_line.main(["shirai2000", "--output", str(tmp_path / "results")]) == 1
    printed = capsys.readouterr().out
    assert "1/level 3/way_accuracy: differs, recorded as match" in printed
    assert "NOT as recorded" in printed


def test_deviations_name_what_is_gone(report: Report, tmp_path: Path) -> None:
    record = tmp_path / "paper.toml"
    record.write_text('[verdicts]\ntruncated = ["9/x/y"]\n[findings."lost"]\n"nowhere" = "nothing left"\n')
    lines = deviations(Report(title="", comparisons=report.comparisons[:1]), record)
    assert lines == [
        "9/x/y: no such number, recorded as truncated",
        "lost, nowhere: not found, recorded as 'nothing left'",
    ]


def test_a_folder_with_a_reproduce_is_a_paper(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "papers" / "drives2030"
    folder.mkdir(parents=True)
    (folder / "reproduce.py").write_text(
        "from papers_repro.comparison import Report, compare_bound\n"
        "def reproduce(output):\n"
        "    (output / 'extra.txt').write_text('made')\n"
        "    rms = compare_bound(table='drive', row='slope', column='rms', unit='m', bound='1.6', ours=1.5)\n"
        "    yield Report(title='Drives', comparisons=[rms], remarks=['one drive'])\n"
    )
    monkeypatch.setattr(command_line, "FOLDER", tmp_path / "papers")
    monkeypatch.setattr(papers_repro, "__path__", [str(tmp_path / "papers")])
    assert command_line.known_papers() == ["drives2030"]
    assert command_line.main(["--output", str(tmp_path / "results")]) == 0
    assert (tmp_path / "results/drives2030/extra.txt").read_text() == "made"
    printed = capsys.readouterr().out
    assert "<= 1.6" in printed and "1 numbers: 1 match" in printed


def test_the_index_says_which_file_holds_what(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of every paper that has results, also where it ran by itself."""
    for paper in ("first", "second"):
        (tmp_path / paper).mkdir()
        held = Output(element="Fig. 1", file="figure_1.png", holds="a line")
        write_report(Report(title=paper, outputs=[held]), tmp_path / paper)
        write_index(tmp_path)
    index = pd.read_csv(tmp_path / "index.csv")
    assert index.to_dict("list") == {
        "paper": ["first", "second"],
        "element": 2 * ["Fig. 1"],
        "file": 2 * ["figure_1.png"],
        "holds": 2 * ["a line"],
    }


def test_every_table_of_the_paper_is_in_a_file(tmp_path: Path, report: Report) -> None:
    assert command_line.main(["shirai2000", "--output", str(tmp_path)]) == 0
    index = pd.read_csv(tmp_path / "index.csv")
    assert set(index["element"]) == {f"Table {table}" for table in PAPER["tables"]}
    assert all((tmp_path / row.paper / row.file).is_file() for row in index.itertuples())


def test_a_stage_says_that_it_begins_goes_on_and_ends(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "_PATIENCE", 0.05)
    with progress.paper_at_work("drives2030"), progress.stage("runs", 3) as advance:
        advance()
        time.sleep(0.2)
    first, *more, last = capsys.readouterr().out.splitlines()
    assert first == "drives2030: runs: begins"
    assert more and more[0] == "drives2030: runs: 0 s so far, 1 of 3 done"
    assert last == "drives2030: runs: done in 0 s"


def test_parts_make_a_whole(report: Report) -> None:
    half = len(report.comparisons) // 2
    first = Report(title="first", comparisons=report.comparisons[:half], tables={"1": "a"}, remarks=["one"])
    second = Report(title="second", comparisons=report.comparisons[half:], tables={"2": "b"}, remarks=["two"])
    together = whole([first, second])
    assert (together.title, together.comparisons) == ("first", report.comparisons)
    assert (together.tables, together.remarks) == ({"1": "a", "2": "b"}, ["one", "two"])


def test_short_reports_show_every_number(report: Report) -> None:
    few = Report(title="few", comparisons=report.comparisons[:10])
    assert all(comparison.printed in format_report(few) for comparison in few.comparisons)


def test_papers_of_printed_numbers_do_not_need_jax() -> None:
    check = "import sys, papers_repro.shirai2000.reproduce; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], cwd=ROOT.parent).returncode == 0
