"""Gauss-Newton on a whole record: where it ends, its error bars against many simulated records, its likelihood."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.intervals import MotionReadings, instants_at
from altijax.motion_estimate.model import MotionNoise, Trajectory
from altijax.motion_estimate.readings import motion_readings
from altijax.motion_estimate.smoother import MotionFit, MotionPrior, motion_between_by_delay, motion_pass
from altijax.motion_estimate.start import window_attitudes
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix, matrix_to_rotvec

GRAVITY, RATE = 9.80665, 25.0
NOISE = MotionNoise(rotation=0.01, acceleration=0.05, gyro_walk=1e-6, accelerometer_walk=1e-6)
STD = [2.0] * 3 + [100.0] * 3 + [0.05] * 3 + [0.03] * 3 + [0.0] * 10


def truth(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Attitude, velocity, force and rate of a banked circle with a changing speed."""
    yaw_rate, bank = 0.5, 0.4
    speed, rise = 10 + 3 * np.sin(0.6 * t), 1.8 * np.cos(0.6 * t)
    yaw = yaw_rate * t + 1.0
    along, left = np.stack([np.cos(yaw), np.sin(yaw), 0 * t], -1), np.stack([-np.sin(yaw), np.cos(yaw), 0 * t], -1)
    a = rise[:, None] * along + (speed * yaw_rate)[:, None] * left
    C = np.asarray(euler_to_matrix(np.stack([np.full_like(t, bank), 0 * t, yaw], -1)))
    f = np.einsum("tji,tj->ti", C, a + np.array([0, 0, GRAVITY]))
    w = np.tile([0.0, yaw_rate * np.sin(bank), yaw_rate * np.cos(bank)], (t.size, 1))
    return C, speed[:, None] * along, f, w


def simulated(seed: int) -> tuple[MotionReadings, np.ndarray]:
    """Readings with noise and biases drawn from what the model believes."""
    rng = np.random.default_rng(seed)
    t, epochs = np.arange(0, 20, 1 / RATE), np.arange(0.5, 19.5, 1.0)
    _, _, f, w = truth(t)
    bias = np.r_[0.05 * rng.normal(size=3), 0.03 * rng.normal(size=3)]
    f = f + bias[:3] + 0.05 * np.sqrt(RATE) * rng.normal(size=f.shape)
    w = w + bias[3:] + 0.01 * np.sqrt(RATE) * rng.normal(size=w.shape)
    imu = pd.DataFrame(np.c_[f, w], columns=["ax", "ay", "az", "gx", "gy", "gz"], index=t)
    v = truth(epochs)[1] + 0.1 * rng.normal(size=(epochs.size, 3))
    gnss = pd.DataFrame(v, columns=["v_e", "v_n", "v_u"], index=epochs)
    return motion_readings(Recording(imu=imu, gnss=gnss), use_gyro=True, delay=0.0), bias


between, one_pass = jax.jit(motion_between_by_delay), jax.jit(motion_pass)


def run(
    readings: MotionReadings,
    trajectory: Trajectory,
    noise: MotionNoise,
    delay: jax.Array,
    doubt: jax.Array | float = 1.0,
) -> MotionFit:
    doubt = jnp.broadcast_to(jnp.asarray(doubt, readings.std.dtype), readings.std.shape)
    prior = MotionPrior(covariance=jnp.diag(jnp.array(STD) ** 2), doubt=doubt, course=jnp.zeros(()))
    return one_pass(readings, trajectory, prior, noise, *between(readings, trajectory, delay))


def solved(readings: MotionReadings) -> tuple:
    trajectory, _, _ = start(readings)
    noise = jax.tree.map(jnp.asarray, NOISE)
    doubt = jnp.ones_like(readings.std)
    for k in range(12):
        fit = run(readings, trajectory, noise, jnp.zeros(()), doubt)
        trajectory = fit.trajectory
        # Doubts begin where the passes have come near.
        doubt = fit.doubt if k > 4 else doubt
    return fit, noise


def start(readings: MotionReadings) -> tuple:
    return window_attitudes(readings, 0.0, 2.0, 9, gyro=True)


@pytest.mark.slow
def test_windows_come_near_and_passes_end() -> None:
    readings, _ = simulated(0)
    C = truth(np.asarray(instants_at(readings, jnp.zeros(()))))[0]
    trajectory, _, _ = start(readings)
    fit, _ = solved(readings)
    before = np.linalg.norm(matrix_to_rotvec(trajectory.C_nb @ np.swapaxes(C, -1, -2)), axis=-1)
    after = np.linalg.norm(matrix_to_rotvec(fit.trajectory.C_nb @ np.swapaxes(C, -1, -2)), axis=-1)
    seen = np.isfinite(np.asarray(readings.std)[:, 0])
    assert before[seen].max() < 0.5 and after.max() < 0.06
    assert float(fit.step) < 1e-6


def test_errors_have_the_size_of_their_bars() -> None:
    """Normalised errors squared of attitude, velocity and biases in mid-record, over simulated records: 12 each."""
    squares = []
    for seed in range(8):
        readings, bias = simulated(seed)
        fit, _ = solved(readings)
        t = np.asarray(instants_at(readings, jnp.zeros(())))
        C, v, _, _ = truth(t)
        k = 10
        error = np.r_[
            matrix_to_rotvec(C[k] @ np.asarray(fit.trajectory.C_nb)[k].T),
            v[k] - np.asarray(fit.trajectory.v_n)[k],
            bias[:3] - np.asarray(fit.trajectory.accelerometer_bias)[k],
            bias[3:] - np.asarray(fit.trajectory.gyro_bias)[k],
        ]
        squares.append(error @ np.linalg.solve(np.asarray(fit.covariance)[k][:12, :12], error))
    # The mean of 8 chi-squares of 12 degrees has a standard deviation of 1.7.
    assert 6.9 < np.mean(squares) < 17.1, squares


@pytest.mark.slow
def test_the_likelihood_has_its_gradient() -> None:
    readings, _ = simulated(1)
    fit, noise = solved(readings)
    trajectory, h = fit.trajectory, 1e-5

    def at(noise: MotionNoise, delay: float) -> float:
        return float(run(readings, trajectory, noise, jnp.asarray(delay), 1.0).log_likelihood)

    fit = run(readings, trajectory, noise, jnp.zeros(()), 1.0)
    by_delay = (at(noise, h) - at(noise, -h)) / (2 * h)
    assert float(fit.by_delay) == pytest.approx(by_delay, rel=1e-4, abs=1e-3)
    h = 1e-3  # a smaller one drowns in the rounding of the likelihood
    for name in ("rotation", "acceleration", "horizontal", "vertical"):
        x = float(getattr(noise, name))
        more, less = (replace(noise, **{name: jnp.asarray(x * factor)}) for factor in (1 + h, 1 - h))
        slope = (at(more, 0.0) - at(less, 0.0)) / (2 * h * x)
        assert float(getattr(fit.by_noise, name)) == pytest.approx(slope, rel=1e-4, abs=1e-3), name


def test_an_outlier_is_doubted_and_nothing_else() -> None:
    readings, _ = simulated(2)
    k = int(np.flatnonzero(np.isfinite(np.asarray(readings.std)[:, 0]))[9])
    spoiled = replace(
        readings,
        v_gnss=readings.v_gnss
        + 5.0 * ((np.arange(readings.instant.size) == k)[:, None] & np.array([False, True, False])),
    )
    fit, _ = solved(spoiled)
    doubted = np.argwhere(np.asarray(fit.doubt) > 1)
    assert [k, 1] in doubted.tolist() and len(doubted) <= 3
    assert abs(float(fit.surprise[k, 1])) > 10


def test_steps_between_join_the_instants() -> None:
    readings, _ = simulated(3)
    fit, _ = solved(readings)
    steps, _ = between(readings, fit.trajectory, jnp.zeros(()))
    t, C, v = steps.t, steps.C_nb, steps.v_n
    np.testing.assert_allclose(C[:, -1], fit.trajectory.C_nb[1:], atol=1e-10)
    np.testing.assert_allclose(v[:, -1], fit.trajectory.v_n[1:], atol=1e-10)
    assert np.abs(np.asarray(v) - truth(np.asarray(t).ravel())[1].reshape(v.shape)).max() < 0.4
