"""What the rate of a body makes of a lever."""

import jax.numpy as jnp
import numpy as np

from altijax.vehicle.parts import Instant, rate_of, turning_of

AT = Instant(rate=jnp.array([0.1, 0.0, 0.5]), acceleration=jnp.zeros(3), delay=jnp.zeros(()))


def test_scales_act_before_the_bias_is_taken_off() -> None:
    state = {"gyro_scale": jnp.array([0.1, 0.0, 0.0]), "gyro_bias": jnp.array([0.0, 0.0, 0.2])}
    np.testing.assert_allclose(rate_of(state, AT), [0.11, 0.0, 0.3])


def test_a_point_ahead_moves_to_the_left_in_a_left_turn() -> None:
    state = {"gyro_bias": jnp.zeros(3), "antenna": jnp.array([2.0, 0.0, 0.0])}
    np.testing.assert_allclose(turning_of(state, AT, "antenna"), [0.0, 1.0, 0.0])
    np.testing.assert_allclose(turning_of(state, AT, "axle"), np.zeros(3))
