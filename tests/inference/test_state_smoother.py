"""Kalman filter and smoother against one dense Gaussian, and the likelihood's gradient against differentiation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from altijax.inference.state_smoother import adjoint_states, filter_states, likelihood_gradients, smooth_states

T, N, ROWS = 6, 4, 2
NAMES = ("F", "c", "Q", "z", "H", "R", "x0", "P0")


@pytest.fixture(scope="module")
def model() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(T - 1, N, N))
    root[:, :, 3] = root[:, 3] = 0.0  # the last state is a constant
    F = 0.5 * rng.normal(size=(T - 1, N, N))
    F[:, 3] = [0, 0, 0, 1]
    c = rng.normal(size=(T - 1, N)) * [1, 1, 1, 0]
    H, z = rng.normal(size=(T, ROWS, N)), rng.normal(size=(T, ROWS))
    H[2], z[2] = 0.0, 0.0  # nothing measured
    R = rng.uniform(0.1, 1, (T, ROWS))
    R[2] = 1.0
    return dict(zip(NAMES, (F, c, root @ root.transpose(0, 2, 1), z, H, R, rng.normal(size=N), np.eye(N)), strict=True))


def dense(model: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and covariance of all states given all measurements, and the measurements' log density, at once."""
    F, c, Q, z, H, R, x0, P0 = (model[name] for name in NAMES)
    lift = np.zeros((T * N, T * N))  # states from initial state and noises
    mean = np.zeros((T, N))
    mean[0] = x0
    lift[:N, :N] = np.eye(N)
    for k in range(T - 1):
        rows, before = slice((k + 1) * N, (k + 2) * N), slice(k * N, (k + 1) * N)
        lift[rows] = F[k] @ lift[before]
        lift[rows, rows] = np.eye(N)
        mean[k + 1] = F[k] @ mean[k] + c[k]
    noise = np.zeros_like(lift)
    for k, block in enumerate([P0, *Q]):
        noise[k * N : (k + 1) * N, k * N : (k + 1) * N] = block
    cov = lift @ noise @ lift.T
    big_H = np.zeros((T * ROWS, T * N))
    for k in range(T):
        big_H[k * ROWS : (k + 1) * ROWS, k * N : (k + 1) * N] = H[k]
    S = big_H @ cov @ big_H.T + np.diag(R.ravel())
    gain = cov @ big_H.T @ np.linalg.inv(S)
    innovation = z.ravel() - big_H @ mean.ravel()
    density = multivariate_normal(np.zeros(T * ROWS), S).logpdf(innovation)
    return (mean.ravel() + gain @ innovation).reshape(T, N), cov - gain @ S @ gain.T, float(density)


@pytest.mark.parametrize("moving", [None, 3])
def test_smoother_and_likelihood_are_those_of_the_dense_gaussian(
    model: dict[str, np.ndarray], moving: int | None
) -> None:
    filtered = filter_states(**model, moving=moving)
    x, P = smooth_states(filtered, adjoint_states(model["F"], model["H"], filtered, moving=moving))
    mean, cov, density = dense(model)
    np.testing.assert_allclose(x, mean, atol=1e-12)
    blocks = [cov[k * N : (k + 1) * N, k * N : (k + 1) * N] for k in range(T)]
    np.testing.assert_allclose(P, blocks, atol=1e-12)
    np.testing.assert_allclose(x[:, 3], x[0, 3], atol=1e-12)
    total = float(jnp.sum(filtered.log_likelihood)) - T * ROWS / 2 * np.log(2 * np.pi)
    assert total == pytest.approx(density, abs=1e-11)


def test_gradients_are_those_of_differentiation(model: dict[str, np.ndarray]) -> None:
    filtered = filter_states(**model)
    adjoint = adjoint_states(model["F"], model["H"], filtered)
    ours = likelihood_gradients(model["F"], model["H"], filtered, adjoint)
    inputs = {name: jnp.asarray(value) for name, value in model.items()}
    theirs = jax.grad(lambda m: jnp.sum(filter_states(**m).log_likelihood))(inputs)
    assert set(ours) == set(NAMES) - {"H"}
    for name, gradient in ours.items():
        expected = np.asarray(theirs[name])
        if name in ("Q", "P0"):
            expected = 0.5 * (expected + np.swapaxes(expected, -1, -2))
        np.testing.assert_allclose(gradient, expected, atol=1e-12, err_msg=name)


def test_shapes_are_checked(model: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"R must have shape \(6, 2\)"):
        filter_states(**(model | {"R": model["R"][:, :1]}))
