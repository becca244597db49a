"""What the readings lead to between the instants."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.vehicle.sensors import layout_of
from altijax.vehicle.smoother import between
from tests.vehicle.made import USE, short_search

LAYOUT = layout_of(USE)


def test_fine_steps_end_at_the_instants() -> None:
    search = short_search()
    said = between(USE, search.readings, jax.tree.map(jnp.asarray, search.trajectory), jnp.asarray(search.delay))
    x = LAYOUT.split(search.trajectory.x)
    np.testing.assert_allclose(said.v_n[:, -1], x["velocity"][1:], atol=1e-9)
    np.testing.assert_allclose(said.p_n[:, -1], x["position"][1:], atol=1e-8)
    np.testing.assert_allclose(said.C_nb[:, -1], search.trajectory.C_nb[1:], atol=1e-9)


def test_accelerations_are_those_of_the_velocities() -> None:
    search = short_search()
    said = between(USE, search.readings, jax.tree.map(jnp.asarray, search.trajectory), jnp.asarray(search.delay))
    t, v = np.asarray(said.instants), np.asarray(search.trajectory.x)[:, LAYOUT.at("velocity")]
    distinct = np.append(True, np.diff(t) > 1e-9)
    apart = np.gradient(v[distinct], t[distinct], axis=0) - np.asarray(said.acceleration)[distinct]
    # Vibration is in the one and not in the other.
    assert np.sqrt(np.mean(apart[2:-2] ** 2)) < 0.5
