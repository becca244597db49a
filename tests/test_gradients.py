"""Estimates as functions of constants: equal to the verbs', with the derivatives that differences have."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from altijax.elevation_estimate.estimates import estimate_elevation, score_elevation
from altijax.gradients import DIFFERENTIABLE, differentiable, sensitivity
from tests.exact import EXACT

BIASED = replace(EXACT, imu=EXACT.imu + np.array([0.05, 0.03, -0.02, 0.0, 0.001, 0.0]))
# Some of each method, off nominal.
CONSTANTS = {
    "slope": {"accelerometer_bias_x": 0.02, "wheel_scale": 1.01, "mounting_pitch": 0.01},
    "shirai": {"accelerometer_bias_z": 0.01, "yaw_rate_bias": 0.001},
    "conventional": {"accelerometer_bias_x": 0.02, "gyro_bias_y": 0.0004, "initial_speed": 0.1},
    "roll": {"accelerometer_bias_y": 0.02, "gyro_scale_y": 1.01, "mounting_yaw": 0.002},
    "aided": {"accelerometer_bias_x": 0.02, "wheel_scale": 1.01, "wheel_delay": 0.013, "gyro_bias_z": 0.001},
    "epoch": {"accelerometer_bias_x": 0.02, "accelerometer_scale_z": 1.01, "gnss_delay": 0.03},
}


def score_of(method: str) -> object:
    estimate = differentiable(BIASED, method)
    return lambda constants: estimate(constants)["score"]


def test_every_method_has_its_constants() -> None:
    assert set(CONSTANTS) == set(DIFFERENTIABLE)


@pytest.mark.parametrize("method", ["slope", "shirai"])
def test_an_elevation_is_that_of_the_verb(method: str) -> None:
    expected = estimate_elevation(BIASED, method=method)
    found = differentiable(BIASED, method)({})
    np.testing.assert_allclose(found["elevation"], expected["elevation"], atol=1e-9)
    np.testing.assert_array_equal(found["t"], expected.index)
    assert float(found["score"]) == pytest.approx(score_elevation(expected, BIASED)["rms"], rel=1e-9)


@pytest.mark.parametrize("method", ["conventional", "roll", "aided"])
def test_ideal_sensors_reckon_the_speed(method: str) -> None:
    found = differentiable(EXACT, method)({})
    # Who neglects the roll is wrong in turns.
    assert float(found["score"]) < (15.0 if method == "conventional" else 0.1)
    assert found["speed"].shape == found["t"].shape == (len(EXACT.imu),)
    undone = {"accelerometer_bias_x": 0.05, "accelerometer_bias_y": 0.03, "accelerometer_bias_z": -0.02}
    estimate = differentiable(BIASED, method)
    again = estimate({name: x for name, x in (undone | {"gyro_bias_y": 0.001}).items() if name in estimate.names})
    np.testing.assert_allclose(again["speed"], found["speed"], atol=1e-6)


def test_ideal_epochs_find_the_attitude() -> None:
    found = differentiable(EXACT, "epoch")({})
    assert np.degrees(float(found["score"])) < 5
    undone = {"accelerometer_bias_x": 0.05, "accelerometer_bias_y": 0.03, "accelerometer_bias_z": -0.02}
    again = differentiable(BIASED, "epoch")(undone)
    np.testing.assert_allclose(again["pitch"], found["pitch"], atol=1e-9)


@pytest.mark.parametrize(
    "method",
    ["slope", "roll", *(pytest.param(x, marks=pytest.mark.slow) for x in ("shirai", "conventional", "aided", "epoch"))],
)
def test_gradients_are_those_of_differences(method: str) -> None:
    score, at = score_of(method), CONSTANTS[method]
    slopes = jax.grad(score)(at)
    for name, value in at.items():
        step = 1e-6
        difference = float(score(at | {name: value + step}) - score(at | {name: value - step})) / (2 * step)
        assert float(slopes[name]) == pytest.approx(difference, rel=2e-4, abs=1e-5), name


@pytest.mark.parametrize(
    "method", ["slope", *(pytest.param(x, marks=pytest.mark.slow) for x in ("conventional", "epoch"))]
)
def test_batches_and_curvature(method: str) -> None:
    score, at = score_of(method), CONSTANTS[method]
    name = "accelerometer_bias_x"
    values = np.array([0.0, 0.02, 0.04])
    batch = jax.vmap(lambda x: score(at | {name: x}))(values)
    np.testing.assert_allclose(batch, [score(at | {name: x}) for x in values], rtol=1e-9)
    bend = jax.hessian(score)({name: 0.02})[name][name]
    ahead, behind = (jax.grad(score)({name: 0.02 + step})[name] for step in (1e-5, -1e-5))
    assert float(bend) == pytest.approx(float(ahead - behind) / 2e-5, rel=1e-3, abs=1e-4)


def test_gradients_without_double_precision_set() -> None:
    with jax.enable_x64(False):
        single = jax.grad(score_of("slope"))(CONSTANTS["slope"])
        bend = jax.jacfwd(jax.grad(lambda x: score_of("slope")(CONSTANTS["slope"] | {"accelerometer_bias_x": x})))(0.02)
        assert np.isfinite(bend)
    double = jax.grad(score_of("slope"))(CONSTANTS["slope"])
    for name, slope in double.items():
        assert float(single[name]) == pytest.approx(float(slope), rel=1e-6)


def test_a_table_of_sensitivities() -> None:
    table = sensitivity(BIASED, "slope")
    assert table["effect"].abs().is_monotonic_decreasing
    slopes = jax.grad(score_of("slope"))({"accelerometer_bias_x": 0.0})
    row = table.loc["accelerometer_bias_x"]
    assert row["derivative"] == pytest.approx(float(slopes["accelerometer_bias_x"]))
    assert row["effect"] == pytest.approx(0.3 * row["derivative"]) and row["unit"] == "m/s^2"
    end = sensitivity(BIASED, "slope", score=lambda estimate: estimate["elevation"][-1])
    # A bias b reads as a slope of b / g.
    distance = float(np.trapezoid(BIASED.wheel["speed"], BIASED.wheel.index))
    assert end.loc["accelerometer_bias_x", "derivative"] == pytest.approx(-distance / 9.80665, rel=0.01)
    assert table.loc["wheel_scale", "value"] == 1.0


def test_what_cannot_be_differentiated_is_told() -> None:
    with pytest.raises(ValueError, match="method must be one of slope"):
        differentiable(EXACT, "fused")
    with pytest.raises(ValueError, match="gyro_bias_x: constants of 'slope' are wheel_scale"):
        differentiable(EXACT, "slope")({"gyro_bias_x": 0.0})
    with pytest.raises(ValueError, match="give a score"):
        sensitivity(replace(EXACT, reference=None), "slope")


def test_who_differentiates_a_verb_is_told_what_to_take() -> None:
    def by_readings(bias: jax.Array) -> jax.Array:
        imu = EXACT.imu.astype(object)
        imu["ax"] = [x + bias for x in EXACT.imu["ax"][:3]] + list(EXACT.imu["ax"][3:])
        return estimate_elevation(replace(EXACT, imu=imu))["elevation"].iloc[-1]

    def by_start(speed: jax.Array) -> jax.Array:
        return estimate_elevation(EXACT, method="shirai", initial_vertical_speed=speed)["elevation"].iloc[-1]

    for height in (by_readings, by_start):
        with pytest.raises(TypeError, match=r"altijax\.differentiable\(recording, method\)"):
            jax.grad(height)(0.1)
