"""Preintegrated readings against strapdown integration, and their derivatives against differentiation."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from altijax.motion_estimate import preintegration
from altijax.rotations import matrix_to_rotvec, rotvec_to_matrix

relative_attitudes, preintegrate = jax.jit(preintegration.relative_attitudes), jax.jit(preintegration.preintegrate)
STEPS, DT = 40, 0.025
LENGTHS = np.full(STEPS, DT)
RNG = np.random.default_rng(3)
F_B = np.array([0.5, -0.3, 9.8]) + np.cumsum(0.2 * RNG.normal(size=(STEPS, 3)), 0)
W_B = np.cumsum(0.05 * RNG.normal(size=(STEPS, 3)), 0)


def gained(gyro: jax.Array, bias: jax.Array, turn: jax.Array, more: jax.Array) -> tuple[jax.Array, jax.Array]:
    w_b, f_b = W_B + W_B @ gyro[3:].reshape(3, 3).T - gyro[:3], F_B + F_B @ more.T - bias
    C = relative_attitudes(w_b, LENGTHS)
    whole = preintegrate(f_b, w_b, C, turn, LENGTHS)
    return whole.C[-1], whole.velocity[-1]


def test_a_constant_rate_is_a_rotation_by_its_angle() -> None:
    rate = np.array([0.4, -1.0, 0.7])
    C = relative_attitudes(np.tile(rate, (STEPS, 1)), LENGTHS)
    expected = [Rotation.from_rotvec(rate * DT * (k + 1)).as_matrix() for k in range(STEPS)]
    np.testing.assert_allclose(C, expected, atol=1e-13)


def test_a_constant_force_is_turned_with_the_body() -> None:
    """About z: the integral of (cos wt, sin wt) f is (sin wT, 1 - cos wT) f / w."""
    rate, T = 0.8, STEPS * DT
    w_b, f_b = np.tile([0.0, 0.0, rate], (STEPS, 1)), np.tile([2.0, 0.0, 0.0], (STEPS, 1))
    velocity = preintegrate(f_b, w_b, relative_attitudes(w_b, LENGTHS), np.zeros(3), LENGTHS).velocity[-1]
    np.testing.assert_allclose(velocity, [2 * np.sin(rate * T) / rate, 2 * (1 - np.cos(rate * T)) / rate, 0], atol=5e-5)


def test_derivatives_are_those_of_differentiation() -> None:
    """To the size of the step, which is neglected within a step."""
    whole = preintegrate(F_B, W_B, relative_attitudes(W_B, LENGTHS), np.zeros(3), LENGTHS)
    C_end = whole.C[-1]
    zeros = jnp.zeros(12), jnp.zeros(3), jnp.zeros(3), jnp.zeros((3, 3))

    def ends(*changes: jax.Array) -> tuple[jax.Array, jax.Array]:
        C, velocity = gained(*changes)
        return matrix_to_rotvec(C @ C_end.T), velocity

    turned, moved = jax.jit(jax.jacfwd(ends, argnums=(0, 1, 2, 3)))(*zeros)
    np.testing.assert_allclose(whole.turn_by_gyro, turned[0], atol=2e-3)
    by_gyro, by_bias, by_turn, by_matrix = moved
    np.testing.assert_allclose(whole.velocity_by_gyro, by_gyro, atol=2e-2)
    np.testing.assert_allclose(whole.velocity_by_bias, by_bias, atol=1e-12)
    np.testing.assert_allclose(whole.velocity_by_turn, by_turn, atol=1e-12)
    np.testing.assert_allclose(whole.velocity_by_matrix, by_matrix, atol=1e-12)


def test_the_turn_ends_where_it_should() -> None:
    turn = np.array([0.02, -0.3, 0.1])
    C = relative_attitudes(W_B, LENGTHS)
    whole = preintegrate(F_B, W_B, C, turn, LENGTHS)
    np.testing.assert_allclose(whole.C[-1], rotvec_to_matrix(turn) @ C[-1], atol=1e-13)
