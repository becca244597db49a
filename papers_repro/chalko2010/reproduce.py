"""The equations audited, every way to an attitude in one table, sweeps, basins, and the paper's question answered."""

import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import jax
import numpy as np
import pandas as pd

from altijax.recordings import Recording
from altijax.rotations import matrix_to_euler, yaw_to_heading
from papers_repro.chalko2010 import sweeps as instruments
from papers_repro.chalko2010.basins import Basin, basins
from papers_repro.chalko2010.cases import MOUNTING, judge, real_recordings, simulations
from papers_repro.chalko2010.epochs import epochs_of, full_rate_attitude, full_rate_velocity
from papers_repro.chalko2010.equations import EXACT, equation_findings, equations
from papers_repro.chalko2010.experiments import exact_readings, simulated_recording
from papers_repro.chalko2010.pictures import COLORS, draw_basins, draw_minute, draw_sweeps, draw_turning
from papers_repro.chalko2010.strategies import gyro_windows, levenberg
from papers_repro.comparison import Comparison, Finding, Output, Report, compare_bound
from papers_repro.progress import stage

FOLDER = Path(__file__).parent
BASIN_POINTS = 37

MINPACK, LEVENBERG, PREVIOUS = "MINPACK", "Levenberg", "prior: previous"
GYRO, STRAIGHT = "windows, gyro", "interpolated"
ROLL, PITCH, HEADING, VELOCITY = "roll (deg)", "pitch (deg)", "heading (deg)", "velocity (m/s)"

Tables = dict[str, pd.DataFrame]
Sweeps = dict[tuple[str, str], dict[str, instruments.Errors]]


def reproduce(output: Path) -> Iterator[Report]:
    """All of it; pictures, attitudes.csv and sweeps.csv go to `output`."""
    with jax.enable_x64(True):
        yield from _parts(output)


def _parts(output: Path) -> Iterator[Report]:
    paper = tomllib.loads((FOLDER / "paper.toml").read_text())
    with stage("equations"):
        found = equations()
        exact = [equation for equation in found if equation.left_over < EXACT]
        rounding = max(equation.left_over for equation in exact)
        audited = Report(
            title=f"{paper['author']} ({paper['year']}): {paper['title']}",
            findings=equation_findings(found),
            remarks=[
                *paper["remarks"],
                f"Equations {', '.join(e.number for e in exact)} hold as printed, to {rounding:.0e}.",
            ],
        )
    yield audited
    simulated = _judged(simulations(), "simulated")
    yield Report(
        title="Every way to an attitude, simulated",
        comparisons=_bounds(simulated),
        tables=paper["tables"],
        remarks=_lines("simulated, truth known", simulated),
    )
    recordings, missing = real_recordings()
    real = _judged(recordings, "real")
    pd.concat(simulated | real, names=["recording", "way"]).to_csv(output / "attitudes.csv")
    draw_minute(*_minute(), output / "windsurfer_minute.png")
    yield Report(
        title="Every way to an attitude, on real recordings",
        remarks=[*missing, *_lines("real", real)],
        outputs=[
            Output(element="Eqs. (3) to (5)", file="attitudes.csv", holds="errors of every way to an attitude"),
            Output(element="Eqs. (3) to (5)", file="windsurfer_minute.png", holds="a minute of it, at full rate"),
        ],
    )
    swept: Sweeps = {}
    with stage("sweeps of the instruments", len(COLORS) * len(instruments.SWEEPS)) as advance:
        for motion in COLORS:
            readings = exact_readings(motion)
            for name in instruments.SWEEPS:
                swept[motion, name] = instruments.sweep(readings, name)
                advance()
    with stage("a turning device"):
        turning = instruments.turning_sweep(instruments.FREQUENCIES)
    with stage("initial values all around"):
        around = basins(BASIN_POINTS)
    with stage("pictures"):
        _sweep_table(swept, turning).to_csv(output / "sweeps.csv", index=False)
        draw_basins(around, output / "basins.png")
        draw_sweeps(swept, output / "sweeps.png")
        draw_turning(instruments.FREQUENCIES, turning, output / "turning.png")
    considerations = "Sampling rate considerations"
    yield Report(
        title="The paper's questions answered",
        findings=_answers(simulated, swept, turning, around),
        remarks=[paper["answer"]],
        outputs=[
            Output(element="Conclusions", file="sweeps.csv", holds="errors by instruments and by turning"),
            Output(element="Conclusions", file="sweeps.png", holds="errors by instruments"),
            Output(element=considerations, file="turning.png", holds="errors by the device's turning"),
            Output(element="Eq. (5), requirement 2", file="basins.png", holds="results from initial values all around"),
        ],
    )


def _judged(recordings: Iterable[Recording], kind: str) -> Tables:
    """What each way makes of each recording."""
    tables = {}
    for recording in recordings:
        with stage(f"{recording.name}, {kind}"):
            tables[recording.name] = judge(recording)
    return tables


def _bounds(simulated: Tables) -> list[Comparison]:
    """Set by what Doppler noise alone does: 0.05 m/s between velocities a second apart are 0.4 deg."""
    attitude = [
        compare_bound(
            table="attitude with a gyro", row=name, column=column, unit="deg", bound=bound, ours=table[column][GYRO]
        )
        for name, table in simulated.items()
        for column, bound in ((ROLL, "0.5"), (PITCH, "0.5"), (HEADING, "2"))
    ]
    velocity = [
        compare_bound(
            table="velocity at full rate",
            row=name,
            column="with a gyro, over interpolated",
            unit="1",
            bound="1",
            ours=table[VELOCITY][GYRO] / table[VELOCITY][STRAIGHT],
        )
        for name, table in simulated.items()
    ]
    return attitude + velocity


def _answers(
    simulated: Tables, swept: Sweeps, turning: dict[str, instruments.Errors], around: dict[str, Basin]
) -> list[Finding]:
    """The paper's suggestions and questions, decided on the simulations."""
    vehicle, sailor, eight = (simulated[name] for name in ("vehicle", "windsurfer", "aircraft"))
    skewed = simulated["vehicle, turned"]

    def answer(where: str, printed: str, expected: str, evidence: str) -> Finding:
        return Finding(
            kind="question of the paper",
            inconsistency=False,
            rule="The method needs to be tested; more research is needed (Conclusions).",
            where=where,
            printed=printed,
            expected=expected,
            evidence=evidence,
        )

    def angles(table: pd.DataFrame, way: str) -> str:
        return "/".join(f"{table[column][way]:.1f}" for column in (ROLL, PITCH, HEADING))

    wandering = vehicle[HEADING][MINPACK] > 5 * vehicle[HEADING][LEVENBERG]
    supplied = abs(skewed[HEADING][LEVENBERG] - MOUNTING[2]) < 4 and vehicle[HEADING][LEVENBERG] < 2
    ahead = sailor[HEADING][LEVENBERG] < 5
    recovered = all(table[HEADING][GYRO] < 2 for table in simulated.values())
    limit = _limit(turning["epochs"])
    late = swept["aircraft", "delay left in the velocities (s)"]["gyro windows"].velocity
    delays = instruments.SWEEPS["delay left in the velocities (s)"][1]
    gained = {name: table[VELOCITY][STRAIGHT] / table[VELOCITY][GYRO] for name, table in simulated.items()}
    alone = {name: table[VELOCITY][STRAIGHT] / table[VELOCITY][LEVENBERG] for name, table in simulated.items()}
    minimum = max(float(np.mean(basin.norm > 0.01)) for basin in around.values())
    near = {name: float(np.mean(np.degrees(basin.angle) < 5)) for name, basin in around.items()}
    return [
        answer(
            "algorithm of reference [2]",
            "suitable, for example",
            "lets the heading wander; damp by a multiple of I" if wandering else "suitable",
            f"vehicle, roll/pitch/heading RMS: {angles(vehicle, MINPACK)} deg by MINPACK, {angles(vehicle, LEVENBERG)} "
            "damped by a multiple of I",
        ),
        answer(
            "initial value pi/2 - COG",
            "a reasonable set of initial values",
            "it is the heading that comes out" if supplied else "undecided",
            f"vehicle {vehicle[HEADING][LEVENBERG]:.1f} deg; device turned by {MOUNTING[2]:g} deg "
            f"{skewed[HEADING][LEVENBERG]:.1f} deg; aircraft in a wind {eight[HEADING][LEVENBERG]:.1f} deg",
        ),
        answer(
            "global minimum",
            "responsibility of the programmer",
            "found from everywhere, and no help" if minimum < 0.02 and max(near.values()) < 0.2 else "undecided",
            f"missed from at most {minimum:.1%} of initial values all around; within 5 deg of the truth from "
            + ", ".join(f"{share:.1%} ({name})" for name, share in near.items()),
        ),
        answer(
            "helmet of a windsurfer",
            "roll and pitch small, looking ahead",
            "not from single epochs" if not ahead else "confirmed",
            f"{angles(sailor, LEVENBERG)} deg; with a gyro {angles(sailor, GYRO)} deg, through a fall "
            f"{angles(simulated['windsurfer falling'], GYRO)} deg",
        ),
        answer(
            "more information is needed",
            "values from previous data sample",
            "a gyro to join epochs; the previous epoch makes it worse"
            if recovered and eight[HEADING][PREVIOUS] > eight[HEADING][LEVENBERG]
            else "undecided",
            f"aircraft: previous epoch {angles(eight, PREVIOUS)} deg, single epochs "
            f"{angles(eight, LEVENBERG)} deg, windows with gyro {angles(eight, GYRO)} deg",
        ),
        answer(
            "Nyquist frequency 0.5 Hz",
            "alignment changes much slower",
            f"at least {int(0.5 / limit)} times slower",
            f"a device turning by 15 deg at {limit:.2f} Hz is 2 deg off at full rate; with a gyro "
            f"{float(np.max(turning['gyro windows'].tilt_full_rate)):.1f} deg at most, up to "
            f"{instruments.FREQUENCIES[-1]:g} Hz",
        ),
        answer(
            "time delay",
            "determined by preliminary experiments",
            "needed: what is left of it goes into the velocity" if late[-1] > 2 * late[0] else "undecided",
            "aircraft with a gyro, error of the velocity at full rate: "
            + ", ".join(f"{delay:g} s {float(error):.2f} m/s" for delay, error in zip(delays, late, strict=True)),
        ),
        answer(
            "combining both velocities",
            "seems possible",
            "confirmed with a gyro" if min(gained.values()) > 1 else "undecided",
            "times better than straight lines between velocities, with and without gyro: "
            + ", ".join(f"{name} {gained[name]:.1f} and {alone[name]:.1f}" for name in simulated),
        ),
    ]


def _limit(found: instruments.Errors) -> float:
    """Frequency of turning at which the tilt at full rate first reaches 2 deg, between neighbours by logarithms."""
    tilt, frequencies = np.asarray(found.tilt_full_rate), np.log(instruments.FREQUENCIES)
    last = max(int(np.argmax(tilt > 2)), 1)
    return float(np.exp(np.interp(2.0, tilt[last - 1 : last + 1], frequencies[last - 1 : last + 1])))


def _minute() -> tuple[pd.DataFrame, dict[str, pd.DataFrame]]:
    """A minute of the windsurfer: the truth, epoch by epoch, and windows carried by the gyro."""
    recording = simulated_recording("windsurfer falling", seed=1)
    reference = _of(recording)
    epochs = epochs_of(recording)
    ways = {}
    for name, C_middle, carried in (
        ("single epochs", levenberg(epochs), False),
        ("windows with gyro", gyro_windows(epochs), True),
    ):
        C_nb = full_rate_attitude(epochs, C_middle, carried=carried)
        roll, pitch, yaw = np.asarray(matrix_to_euler(C_nb)).T
        columns = [roll, pitch, np.asarray(yaw_to_heading(yaw)), *np.asarray(full_rate_velocity(epochs, C_nb)).T]
        ways[name] = pd.DataFrame(dict(zip(reference.columns, columns, strict=True)), index=reference.index)
    middle = 0.55 * reference.index[-1]
    shown = (reference.index >= middle - 30) & (reference.index <= middle + 30)
    return reference[shown], {name: table[shown] for name, table in ways.items()}


def _of(recording: Recording) -> pd.DataFrame:
    if recording.reference is None:
        raise ValueError(f"recording {recording.name!r} has no reference")
    return recording.reference


def _sweep_table(swept: Sweeps, turning: dict[str, instruments.Errors]) -> pd.DataFrame:
    rows = [
        (motion, name, value, method, *(float(x[i]) for x in jax.tree.leaves(errors)))
        for (motion, name), methods in swept.items()
        for method, errors in methods.items()
        for i, value in enumerate(instruments.SWEEPS[name][1])
    ]
    rows += [
        ("turning device", "frequency (Hz)", f, method, *(float(x[i]) for x in jax.tree.leaves(errors)))
        for method, errors in turning.items()
        for i, f in enumerate(instruments.FREQUENCIES)
    ]
    measures = ["tilt_deg", "heading_deg", "tilt_full_rate_deg", "velocity_m_s"]
    return pd.DataFrame(rows, columns=["motion", "sweep", "value", "method", *measures])


def _lines(title: str, tables: Tables) -> list[str]:
    """One table, a row a way, in each recording roll/pitch/heading in degrees and the velocity in m/s."""
    if not tables:
        return []

    def digits(x: float) -> str:
        return f"{x:.1f}" if x < 10 else f"{x:.0f}"

    cells = {
        name: ["/".join(map(digits, row[:3])) + f" {row[3]:.3f}" for row in table.to_numpy()]
        for name, table in tables.items()
    }
    frame = pd.DataFrame(cells, index=next(iter(tables.values())).index).replace("nan/nan/nan", "", regex=True)
    return [f"RMS errors, {title}: roll/pitch/heading (deg) velocity (m/s)", *frame.to_string().splitlines()]
