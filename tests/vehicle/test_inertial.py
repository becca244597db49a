"""Trajectories and their errors."""

import jax.numpy as jnp
import numpy as np

from altijax.vehicle.inertial import Trajectory, moved, stationary
from altijax.vehicle.parts import Part
from altijax.vehicle.sensors import layout_of
from tests.vehicle.made import USE

LAYOUT = layout_of(USE)


def test_an_error_of_the_attitude_turns_about_navigation_axes() -> None:
    C = np.broadcast_to(np.eye(3), (1, 3, 3))
    x = np.zeros((1, LAYOUT.size))
    turned = moved(Trajectory(C_nb=jnp.asarray(C), x=jnp.asarray(x)), jnp.asarray(x).at[0, 2].set(0.1), LAYOUT)
    np.testing.assert_allclose(turned.C_nb[0, :, 0], [np.cos(0.1), np.sin(0.1), 0], atol=1e-12)
    assert not turned.x.any()


def test_parts_that_fade_vary_as_their_levels_say() -> None:
    levels = {"a": 0.1, "b": 0.2}
    np.testing.assert_allclose(stationary(Part(size=3, level=("a", "a", "b"), time="t"), levels), [0.01, 0.01, 0.04])
    np.testing.assert_allclose(stationary(Part(size=2, level=("b",), time="t"), levels), [0.04, 0.04])
