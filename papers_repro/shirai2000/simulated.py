"""The experiments simulated: printed rows placed among them, claims decided, charts drawn."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from papers_repro.comparison import Comparison, Finding, Output, Report, compare_bound
from papers_repro.progress import stage
from papers_repro.shirai2000.bands import Cell, cells, comparisons, table_lines, uniformity
from papers_repro.shirai2000.charts import FIGURES, TITLES, actual_profile, plot_budget, plot_running_through
from papers_repro.shirai2000.claims import claims, repeated_errors
from papers_repro.shirai2000.drift import budget_comparisons, budget_lines, developments, drift, rms_of, shares
from papers_repro.shirai2000.inference import NAMES, PRIORS, SCALE, Posterior
from papers_repro.shirai2000.study import RUNS, Study, study
from papers_repro.shirai2000.tables import Row, number


def simulated(rows: Sequence[Row], paper: dict[str, Any], output: Path) -> Iterator[Report]:
    """Tables and figures as simulated, then the error budget; pictures and bands.csv go to `output`."""
    found = study(rows)
    placed = cells(rows, found.names, found.profiles[:, :, -1])
    _write_bands(placed, output / "bands.csv")
    with stage("figures 9 to 14"):
        figures = _draw_charts(found, rows, output)
    tables = paper["simulated_tables"]
    yield Report(
        title=f"Tables 1 to 5 simulated: {RUNS} runs of every experiment, its sensors inferred from all others",
        comparisons=[*comparisons(placed), *_judged(placed)],
        findings=[
            *inference_findings(found.posterior),
            *claims(repeated_errors(found.experiments, found.profiles[:, :, -1]), paper),
        ],
        tables={name: line for name, line in tables.items() if name != "budget"},
        remarks=[*table_lines(placed, paper["tables"]), "", *coverage_lines(placed)],
        outputs=[
            *(
                Output(element=f"Table {table}", file="bands.csv", holds="each measurement among simulated ones")
                for table in paper["tables"]
            ),
            *figures,
        ],
    )
    with stage("error budget"):
        budget = Report(
            title="Why the elevation drifts",
            comparisons=budget_comparisons(found),
            findings=[*drift(found), *developments(found)],
            tables={"budget": tables["budget"]},
            remarks=budget_lines(found),
            outputs=_draw_budgets(found, output),
        )
    yield budget


def coverage_lines(placed: Sequence[Cell]) -> list[str]:
    """Share of printed measurements inside the 2.5 to 97.5 % band, and whether their percentiles are uniform."""
    lines = ["Printed measurements inside the simulated 2.5 to 97.5 % band (outside: !), and p that they are uniform:"]
    for tables in ("1", "2", "3", "4", "5", "345"):
        of = [cell for cell in placed if cell.row["table"] in tables]
        inside = sum(cell.inside for cell in of)
        name = f"table {tables}" if len(tables) == 1 else "tables 3 to 5"
        lines.append(f"  {name}: {inside} of {len(of)} ({100 * inside / len(of):.0f} %), p = {uniformity(of):.3f}")
    return lines


def _judged(placed: Sequence[Cell]) -> list[Comparison]:
    of = [cell for cell in placed if cell.row["table"] in "345"]
    outside = 1 - np.mean([cell.inside for cell in of])
    return [
        compare_bound(
            table="bands", row="tables 3 to 5", column="outside 2.5..97.5 %", unit="1", bound="0.1", ours=float(outside)
        ),
        compare_bound(
            table="bands",
            row="tables 3 to 5",
            column="1 - p of uniform percentiles",
            unit="1",
            bound="0.99",
            ours=1 - uniformity(of),
        ),
    ]


def inference_findings(posterior: Posterior) -> list[Finding]:
    """Every unknown: what the rows say of it, and how much narrower than the prior."""
    findings = []
    narrower = np.sqrt(np.diagonal(posterior.covariance))
    for i, (name, (centre, spread)) in enumerate(PRIORS.items()):
        at = posterior.mode[i]
        if i == SCALE:
            value, band = centre + spread * at, f"+- {spread * narrower[i]:.1g}"
        else:
            value, band = centre * np.exp(spread * at), f"times or by {np.exp(spread * narrower[i]):.2g}"
        share = narrower[i]
        findings.append(
            Finding(
                kind="inferred",
                inconsistency=False,
                rule="Unknown of the sensors by the printed rows; identified where its spread is half the prior's.",
                where=name,
                printed=f"prior {centre:.2g}",
                expected="identified" if share < 0.5 else "in part" if share < 0.8 else "not identified",
                evidence=f"{value:.3g} {band}; spread {share:.2f} of the prior's",
            )
        )
    deviations = posterior.covariance / np.outer(narrower, narrower)
    pairs = [(abs(deviations[i, j]), i, j) for i in range(len(NAMES)) for j in range(i)]
    _, i, j = max(pairs)
    findings.append(
        Finding(
            kind="inferred together",
            inconsistency=False,
            rule="Unknowns of which the rows tell a combination better than each.",
            where="strongest correlation",
            printed="",
            expected=f"{NAMES[j]} and {NAMES[i]}",
            evidence=f"correlation {deviations[i, j]:.2f}",
        )
    )
    return findings


def plot_experiment(found: Study, rows: Sequence[Row], chain: str, course: str, title: str, ax: Axes) -> None:
    """Running-through chart of one chain on one course, of the experiment in the middle of its table's rows."""
    of = [r for r in rows if r["sensor"] == chain and r["course"] == course and r["experiment"] != "average"]
    place = "level" if course == "level" else "slope"
    index = found.names.index((place, of[len(of) // 2]["experiment"]))
    its = jax.tree.map(lambda x: float(x[index]), found.experiments.course)
    profiles = found.profiles[index]
    printed = np.array([[float(number(r, "horizontal_m")), float(number(r, "elevation_m"))] for r in of])
    actual = actual_profile(its.way, its.horizontal, its.rise, its.duration, profiles.shape[1])
    plot_running_through(title, chain, profiles, actual, printed, ax)


def _draw_charts(found: Study, rows: Sequence[Row], output: Path) -> list[Output]:
    """Figures 9 to 14, and the same charts of the passage, which the paper does not show."""
    outputs = []
    for chain, figures in FIGURES.items():
        for figure_number, course in zip(figures, ("descent", "ascent"), strict=True):
            outputs.append(
                Output(
                    element=f"Fig. {figure_number}",
                    file=f"figure_{figure_number}.png",
                    holds=f"{TITLES[chain]}, {course}",
                )
            )
            _draw_chart(found, rows, chain, course, f"Fig. {figure_number}, {course}", output / outputs[-1].file)
    for chain in ("vibration_gyro", "vehicle_speed"):
        table = next(row["table"] for row in rows if row["sensor"] == chain and row["course"] == "level")
        outputs.append(Output(element=f"Table {table}", file=f"indoors_{chain}.png", holds="running-through chart"))
        _draw_chart(found, rows, chain, "level", "indoors", output / outputs[-1].file)
    return outputs


def _draw_chart(found: Study, rows: Sequence[Row], chain: str, course: str, title: str, path: Path) -> None:
    figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    plot_experiment(found, rows, chain, course, title, ax)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_budgets(found: Study, output: Path) -> list[Output]:
    outputs = []
    for place in found.courses:
        figure, axes = plt.subplots(1, 3, figsize=(12, 4.5), sharey=True, layout="constrained")
        plot_budget(shares(found, place), *rms_of(found, place), axes)
        figure.savefig(output / f"budget_{place}.png", dpi=120)
        plt.close(figure)
        outputs.append(Output(element="elevation", file=f"budget_{place}.png", holds=f"error by source, {place}"))
    return outputs


def _write_bands(placed: Sequence[Cell], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["table", "course", "experiment", "quantity", "printed", "p05", "median", "p95", "percentile"])
        for cell in placed:
            writer.writerow(
                [
                    *(cell.row[name] for name in ("table", "course", "experiment")),
                    cell.quantity,
                    cell.row[f"{cell.quantity}_m"],
                    *(f"{value:.3f}" for value in (cell.low, cell.median, cell.high)),
                    f"{cell.percentile:.4f}",
                ]
            )
