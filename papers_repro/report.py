"""What a reader gets of a report: plain text, CSV and JSON files, and what deviates from the record."""

import csv
import json
import textwrap
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields
from itertools import groupby
from pathlib import Path

from filelock import FileLock

from papers_repro.comparison import HYPOTHESES, Comparison, Finding, Output, Report

WIDTH = 120
VERDICTS = ("match", "explained", "differs")

# A longer list of numbers is cut to those that do not match.
MANY = 40


def format_report(report: Report, *, every_number: bool = False) -> str:
    """The report as plain text of at most 120 columns."""
    parts = [_wrap(report.title), "=" * min(len(report.title), WIDTH), *(_wrap(remark) for remark in report.remarks)]
    if report.comparisons:
        parts += ["", *_counts(report)]
        shown = report.comparisons
        if len(shown) > MANY and not every_number:
            shown = [comparison for comparison in shown if comparison.verdict != "match"]
        parts += ["", *_numbers(report, shown)]
    for inconsistency, heading in ((True, "Inconsistencies found"), (False, "What else the printed numbers say")):
        found = [finding for finding in report.findings if finding.inconsistency == inconsistency]
        if found:
            parts += ["", f"{heading}: {len(found)}", "-" * len(heading), *_findings(found)]
    if report.outputs:
        outputs = [[output.element, output.file, output.holds] for output in report.outputs]
        parts += ["", *_aligned(["of the paper", "file", ""], outputs)]
    return "\n".join(parts)


def summary(comparisons: Sequence[Comparison], findings: Sequence[Finding]) -> str:
    """Counts in one line."""
    counts = Counter(comparison.verdict for comparison in comparisons)
    inconsistencies = sum(finding.inconsistency for finding in findings)
    others = len(findings) - inconsistencies
    return (
        f"{len(comparisons)} numbers: {counts['match']} match, {counts['explained']} explained, "
        f"{counts['differs']} differ; {inconsistencies} inconsistencies, {others} other findings"
    )


def write_report(report: Report, output: Path) -> None:
    """comparison, findings and outputs in `output`, each as .csv and .json with the same rows."""
    for name, kind, rows in (
        ("comparison", Comparison, report.comparisons),
        ("findings", Finding, report.findings),
        ("outputs", Output, report.outputs),
    ):
        records = [asdict(row) for row in rows]
        (output / f"{name}.json").write_text(json.dumps(records, indent=1) + "\n")
        with (output / f"{name}.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(kind)])
            writer.writeheader()
            writer.writerows(records)


def write_index(results: Path) -> None:
    """index.csv in the folder of all results: which file holds which element of which paper."""
    # Papers that run at the same time end at the same time.
    with FileLock(results / ".index.lock"), (results / "index.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["paper", *(field.name for field in fields(Output))])
        for listed in sorted(results.glob("*/outputs.json")):
            writer.writerows([listed.parent.name, *row.values()] for row in json.loads(listed.read_text()))


def deviations(report: Report, record: Path) -> list[str]:
    """How verdicts and findings deviate from a paper.toml; without one every number must match."""
    recorded = tomllib.loads(record.read_text()) if record.exists() else {}
    outcomes = {key: outcome for outcome, keys in recorded.get("verdicts", {}).items() for key in keys}
    lines = []
    for comparison in report.comparisons:
        expected = outcomes.pop(number_key(comparison), "match")
        if outcome(comparison) != expected:
            lines.append(f"{number_key(comparison)}: {outcome(comparison)}, recorded as {expected}")
    lines += [f"{key}: no such number, recorded as {expected}" for key, expected in outcomes.items()]
    expected_findings = {
        (kind, where): text for kind, places in recorded.get("findings", {}).items() for where, text in places.items()
    }
    for finding in report.findings:
        expected = expected_findings.pop((finding.kind, finding.where), "nothing")
        if finding.expected != expected:
            lines.append(f"{finding.kind}, {finding.where}: {finding.expected!r} found, recorded as {expected!r}")
    lines += [f"{kind}, {where}: not found, recorded as {text!r}" for (kind, where), text in expected_findings.items()]
    return lines


def number_key(comparison: Comparison) -> str:
    """Name of a number in paper.toml."""
    return f"{comparison.table}/{comparison.row}/{comparison.column}"


def outcome(comparison: Comparison) -> str:
    """The verdict, or the explanation where there is one."""
    return comparison.explanation or comparison.verdict


def _counts(report: Report) -> list[str]:
    rows = []
    for table, of_table in groupby(report.comparisons, key=lambda comparison: comparison.table):
        counts = Counter(comparison.verdict for comparison in of_table)
        rows.append([table, *(str(counts[v]) for v in VERDICTS), str(counts.total()), report.tables.get(table, "")])
    counts = Counter(comparison.verdict for comparison in report.comparisons)
    rows.append(["all", *(str(counts[v]) for v in VERDICTS), str(counts.total()), ""])
    explanations = Counter(comparison.explanation for comparison in report.comparisons if comparison.explanation)
    lines = _aligned(["table", *VERDICTS, "numbers", ""], rows, right=(1, 2, 3, 4))
    if explanations:
        reasons = [[name, str(n), HYPOTHESES[name].__doc__ or ""] for name, n in explanations.most_common()]
        lines += ["", *_aligned(["explained by", "numbers", ""], reasons, right=(1,))]
    return lines


def _numbers(report: Report, shown: Sequence[Comparison]) -> list[str]:
    hidden = len(report.comparisons) - len(shown)
    lines = [
        f"The {len(shown)} numbers that do not match; difference is ours - printed (--all shows the other {hidden} too)"
        if hidden
        else "Numbers"
    ]
    header = ["row", "number", "printed", "ours", "difference", "verdict", ""]
    for table, of_table in groupby(shown, key=lambda comparison: comparison.table):
        rows = [
            [
                c.row,
                c.column,
                c.printed,
                _like_printed(c, c.ours),
                _like_printed(c, c.difference),
                c.verdict,
                _reason(c),
            ]
            for c in of_table
        ]
        lines += ["", f"table {table}: {report.tables[table]}" if table in report.tables else table]
        lines += _aligned(header, rows, right=(2, 3, 4))
    return lines


def _findings(found: Sequence[Finding]) -> list[str]:
    lines = []
    for (kind, rule), of_kind in groupby(found, key=lambda finding: (finding.kind, finding.rule)):
        rows = [[finding.where, finding.printed, finding.expected, finding.evidence] for finding in of_kind]
        header = ["where", "printed", "should be" if found[0].inconsistency else "it follows", "evidence"]
        lines += ["", _wrap(f"{kind} ({len(rows)}): {rule}"), *_aligned(header, rows)]
    return lines


def _reason(comparison: Comparison) -> str:
    return ": ".join(part for part in (comparison.explanation, comparison.note) if part)


def _like_printed(comparison: Comparison, value: float) -> str:
    decimals = len(comparison.printed.partition(".")[2]) + (2 if comparison.unit == "1/n" else 1)
    reciprocal = comparison.unit == "1/n" and value == comparison.ours
    return f"{'1/' if reciprocal else ''}{value:.{decimals}f}"


def _wrap(text: str) -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent="    ")


def _aligned(header: list[str], rows: list[list[str]], right: Sequence[int] = ()) -> list[str]:
    """Rows in columns of at most 120 characters in all; the widest columns give way, their cells wrap."""
    table = [header, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    room = WIDTH - 2 - 2 * (len(widths) - 1)
    while sum(widths) > room:
        widths[widths.index(max(widths))] -= 1
    lines = []
    for row in table:
        cells = [textwrap.wrap(cell, max(width, 1)) or [""] for cell, width in zip(row, widths, strict=True)]
        for i in range(max(len(cell) for cell in cells)):
            texts = [cell[i] if i < len(cell) else "" for cell in cells]
            columns = zip(texts, widths, strict=True)
            aligned = [text.rjust(w) if k in right else text.ljust(w) for k, (text, w) in enumerate(columns)]
            lines.append(("  " + "  ".join(aligned)).rstrip())
    return lines
