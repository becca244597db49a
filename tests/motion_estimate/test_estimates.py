"""Motion of recordings: what comes out, that simulated truth lies within the stated errors, and what real ones say."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.estimates import MOTION_METHODS, estimate_motion
from altijax.motion_estimate.scores import score_motion
from altijax.motions import flight_pose, ideal_readings
from altijax.recordings import Recording
from altijax.roads import rest_to_rest, winding_road
from altijax.rotations import matrix_to_euler
from altijax.vehicle.estimates import CONSISTENT

DELAY = 0.12
COLUMNS = ["roll", "pitch", "heading", "v_e", "v_n", "v_u"]
COLUMNS += [f"{name}_std" for name in COLUMNS] + ["valid"]


@pytest.fixture(scope="module")
def flight() -> Recording:
    return flown(slope=0.05, wavelength=300.0)


def flown(*, slope: float, wavelength: float, later_climb: float = 0.0) -> Recording:
    """A minute of turns in a wind, a biased IMU at 50 Hz from t = 5 s, and late GNSS at 1 Hz that ends early."""
    one = jnp.ones(1)
    road = winding_road(1.2 * one, 250.0 * one, 0 * one, slope * one, wavelength * one, 0 * one, 0.0)
    pose = partial(flight_pose, road, rest_to_rest(2000.0, 100.0, 10.0), jnp.array([6.0, -4.0, 0.0]), 9.80665)
    t = np.arange(0, 60, 0.02)
    truth = jax.jit(partial(ideal_readings, pose))(jnp.asarray(t + 15.0), 9.80665)
    rng = np.random.default_rng(7)
    f = np.asarray(truth.f_b) + [0.04, -0.03, 0.05] + 0.3 * rng.normal(size=(t.size, 3))
    w = np.asarray(truth.w_b) + [0.01, -0.02, 0.015] + 0.01 * rng.normal(size=(t.size, 3))
    index = pd.Index(t + 5.0, name="t")
    euler, v = np.asarray(matrix_to_euler(truth.C_nb)), np.asarray(truth.velocity)
    reference = {"roll": euler[:, 0], "pitch": euler[:, 1], "heading": np.mod(np.pi / 2 - euler[:, 2], 2 * np.pi)}
    reference |= dict(zip(("v_e", "v_n", "v_u"), v.T, strict=True))
    epochs = np.arange(0.4, 56, 1.0)
    late = {"v_e": 0.0, "v_n": 0.0, "v_u": later_climb}
    measured = {name: np.interp(epochs - late[name], t, reference[name]) for name in late}
    gnss = pd.DataFrame(measured, index=pd.Index(epochs + 5 + DELAY, name="t"))
    return Recording(
        name="flight",
        imu=pd.DataFrame(dict(zip(("ax", "ay", "az", "gx", "gy", "gz"), [*f.T, *w.T], strict=True)), index=index),
        gnss=gnss + 0.1 * rng.normal(size=gnss.shape),
        reference=pd.DataFrame(reference, index=index),
    )


@pytest.fixture(scope="module")
def batch(flight: Recording) -> pd.DataFrame:
    return estimate_motion(flight)


def test_one_finite_row_a_sample(flight: Recording, batch: pd.DataFrame) -> None:
    assert list(batch.columns) == COLUMNS
    assert batch.index.equals(flight.imu.index)
    assert np.isfinite(batch.to_numpy(float)).all() and batch["valid"].dtype == bool
    # GNSS ends at 60.5 s, the IMU at 65 s.
    assert batch["valid"].loc[6.0:60.0].all() and not batch["valid"].loc[63.0:].any()
    assert batch["v_e_std"].iloc[-1] > 2 * batch["v_e_std"].loc[30.0]


def test_truth_lies_within_the_stated_errors(flight: Recording, batch: pd.DataFrame) -> None:
    """All angles and velocities, biases and delay estimated beside them."""
    score = score_motion(batch, flight)
    ratio = score["rms"] / score["stated_std"]
    assert (ratio.drop("velocity") < 2.0).all(), score
    assert score.loc["roll", "rms"] < np.radians(0.6) and score.loc["heading", "rms"] < np.radians(1.5), score
    assert score.loc["velocity", "rms"] < 0.15, score
    assert batch.attrs["delay"] == pytest.approx(DELAY, abs=0.03)
    constants = batch.attrs["constants"]
    found = np.array([constants[f"gyro_bias_{axis}"] for axis in "xyz"])
    error = found[:, 0] - [0.01, -0.02, 0.015]
    assert (np.abs(error) < 3 * found[:, 1]).all() and (np.abs(error) < 0.005).all(), found
    assert 0.5 < batch.attrs["nis"] < 2.0
    assert batch.attrs["verdict"] == CONSISTENT


@pytest.mark.slow
def test_without_a_gyro_the_direction_of_travel_tells_the_attitude() -> None:
    """A climb that is reported later than the rest is noticed."""
    recording = flown(slope=0.15, wavelength=100.0, later_climb=0.1)
    estimate = estimate_motion(recording, use_gyro=False)
    score = score_motion(estimate.loc[6.0:60.0], recording)
    assert (score["rms"] / score["stated_std"]).drop("velocity").max() < 2.0, score
    assert score.loc["roll", "rms"] < np.radians(5.0) and score.loc["pitch", "rms"] < np.radians(3.5), score
    assert estimate.attrs["climb_delay"] == pytest.approx(0.1, abs=0.05)


def test_the_reference_is_never_used(flight: Recording) -> None:
    spoiled = replace(flight, reference=flight.reference * 0 + 1.0)
    for method in ("epoch", "window"):
        a, b = estimate_motion(flight, method=method), estimate_motion(spoiled, method=method)
        pd.testing.assert_frame_equal(a, b, check_exact=True)


def test_the_epoch_method_needs_no_gyro(flight: Recording) -> None:
    without = replace(flight, imu=flight.imu[["ax", "ay", "az"]])
    pd.testing.assert_frame_equal(
        estimate_motion(flight, method="epoch"), estimate_motion(without, method="epoch"), check_exact=True
    )


@pytest.mark.parametrize("method", MOTION_METHODS)
def test_what_is_missing_is_named(flight: Recording, method: str) -> None:
    with pytest.raises(ValueError, match=r"'flight' has no GNSS velocities"):
        estimate_motion(replace(flight, gnss=None), method=method)


def test_options_are_checked(flight: Recording) -> None:
    with pytest.raises(ValueError, match="method must be one of epoch, window, batch, got 'ekf'"):
        estimate_motion(flight, method="ekf")
    with pytest.raises(ValueError, match="wind must be True, False"):
        estimate_motion(flight, wind="some")
    late = replace(flight, gnss=flight.gnss.set_index(flight.gnss.index + 500.0))
    with pytest.raises(ValueError, match="are the streams on one clock"):
        estimate_motion(late, method="window")
