"""Covariances of what wanders, against sums over made-up series; the update, against weighted means."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.elevation_estimate.smoother import (
    ElevationNoise,
    gaussian_update,
    mixture_moments,
    norm_way_covariance,
    quadrature_nodes,
    road_covariance,
    slope_way_covariance,
)

jax.config.update("jax_enable_x64", True)

G = 9.81
T = jnp.linspace(0, 60, 61)
QUIET = ElevationNoise(slope=0.0, trim=0.0, vertical=0.0, kinematic=0.0, rectified=0.0)


def test_white_slope_noise_grows_as_the_way() -> None:
    covariance = slope_way_covariance(T, 10 * T, G, replace(QUIET, slope=0.02))
    np.testing.assert_allclose(covariance, 0.02**2 * 10 * np.minimum(T[:, None], T), rtol=1e-12)


def test_a_trim_error_that_stays_is_a_slope() -> None:
    """Kept for much longer than the drive it is one constant: its elevation is its share of gravity times the way."""
    covariance = slope_way_covariance(T, 10 * T, G, replace(QUIET, trim=0.1, trim_time=1e9))
    np.testing.assert_allclose(covariance, (0.1 / G * 10) ** 2 * jnp.outer(T, T), rtol=1e-6)


def test_standing_still_adds_nothing() -> None:
    way = jnp.where(T < 20, 10 * T, jnp.where(T < 40, 200.0, 200 + 10 * (T - 40)))
    variance = jnp.diagonal(slope_way_covariance(T, way, G, ElevationNoise()))
    np.testing.assert_allclose(variance[20:41], variance[20], rtol=1e-12)
    assert variance[-1] > variance[40]


def test_white_acceleration_noise_grows_as_the_cube_of_time() -> None:
    """q^2 t^3 / 3; what comes of the acceleration is its share of gravity."""
    for noise, density in (({"vertical": 0.01}, 0.01), ({"kinematic": 0.2}, 0.2 * 3.0 / G)):
        covariance = norm_way_covariance(T, jnp.full(60, 3.0), G, replace(QUIET, **noise))
        np.testing.assert_allclose(jnp.diagonal(covariance)[30:], density**2 * T[30:] ** 3 / 3, rtol=1e-3)


def test_a_rectified_error_that_stays_is_a_parabola() -> None:
    covariance = norm_way_covariance(T, jnp.zeros(60), G, replace(QUIET, rectified=0.1, rectified_time=1e9))
    np.testing.assert_allclose(jnp.sqrt(jnp.diagonal(covariance)), 0.1 * T**2 / 2, rtol=1e-6)


def test_roads_are_slopes_when_short_and_wander_when_long() -> None:
    noise = ElevationNoise(road=0.05, road_length=200.0)
    near, far = jnp.array([0.0, 1.0]), jnp.array([0.0, 1e6])
    assert jnp.sqrt(road_covariance(near, noise)[1, 1]) == pytest.approx(0.05, rel=2e-3)
    assert road_covariance(far, noise)[1, 1] == pytest.approx(2 * 0.05**2 * 200 * 1e6, rel=1e-3)


def test_covariances_have_no_negative_direction_and_start_from_nothing() -> None:
    way = jnp.cumsum(jnp.abs(jnp.sin(T)) * 12) - jnp.abs(jnp.sin(T[0])) * 12
    noise = ElevationNoise()
    for covariance in (
        slope_way_covariance(T, way, G, noise),
        norm_way_covariance(T, jnp.ones(60), G, noise),
        road_covariance(way, noise),
    ):
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-9)
        assert not covariance[0].any()
        assert jnp.linalg.eigvalsh(covariance)[0] > -1e-9 * covariance.max()


def test_an_update_is_the_weighted_mean() -> None:
    """A value of prior 0 +- 2, seen twice, as 3 +- 1 and as 5 +- 2."""
    mean, covariance, log_likelihood = gaussian_update(
        jnp.eye(1) * 4, jnp.ones((2, 1)), jnp.array([3.0, 5.0]), jnp.diag(jnp.array([1.0, 4.0]))
    )
    weight = 1 / 4 + 1 + 1 / 4
    assert mean[0] == pytest.approx((3 + 5 / 4) / weight)
    assert covariance[0, 0] == pytest.approx(1 / weight)
    joint = np.array([[5.0, 4.0], [4.0, 8.0]])
    expected = -0.5 * np.array([3, 5]) @ np.linalg.solve(joint, [3, 5]) - 0.5 * np.log(np.linalg.det(joint))
    assert log_likelihood == pytest.approx(expected)


def test_an_update_of_unknown_noise_is_the_integral_over_its_levels() -> None:
    """Five readings of a value, their noise known to a factor e^0.7: against a sum over a fine grid of levels."""
    observed = jnp.array([0.3, 2.4, 1.1, -0.9, 1.9])

    def update(z: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        noise = jnp.exp(1.4 * z[0]) * jnp.eye(5)
        mean, covariance, log_likelihood = gaussian_update(jnp.eye(1), jnp.ones((5, 1)), observed, noise)
        return mean, covariance, log_likelihood - 0.5 * z[0] ** 2

    def over(nodes: jax.Array, log_weights: jax.Array | float) -> tuple[jax.Array, jax.Array]:
        means, covariances, log_density = jax.vmap(update)(nodes)
        return mixture_moments(means, covariances, log_weights + log_density)

    fine = jnp.linspace(-6, 6, 4001)[:, None]
    best = fine[jnp.argmax(jax.vmap(update)(fine)[2])]
    curvature = -jax.hessian(lambda z: update(z)[2])(best)
    mean, variance = over(fine, jnp.zeros(4001))
    found, found_variance = over(*quadrature_nodes(best, curvature, 1.0))
    np.testing.assert_allclose(found, mean, rtol=0.005)
    np.testing.assert_allclose(found_variance, variance, rtol=0.02)
    # at the likeliest level alone the bar is another
    assert abs(update(best)[1][0, 0] / variance[0, 0] - 1) > 0.05


def test_quadrature_is_exact_for_polynomials_under_a_normal_density() -> None:
    curvature = jnp.array([[3.0, 1.0], [1.0, 2.0]])
    nodes, log_weights = quadrature_nodes(jnp.array([1.0, -2.0]), curvature, 0.1)
    away = nodes - jnp.array([1.0, -2.0])
    weights = jax.nn.softmax(log_weights - 0.5 * jnp.einsum("ni,ij,nj->n", away, curvature, away))
    covariance = jnp.linalg.inv(curvature)
    np.testing.assert_allclose(weights @ away, 0, atol=1e-12)
    np.testing.assert_allclose(jnp.einsum("n,ni,nj->ij", weights, away, away), covariance, rtol=1e-9)


def test_a_mixture_is_as_wide_as_its_parts_and_as_they_are_apart() -> None:
    mean, covariance = mixture_moments(
        jnp.array([[1.0, 0.0], [4.0, 2.0]]), jnp.stack([jnp.eye(2), 2 * jnp.eye(2)]), jnp.log(jnp.array([2.0, 1.0]))
    )
    np.testing.assert_allclose(mean, [2.0, 2 / 3])
    between = 2 / 9 * np.outer([3, 2], [3, 2])
    np.testing.assert_allclose(covariance, 4 / 3 * np.eye(2) + between)


def test_shapes_that_do_not_fit_are_named() -> None:
    with pytest.raises(ValueError, match="acceleration must have shape"):
        norm_way_covariance(T, jnp.zeros(61), G, QUIET)
    with pytest.raises(ValueError, match="way must have shape"):
        slope_way_covariance(T, jnp.zeros(60), G, QUIET)
