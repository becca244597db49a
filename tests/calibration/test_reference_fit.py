"""The most probable constants, with the noise that the misfit itself shows."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.calibration.reference_fit import calibration_from, fit_to_reference, stepwise_fit, weighted_fit

PRIOR = pd.DataFrame({"nominal": [1.0, 0.0], "uncertainty": [0.5, 2.0], "unit": "m"}, index=["a", "b"])
T = np.linspace(-1, 1, 400)


def fit(y: np.ndarray, design: np.ndarray) -> object:
    def residuals(x: jax.Array) -> tuple[jax.Array, ...]:
        return ((jnp.asarray(y) - design @ x)[None],)

    solve = jax.jit(lambda x, noise: weighted_fit(residuals, x, noise))
    return fit_to_reference(solve, design.shape[1], residuals(jnp.zeros(design.shape[1])))


def test_white_noise_is_found_and_the_posterior_is_the_linear_one() -> None:
    rng = np.random.default_rng(0)
    design = np.stack([np.ones_like(T), T], -1)
    found = fit(design @ [0.3, -1.0] + 0.2 * rng.normal(size=T.size), design)
    assert found.noise[0] == pytest.approx(0.2, rel=0.15)
    information = design.T @ design / found.noise[0] ** 2 + np.eye(2)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(information), rtol=1e-5, atol=1e-12)
    assert np.abs(found.x - [0.3, -1.0]).max() < 4 * np.sqrt(found.covariance.diagonal().max())


def test_steps_in_numpy_end_where_those_in_jax_do() -> None:
    """On a curved problem with two minima, of which the way decides."""
    rng = np.random.default_rng(3)
    y = 1.5 * T + 0.3 * np.sin(3 * T + 1.0) + 0.05 * rng.normal(size=T.size)

    def residuals(x: jax.Array) -> tuple[jax.Array, ...]:
        return ((jnp.asarray(y) - (x[0] ** 2 + x[1]) * T - x[1] * jnp.sin(3 * T + x[0]))[None],)

    start = [np.asarray(r) for r in residuals(jnp.zeros(2))]
    compiled = fit_to_reference(jax.jit(lambda x, noise: weighted_fit(residuals, x, noise)), 2, start)
    slopes = jax.jit(jax.jacfwd(residuals))

    def linearised(x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(np.asarray(r), np.asarray(J)) for r, J in zip(residuals(x), slopes(x), strict=True)]

    plain = fit_to_reference(partial(stepwise_fit, linearised), 2, start)
    np.testing.assert_allclose(plain.x, compiled.x, atol=1e-7)
    np.testing.assert_allclose(plain.covariance, compiled.covariance, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(plain.noise, compiled.noise, rtol=1e-7)


def test_neighbours_that_go_together_count_as_one() -> None:
    rng = np.random.default_rng(1)
    held = np.repeat(rng.normal(size=T.size // 8), 8)
    found = fit(0.2 * held, np.stack([np.ones_like(T), T], -1))
    assert found.noise[0] == pytest.approx(0.2 * np.sqrt(8), rel=0.3)


def test_what_two_constants_share_is_said() -> None:
    rng = np.random.default_rng(2)
    design = np.stack([T, 4 * T], -1)
    found = fit(design @ [0.5, 0.0] + 0.01 * rng.normal(size=T.size), design)
    record = calibration_from("made", ["a", "b"], found.x, found.covariance, pd.DataFrame(), prior=PRIOR)
    assert record.undetermined[0].startswith("a and b cannot be told apart here; a + b can")
    assert record.values["a"] + record.values["b"] == pytest.approx(1.0 + 0.25, abs=0.01)
    with pytest.raises(ValueError, match="b: changes nothing in method 'made'"):
        calibration_from("made", ["a", "b"], np.zeros(2), np.diag([0.1, 1.0]), pd.DataFrame(), prior=PRIOR)
