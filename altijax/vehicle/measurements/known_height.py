"""Surveyed heights at some times, beside that of the first of them."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.vehicle.measurements.doppler_velocity import means_at
from altijax.vehicle.parts import Instant, Kind, Part, Rows, State

# The datum is believed to be near the first known height: a vehicle may have climbed by so much until there, m.
_CLIMBED = 300.0
# Of a surveyed height at the place the vehicle is said to be, m.
_STD = 0.02


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Height above the datum of the known ones (1,), m."""
    return jnp.stack([state["position"][2] + state["datum"] + state["velocity"][2] * lead])


def rows_of(heights: list[tuple[float, float]], t: np.ndarray) -> Rows:
    """Heights (m) at their times (s) from the IMU's first sample, at the nearest instants."""
    stamp, value = np.array(heights, float).T
    return means_at(t, stamp, value[:, None], np.full((value.size, 1), _STD), np.inf)


KIND = Kind(
    rows=("height",),
    expected=expected,
    measured=lambda recording, t: None,
    parts={"datum": Part(std=_CLIMBED)},
)
