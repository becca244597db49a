"""Where a vehicle goes, seen from its IMU."""

import jax.numpy as jnp
import numpy as np

from altijax.vehicle.measurements.course import expected, floor, measured
from tests.vehicle.made import short_drive
from tests.vehicle.measurements.state import AT, NOW, driving


def test_a_vehicle_goes_where_it_points() -> None:
    np.testing.assert_allclose(expected(driving(), AT, NOW), [0, 0], atol=1e-12)


def test_a_crooked_imu_sees_it_go_aside() -> None:
    to_the_left = driving(velocity=jnp.array([-1.0, 10.0, 0.5]))
    angles = np.array([np.arctan(0.1), np.arctan(0.5 / np.hypot(1, 10))])
    np.testing.assert_allclose(expected(to_the_left, AT, NOW), angles, atol=1e-12)
    np.testing.assert_allclose(expected(to_the_left | {"mounting": -jnp.asarray(angles)}, AT, NOW), 0, atol=1e-12)


def test_the_axle_goes_straight_where_the_front_swings() -> None:
    behind = driving(velocity=jnp.array([-0.4, 10.0, 0.0]), axle=jnp.array([-2.0, 0.0, 0.0]))
    np.testing.assert_allclose(expected(behind, AT, NOW), [0, 0], atol=1e-12)


def test_a_wind_carries_it_aside() -> None:
    np.testing.assert_allclose(
        expected(driving(velocity=jnp.array([3.0, 10.0, 0.0]), wind=jnp.array([3.0, 0.0])), AT, NOW), 0, atol=1e-12
    )


def test_it_says_nothing_at_rest() -> None:
    at_rest = driving(velocity=jnp.zeros(3))
    assert np.isfinite(np.asarray(expected(at_rest, AT, NOW))).all()
    assert np.asarray(floor(at_rest, AT)).min() > 1e4 > 0.01 > np.asarray(floor(driving(), AT)).max()


def test_it_holds_at_every_instant() -> None:
    assert np.isfinite(measured(short_drive(), np.arange(5.0)).std).all()
