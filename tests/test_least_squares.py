"""Levenberg-Marquardt against scipy, on full-rank, rank-deficient and hopeless problems."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from altijax.least_squares import CONVERGED, NOT_FINITE, STEPS_USED_UP, levenberg_marquardt

T = jnp.linspace(0, 4, 40)
DATA = 2.5 * jnp.exp(-1.3 * T) + 0.5 + 0.01 * jnp.asarray(np.random.default_rng(0).normal(size=40))


def exponential(x: jax.Array) -> jax.Array:
    return x[0] * jnp.exp(-x[1] * T) + x[2] - DATA


def test_minimum_and_covariance_are_scipys() -> None:
    fit = jax.jit(lambda x0: levenberg_marquardt(exponential, x0))(jnp.array([1.0, 1.0, 0.0]))
    expected = least_squares(
        lambda x: np.asarray(exponential(jnp.asarray(x))), [1.0, 1.0, 0.0], xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    assert (fit.status, fit.rank) == (CONVERGED, 3)
    np.testing.assert_allclose(fit.x, expected.x, atol=1e-8)
    np.testing.assert_allclose(fit.cost, 2 * expected.cost, rtol=1e-12)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(expected.jac.T @ expected.jac), rtol=1e-5)


def test_curved_valley() -> None:
    """Rosenbrock's, from his starting point."""
    fit = levenberg_marquardt(lambda x: jnp.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), [-1.2, 1.0])
    np.testing.assert_allclose(fit.x, [1, 1], atol=1e-9)
    assert fit.status == CONVERGED


def test_linear_problem_is_solved_to_rounding() -> None:
    A = np.random.default_rng(1).normal(size=(7, 2))
    b = np.arange(7.0)
    fit = levenberg_marquardt(lambda x: A @ x - b, jnp.zeros(2))
    np.testing.assert_allclose(fit.x, np.linalg.lstsq(A, b)[0], atol=1e-12)


def test_undetermined_direction_stays_and_is_reported() -> None:
    fit = levenberg_marquardt(lambda x: jnp.array([x[0] + x[1] - 3.0, 2 * (x[0] + x[1]) - 6.0]), [5.0, -1.0])
    np.testing.assert_allclose(fit.x, [4.5, -1.5], atol=1e-7)
    assert (fit.rank, fit.status) == (1, CONVERGED)
    blind = np.array([1.0, -1.0]) / np.sqrt(2)
    assert blind @ fit.covariance @ blind > 1e10
    assert np.isfinite(fit.covariance).all()


def test_batch_under_vmap_is_the_loop() -> None:
    starts = jnp.array([[1.0, 1.0, 0.0], [2.0, 2.0, 1.0], [3.0, 0.5, 0.2], [1.0, 3.0, 0.0], [4.0, 1.0, 0.0]])
    batch = jax.vmap(lambda x0: levenberg_marquardt(exponential, x0))(starts)
    for i in range(5):
        np.testing.assert_allclose(batch.x[i], levenberg_marquardt(exponential, starts[i]).x, atol=1e-9)


def test_failure_is_data() -> None:
    assert levenberg_marquardt(lambda x: x / 0.0, [1.0]).status == NOT_FINITE
    assert levenberg_marquardt(exponential, [1.0, 1.0, 0.0], max_steps=1).status == STEPS_USED_UP
    # a step into the undefined is rejected, not taken
    fit = levenberg_marquardt(lambda x: jnp.log(x) + 2.0, [1.0])
    np.testing.assert_allclose(fit.x, np.exp(-2.0), rtol=1e-8)


def test_start_must_be_a_vector() -> None:
    with pytest.raises(ValueError, match=r"x0 must have shape \(any,\), got \(\)"):
        levenberg_marquardt(lambda x: x, 0.0)
