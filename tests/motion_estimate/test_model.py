"""The linear model of errors against the nonlinear motion it comes from."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.motion_estimate.model import (
    STATES,
    Gains,
    Intervals,
    MotionNoise,
    Trajectory,
    interval_gains,
    motion_measurements,
    motion_transitions,
    moved,
    preintegrated_intervals,
)
from altijax.rotations import euler_to_matrix

GRAVITY, STEPS = 9.81, 50
RNG = np.random.default_rng(5)


def interval() -> tuple[Trajectory, Intervals]:
    """One second of turning readings, and a trajectory that obeys them."""
    intervals = Intervals(
        f_b=jnp.asarray([[0.5, 1.0, 9.5] + 0.5 * RNG.normal(size=(STEPS, 3))]),
        w_b=jnp.asarray([[0.1, -0.05, 0.3] + 0.1 * RNG.normal(size=(STEPS, 3))]),
        dt=jnp.full((1, STEPS), 1 / STEPS),
        duration=jnp.ones(1),
        gap=jnp.zeros(1),
    )
    C = euler_to_matrix(jnp.array([0.3, 0.1, 2.0]))
    trajectory = Trajectory(
        C_nb=jnp.stack([C, C]),
        v_n=jnp.tile(jnp.array([10.0, 5.0, 0.0]), (2, 1)),
        accelerometer_bias=jnp.full((2, 3), 0.02),
        gyro_bias=jnp.full((2, 3), -0.01),
        slip=jnp.array([0.1, -0.05]) * jnp.exp(-jnp.arange(2.0) / MotionNoise().slip_time)[:, None],
        constants=jnp.array([0.02, 0.0, -0.03, 0.1, 0.07, 3.0, -2.0, 0.1]),
    )
    return obeying(trajectory, intervals), intervals


def gains(trajectory: Trajectory, intervals: Intervals) -> Gains:
    return interval_gains(trajectory.C_nb[:-1], *preintegrated_intervals(trajectory, intervals), intervals)


def obeying(trajectory: Trajectory, intervals: Intervals) -> Trajectory:
    """The second instant moved to where the readings lead from the first."""
    pre, miss = preintegrated_intervals(trajectory, intervals)
    C = trajectory.C_nb[0] @ pre.C[0, -1]
    for _ in range(3):  # the spread of the miss depends on the end
        trajectory = replace(trajectory, C_nb=jnp.stack([trajectory.C_nb[0], C]))
        pre, miss = preintegrated_intervals(trajectory, intervals)
        x = jnp.zeros((2, STATES)).at[1, :3].set(-miss[0])
        C = moved(trajectory, x).C_nb[1]
    v = trajectory.v_n[0] + trajectory.C_nb[0] @ pre.velocity[0, -1] - jnp.array([0, 0, GRAVITY])
    return replace(trajectory, v_n=jnp.stack([trajectory.v_n[0], v]))


def test_a_trajectory_that_obeys_its_readings_misses_nothing() -> None:
    trajectory, intervals = interval()
    _, c, _ = motion_transitions(trajectory, gains(trajectory, intervals), MotionNoise(), GRAVITY)
    np.testing.assert_allclose(c, 0, atol=1e-10)


def test_transition_carries_small_errors_as_the_motion_does() -> None:
    """Errors of the first instant, led to the second by the readings, arrive there as F says, to second order."""
    trajectory, intervals = interval()
    F, _, _ = motion_transitions(trajectory, gains(trajectory, intervals), MotionNoise(), GRAVITY)
    x = 1e-4 * RNG.normal(size=STATES)
    both = jnp.stack([jnp.asarray(x), jnp.asarray(np.r_[np.zeros(6), x[6:]])])
    led = obeying(moved(trajectory, both), intervals)
    ended = replace(led, C_nb=led.C_nb.at[1].set(trajectory.C_nb[1]), v_n=led.v_n.at[1].set(trajectory.v_n[1]))
    _, c, _ = motion_transitions(ended, gains(ended, intervals), MotionNoise(), GRAVITY)
    expected = (F[0] @ x)[:6]
    np.testing.assert_allclose(led.v_n[1] - trajectory.v_n[1], expected[3:], atol=3e-6)
    np.testing.assert_allclose(c[0, :3], expected[:3], atol=3e-6)
    assert np.linalg.norm(expected[:3]) > 5e-5 and np.linalg.norm(expected[3:]) > 5e-5


def test_measurements_miss_by_what_the_errors_predict() -> None:
    trajectory, _ = interval()
    x = 1e-5 * RNG.normal(size=(2, STATES))
    x[0, 12:20] = x[1, 12:20]
    true = moved(trajectory, x)
    variance = jnp.ones((2, 3)).at[1, 2].set(jnp.inf)
    climbing = jnp.array([2.0, -1.0])
    z, H, R = motion_measurements(trajectory, true.v_n, variance, jnp.full(2, 0.01), climbing)
    z_true, _, _ = motion_measurements(true, true.v_n, variance, jnp.full(2, 0.01), climbing)
    np.testing.assert_allclose(z - jnp.einsum("tij,tj->ti", H, x), z_true, atol=1e-8)
    assert float(R[1, 2]) == 1.0 and not H[1, 2].any() and float(z[1, 2]) == 0.0


def test_late_vertical_velocities_are_those_of_a_moment_ago() -> None:
    trajectory, _ = interval()
    climbing = jnp.array([2.0, -1.0])
    earlier = trajectory.v_n.at[:, 2].add(-trajectory.constants[7] * climbing)
    z, _, _ = motion_measurements(trajectory, earlier, jnp.ones((2, 3)), jnp.full(2, jnp.inf), climbing)
    np.testing.assert_allclose(z, 0, atol=1e-12)


@pytest.mark.parametrize("bank", [0.0, 1.0])
def test_slips_are_angles_of_the_body(bank: float) -> None:
    """Body x points left of the way through the air by yaw and above it by pitch, in the body's own axes."""
    trajectory, _ = interval()
    yaw, pitch = np.asarray(trajectory.slip[0] + trajectory.constants[3:5])
    in_body = np.array([np.cos(pitch) * np.cos(yaw), -np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    C = np.asarray(euler_to_matrix(jnp.array([bank, 0.2, 2.0])))
    v = 15.0 * C @ in_body + np.append(trajectory.constants[5:7], 0.0)
    trajectory = replace(
        trajectory,
        C_nb=jnp.stack([jnp.asarray(C)] * 2),
        v_n=jnp.stack([jnp.asarray(v)] * 2),
        slip=jnp.stack([trajectory.slip[0]] * 2),
    )
    z, _, _ = motion_measurements(trajectory, trajectory.v_n, jnp.ones((2, 3)), jnp.full(2, 0.01), jnp.zeros(2))
    np.testing.assert_allclose(z[:, 3:], 0, atol=1e-12)
