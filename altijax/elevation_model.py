"""Elevation of a drive as a function of named constants: what the verbs evaluate, calibrate and differentiate."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.altitude import elevation_by_norm, elevation_by_slope, horizontal_distance
from altijax.drives import Drive
from altijax.rotations import euler_to_matrix
from altijax.sensors import Accelerometer, correct_accelerometer
from altijax.signals import cumulative_integral, resample

ELEVATION_METHODS = ("shirai", "slope")

PARAMETERS = pd.DataFrame.from_dict(
    {
        "accelerometer_bias_x": (0.0, 0.3, "m/s^2"),
        "accelerometer_bias_y": (0.0, 0.3, "m/s^2"),
        "accelerometer_bias_z": (0.0, 0.3, "m/s^2"),
        "accelerometer_scale": (1.0, 0.01, "1"),
        "accelerometer_scale_x": (1.0, 0.01, "1"),
        "accelerometer_scale_y": (1.0, 0.01, "1"),
        "accelerometer_scale_z": (1.0, 0.01, "1"),
        "mounting_pitch": (0.0, 0.05, "rad"),
        "wheel_scale": (1.0, 0.01, "1"),
        "wheel_delay": (0.0, 0.1, "s"),
        "gnss_delay": (0.0, 0.1, "s"),
        "initial_vertical_speed": (np.nan, 0.2, "m/s"),
    },
    orient="index",
    columns=["nominal", "uncertainty", "unit"],
)
"""Constants that can be calibrated: nominal value (NaN: found by the method itself); by how much a consumer's sensor,
as mounted, may be off (assumed: it scales the fit, and is the error bar of what was not calibrated); unit."""

NOMINAL = {str(name): float(value) for name, value in PARAMETERS["nominal"].dropna().items()}
UNCERTAINTY = {str(name): float(value) for name, value in PARAMETERS["uncertainty"].items()}

# What is left when the constants are right, assumed; on the road it is the car (trim, squat) more than the sensor.
# 3 cm a root metre, in slope, is 1 m after 1 km; 1 cm/s^2/sqrt(Hz), in vertical acceleration, is 3 m after a minute.
# Where no speed is known, the slope could be 5 %.
_SLOPE_NOISE, _ACCELERATION_NOISE, _UNKNOWN_SLOPE = 0.03, 0.01, 0.05
_FIRST_SECOND = 1.0


@partial(jax.jit, static_argnames="method")
def elevation(values: dict[str, jax.Array], drive: Drive, method: str) -> dict[str, jax.Array]:
    """Elevation, its rate, the way and the horizontal distance on the grid, for constants by name."""

    def value(name: str) -> jax.Array:
        return jnp.asarray(values.get(name, NOMINAL[name]))

    bias = jnp.stack([value(f"accelerometer_bias_{axis}") for axis in "xyz"])
    scale = jnp.stack([value(f"accelerometer_scale_{axis}") for axis in "xyz"])
    f_s = correct_accelerometer(Accelerometer(bias=bias, scale=scale * value("accelerometer_scale")), drive.f)
    mounting = euler_to_matrix(jnp.stack([jnp.zeros(()), value("mounting_pitch"), jnp.zeros(())]))
    f_b = f_s @ mounting.T
    delay = jnp.where(drive.from_wheel, value("wheel_delay"), value("gnss_delay"))
    speed, _ = resample(drive.t + delay, drive.t_speed, drive.speed, jnp.inf)
    speed = speed * jnp.where(drive.from_wheel, value("wheel_scale"), 1.0)
    height, vertical_speed = elevation_by_slope(drive.t, f_b[:, 0], speed, drive.gravity)
    if method == "shirai":
        first = drive.t <= _FIRST_SECOND
        way = jnp.sum(jnp.where(first, speed, 0))
        slope = jnp.sum(jnp.where(first, vertical_speed, 0)) / jnp.where(way > 0, way, 1)
        initial = values.get("initial_vertical_speed", speed[0] * slope)
        height, vertical_speed = elevation_by_norm(drive.t, f_b, speed, drive.yaw_rate, drive.gravity, initial)
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
    }[method]
    speed = ("wheel_scale", "wheel_delay") if drive.from_wheel else ("gnss_delay",)
    deviation = {name: UNCERTAINTY[name] for name in (*own, *speed)}
    if method == "shirai":
        # It is found from the slope, which the mounting pitch is in; at standstill it is known.
        deviation["initial_vertical_speed"] = float(drive.speed[0]) * UNCERTAINTY["mounting_pitch"]
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


def elevation_std(
    found: dict[str, jax.Array], jacobian: jax.Array, covariance: np.ndarray, t: jax.Array, method: str
) -> jax.Array:
    """Standard deviation of the elevation: what the constants leave open, what the road adds, what is not supported."""
    constants = jnp.einsum("ti,ij,tj->t", jacobian, covariance, jacobian)
    noise = _ACCELERATION_NOISE**2 * t**3 / 3 if method == "shirai" else _SLOPE_NOISE**2 * found["way"]
    unsupported = cumulative_integral(t, jnp.where(found["valid"], 0.0, jnp.maximum(found["speed"], 1.0)))
    return jnp.sqrt(constants + noise + (_UNKNOWN_SLOPE * unsupported) ** 2)
