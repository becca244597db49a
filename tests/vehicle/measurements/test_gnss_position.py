"""Places of the antenna beside the first one."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from altijax.vehicle.measurements.gnss_position import expected, measured, origin_of
from tests.vehicle.made import short_drive
from tests.vehicle.measurements.state import AT, NOW, driving


def test_places_are_of_the_antenna_and_late() -> None:
    state = driving(position=jnp.array([5.0, 7.0, 1.0]), antenna=jnp.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(expected(state, AT, NOW), [5, 8], atol=1e-12)
    late = state | {"gnss_delay": jnp.asarray(0.2)}
    np.testing.assert_allclose(expected(late, AT, NOW), [5, 7], atol=1e-12)


def test_the_first_place_is_the_origin() -> None:
    rows = measured(short_drive(), short_drive().gnss.index.to_numpy(float))
    assert rows is not None
    np.testing.assert_allclose(rows.value[0], [0, 0], atol=1e-6)
    lat, lon, _ = origin_of(short_drive())
    assert (lat, lon) == tuple(short_drive().gnss[["lat", "lon"]].iloc[0])
    assert origin_of(replace(short_drive(), gnss=None)) is None
