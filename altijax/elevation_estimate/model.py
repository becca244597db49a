"""Elevation of a drive as a function of named constants: what the verbs evaluate, calibrate and differentiate."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.altitude import elevation_by_norm, elevation_by_slope, horizontal_distance
from altijax.calibration.parameters import PARAMETERS
from altijax.drives import Drive
from altijax.rotations import euler_to_matrix
from altijax.sensors import Accelerometer, correct_accelerometer
from altijax.signals import cumulative_integral, resample

ELEVATION_METHODS = ("shirai", "slope", "fused")

NOMINAL = {str(name): float(value) for name, value in PARAMETERS["nominal"].dropna().items()}
UNCERTAINTY = {str(name): float(value) for name, value in PARAMETERS["uncertainty"].items()}

_FIRST_SECOND = 1.0


@partial(jax.jit, static_argnames="method")
def elevation(values: dict[str, jax.Array], drive: Drive, method: str) -> dict[str, jax.Array]:
    """Elevation by one of the two ways, its rate, the way and the horizontal distance on the grid.

    "fused" is the slope way here: the two are fused in `elevation_posterior`.
    """

    def value(name: str) -> jax.Array:
        return jnp.asarray(values.get(name, NOMINAL[name]))

    bias = jnp.stack([value(f"accelerometer_bias_{axis}") for axis in "xyz"])
    scale = jnp.stack([value(f"accelerometer_scale_{axis}") for axis in "xyz"])
    f_s = correct_accelerometer(Accelerometer(bias=bias, scale=scale * value("accelerometer_scale")), drive.f)
    mounting = euler_to_matrix(jnp.stack([jnp.zeros(()), value("mounting_pitch"), value("mounting_yaw")]))
    yaw_rate = drive.yaw_rate - value("yaw_rate_bias")
    # A sensor ahead of the point that moves along the path is drawn backwards in turns.
    f_b = (f_s @ mounting.T).at[:, 0].add(value("lever_arm") * yaw_rate**2)
    delay = jnp.where(drive.from_wheel, value("wheel_delay"), value("gnss_delay"))
    speed, _ = resample(drive.t + delay, drive.t_speed, drive.speed, jnp.inf)
    speed = speed * jnp.where(drive.from_wheel, value("wheel_scale"), 1.0)
    # The car pitches under the same load that the accelerometer reads, on a slope as much as when it speeds up.
    f_x = f_b[:, 0] / (1 + value("weight_transfer"))
    height, vertical_speed = elevation_by_slope(drive.t, f_x, speed, drive.gravity)
    if method == "shirai":
        first = drive.t <= _FIRST_SECOND
        way = jnp.sum(jnp.where(first, speed, 0))
        slope = jnp.sum(jnp.where(first, vertical_speed, 0)) / jnp.where(way > 0, way, 1)
        initial = values.get("initial_vertical_speed", speed[0] * slope)
        height, vertical_speed = elevation_by_norm(drive.t, f_b, speed, yaw_rate, drive.gravity, initial)
    return {
        "elevation": height,
        "vertical_speed": vertical_speed,
        "way": cumulative_integral(drive.t, speed),
        "horizontal": horizontal_distance(drive.t, speed, vertical_speed),
        "speed": speed,
        "valid": drive.supported,
    }


def uncertain_constants(drive: Drive, method: str) -> dict[str, float]:
    """Standard deviation of each constant that a method depends on, for an instrument that nobody has calibrated."""
    own = {
        "shirai": ("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z", "accelerometer_scale"),
        "slope": ("accelerometer_bias_x", "accelerometer_scale_x", "mounting_pitch"),
        "fused": (
            *("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z"),
            *("accelerometer_scale", "accelerometer_scale_x", "mounting_pitch", "mounting_yaw"),
            *("lever_arm", "weight_transfer", "yaw_rate_bias"),
        ),
    }[method]
    speed = ("wheel_scale", "wheel_delay") if drive.from_wheel else ("gnss_delay",)
    deviation = {name: UNCERTAINTY[name] for name in (*own, *speed)}
    if method != "slope":
        # It is found from the slope, which the mounting pitch is in; at standstill it is known.
        deviation["initial_vertical_speed"] = float(drive.speed[0]) * UNCERTAINTY["mounting_pitch"]
    if method == "fused":
        # A speed sensor at rest may read a little.
        deviation["initial_vertical_speed"] = float(np.hypot(1.2 * deviation["initial_vertical_speed"], 0.02))
    return deviation


@partial(jax.jit, static_argnames=("names", "method"))
def elevation_and_sensitivity(
    values: dict[str, jax.Array], drive: Drive, names: tuple[str, ...], method: str
) -> tuple[dict[str, jax.Array], jax.Array]:
    """Elevation and the rest, and the elevation's derivatives with respect to the named constants (time, names)."""
    found = elevation(values, drive, method)
    start = {**NOMINAL, "initial_vertical_speed": found["vertical_speed"][0]} | values

    def height(x: jax.Array) -> jax.Array:
        return elevation(values | dict(zip(names, x, strict=True)), drive, method)["elevation"]

    return found, jax.jacfwd(height)(jnp.stack([jnp.asarray(start[name]) for name in names]))
