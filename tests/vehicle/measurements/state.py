"""A state of a vehicle that drives to the North at 10 m/s and turns to the left."""

import jax.numpy as jnp
from scipy.spatial.transform import Rotation

from altijax.vehicle.parts import Instant

AT = Instant(rate=jnp.array([0.0, 0.0, 0.2]), acceleration=jnp.array([-2.0, 0.5, 0.0]), delay=jnp.asarray(0.1))
NOW = jnp.zeros(())


def driving(**changed: object) -> dict[str, object]:
    zero3, zero2, zero = jnp.zeros(3), jnp.zeros(2), jnp.zeros(())
    names3 = ("position", "gyro_bias", "gyro_scale", "antenna", "axle", "velocity_error")
    names1 = ("climb_delay", "wheel_scale", "wheel_delay", "wheel_slip", "datum")
    state = dict.fromkeys(names3, zero3) | dict.fromkeys(names1, zero)
    state |= dict.fromkeys(("mounting", "slip", "yielding", "place", "place_error"), zero2)
    state["gnss_delay"] = jnp.asarray(0.1)
    state["velocity"] = jnp.array([0.0, 10.0, 0.0])
    state["C_nb"] = jnp.asarray(Rotation.from_euler("Z", 90, degrees=True).as_matrix())
    return state | changed
