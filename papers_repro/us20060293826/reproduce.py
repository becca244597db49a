"""The equations checked, figures 6 and 7 as experiments, where the method helps, and its instability."""

import csv
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from papers_repro.comparison import Comparison, Finding, Output, Report, compare_bound
from papers_repro.progress import stage
from papers_repro.us20060293826.equations import EXACT, equation_findings, equations, unexplained
from papers_repro.us20060293826.experiments import METHODS, Runs, figure_drives, rms_errors, simulate, winding_drive
from papers_repro.us20060293826.outages import real_outages
from papers_repro.us20060293826.pictures import draw_figure, draw_growth, draw_map
from papers_repro.us20060293826.stability import Growth, curvy_drive, error_growth

FOLDER = Path(__file__).parent
RUNS = 64
QUALITIES = (0.1, 0.3, 1.0, 3.0)
SWINGS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)


def reproduce(output: Path) -> Iterator[Report]:
    """Both figures, the map, the growth of errors, real outages; pictures, errors.csv, outages.csv go to `output`."""
    with jax.enable_x64(True):
        yield from _parts(output)


def _parts(output: Path) -> Iterator[Report]:
    paper = tomllib.loads((FOLDER / "paper.toml").read_text())
    with stage("equations"):
        checked = equations()
        exact = [equation for equation in checked if equation.printed < EXACT]
    yield Report(
        title=f"{paper['number']} ({paper['year']}): {paper['title']}",
        findings=equation_findings(checked),
        remarks=[
            *paper["remarks"],
            f"Equations {', '.join(e.number for e in exact)} hold as printed, to {max(e.printed for e in exact):.0e}; "
            f"no correction found for: {', '.join(unexplained(checked)) or 'none'}.",
        ],
    )
    with stage("figures 6 and 7"):
        figures = {
            (name, quality): simulate(drive, jnp.asarray(quality), jax.random.key(number), runs=RUNS)
            for number, (name, drive) in enumerate(figure_drives().items())
            for quality in (0.1, 1.0)
        }
        for name in figure_drives():
            draw_figure(name, figures[name, 1.0], output / f"{name.replace(' ', '_')}.png")
        _write_errors(figures, output / "errors.csv")
    yield Report(
        title="Figures 6 and 7 as simulated experiments",
        comparisons=_claims(figures),
        findings=_smallness(figures),
        tables={"figures": paper["tables"]["figures"]},
        remarks=_error_lines(figures),
        outputs=[
            Output(element="Fig. 6", file="figure_6.png", holds="speed without and with the roll"),
            Output(element="Fig. 7", file="figure_7.png", holds="speed without and with the roll"),
            Output(element="Figs. 6 and 7", file="errors.csv", holds="errors of every run"),
        ],
    )
    with stage("growth of errors"):
        growth = error_growth(curvy_drive())
        draw_growth(growth, output / "error_growth.png")
    yield Report(
        title="Stability of the loop",
        comparisons=_laws(growth),
        findings=_stability(growth),
        tables={"stability": paper["tables"]["stability"]},
        outputs=[Output(element="Eqs. (10) to (12)", file="error_growth.png", holds="growth of errors with turning")],
    )
    turning, better = _map_of_benefit()
    draw_map(turning, QUALITIES, better, output / "where_the_roll_helps.png")
    yield Report(
        title="Where the roll helps",
        findings=[_region(turning, better)],
        outputs=[
            Output(
                element="claim of many curves",
                file="where_the_roll_helps.png",
                holds="share of runs made better, by turning and gyros",
            )
        ],
    )
    with stage("real outages"):
        lines = real_outages(output)
    yield Report(
        title="On a real drive",
        remarks=lines,
        outputs=[Output(element="claim of accuracy", file="outages.csv", holds="errors after outages of the GNSS")]
        if (output / "outages.csv").exists()
        else [],
    )


def _map_of_benefit() -> tuple[np.ndarray, np.ndarray]:
    """Accumulated change of heading (swings,), and the share of runs that the roll made better (qualities, swings)."""
    turning, better = [], []
    with stage("map of where the roll helps", len(SWINGS) * len(QUALITIES)) as advance:
        for swing in SWINGS:
            drive = winding_drive((swing * 0.16, swing * 0.10), 700.0)
            shares = []
            for quality in QUALITIES:
                runs = simulate(drive, jnp.asarray(quality), jax.random.key(100), runs=RUNS)
                shares.append(_share_better(runs))
                advance()
            turning.append(float(runs.turning[-1]))
            better.append(shares)
    return np.array(turning), np.array(better).T


def _share_better(runs: Runs) -> float:
    rms = rms_errors(runs)
    return float(np.mean(rms["with roll"] < rms["without roll"]))


def _medians(runs: Runs) -> dict[str, float]:
    return {name: float(np.median(rms)) for name, rms in rms_errors(runs).items()}


def _claims(figures: dict[tuple[str, float], Runs]) -> list[Comparison]:
    return [
        compare_bound(
            table="figures",
            row=name,
            column=f"runs worse with roll, gyros x{quality:g}",
            unit="1",
            bound="0.1",
            ours=1 - _share_better(runs),
        )
        for (name, quality), runs in figures.items()
    ]


def _laws(growth: Growth) -> list[Comparison]:
    off = {
        "simulated": np.max(np.abs(growth.simulated / growth.linearised - 1)),
        "derivative of the loop": np.max(np.abs(growth.derivative / growth.linearised - 1)),
    }
    return [
        compare_bound(
            table="stability", row=name, column="off the linearised growth", unit="1", bound="0.05", ours=float(ours)
        )
        for name, ours in off.items()
    ] + [
        compare_bound(
            table="stability",
            row="second-order stepping",
            column="RMS on error-free readings",
            unit="m/s",
            bound="0.05",
            ours=_rms(growth.second_order),
        )
    ]


def _rms(error: jax.Array) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def _smallness(figures: dict[tuple[str, float], Runs]) -> list[Finding]:
    findings = []
    for (name, quality), runs in figures.items():
        rms = rms_errors(runs)
        speed = float(jnp.mean(runs.gps))
        small = float(np.mean(rms["with roll"] < 0.1 * speed))
        medians = _medians(runs)
        findings.append(
            Finding(
                kind="claim of the figures",
                inconsistency=False,
                rule="Almost the same as the actual speed: within a tenth of its mean, RMS, in most runs.",
                where=f"{name}, gyros x{quality:g}",
                printed="large difference without roll, small with roll",
                expected="small with roll" if small >= 0.5 else "not small with roll either",
                evidence=f"probability {small:.2f} of {RUNS} runs; median RMS {medians['without roll']:.1f} without "
                f"and {medians['with roll']:.1f} m/s with roll, {medians['aided roll']:.1f} with the GPS speed inside "
                f"the roll; {float(runs.turning[-1]):.1f} rad of turning, mean speed {speed:.0f} m/s",
            )
        )
    return findings


def _stability(growth: Growth) -> list[Finding]:
    last = float(growth.turning[-1])
    return [
        Finding(
            kind="unstable loop",
            inconsistency=False,
            rule="The roll comes from the method's own speed: dv'' = w_Z^2 dv.",
            where="Eqs. (10) to (12)",
            printed="the speed can be accurately measured",
            expected="errors grow exponentially with the accumulated change of heading",
            evidence=f"an initial error grew {float(growth.simulated[-1]):.0f} times in {last:.1f} rad of curves, the "
            f"equation integrated {float(growth.linearised[-1]):.0f}, cosh {float(growth.constant_rate[-1]):.0f}",
        ),
        Finding(
            kind="literal stepping",
            inconsistency=False,
            rule="Truncation is an error like any other, and grows like it.",
            where="immediately previous estimates",
            printed="previous estimates of speed and inclination",
            expected="a step of second order is needed",
            evidence=f"error-free readings at 100 Hz, {last:.1f} rad: RMS {_rms(growth.literal):.1f} m/s, with a step "
            f"of second order {_rms(growth.second_order):.3f}",
        ),
    ]


def _region(turning: np.ndarray, better: np.ndarray) -> Finding:
    limits = [f"gyros x{q:g}: {_limit(turning, share)}" for q, share in zip(QUALITIES, better, strict=True)]
    return Finding(
        kind="region of validity",
        inconsistency=False,
        rule="The roll helps while what it takes off exceeds what its own loop has made of the sensors' errors.",
        where="a minute of curves",
        printed="many curves",
        expected="up to a limit of turning, which is the lower the worse the gyros are",
        evidence="better in most runs, " + "; ".join(limits),
    )


def _limit(turning: Sequence[float] | np.ndarray, share: Sequence[float] | np.ndarray) -> str:
    """The turning after which fewer than half of the runs are better, between neighbouring roads linearly."""
    within = [i for i, better in enumerate(share) if better >= 0.5]
    if not within:
        return "nowhere"
    last = within[-1]
    if last == len(share) - 1:
        return f"beyond {turning[last]:.1f} rad"
    part = (share[last] - 0.5) / (share[last] - share[last + 1])
    return f"up to {turning[last] + part * (turning[last + 1] - turning[last]):.1f} rad"


def _error_lines(figures: dict[tuple[str, float], Runs]) -> list[str]:
    lines = [f"RMS difference from the GPS speed, median of {RUNS} runs (m/s): {', '.join(METHODS)}"]
    for (name, quality), runs in figures.items():
        medians = _medians(runs)
        lines.append(f"  {name}, gyros x{quality:g}: " + ", ".join(f"{medians[method]:.1f}" for method in METHODS))
    return lines


def _write_errors(figures: dict[tuple[str, float], Runs], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["figure", "gyro_errors", "run", "method", "rms_m_s", "end_m_s"])
        for (name, quality), runs in figures.items():
            for method, rms in rms_errors(runs).items():
                for run, (value, end) in enumerate(zip(rms, runs.errors[method][:, -1], strict=True)):
                    writer.writerow([name, quality, run, method, f"{float(value):.4f}", f"{float(end):.4f}"])
