"""Strapdown integration against rotations known in closed form, and its order by halving the step."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.strapdown import integrate_attitude, integrate_position, integrate_velocity

GRAVITY = 9.81


def tumbling(n: int, duration: float = 2.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Rate, force, attitude and position of a body that turns about two axes while it flies a curve."""
    t = np.linspace(0, duration, n)
    yaw, roll = 0.9 * t + 0.4 * np.sin(2 * t), 0.5 * np.sin(3 * t)
    yaw_rate, roll_rate = 0.9 + 0.8 * np.cos(2 * t), 1.5 * np.cos(3 * t)
    C = (Rotation.from_euler("z", yaw[:, None]) * Rotation.from_euler("x", roll[:, None])).as_matrix()
    w_b = np.stack([roll_rate, yaw_rate * np.sin(roll), yaw_rate * np.cos(roll)], -1)
    p = np.stack([np.sin(t), t**2, np.cos(2 * t)], -1)
    a = np.stack([-np.sin(t), 2 + 0 * t, -4 * np.cos(2 * t)], -1)
    f_b = np.einsum("tji,tj->ti", C, a + np.array([0, 0, GRAVITY]))
    return w_b, f_b, C, p, t[1]


def flown(n: int) -> tuple[float, float]:
    w_b, f_b, C, p, dt = tumbling(n)
    C_nb = integrate_attitude(w_b, C[0], dt)
    v_n = integrate_velocity(f_b, C_nb, jnp.array([1.0, 0.0, 0.0]), GRAVITY, dt)
    p_n = integrate_position(v_n, p[0], dt)
    turned = Rotation.from_matrix(np.asarray(C_nb[-1]).T @ C[-1]).magnitude()
    return float(turned), float(np.linalg.norm(p_n[-1] - p[-1]))


def test_halving_the_step_quarters_the_errors() -> None:
    coarse, fine = flown(201), flown(401)
    assert 3.5 < coarse[0] / fine[0]
    assert 3.5 < coarse[1] / fine[1] < 4.5
    assert fine[0] < 1e-4 and fine[1] < 1e-3


def test_a_constant_rate_is_exact_for_any_step() -> None:
    rate = np.array([0.3, -2.0, 1.1])
    C0 = Rotation.from_euler("xyz", [0.2, 0.3, -1.0])
    C_nb = integrate_attitude(np.tile(rate, (9, 1)), C0.as_matrix(), 0.7)
    expected = [(C0 * Rotation.from_rotvec(rate * 0.7 * k)).as_matrix() for k in range(9)]
    np.testing.assert_allclose(C_nb, expected, atol=1e-13)


def coning_drift(n: int, cross_term: bool = True) -> float:
    """What is left of the attitude after 20 turns of a cone, which bring it back exactly."""
    cone, frequency = 0.05, 2 * np.pi * 5
    t = np.linspace(0, 4, n)
    tilted, upright = frequency * np.sin(cone), frequency * (1 - np.cos(cone))
    phase = frequency * t
    w_b = np.stack([-tilted * np.sin(phase), tilted * np.cos(phase), np.full(n, -upright)], -1)
    C0 = Rotation.from_rotvec([cone, 0, 0])
    if cross_term:
        end = Rotation.from_matrix(np.asarray(integrate_attitude(w_b, C0.as_matrix(), t[1])[-1]))
    else:
        end = C0
        for turn in t[1] * (w_b[:-1] + w_b[1:]) / 2:
            end = end * Rotation.from_rotvec(turn)
    return float((end * C0.inv()).magnitude())


def test_coning_drifts_in_second_order_and_by_half_of_what_mean_rates_do() -> None:
    assert 3.9 < coning_drift(401) / coning_drift(801) < 4.3
    assert coning_drift(801) < 0.55 * coning_drift(801, cross_term=False)


def test_at_rest_nothing_moves() -> None:
    C0 = Rotation.from_euler("xyz", [0.3, -0.2, 1.0]).as_matrix()
    f_b = np.tile(C0.T @ [0, 0, GRAVITY], (7, 1))
    C_nb = integrate_attitude(np.zeros((7, 3)), C0, 0.1)
    v_n = integrate_velocity(f_b, C_nb, np.zeros(3), GRAVITY, 0.1)
    np.testing.assert_allclose(v_n, 0, atol=1e-14)


def test_the_derivative_by_the_initial_attitude_is_gravity_crossed() -> None:
    """A tilt error leans gravity over: dv = -t g x tilt."""
    f_b = jnp.tile(jnp.array([0.0, 0.0, GRAVITY]), (7, 1))

    def end(angle: jax.Array) -> jax.Array:
        C0 = jnp.eye(3) + jnp.array([[0, 0, 1], [0, 0, 0], [-1, 0, 0]]) * angle
        return integrate_velocity(f_b, integrate_attitude(jnp.zeros((7, 3)), C0, 0.5), jnp.zeros(3), GRAVITY, 0.5)[-1]

    np.testing.assert_allclose(jax.jacfwd(end)(0.0), [3.0 * GRAVITY, 0, 0], atol=1e-12)
    np.testing.assert_allclose(jax.jacrev(end)(0.0), [3.0 * GRAVITY, 0, 0], atol=1e-12)


@pytest.mark.parametrize("batch", [(5,), (2, 5)])
def test_batches_are_the_single_problems(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    w_b = rng.normal(size=(*batch, 7, 3))
    C0 = Rotation.random(int(np.prod(batch)), rng=2).as_matrix().reshape(*batch, 3, 3)
    together = integrate_attitude(w_b, C0, 0.1)
    alone = integrate_attitude(w_b[(-1,) * len(batch)], C0[(-1,) * len(batch)], 0.1)
    assert together.shape == (*batch, 7, 3, 3)
    np.testing.assert_allclose(together[(-1,) * len(batch)], alone, atol=1e-14)


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ValueError, match="w_b must have shape"):
        integrate_attitude(np.zeros((7, 2)), np.eye(3), 0.1)
    with pytest.raises(ValueError, match="C_nb0 must have shape"):
        integrate_attitude(np.zeros((7, 3)), np.eye(2), 0.1)
    with pytest.raises(ValueError, match="C_nb must have shape"):
        integrate_velocity(np.zeros((7, 3)), np.zeros((6, 3, 3)), np.zeros(3), GRAVITY, 0.1)
    with pytest.raises(ValueError, match="v_n must have shape"):
        integrate_position(np.zeros((7, 2)), np.zeros(3), 0.1)
