"""Shared attitudes against the singular value decomposition, scipy, and their own statistics."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax import wahba as w
from altijax.rotations import matrix_to_rotvec, rotvec_to_matrix

G = 9.81


def by_svd(B):
    """Rotation and signed singular values."""
    U, s, Vt = np.linalg.svd(B)
    sign = np.stack([np.ones_like(s[..., 0])] * 2 + [np.sign(np.linalg.det(U) * np.linalg.det(Vt))], -1)
    return (U * sign[..., None, :]) @ Vt, s * sign


def forces(rng, shape, spread):
    """Specific forces in navigation axes: gravity upward and accelerations of `spread` m/s^2."""
    return np.array([0, 0, G]) + spread * rng.standard_normal((*shape, 3))


def turned(C, v):
    return np.einsum("...ij,...j->...i", C, v)


def angle(C, D):
    return np.linalg.norm(matrix_to_rotvec(np.swapaxes(C, -1, -2) @ D), axis=-1)


# --- the kernel -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("s2", "s3"),
    [(1, 1), (0.5, -0.2), (0.5, -0.49), (1e-2, 1e-4), (1e-2, 0), (1e-4, -1e-5), (1e-6, 1e-7), (1e-8, 0)],
)
def test_nearest_rotation_is_as_exact_as_the_decomposition(s2, s3):
    """Built from its own decomposition, so that the truth is known: rounding over (s2 + s3), as backward stable."""
    rng = np.random.default_rng(0)
    U, V = Rotation.random(200, rng=rng).as_matrix(), Rotation.random(200, rng=rng).as_matrix()
    B = 1e3 * U @ np.diag([1.0, s2, s3]) @ np.swapaxes(V, -1, -2)
    found = w.nearest_rotation(B)
    np.testing.assert_allclose(found, U @ np.swapaxes(V, -1, -2), rtol=0, atol=1e-15 + 2e-15 / (s2 + s3))
    np.testing.assert_allclose(found @ np.swapaxes(found, -1, -2), np.broadcast_to(np.eye(3), B.shape), atol=2e-15)


def test_nearest_rotation_of_random_matrices():
    """Half of them have a negative determinant, some s2 = -s3 almost."""
    B = np.random.default_rng(1).standard_normal((20_000, 3, 3))
    expected, s = by_svd(B)
    error = np.abs(w.nearest_rotation(B) - expected).max((-1, -2))
    assert (error * (s[:, 1] + s[:, 2]) / s[:, 0]).max() < 1e-13


@pytest.mark.parametrize("B", [np.zeros((3, 3)), np.diag([1.0, 0, 0]), np.diag([1.0, -1, 1]), -np.eye(3)])
def test_without_a_unique_answer_there_is_a_rotation_and_no_nan(B):
    found, slopes = w.nearest_rotation(B), jax.jacrev(w.nearest_rotation)(B)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(found) > 0.9
    assert np.isfinite(slopes).all()


def test_single_precision():
    B = np.random.default_rng(2).standard_normal((100, 3, 3)) + 2 * np.eye(3)
    np.testing.assert_allclose(w.nearest_rotation(jnp.asarray(1e6 * B, np.float32)), by_svd(B)[0], atol=2e-5)


def test_derivatives_are_difference_quotients():
    rng = np.random.default_rng(3)
    B, dB = rng.standard_normal((2, 3, 3)) + np.eye(3)
    slope = jax.jvp(w.nearest_rotation, (B,), (dB,))[1]
    h = 1e-5
    quotient = (by_svd(B + h * dB)[0] - by_svd(B - h * dB)[0]) / (2 * h)
    np.testing.assert_allclose(slope, quotient, atol=1e-8)


# --- sets of pairs ----------------------------------------------------------------------------------------------------


def fit(f_b, f_n, C0, prior_std=1.0, std=0.1):
    return w.fit_shared_attitude(f_b, f_n, C0, jnp.full(f_b.shape[:-2], prior_std), np.full(f_b.shape[:-1], std))


def test_scipy_finds_the_same_attitude():
    rng = np.random.default_rng(4)
    C = Rotation.random(rng=rng)
    f_n = forces(rng, (5,), 3.0)
    f_b = C.inv().apply(f_n) + 0.1 * rng.standard_normal((5, 3))
    std = rng.uniform(0.05, 0.2, 5)
    found = w.fit_shared_attitude(f_b, f_n, np.eye(3), 1e9, std)
    expected, _ = Rotation.align_vectors(f_n, f_b, weights=1 / std**2)
    # the weakest prior there is: 2e-11 of the pairs' weight
    np.testing.assert_allclose(found.C_nb, expected.as_matrix(), atol=1e-9)
    left = (f_n - expected.apply(f_b)) / std[:, None]
    assert found.misfit == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-9)
    assert found.rank == 3 and found.valid


def test_one_direction_turns_the_prior_by_the_least_angle():
    rng = np.random.default_rng(5)
    C0 = Rotation.random(rng=rng).as_matrix()
    f_n = np.tile(forces(rng, (), 2.0), (5, 1))
    f_b = turned(rotvec_to_matrix(0.3 * rng.standard_normal(3)) @ C0.T, f_n)
    a, b = turned(C0, f_b[0]), f_n[0]
    axis = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    least = rotvec_to_matrix(axis * np.arccos(cosine))
    for prior_std in (1e2, 1e9):
        found = fit(f_b, f_n, C0, prior_std)
        np.testing.assert_allclose(found.C_nb, least @ C0, atol=1e-6)
    found = fit(f_b, f_n, C0, 0.2)
    assert found.rank == 2 and found.valid
    along = b / np.linalg.norm(b)
    # the prior's cost 1 - cos curves less, the farther it was turned
    assert along @ found.covariance @ along == pytest.approx((0.2 * 2 / (1 + cosine)) ** 2, rel=1e-3)


def test_the_fit_turns_with_its_inputs():
    """Other navigation axes turn the attitude and its covariance, other body axes the attitude alone."""
    rng = np.random.default_rng(6)
    R, S, C0 = Rotation.random(3, rng=rng).as_matrix()
    f_n = forces(rng, (5,), 1.0)
    f_b = turned(C0.T, f_n) + 0.3 * rng.standard_normal((5, 3))
    found = fit(f_b, f_n, C0, 0.3)
    again = fit(turned(S.T, f_b), turned(R, f_n), R @ C0 @ S, 0.3)
    np.testing.assert_allclose(again.C_nb, R @ found.C_nb @ S, atol=1e-12)
    np.testing.assert_allclose(again.covariance, R @ found.covariance @ R.T, atol=1e-14)


def test_missing_pairs_and_free_fall_leave_the_prior():
    C0 = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    for f, std in ((forces(np.random.default_rng(7), (5,), 1.0), np.inf), (np.zeros((5, 3)), 0.1)):
        found = fit(f, f, C0, 0.2, std)
        np.testing.assert_allclose(found.C_nb, C0, atol=1e-14)
        np.testing.assert_allclose(found.covariance, 0.04 * np.eye(3), atol=1e-15)
        assert found.rank == 0 and not found.valid

        def of(f_b, f_n, C0, prior_std, std=std):
            found = fit(f_b, f_n, C0, prior_std, std)
            return found.C_nb, found.covariance, found.misfit

        assert all(np.isfinite(x).all() for x in jax.tree.leaves(jax.jacrev(of, argnums=(0, 1, 2, 3))(f, f, C0, 0.2)))


def test_a_prior_upside_down_is_survived():
    f = np.tile([0.0, 0.0, G], (5, 1))
    found = fit(f, f, np.diag([1.0, -1.0, -1.0]))
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(found))
    np.testing.assert_allclose(found.C_nb @ found.C_nb.T, np.eye(3), atol=1e-9)
    assert np.linalg.eigvalsh(found.covariance)[-1] > 1


@pytest.mark.parametrize(("spread", "prior_std"), [(3.0, 1.0), (0.3, 0.3), (0.05, 0.1), (0.0, 0.1)])
def test_covariance_is_that_of_the_errors(spread, prior_std):
    """Down to a spread that is all noise, where the information of the noisy directions would promise too much."""
    runs, pairs, std = 4000, 9, 0.1
    rng = np.random.default_rng(8)
    C = Rotation.random(runs, rng=rng).as_matrix()
    C0 = rotvec_to_matrix(prior_std * rng.standard_normal((runs, 3))) @ C
    truth = forces(rng, (runs, pairs), spread)
    noise = std / np.sqrt(2) * rng.standard_normal((2, runs, pairs, 3))
    f_n, f_b = truth + noise[0], turned(np.swapaxes(C, -1, -2)[:, None], truth) + noise[1]
    found = fit(f_b, f_n, C0, prior_std, std)
    error = matrix_to_rotvec(C @ np.swapaxes(found.C_nb, -1, -2))
    normalised = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
    # the mean of 4000 chi-squares of three degrees is 3 +- 0.04; the linearised prior of 1 rad is not exact
    assert 2.6 < np.median(normalised) / 2.366 * 3 < 3.3
    assert 2.5 < normalised.mean() < 3.4
    assert found.misfit.mean() == pytest.approx(1, abs=0.15)
    assert found.rank.min() >= 2
    assert (found.rank == 3).mean() == pytest.approx(1 if spread > 0.1 else 0, abs=0.1)


# --- windows ----------------------------------------------------------------------------------------------------------


def windows(f_b, f_n, C0, window, C_gyro=None, std=0.1, prior_std=0.5):
    n = f_b.shape[0]
    return w.fit_windows(f_b, f_n, C0, np.full(n, prior_std), np.full(n, std), window, C_gyro)


@pytest.mark.parametrize("window", [1, 9, 41])
def test_windows_are_the_fits_of_their_pairs(window):
    rng = np.random.default_rng(9)
    n = 20
    C0 = Rotation.random(n, rng=rng).as_matrix()
    f_n = forces(rng, (n,), 2.0)
    f_b = turned(C0.swapaxes(-1, -2), f_n) + 0.1 * rng.standard_normal((n, 3))
    found = windows(f_b, f_n, C0, window)
    for i in (0, 2, 10, 19):
        near = slice(max(0, i - window // 2), i + window // 2 + 1)
        alone = fit(f_b[near], f_n[near], C0[i], 0.5)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(a[i], b, atol=1e-11)


def test_gyros_let_the_attitude_turn_within_a_window():
    """Exact pairs of a turning device: exact attitudes, from gyros of an unknown start and any prior."""
    rng = np.random.default_rng(10)
    n = 40
    steps = rotvec_to_matrix(0.2 * rng.standard_normal((n, 3)))
    C = np.empty((n, 3, 3))
    C[0] = Rotation.random(rng=rng).as_matrix()
    for k in range(1, n):
        C[k] = C[k - 1] @ steps[k]
    f_n = forces(rng, (n,), 2.0)
    f_b = turned(C.swapaxes(-1, -2), f_n)
    start = Rotation.random(rng=rng).as_matrix()
    prior = rotvec_to_matrix(0.3 * rng.standard_normal((n, 3))) @ C
    found = windows(f_b, f_n, prior, 9, start @ C, prior_std=1e9)
    np.testing.assert_allclose(found.C_nb, C, atol=1e-8)
    assert np.abs(windows(f_b, f_n, prior, 9, prior_std=1e9).C_nb - C).max() > 0.1
    assert (found.misfit < 1e-5).all()


def test_windows_are_odd():
    f = np.zeros((5, 3))
    with pytest.raises(ValueError, match="window must be a positive odd number of epochs, got 4"):
        windows(f, f, np.zeros((5, 3, 3)), 4)
