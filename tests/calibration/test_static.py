"""Static procedures recover the sensors that `altijax.sensors` simulates, with intervals that hold the truth."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from altijax.calibration.static import (
    fit_accelerometer_positions,
    fit_accelerometer_temperature,
    fit_gyro_at_rest,
    fit_gyro_temperature,
)
from altijax.sensors import (
    Accelerometer,
    Gyro,
    accelerometer_output,
    correct_accelerometer,
    correct_gyro,
    gyro_output,
)

fit_positions = jax.jit(fit_accelerometer_positions, static_argnames="model")
fit_temperature = jax.jit(fit_accelerometer_temperature)

GRAVITY = 9.81
FACES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1], [-1, 1, 0], [1, 0, -1], [0, -1, 1]]) / 2**0.5
ACCELEROMETER = Accelerometer(
    bias=jnp.array([0.3, -0.2, 0.1]),
    scale=jnp.array([1.01, 0.985, 1.02]),
    misalignment=jnp.array([0.0, 0.0, 0.01, 0.0, -0.015, 0.02]),
)


def positions(directions: np.ndarray, noise: float = 0.0, seed: int = 0) -> jax.Array:
    ideal = accelerometer_output(ACCELEROMETER, GRAVITY * directions, 1.0, key=jax.random.key(0))
    return ideal + noise * np.random.default_rng(seed).normal(size=directions.shape)


def test_positions_recover_the_sensor_whatever_their_orientation() -> None:
    turned = np.concatenate([FACES, EDGES]) @ Rotation.from_euler("xyz", [20, 30, 40], degrees=True).as_matrix().T
    fit = fit_positions(positions(turned), GRAVITY, 0.01)
    for name in ("bias", "scale", "misalignment"):
        np.testing.assert_allclose(getattr(fit.sensor, name), getattr(ACCELEROMETER, name), atol=1e-10)
    assert fit.rank == 9 and fit.misfit < 1e-6
    other = np.array([[0.3, -0.5, np.sqrt(0.66)]])
    corrected = correct_accelerometer(fit.sensor, positions(other))
    np.testing.assert_allclose(corrected, GRAVITY * other, atol=1e-9)


def test_minimum_and_covariance_are_scipys() -> None:
    f_mean = np.asarray(positions(np.concatenate([FACES, EDGES]), 0.01))
    fit = jax.jit(partial(fit_accelerometer_positions, f_std=0.01))(f_mean, GRAVITY)

    def residual(x: np.ndarray) -> np.ndarray:
        lower = np.eye(3)
        lower[[1, 2, 2], [0, 0, 1]] = x[6:]
        f_b = np.linalg.solve(lower, (f_mean / (1 + x[3:6]) - x[:3]).T)
        return (np.linalg.norm(f_b, axis=0) - GRAVITY) / 0.01

    best = least_squares(residual, np.zeros(9), xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac")
    found = np.concatenate([fit.sensor.bias, fit.sensor.scale - 1, np.asarray(fit.sensor.misalignment)[[2, 4, 5]]])
    np.testing.assert_allclose(found, best.x, atol=1e-7)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(best.jac.T @ best.jac), rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(fit.jacobian, best.jac, rtol=1e-4, atol=1e-3)
    assert fit.misfit == pytest.approx(np.sqrt(2 * best.cost / 3), rel=1e-6)


def test_intervals_hold_the_truth() -> None:
    directions = np.concatenate([FACES, EDGES])
    noisy = jnp.stack([positions(directions, 0.01, seed) for seed in range(400)])
    fit = jax.jit(jax.vmap(lambda f: fit_accelerometer_positions(f, GRAVITY, 0.01)))(noisy)
    for name in ("bias", "scale"):
        inside = np.abs(getattr(fit.sensor, name) - getattr(ACCELEROMETER, name)) < 1.96 * getattr(fit.std, name)
        assert np.all((inside.mean(0) > 0.92) & (inside.mean(0) < 0.98)), name
    assert np.mean(np.square(fit.misfit)) == pytest.approx(1, abs=0.15)


def test_what_few_positions_leave_open_stays_nominal_and_is_said() -> None:
    fit = fit_positions(positions(FACES), GRAVITY, 0.01)
    assert fit.rank == 6
    assert np.asarray(fit.std.misalignment)[[2, 4, 5]].max() > 100 * np.max(fit.std.bias)
    assert fit.misfit == 0
    six = fit_positions(positions(FACES), GRAVITY, 0.01, model="bias and scale")
    assert six.rank == 6
    # faces see the misalignment in second order only
    np.testing.assert_allclose(six.sensor.bias, ACCELEROMETER.bias, atol=0.01)
    np.testing.assert_array_equal(six.std.misalignment, 0)
    left_out = fit_positions(
        jnp.concatenate([positions(FACES), jnp.ones((6, 3))]), GRAVITY, jnp.array([0.01] * 6 + [jnp.inf] * 6)
    )
    np.testing.assert_allclose(left_out.sensor.bias, fit.sensor.bias, atol=1e-9)


def test_derivatives_are_those_of_the_minimum() -> None:
    f_mean = positions(np.concatenate([FACES, EDGES]), 0.01)

    def bias(gravity: jax.Array, f_mean: jax.Array) -> jax.Array:
        return fit_accelerometer_positions(f_mean, gravity, 0.01).sensor.bias[0]

    by_gravity, by_reading = jax.jit(jax.grad(bias, (0, 1)))(GRAVITY, f_mean)
    step = 1e-4
    f = jax.jit(bias)
    assert by_gravity == pytest.approx(
        float(f(GRAVITY + step, f_mean) - f(GRAVITY - step, f_mean)) / (2 * step), rel=1e-4
    )
    up, down = (f(GRAVITY, f_mean.at[1, 0].add(s)) for s in (step, -step))
    assert by_reading[1, 0] == pytest.approx(float(up - down) / (2 * step), rel=1e-4, abs=1e-8)


def test_model_must_be_known() -> None:
    with pytest.raises(ValueError, match="model must be one of 'bias'"):
        fit_accelerometer_positions(positions(FACES), GRAVITY, 0.01, "scale")
    with pytest.raises(ValueError, match="degree must be 1 or more, got 0"):
        fit_gyro_temperature(jnp.zeros((9, 3)), jnp.zeros(9), degree=0)


def test_gyro_bias_at_rest() -> None:
    bias = jnp.array([0.01, -0.02, 0.005])
    gyro = Gyro(bias=bias, noise_density=1e-3, bandwidth=2.0)  # correlated over many samples
    still = jnp.zeros((4000, 3))
    keys = jax.random.split(jax.random.key(0), 300)
    readings = jax.jit(jax.vmap(lambda key: gyro_output(gyro, still, still, 0.01, key=key)))(keys)
    fit = jax.jit(jax.vmap(fit_gyro_at_rest))(readings)
    inside = np.mean(np.abs(fit.sensor.bias - bias) < 1.96 * fit.std.bias)
    assert 0.92 < inside < 0.97
    assert np.mean(fit.std.bias) == pytest.approx(np.std(np.asarray(fit.sensor.bias), 0).mean(), rel=0.1)
    one = jax.tree.map(lambda leaf: leaf[0] if jnp.ndim(leaf) else leaf, fit.sensor)
    assert np.abs(np.mean(correct_gyro(one, readings[0], still), 0)).max() < 1e-15


SWEEP = jnp.linspace(-10, 50, 3000)


def test_gyro_temperature() -> None:
    gyro = Gyro(
        bias=jnp.array([0.01, 0.0, -0.01]),
        bias_temperature=jnp.array([[1e-4, -2e-4, 0.0], [1e-6, 0, 2e-6]]),
        reference_temperature=20.0,
        noise_density=2e-4,
    )
    still = jnp.zeros((3000, 3))
    keys = jax.random.split(jax.random.key(1), 60)
    readings = jax.jit(jax.vmap(lambda key: gyro_output(gyro, still, still, 0.1, SWEEP, key=key)))(keys)
    fit = jax.jit(jax.vmap(lambda w: fit_gyro_temperature(w, SWEEP, 20.0, 2)))(readings)
    for name in ("bias", "bias_temperature"):
        inside = np.abs(getattr(fit.sensor, name) - getattr(gyro, name)) < 1.96 * getattr(fit.std, name)
        assert 0.9 < inside.mean() < 0.985, name


def test_accelerometer_temperature() -> None:
    accelerometer = replace(
        ACCELEROMETER,
        misalignment=0.0,
        bias_temperature=jnp.array([[2e-3, 0, -1e-3]]),
        scale_temperature=jnp.array([[1e-4, -2e-4, 0]]),
    )
    each = SWEEP.reshape(6, 500)
    temperature = jnp.concatenate([each[i % 6] for i in range(0, 30, 5)] + [each[5 - i] for i in range(6)])
    f_b = jnp.repeat(GRAVITY * jnp.concatenate([FACES, FACES]), 500, 0)
    measured = accelerometer_output(accelerometer, f_b, 0.1, temperature, key=jax.random.key(0))
    fit = fit_temperature(measured, f_b, temperature)
    for name in ("bias", "scale", "bias_temperature", "scale_temperature"):
        np.testing.assert_allclose(getattr(fit.sensor, name), getattr(accelerometer, name), atol=1e-8)
    np.testing.assert_allclose(correct_accelerometer(fit.sensor, measured, temperature), f_b, atol=1e-6)
    assert fit.rank == 12
    up_only = f_b[:, 2] > 0
    few = fit_temperature(measured[up_only], f_b[up_only], temperature[up_only])
    assert few.rank < 12
