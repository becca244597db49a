"""Surveyed heights at their instants."""

import jax.numpy as jnp
import numpy as np

from altijax.vehicle.measurements.known_height import expected, rows_of
from tests.vehicle.measurements.state import AT, driving


def test_heights_are_above_a_datum() -> None:
    state = driving(position=jnp.array([0, 0, 3.0]), datum=jnp.asarray(600.0), velocity=jnp.array([0, 10.0, 0.5]))
    np.testing.assert_allclose(expected(state, AT, jnp.asarray(0.2)), [603.1])


def test_a_height_is_at_the_nearest_instant_alone() -> None:
    rows = rows_of([(1.2, 600.0)], np.array([0.0, 1.0, 2.0]))
    np.testing.assert_array_equal(np.isfinite(rows.std[:, 0]), [False, True, False])
    assert (rows.value[1, 0], rows.stamp[1]) == (600.0, 1.2)
