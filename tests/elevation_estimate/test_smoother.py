"""Covariances of what wanders, against sums over made-up series; the update, against weighted means."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.elevation_estimate.smoother import (
    ElevationNoise,
    gaussian_update,
    norm_way_covariance,
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


def test_shapes_that_do_not_fit_are_named() -> None:
    with pytest.raises(ValueError, match="acceleration must have shape"):
        norm_way_covariance(T, jnp.zeros(61), G, QUIET)
    with pytest.raises(ValueError, match="way must have shape"):
        slope_way_covariance(T, jnp.zeros(60), G, QUIET)
