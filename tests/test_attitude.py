"""The epoch fit against MINPACK, laws of rotation, and the edges where an epoch tells little or nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from altijax.attitude import fit_attitude
from altijax.least_squares import CONVERGED
from altijax.rotations import euler_to_matrix, wrap_angle

PRIOR, NOISE = np.radians(10.0), 0.1
UP = np.array([0.0, 0.0, 9.81])


def epochs(n: int, seed: int = 0, prior: float = PRIOR) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Specific forces and initial angles of `n` epochs of lively motion, with the errors that the fit expects."""
    rng = np.random.default_rng(seed)
    truth = rng.standard_normal((n, 3)) * [0.3, 0.3, 2.0]
    f_n = UP + 2 * rng.standard_normal((n, 3))
    f_b = np.einsum("nji,nj->ni", euler_to_matrix(truth), f_n) + NOISE * rng.standard_normal((n, 3))
    return f_b, f_n, truth + prior * rng.standard_normal((n, 3))


@jax.jit
def fit_each(f_b, f_n, euler0, prior_std=PRIOR, measurement_std=NOISE):
    def fit(f_b, f_n, euler0):
        return fit_attitude(f_b, f_n, euler0, prior_std=prior_std, measurement_std=measurement_std)

    return jax.vmap(fit)(f_b, f_n, euler0)


def by_minpack(f_b, f_n, euler0):
    def residuals(x):
        C_nb = Rotation.from_euler("ZYX", [x[2], -x[1], x[0]]).as_matrix()
        return np.concatenate([(C_nb.T @ f_n - f_b) / NOISE, (x - euler0) / PRIOR])

    return least_squares(residuals, euler0, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)


def test_minimum_covariance_and_rank_are_minpacks() -> None:
    data = epochs(20)
    fits = fit_each(*data)
    assert (fits.status == CONVERGED).all()
    for i, epoch in enumerate(zip(*data, strict=True)):
        expected = by_minpack(*epoch)
        assert fits.cost[i] == pytest.approx(2 * expected.cost, rel=1e-10)
        np.testing.assert_allclose(wrap_angle(fits.euler[i] - expected.x), 0, atol=1e-6)
        np.testing.assert_allclose(fits.covariance[i], np.linalg.inv(expected.jac.T @ expected.jac), atol=1e-8)
        assert fits.rank[i] == np.sum(np.linalg.svd(expected.jac[:3] * PRIOR)[1] > 1)


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ValueError, match=r"prior_std must have shape \(3,\), got \(2,\)"):
        fit_attitude(UP, UP, jnp.zeros(3), prior_std=jnp.ones(2), measurement_std=1.0)
    with pytest.raises(ValueError, match=r"measurement_std must have shape \(\), got \(3,\)"):
        fit_attitude(UP, UP, jnp.zeros(3), prior_std=1.0, measurement_std=jnp.ones(3))
