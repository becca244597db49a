"""What wheels should read: speed along the vehicle, without a sign."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.vehicle.measurements.wheel_speed import expected, measured
from tests.vehicle.made import short_drive
from tests.vehicle.measurements.state import AT, NOW, driving


def test_reverse_counts_as_forward() -> None:
    for way in (1, -1):
        reading = expected(driving(velocity=jnp.array([0.0, way * 10.0, 0.0])), AT, NOW)
        np.testing.assert_allclose(reading, [10.0])


def test_scale_and_delay() -> None:
    np.testing.assert_allclose(expected(driving(wheel_scale=jnp.asarray(0.01)), AT, NOW), [10.1])
    # It speeds up by 0.5 m/s^2: a late sensor tells less.
    np.testing.assert_allclose(expected(driving(wheel_delay=jnp.asarray(0.2)), AT, NOW), [9.9])


def test_only_what_is_along_the_vehicle_counts() -> None:
    aside = driving(mounting=jnp.array([0.1, 0.0]))
    np.testing.assert_allclose(expected(aside, AT, NOW), [10 * np.cos(0.1)])


def test_means_are_those_of_the_stream() -> None:
    t = np.arange(1.0, 19.0, 0.5)
    rows = measured(short_drive(), t)
    assert rows is not None
    speed = short_drive().wheel["speed"]
    known = np.interp(rows.stamp, speed.index, speed)
    assert np.abs(rows.value[:, 0] - known).max() < 0.15
    assert measured(replace(short_drive(), wheel=None), t) is None


def test_a_wheel_at_rest_has_a_derivative() -> None:
    assert expected(driving(velocity=jnp.zeros(3)), AT, NOW) == pytest.approx(0)
