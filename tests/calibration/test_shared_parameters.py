"""Shared and own parameters against one dense solve of the same problem, and what robust losses are for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from altijax.calibration.shared_parameters import fit_shared, shared_information

RNG = np.random.default_rng(0)
T = np.linspace(0, 1, 20)
STRETCHES, SHARED_STD, OWN_STD = 7, np.array([2.0, 1.0]), np.array([3.0, 0.5])
OWN = OWN_STD * RNG.normal(size=(STRETCHES, 2))
RATES = RNG.uniform(1, 3, STRETCHES)
TRUTH = np.array([1.4, 0.6])
NOISE = 0.05
CLEAN = TRUTH[0] * np.exp(-TRUTH[1] * RATES[:, None] * T) + OWN[:, :1] + OWN[:, 1:] * T
DATA = {"rate": RATES, "y": CLEAN + NOISE * RNG.normal(size=CLEAN.shape)}


def residual(shared: jax.Array, own: jax.Array, stretch: dict) -> jax.Array:
    model = shared[0] * jnp.exp(-shared[1] * stretch["rate"] * T) + own[0] + own[1] * T
    return (stretch["y"] - model) / NOISE


solve = jax.jit(
    lambda data, loss="squares": fit_shared(
        residual, data, np.ones(2), SHARED_STD, np.zeros((STRETCHES, 2)), OWN_STD, loss
    ),
    static_argnames="loss",
)


def dense(z: np.ndarray) -> np.ndarray:
    shared, own = z[:2], z[2:].reshape(STRETCHES, 2)
    model = shared[0] * np.exp(-shared[1] * RATES[:, None] * T) + own[:, :1] + own[:, 1:] * T
    return np.concatenate([((DATA["y"] - model) / NOISE).ravel(), (shared - 1) / SHARED_STD, (own / OWN_STD).ravel()])


def test_the_same_minimum_and_covariance_as_one_dense_problem() -> None:
    fit = solve(DATA)
    best = least_squares(dense, np.r_[1, 1, np.zeros(2 * STRETCHES)], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert fit.converged
    np.testing.assert_allclose(fit.shared, best.x[:2], atol=1e-5)
    np.testing.assert_allclose(fit.own.ravel(), best.x[2:], atol=1e-5)
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:2, :2]
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-4)
    np.testing.assert_allclose(fit.information, np.linalg.inv(covariance) - np.diag(SHARED_STD**-2.0), rtol=1e-3)
    again = shared_information(residual, DATA, fit.shared, fit.own, OWN_STD)
    np.testing.assert_allclose(again, fit.information, rtol=1e-8)
    assert fit.nis == pytest.approx(2 * best.cost / DATA["y"].size)
    assert 0.6 < fit.nis < 1.3


def test_robust_losses_pass_over_outliers() -> None:
    spoilt = {"rate": RATES, "y": DATA["y"] + np.where(RNG.random(CLEAN.shape) < 0.1, 3.0, 0.0)}
    clean = solve(DATA)
    std = np.sqrt(np.diag(clean.covariance))
    fits = {loss: solve(spoilt, loss) for loss in ("squares", "huber", "cauchy")}
    off = {loss: np.max(np.abs(fit.shared - TRUTH) / std) for loss, fit in fits.items()}
    assert off["cauchy"] < min(3, off["squares"])
    # an outlier of 60 standard deviations counts no more than one of the tuning constant
    hit = np.abs(spoilt["y"] - CLEAN) > 1
    assert np.max(fits["huber"].weights[hit]) < 0.1 and np.max(fits["cauchy"].weights[hit]) < 0.01
    assert np.median(fits["cauchy"].weights[~hit]) > 0.8
    assert np.all(fits["squares"].weights == 1)
    np.testing.assert_allclose(solve(DATA, "huber").shared, clean.shared, atol=float(std.max()))


def test_fixed_parameters_stay() -> None:
    fit = fit_shared(residual, DATA, TRUTH, np.zeros(2), np.zeros((STRETCHES, 2)), OWN_STD)
    np.testing.assert_array_equal(fit.shared, TRUTH)
    np.testing.assert_array_equal(fit.covariance, 0)


def test_loss_must_be_known() -> None:
    with pytest.raises(ValueError, match="loss must be one of squares, huber, cauchy, got 'l1'"):
        fit_shared(residual, DATA, TRUTH, SHARED_STD, np.zeros((STRETCHES, 2)), OWN_STD, "l1")
