"""A stretch of a drive as an IMU, a GNSS receiver and the wheels see it: the residuals of a drive's calibration.

The IMU carries attitude and velocity from their values at the start of the stretch; the velocity is compared with the
receiver's, and, seen from the vehicle, with the wheels' and with standing still sideways and upwards. All stamps are
corrected by their delays: the reading stamped t was that of ``t - delay`` on the IMU's clock. Vehicle axes come from
those of the IMU by the mounting, ``v_vehicle = C(mounting) v_imu``: the IMU sits nose up by `mounting_pitch` and turned
to the left by `mounting_yaw`. Its roll changes nothing here. Lever arms and side slip are left out.

The noise of the IMU within a stretch is part of the model: at the start of each interval its attitude and
velocity are kicked by as much as white noise makes in that time. So a stretch is as long as one likes.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from altijax.rotations import euler_to_matrix, rotvec_to_matrix
from altijax.sensors import Accelerometer, Gyro, correct_accelerometer, correct_gyro

DRIVE_PARAMETERS = {
    "wheel_scale": (1.0, 0.03, "1"),
    "wheel_delay": (0.0, 0.15, "s"),
    "gnss_delay": (0.0, 0.3, "s"),
    "accelerometer_bias_x": (0.0, 0.3, "m/s^2"),
    "accelerometer_bias_y": (0.0, 0.3, "m/s^2"),
    "accelerometer_bias_z": (0.0, 0.3, "m/s^2"),
    "accelerometer_scale": (1.0, 0.01, "1"),
    "gyro_bias_x": (0.0, 0.02, "rad/s"),
    "gyro_bias_y": (0.0, 0.02, "rad/s"),
    "gyro_bias_z": (0.0, 0.02, "rad/s"),
    "mounting_pitch": (0.0, 0.1, "rad"),
    "mounting_yaw": (0.0, 0.1, "rad"),
}
"""Parameters by name, in the order of the fit: nominal value, prior standard deviation (a consumer's instrument fixed
to a car by hand, assumed), unit."""

GROUPS = ("GNSS horizontal", "GNSS vertical", "wheel", "sideways", "upwards")
"""Kinds of residuals, in the order of the fields `gnss_std` and `wheel_std` of `Stretch`."""

STEP = 0.05
"""Length of a step, s: a car's turns are slow enough for it."""

STEPS_OF_INTERVAL = 100
"""Steps of an interval of the IMU's noise: within 5 s a consumer's gyro makes no more than 5 mm/s of velocity."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Data of one stretch; times count from its start. Missing observations have an infinite standard deviation.

    Attributes
    ----------
    f : (steps, 3) m/s^2
        Mean reading of the accelerometers in each step.
    w : (steps, 3) rad/s
        Mean reading of the gyros.
    C_nb : (3, 3)
        First guess of the attitude at the start.
    gravity : () m/s^2
        Magnitude of gravity.
    noise : (2,) rad/sqrt(s), m/s/sqrt(s)
        Random walk of attitude and of velocity that the IMU's noise makes.
    t_gnss : (epochs,) s
        Stamps of the receiver.
    v_gnss : (epochs, 3) m/s
        Its velocities.
    gnss_std : (epochs, 2) m/s
        Standard deviation of their horizontal components and of the vertical one.
    t_wheel : (samples,) s
        Stamps of the wheels.
    wheel : (samples,) m/s
        Their speeds.
    wheel_std : (samples, 3) m/s
        Standard deviation of the wheel speed and of standing still sideways and upwards.
    """

    f: jax.Array
    w: jax.Array
    C_nb: jax.Array
    gravity: jax.Array
    noise: jax.Array
    t_gnss: jax.Array
    v_gnss: jax.Array
    gnss_std: jax.Array
    t_wheel: jax.Array
    wheel: jax.Array
    wheel_std: jax.Array


def own_states(steps: int) -> int:
    """Number of parameters that each stretch has of its own.

    Parameters
    ----------
    steps : int
        Steps of a stretch.

    Returns
    -------
    states : int
        Attitude and velocity at the start, and six kicks at each later interval.
    """
    return 6 * -(-steps // STEPS_OF_INTERVAL)


def drive_residuals(parameters: jax.Array, own: jax.Array, stretch: Stretch) -> jax.Array:
    """Residuals of a stretch in units of their standard deviations, group after group.

    Parameters
    ----------
    parameters : (12,)
        Values in the order of `DRIVE_PARAMETERS`.
    own : (states,)
        Turn of the first guess of the attitude (rad) and velocity at the start (m/s), both in navigation axes; then,
        interval after interval, kicks in units of their standard deviations, three for attitude and three for velocity.
    stretch : Stretch
        Its data.

    Returns
    -------
    residuals : (observations,)
        East, North and up of all epochs, then wheel, sideways and upwards of all samples.
    """
    p = dict(zip(DRIVE_PARAMETERS, parameters, strict=True))
    v_n, v_vehicle = _motion(p, own, stretch)
    at_epochs = _at(stretch.t_gnss - p["gnss_delay"], v_n)
    gnss = (stretch.v_gnss - at_epochs) / stretch.gnss_std[:, jnp.asarray([0, 0, 1])]
    at_samples = _at(stretch.t_wheel - p["wheel_delay"], v_vehicle)
    shown = jnp.stack([p["wheel_scale"] * stretch.wheel, 0 * stretch.wheel, 0 * stretch.wheel], -1)
    wheel = (shown - at_samples) / stretch.wheel_std
    return jnp.concatenate([gnss.T.reshape(-1), wheel.T.reshape(-1)])


def _motion(p: dict[str, jax.Array], own: jax.Array, stretch: Stretch) -> tuple[jax.Array, jax.Array]:
    """Velocity (steps + 1, 3) in navigation and in vehicle axes."""
    bias, scale, gyro_bias = (
        jnp.stack([p[f"accelerometer_bias_{axis}"] for axis in "xyz"]),
        p["accelerometer_scale"],
        jnp.stack([p[f"gyro_bias_{axis}"] for axis in "xyz"]),
    )
    f = correct_accelerometer(Accelerometer(bias=bias, scale=scale), stretch.f)
    w = correct_gyro(Gyro(bias=gyro_bias), stretch.w, f)
    states = own.reshape(-1, 6)
    turns = jax.lax.associative_scan(_product, rotvec_to_matrix(w * STEP))
    turns = _product(stretch.C_nb, jnp.concatenate([jnp.eye(3, dtype=f.dtype)[None], turns]))
    first_turn = rotvec_to_matrix(states[0, :3])
    # Constant rate and force in the body during a step: to first order the force is turned by half the step.
    force = _turned(turns[:-1], f + jnp.cross(w, f) * STEP / 2) @ first_turn.T
    # Kicks are so small that they add up as vectors.
    begins = jnp.arange(f.shape[0]) // STEPS_OF_INTERVAL
    in_noise = states.at[0].set(0)[begins]
    first = jnp.concatenate([jnp.ones(1, bool), begins[1:] != begins[:-1]])[:, None]
    kicks = jnp.where(first, in_noise, 0) * jnp.repeat(stretch.noise, 3) * (STEPS_OF_INTERVAL * STEP) ** 0.5
    tilt = jnp.cumsum(kicks[:, :3], 0)
    force = force + jnp.cross(tilt, force)
    change = (force - jnp.stack([0 * stretch.gravity, 0 * stretch.gravity, stretch.gravity])) * STEP + kicks[:, 3:]
    v_n = states[0, 3:] + jnp.concatenate([jnp.zeros((1, 3), f.dtype), jnp.cumsum(change, 0)])
    tilt = jnp.concatenate([tilt[:1], tilt])
    mounting = euler_to_matrix(jnp.stack([0 * p["mounting_pitch"], p["mounting_pitch"], p["mounting_yaw"]]))
    v_level = (v_n - jnp.cross(tilt, v_n)) @ first_turn
    v_vehicle = _turned(jnp.swapaxes(turns, -1, -2), v_level) @ mounting.T
    return v_n, v_vehicle


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix product without a call of a matrix routine for each of many small matrices."""
    return jnp.sum(a[..., :, :, None] * b[..., None, :, :], -2)


def _turned(matrices: jax.Array, vectors: jax.Array) -> jax.Array:
    return jnp.sum(matrices * vectors[..., None, :], -1)


def _at(t: jax.Array, values: jax.Array) -> jax.Array:
    """Rows of a uniform series at other times, by the parabola through three neighbours: smooth in the time."""
    place = jnp.clip(t / STEP, 0, values.shape[0] - 1)
    i = jnp.clip(jax.lax.stop_gradient(jnp.round(place)).astype(int), 1, values.shape[0] - 2)
    x = (place - i)[:, None]
    before, here, after = values[i - 1], values[i], values[i + 1]
    return here + x * (after - before) / 2 + x * x * (after - 2 * here + before) / 2
