"""The states that every vehicle with an IMU has, and a trajectory of them.

The error of the attitude is a rotation vector in navigation axes, C_nb true = exp(error) C_nb; all else adds.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from altijax.inference.layout import Layout
from altijax.rotations import rotvec_to_matrix
from altijax.vehicle.parts import Level, Part

# Attitude and velocity can be anything; positions and the way count from the first instant.
PARTS = {
    "attitude": Part(size=3, std=2.0),
    "velocity": Part(size=3, std=10.0),
    "position": Part(size=3),
    "way": Part(),
    "accelerometer_bias": Part(size=3, std=0.15, walk="accelerometer_walk"),
    # Vibration rectified, and a body that leans on its springs for a while.
    "force_error": Part(size=3, level=("force_error",), time="force_error_time"),
    "accelerometer_scale": Part(size=3, std=0.015),
    # The share of forward force in the left reading, of forward and of left force in the upward one.
    "accelerometer_axes": Part(size=3, entries=("yx", "zx", "zy"), std=0.005),
}
LEVELS = {
    "acceleration": Level(usual=0.05),
    "accelerometer_walk": Level(usual=1e-3, spread=1.0),
    "force_error": Level(usual=0.02),
    "force_error_time": Level(usual=5.0, spread=0.7),
}
GYRO_LEVELS = {"rotation": Level(usual=0.005), "gyro_walk": Level(usual=1e-4, spread=1.0)}
GYRO_PARTS = {
    "gyro_bias": Part(size=3, std=0.07, walk="gyro_walk"),
    "gyro_scale": Part(size=3, std=0.03),
    # The shares of the other axes' rates in a reading: of y and z in x, of x and z in y, of x and y in z.
    "gyro_axes": Part(size=6, entries=("xy", "xz", "yx", "yz", "zx", "zy"), std=0.005),
}
# Without a gyro the attitude walks as the vehicle turns, about each of its axes, and what lasts of its rate fades.
_TURNING = ("turning_x", "turning_y", "turning_z")
# A bias that may be large would take up what is wrong with so free a bank.
TURNING_PARTS = {
    "accelerometer_bias": Part(size=3, std=0.1, walk="accelerometer_walk"),
    "gyro_bias": Part(size=3, level=_TURNING, time="turning_time"),
}
# Few epochs say little of how anything turns: a likelihood about one trajectory would have it turn ever less.
TURNING_LEVELS = {
    **{name: Level(usual=0.1, spread=0.5) for name in ("rotation_x", "rotation_y", "rotation_z")},
    **{name: Level(usual=0.1, spread=0.5) for name in _TURNING},
    "turning_time": Level(usual=2.0, spread=0.5),
}

ROTATION = ("rotation", "rotation_x", "rotation_y", "rotation_z")

MOVING = ("attitude", "velocity", "position", "way")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """States at a series of instants.

    Attributes
    ----------
    C_nb : (time, 3, 3)
        Attitude.
    x : (time, states)
        All else, in its layout; zero in the place of the attitude.
    """

    C_nb: jax.Array
    x: jax.Array


def stationary(part: Part, levels: Mapping[str, jax.Array]) -> jax.Array:
    """Variances (size,) of a part that fades, as its levels have them."""
    return jnp.broadcast_to(jnp.stack([jnp.asarray(levels[name]) ** 2 for name in part.level]), (part.size,))


def moved(trajectory: Trajectory, x: jax.Array, layout: Layout) -> Trajectory:
    """The trajectory with an error state (time, states) added at each instant."""
    attitude = layout.at("attitude")
    return Trajectory(
        C_nb=rotvec_to_matrix(x[:, attitude]) @ trajectory.C_nb,
        x=trajectory.x + jnp.asarray(x).at[:, attitude].set(0),
    )
