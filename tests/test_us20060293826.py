"""The patent's equations, its figures in small, and what is said of both."""

from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.datasets import DatasetNotFoundError
from altijax.recordings import Recording
from altijax.speed_estimate import estimates as speed_estimates
from altijax.speed_estimate.outages import outage_table
from papers_repro.comparison import Report, whole
from papers_repro.report import deviations
from papers_repro.us20060293826 import outages, reproduce as paper
from papers_repro.us20060293826.equations import EXACT, Equation, equation_findings, equations, unexplained
from papers_repro.us20060293826.experiments import calibrated_readings, figure_drives, readings_of, turning_of
from papers_repro.us20060293826.stability import curvy_drive, error_growth
from tests.made_drives import curvy_recording

CHECKED = equations()


def _no_dataset(name: str) -> Recording:
    raise DatasetNotFoundError(name)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Report, Path]:
    """All of it, with fewer runs and a smaller map."""
    output = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outages, "load_dataset", _no_dataset)
        patch.setattr(paper, "RUNS", 16)
        patch.setattr(paper, "SWINGS", (1.0, 3.0))
        patch.setattr(paper, "QUALITIES", (0.3, 3.0))
        return whole(paper.reproduce(output)), output


def test_equations_hold_or_are_corrected():
    assert [e.number for e in CHECKED if e.printed < EXACT] == ["1", "2", "4"]
    assert [f.where for f in equation_findings(CHECKED)] == ["Eq. (5)", "Eq. (7)", "Eq. (11)"]
    assert unexplained(CHECKED) == []
    for equation in CHECKED:
        if equation.correction:
            assert equation.printed > 0.01
            assert equation.corrected < 1e-12


def test_a_wrong_correction_is_unexplained():
    wrong = Equation(number="0", text="x = y", unit="m", printed=1.0, correction="x = z", corrected=0.1)
    silent = Equation(number="9", text="x = y", unit="m", printed=1.0)
    assert unexplained([wrong, silent]) == ["0", "9"]
    assert equation_findings([wrong, silent]) == []


@pytest.mark.slow
def test_verdicts_and_findings_are_the_recorded_ones(small):
    report, _ = small
    assert deviations(report, Path(paper.__file__).parent / "paper.toml") == []
    assert [c.verdict for c in report.comparisons] == 7 * ["match"]


@pytest.mark.slow
def test_pictures_and_errors_are_written(small):
    report, output = small
    assert {held.file for held in report.outputs} == {path.name for path in output.iterdir()}
    assert {path.name for path in output.iterdir()} == {
        "figure_6.png",
        "figure_7.png",
        "where_the_roll_helps.png",
        "error_growth.png",
        "errors.csv",
    }
    # Two figures, two qualities of gyros, three methods, sixteen runs, and the heading.
    assert len((output / "errors.csv").read_text().splitlines()) == 2 * 2 * 3 * 16 + 1


def test_drives_turn_both_ways_and_return_to_rest():
    for drive in figure_drives().values():
        readings = jax.jit(readings_of)(drive)
        assert 2.5 < turning_of(readings)[-1] < 5
        assert readings.w_b[:, 2].min() < -0.05 and readings.w_b[:, 2].max() > 0.05
        assert readings.speed[0] == 0 and readings.speed[-1] < 0.01


def test_static_calibration_leaves_noise_alone():
    """At rest what is left averages to the noise of the calibration; a motion shows scales and axes as well."""
    readings = jax.jit(readings_of)(figure_drives()["figure 6"])
    still = jax.tree.map(lambda x: jnp.broadcast_to(x[:1], x.shape), readings)
    run = jax.jit(calibrated_readings)
    f_b, w_b = run(still, jnp.asarray(1.0), jax.random.key(0))
    # Standing on a slope of 0.07, the gyros feel another gravity than on the level, and so do axes out of square.
    np.testing.assert_allclose(w_b.mean(0), 0, atol=3e-4)
    np.testing.assert_allclose(f_b.mean(0), still.f_b[0], atol=0.03)
    moving, _ = run(readings, jnp.asarray(1.0), jax.random.key(0))
    assert np.abs(moving - readings.f_b).std() > np.abs(f_b - still.f_b).std()


@pytest.mark.slow
def test_growth_is_that_of_the_linearised_equation():
    growth = error_growth(curvy_drive())
    assert 9 < growth.turning[-1] < 11
    np.testing.assert_allclose(growth.simulated, growth.linearised, rtol=0.05)
    np.testing.assert_allclose(growth.derivative, growth.simulated, rtol=1e-3)
    assert growth.linearised[-1] > 2 * growth.constant_rate[-1]


@pytest.mark.parametrize(
    ("share", "expected"),
    [
        ([0.9, 0.7, 0.3], "up to 2.5 rad"),
        ([0.4, 0.9, 0.4], "up to 2.8 rad"),
        ([0.1, 0.7, 0.9], "beyond 3.0 rad"),
        ([0.1, 0.2, 0.3], "nowhere"),
    ],
)
def test_limit_of_the_region(share, expected):
    assert paper._limit([1.0, 2.0, 3.0], share) == expected


@pytest.mark.slow
def test_real_outages_are_shown_or_said_to_be_missing(small, tmp_path, monkeypatch):
    assert small[0].remarks[-1].startswith("No real outages: rtk-drive is not here")
    monkeypatch.setattr(outages, "load_dataset", lambda name: curvy_recording())
    monkeypatch.setattr(outages, "outage_table", partial(outage_table, durations=(5.0, 15.0), first=14.0))
    monkeypatch.setattr(speed_estimates, "_FIT_FROM", np.inf)
    lines = outages.real_outages(tmp_path)
    assert lines[2].split() == ["after", "(outages)", "5", "s", "(3)", "15", "s", "(2)"]
    assert len(lines) == 3 + len(outages.METHODS)
    table = pd.read_csv(tmp_path / "outages.csv")
    assert set(table["method"]) == set(outages.METHODS) and np.isfinite(table["rms"]).all()
