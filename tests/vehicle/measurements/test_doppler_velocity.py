"""What a receiver should say of a velocity, and the means of what it said."""

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.vehicle.measurements.doppler_velocity import expected, means_at, measured
from tests.vehicle.made import short_drive
from tests.vehicle.measurements.state import AT, NOW, driving


def test_an_antenna_ahead_swings_outwards() -> None:
    np.testing.assert_allclose(expected(driving(), AT, NOW), [0, 10, 0], atol=1e-12)
    np.testing.assert_allclose(expected(driving(antenna=jnp.array([1.0, 0, 0])), AT, NOW), [-0.2, 10, 0], atol=1e-12)


def test_a_later_receiver_tells_of_before() -> None:
    late = driving(gnss_delay=jnp.asarray(0.3))
    np.testing.assert_allclose(expected(late, AT, NOW), [0.4, 9.9, 0], atol=1e-12)
    np.testing.assert_allclose(expected(late, AT, jnp.asarray(0.2)), [0, 10, 0], atol=1e-12)


def test_means_are_of_what_is_near() -> None:
    stamp, value = np.array([0.0, 0.9, 1.1, 5.0]), np.array([[1.0], [2.0], [4.0], [9.0]])
    rows = means_at(np.array([0.0, 1.0, 2.0]), stamp, value, np.array([[0.1], [0.1], [0.3], [0.1]]), 0.5)
    np.testing.assert_allclose(rows.value[:2, 0], [1, 3])
    np.testing.assert_allclose(rows.std[:, 0], [0.1, 0.2, np.inf])
    assert rows.stamp[1] == pytest.approx(1.0)


def test_epochs_of_a_recording_are_at_their_instants() -> None:
    t = short_drive().gnss.index.to_numpy(float)
    rows = measured(short_drive(), t)
    assert rows is not None
    np.testing.assert_allclose(rows.stamp, t, atol=1e-9)
    np.testing.assert_allclose(rows.value, short_drive().gnss[["v_e", "v_n", "v_u"]], atol=1e-12)
