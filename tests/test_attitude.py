"""The epoch fit against MINPACK, laws of rotation, and the edges where an epoch tells little or nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from altijax.attitude import RESCUED, course_attitude, fit_attitude, fit_attitudes, hold_attitudes
from altijax.least_squares import CONVERGED, NOT_FINITE, STEPS_USED_UP, levenberg_marquardt
from altijax.rotations import euler_to_matrix, matrix_to_euler, wrap_angle
from tests.quick import quick_jit

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


@jax.jit
def fit_all(f_b, f_n, euler0, prior_std=PRIOR, measurement_std=NOISE):
    return fit_attitudes(f_b, f_n, euler0, prior_std=prior_std, measurement_std=measurement_std)


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


def test_generic_levenberg_marquardt_finds_the_same() -> None:
    f_b, f_n, euler0 = (x[0] for x in epochs(1, seed=1))

    def residuals(euler):
        return jnp.concatenate([(euler_to_matrix(euler).T @ f_n - f_b) / NOISE, (euler - euler0) / PRIOR])

    expected = levenberg_marquardt(residuals, jnp.asarray(euler0))
    fit = fit_attitude(f_b, f_n, euler0, prior_std=PRIOR, measurement_std=NOISE)
    np.testing.assert_allclose(fit.covariance, expected.covariance, rtol=1e-6)
    np.testing.assert_allclose(wrap_angle(fit.euler - expected.x), 0, atol=1e-7)
    np.testing.assert_allclose(fit.cost, expected.cost, rtol=1e-10)


def test_a_turn_about_the_vertical_turns_the_yaw_alone() -> None:
    f_b, f_n, euler0 = epochs(20, seed=2)
    turn = 2.0
    turned = f_n @ Rotation.from_euler("z", turn).as_matrix().T
    before, after = fit_each(f_b, f_n, euler0), fit_each(f_b, turned, euler0 + np.array([0, 0, turn]))
    np.testing.assert_allclose(wrap_angle(after.euler - before.euler - np.array([0, 0, turn])), 0, atol=1e-11)
    np.testing.assert_allclose(after.cost, before.cost, rtol=1e-11)
    np.testing.assert_allclose(after.covariance, before.covariance, atol=1e-13)


def test_level_epoch_leaves_the_yaw_to_the_prior() -> None:
    """The specific force is vertical: roll and pitch come from the data, the yaw does not, and says so."""
    fit = fit_attitude(UP, UP, [0.05, -0.05, 1.0], prior_std=PRIOR, measurement_std=1e-3)
    np.testing.assert_allclose(fit.euler, [0, 0, 1.0], atol=1e-7)
    np.testing.assert_allclose(fit.data_share, [1, 1, 0], atol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), [1e-3 / 9.81, 1e-3 / 9.81, PRIOR], rtol=1e-6)
    assert fit.rank == 2


def test_free_fall_and_missing_data_leave_all_to_the_prior() -> None:
    zero, missing = np.zeros(3), np.full(3, np.nan)
    f_b, f_n = np.stack([zero, UP, missing]), np.stack([1e-9 * UP, missing, UP])
    euler0 = np.tile([0.3, -0.2, 1.0], (3, 1))
    for fits in (fit_each(f_b, f_n, euler0), fit_all(f_b, f_n, euler0)):
        np.testing.assert_allclose(fits.euler, euler0, atol=1e-9)
        np.testing.assert_allclose(fits.covariance, PRIOR**2 * np.tile(np.eye(3), (3, 1, 1)), atol=1e-9)
        np.testing.assert_array_equal(fits.rank, 0)
        np.testing.assert_array_equal(fits.status, [CONVERGED, NOT_FINITE, NOT_FINITE])


def test_angles_come_back_in_their_ranges() -> None:
    """From an initial pitch beyond the pole: the same attitude, in the ranges of matrix_to_euler."""
    C_nb = euler_to_matrix(jnp.array([0.2, 1.5, 0.3]))
    beyond = jnp.array([0.2 + np.pi, np.pi - 1.5, 0.3 + np.pi + 4 * np.pi])
    fit = fit_attitude(C_nb.T @ UP, UP, beyond, prior_std=PRIOR, measurement_std=NOISE)
    np.testing.assert_allclose(fit.C_nb, C_nb, atol=1e-9)
    np.testing.assert_allclose(fit.euler, matrix_to_euler(fit.C_nb), atol=1e-9)
    assert fit.cost < 1e-15


@pytest.mark.parametrize("prior", [PRIOR, np.radians(40.0)])
def test_all_at_once_is_each_by_itself(prior: float) -> None:
    """Also where many epochs need the second attempt, and where the last chunk reaches back."""
    f_b, f_n, euler0 = epochs(5000, seed=3, prior=prior)
    each, fits = fit_each(f_b, f_n, euler0, prior), fit_all(f_b, f_n, euler0, prior)
    same = np.isclose(fits.cost, each.cost, rtol=1e-10)
    if prior == PRIOR:
        assert np.isin(fits.status, [CONVERGED, RESCUED]).all()
        assert same.all()
    else:
        assert np.mean(fits.status == RESCUED) > 0.1
        # Of several minima the two ways may take different ones, and at the edge of half a turn neither may arrive.
        assert same.mean() > 0.995
        assert np.mean(fits.status == STEPS_USED_UP) < 0.002
    np.testing.assert_allclose(wrap_angle(fits.euler - each.euler)[same], 0, atol=1e-6)
    np.testing.assert_allclose(fits.covariance[same], each.covariance[same], atol=1e-6)


def test_single_precision_is_near_double() -> None:
    f_b, f_n, euler0 = epochs(500, seed=4)
    double = fit_all(f_b, f_n, euler0)
    single = fit_all(*(np.float32(x) for x in (f_b, f_n, euler0)))
    assert single.euler.dtype == np.float32
    assert np.isin(single.status, [CONVERGED, RESCUED]).all()
    np.testing.assert_allclose(wrap_angle(single.euler - double.euler), 0, atol=2e-4)
    np.testing.assert_allclose(single.cost, double.cost, rtol=1e-2, atol=1e-4)


def test_derivatives_are_those_of_the_minimum() -> None:
    """By every argument, against finite differences, one epoch and many; forward and reverse."""
    f_b, f_n, euler0 = (jnp.asarray(x) for x in epochs(2, seed=5))
    arguments = f_b, f_n, euler0, jnp.array([0.15, 0.2, 0.25]), jnp.array(NOISE)
    rng = np.random.default_rng(6)
    tangents = tuple(jnp.asarray(0.1 * rng.standard_normal(x.shape)) for x in arguments)

    def at_once(*arguments):
        fits = fit_all(*arguments)
        return fits.euler, fits.covariance, fits.cost

    def each(*arguments):
        fits = fit_each(*arguments)
        return fits.euler, fits.covariance, fits.cost

    for fit in (at_once, each):
        forward = quick_jit(lambda a, t, fit=fit: jax.jvp(fit, a, t)[1])(arguments, tangents)
        value = quick_jit(fit)
        ahead, behind = (value(*(a + e * t for a, t in zip(arguments, tangents, strict=True))) for e in (1e-4, -1e-4))
        for f, a, b in zip(forward, ahead, behind, strict=True):
            np.testing.assert_allclose(f, (a - b) / 2e-4, rtol=1e-5, atol=1e-6)
    backward = quick_jit(lambda a, c: jax.vjp(at_once, *a)[1](c))(arguments, forward)
    one = sum(float(jnp.vdot(f, f)) for f in forward)
    other = sum(float(jnp.vdot(b, t)) for b, t in zip(backward, tangents, strict=True))
    # each and all at once are the same to rounding, so one's derivative serves the other's transpose
    assert one == pytest.approx(other, rel=1e-8)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-40, 40, width=32), min_size=9, max_size=9))
def test_everything_is_finite_for_finite_input(numbers: list[float]) -> None:
    f_b, f_n, euler0 = jnp.asarray(numbers, float).reshape(3, 3)
    for leaf in jax.tree.leaves(values_and_slopes(f_b, f_n, euler0)):
        assert np.isfinite(leaf).all()


@quick_jit
def values_and_slopes(f_b, f_n, euler0):
    def fit(f_b, f_n, euler0):
        found = fit_attitude(f_b, f_n, euler0, prior_std=0.5, measurement_std=NOISE)
        return found.euler, found.C_nb, found.covariance, found.cost

    return fit(f_b, f_n, euler0), jax.jacfwd(fit, (0, 1, 2))(f_b, f_n, euler0)


def test_of_several_minima_the_lowest_is_found_from_many_starts() -> None:
    """The yaw believed is wrong by more than the pitch leaves room for: downhill leads elsewhere for some."""
    prior = np.radians(60.0)
    data = tuple(jnp.asarray(x) for x in epochs(200, seed=7, prior=prior))

    @quick_jit
    def costs(f_b, f_n, euler0):
        def of(starts):
            def fit(*epoch):
                return fit_attitude(*epoch, prior_std=prior, measurement_std=NOISE, starts=starts)

            return jax.vmap(fit)(f_b, f_n, euler0).cost

        return of(1), of(12)

    one, many = costs(*data)
    assert (many <= one * (1 + 1e-10)).all()
    assert (many < 0.99 * one).any()
    with pytest.raises(ValueError, match="starts must be at least 1, got 0"):
        fit_attitude(UP, UP, jnp.zeros(3), prior_std=1.0, measurement_std=1.0, starts=0)


def test_attitudes_are_held_where_they_are_not_valid() -> None:
    euler = jnp.arange(18.0).reshape(6, 3)
    covariance = jnp.tile(0.01 * jnp.eye(3), (6, 1, 1))
    valid = jnp.array([False, True, False, False, True, False])
    held, grown = hold_attitudes(euler, covariance, valid, drift_std=0.2)
    np.testing.assert_array_equal(held, euler[jnp.array([0, 1, 1, 1, 4, 4])])
    np.testing.assert_allclose(grown[:, 0, 0], 0.01 + 0.04 * np.array([0, 0, 1, 2, 0, 1]))
    np.testing.assert_allclose(grown[:, 0, 1], 0)


def test_initial_value_is_level_along_the_course() -> None:
    """Eq. (5) starts from (0, 0, pi/2 - COG); North is a course of 0."""
    euler = course_attitude([[0.0, 2.0, 1.0], [-3.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(euler, [[0, 0, np.pi / 2], [0, 0, np.pi], [0, 0, 0]], atol=1e-15)


def test_no_epochs_give_no_attitudes() -> None:
    none = np.zeros((0, 3))
    fits = fit_attitudes(none, none, none, prior_std=PRIOR, measurement_std=NOISE)
    assert fits.covariance.shape == (0, 3, 3)


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ValueError, match=r"prior_std must have shape \(3,\), got \(2,\)"):
        fit_attitude(UP, UP, jnp.zeros(3), prior_std=jnp.ones(2), measurement_std=1.0)
    with pytest.raises(ValueError, match=r"measurement_std must have shape \(\), got \(3,\)"):
        fit_attitude(UP, UP, jnp.zeros(3), prior_std=1.0, measurement_std=jnp.ones(3))
    with pytest.raises(ValueError, match=r"f_n must have shape \(4, 3\), got \(5, 3\)"):
        fit_attitudes(np.zeros((4, 3)), np.zeros((5, 3)), np.zeros((4, 3)), prior_std=1.0, measurement_std=1.0)
