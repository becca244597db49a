"""The audit of the equations, the ways to an attitude, their table in small, and what is said of all of it."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.rotations import euler_to_matrix
from papers_repro.chalko2010 import reproduce as paper, strategies, sweeps
from papers_repro.chalko2010.basins import basins, initial_errors
from papers_repro.chalko2010.cases import MOUNTING, judge, turned
from papers_repro.chalko2010.epochs import epochs_of, full_rate_attitude, full_rate_velocity, reference_attitude
from papers_repro.chalko2010.equations import EXACT, equations, kink, mean_error, rank, singular_values
from papers_repro.chalko2010.experiments import MOTIONS, exact_readings, simulated_recording
from papers_repro.comparison import Report, whole
from papers_repro.report import deviations

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Report, Path]:
    """All of it but real recordings, with one unit, two values a sweep and a coarse map."""
    output = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweeps, "UNITS", 1)
        ends = {
            name: (parameter, [values[0], values[-1]])
            for name, (parameter, values) in sweeps.SWEEPS.items()
            if not parameter.endswith("rate")
        }
        patch.setattr(sweeps, "SWEEPS", ends)
        patch.setattr("papers_repro.chalko2010.pictures.SWEEPS", ends)
        patch.setattr(sweeps, "FREQUENCIES", sweeps.FREQUENCIES[[0, 5, 6, 12]])
        patch.setattr(paper, "BASIN_POINTS", 9)
        patch.setattr(paper, "real_recordings", lambda: ([], []))
        return whole(paper.reproduce(output)), output


@pytest.fixture(scope="module")
def vehicle():
    return simulated_recording("vehicle", seed=0)


def test_findings_and_verdicts_are_the_recorded_ones(small):
    report, _ = small
    assert deviations(report, Path(paper.__file__).parent / "paper.toml") == []
    assert "undecided" not in {finding.expected for finding in report.findings}


def test_files_are_written(small):
    report, output = small
    assert {held.file for held in report.outputs} == {path.name for path in output.iterdir()}
    assert {path.name for path in output.iterdir()} == {
        "attitudes.csv",
        "sweeps.csv",
        "basins.png",
        "sweeps.png",
        "turning.png",
        "windsurfer_minute.png",
    }
    assert any(line.lstrip().startswith("windows, gyro") for line in report.remarks)


def test_equations_hold_but_one():
    left_over = {equation.number: equation.left_over for equation in equations()}
    assert [number for number, rest in left_over.items() if rest > 1e-3] == ["text before (4)"]
    assert sum(rest < EXACT for rest in left_over.values()) == 5


@pytest.mark.parametrize("motion", MOTIONS)
def test_rank_is_two_everywhere(motion):
    found = rank(exact_readings(motion))
    assert found.third < 1e-12 < 0.5 < found.second
    assert found.turned < EXACT


def test_singular_values_of_a_level_device():
    """At rest, level, roll and pitch each turn gravity by itself and yaw not at all."""
    values = singular_values(jnp.array([0.0, 0.0, 1.0]), jnp.array([0.0, 0.0, 9.81]))
    np.testing.assert_allclose(values, [9.81, 9.81, 0], atol=1e-12)


def test_mean_error_shrinks_with_the_square_of_the_epoch():
    """A vehicle turns slowly: what the mean in body axes misses is of second order in the epoch."""
    long, short = mean_error("vehicle", 1.0), mean_error("vehicle", 0.5)
    assert 3.5 < long.vector / short.vector < 4.5
    assert long.carried < 1e-12


def test_the_norm_has_a_kink_at_its_minimum():
    before, after = kink(exact_readings("windsurfer"))
    assert before < -1 < 1 < after
    np.testing.assert_allclose(before, -after, rtol=1e-3)


def test_goal_of_minpack_is_the_others():
    angles, f_b, f_n = np.array([0.3, -0.4, 2.0]), np.array([1.0, 2.0, 9.0]), np.array([0.5, 0.2, 9.8])
    np.testing.assert_allclose(
        strategies.left_over(angles, f_b, f_n), euler_to_matrix(jnp.array(angles)) @ f_b - f_n, atol=1e-12
    )


def test_levenberg_keeps_what_the_data_do_not_tell():
    """On the level and without acceleration the yaw comes out as it went in; Marquardt's makes a minimum as well."""
    start = jnp.array([0.2, -0.1, 1.0])
    f_n = jnp.array([0.0, 0.0, 9.81])
    found = strategies.levenberg_angles(f_n, f_n, start)
    np.testing.assert_allclose(found[:2], 0, atol=1e-6)
    assert abs(found[2] - 1.0) < 0.05
    f_b = euler_to_matrix(jnp.array([0.1, 0.2, 0.5])).T @ f_n
    rest = euler_to_matrix(strategies.marquardt_angles(f_b, f_n, start)) @ f_b - f_n
    np.testing.assert_allclose(rest, 0, atol=1e-6)


def test_turned_device_is_the_mounting_times_the_vehicle(vehicle):
    skewed = turned(vehicle)
    t = jnp.array([10.0, 50.0])
    relative = jnp.swapaxes(reference_attitude(vehicle, t), -1, -2) @ reference_attitude(skewed, t)
    roll, pitch, yaw = MOUNTING
    oracle = Rotation.from_euler("ZYX", [yaw, -pitch, roll], degrees=True).as_matrix()
    np.testing.assert_allclose(relative, np.stack([oracle, oracle]), atol=1e-9)
    for columns in (["ax", "ay", "az"], ["gx", "gy", "gz"]):
        np.testing.assert_allclose(skewed.imu[columns] @ oracle.T, vehicle.imu[columns], atol=1e-9)


def test_full_rate_meets_attitudes_and_velocities(vehicle):
    epochs = epochs_of(vehicle)
    true = reference_attitude(vehicle, epochs.t_middle)
    for carried in (False, True):
        C_nb = full_rate_attitude(epochs, true, carried=carried)
        # Mid-epoch falls on every 50th sample from the 25th on.
        np.testing.assert_allclose(C_nb[25::50], true, atol=1e-9)
        velocity = full_rate_velocity(epochs, C_nb)
        np.testing.assert_allclose(velocity[::50], epochs.v_knots, atol=1e-9)


def test_windows_find_any_mounting_alike(vehicle):
    """A turned device changes what the initial values are worth, and nothing for windows with a gyro."""
    straight, skewed = judge(vehicle), judge(turned(vehicle))
    assert skewed.loc["Levenberg", "heading (deg)"] > 30 > 2 > straight.loc["Levenberg", "heading (deg)"]
    for table in (straight, skewed):
        assert table.loc["windows, gyro", "heading (deg)"] < 2


def test_basins():
    """Initial errors are all around without the truth being hit; minima are found nearly everywhere."""
    errors = initial_errors(8)
    assert len(errors) == 8 and np.abs(errors).min() > 0
    np.testing.assert_allclose(errors, -errors[::-1])
    found = basins(5)
    assert set(found) == {"MINPACK", "Marquardt", "Levenberg"}
    assert all(basin.norm.shape == (5, 5) for basin in found.values())
    assert np.mean(found["Levenberg"].norm < 1e-6) > 0.9
