"""A stretch of a drive as an IMU, a GNSS receiver and the wheels see it: the residuals of a drive's calibration.

The IMU carries attitude and velocity from their values at the start of the stretch; the velocity is compared with the
receiver's, and, seen from the vehicle, with the wheels' and with standing still sideways and upwards. All stamps are
corrected by their delays: the reading stamped t was that of ``t - delay`` on the IMU's clock. Vehicle axes come from
those of the IMU by the mounting, ``v_vehicle = C(mounting) v_imu``: the IMU sits nose up by `mounting_pitch` and turned
to the left by `mounting_yaw`. Its roll changes nothing here. What stands still sideways and upwards is the middle of
the rear axle, `lever_arm` behind the IMU; the antenna is `antenna_lever_arm` ahead of it. An accelerating body pitches
up by `weight_transfer` a / g, and driven tyres turn faster than they roll, by `wheel_slip` a. Where the wheels of an
axle that is not steered are recorded one by one, the right one goes faster than the left one by the rate of turn times
`track_width`; a right wheel that is larger than the left one by the fraction `wheel_difference` shows less of it. Side
slip, the way that steered wheels go further in a bend, and lever arms across and up are left out.

The noise of the IMU within a stretch is part of the model: in each interval its attitude and velocity drift evenly by
as much as white noise makes in that time, the straight line through Brownian motion. What is left of that between the
ends of an interval has a third of the variance that kicks at its ends would leave. So a stretch is as long as one
likes. So is an error of the receiver's velocity that lasts a whole stretch, as satellites' paths through the air and
reflections make it: no residual shows it, and without it a long drive would know the wheels better than the receiver
knows the speed.
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
    "gyro_scale_z": (1.0, 0.01, "1"),
    "weight_transfer": (0.0, 0.1, "1"),
    "wheel_slip": (0.0, 0.003, "s^2/m"),
    "lever_arm": (0.0, 1.5, "m"),
    "antenna_lever_arm": (0.0, 1.0, "m"),
    "wheel_difference": (0.0, 0.02, "1"),
    "track_width": (1.5, 0.1, "m"),
}
"""Parameters by name, in the order of the fit: nominal value, prior standard deviation (a consumer's instrument fixed
to a car by hand, assumed; a tyre slips by some 1 % at a third of g), unit."""

GROUPS = ("GNSS horizontal", "GNSS vertical", "wheel", "sideways", "upwards", "right less left wheel")
"""Kinds of residuals, in the order of the fields `gnss_std` and `wheel_std` of `Stretch`."""

STEP = 0.05
"""Length of a step, s: a car's turns are slow enough for it."""

STEPS_OF_INTERVAL = 60
"""Steps of an interval of the IMU's noise, 3 s: with 5 s, what is left of it between the ends shook a wheel's delay by
15 % more than its bar says; with 2 s a fit takes twice as long."""

_LOOK = 3  # steps either way for the acceleration: wide against its noise, short against a driver's foot


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
    noise : (3,) rad/sqrt(s), m/s/sqrt(s), m/s
        Random walk of attitude and of velocity that the IMU's noise makes, and the size of the receiver's slow error.
    t_gnss : (epochs,) s
        Stamps of the receiver.
    v_gnss : (epochs, 3) m/s
        Its velocities.
    gnss_std : (epochs, 2) m/s
        Standard deviation of their horizontal components and of the vertical one.
    t_wheel : (samples,) s
        Stamps of the wheels.
    wheel : (samples,) m/s
        Their speeds, each the mean over some time.
    apart : (samples,) m/s
        By how much the right wheel of an axle is faster than the left one, means likewise.
    wheel_spread : (samples,) s
        Standard deviation of the times that they are the means of.
    wheel_std : (samples, 4) m/s
        Standard deviation of the wheel speed, of standing still sideways and upwards, and of `apart`.
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
    apart: jax.Array
    wheel_spread: jax.Array
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
        Attitude and velocity at the start, six drifts in each interval, and the receiver's slow error.
    """
    return 9 + 6 * -(-steps // STEPS_OF_INTERVAL)


def drive_residuals(parameters: jax.Array, own: jax.Array, stretch: Stretch) -> jax.Array:
    """Residuals of a stretch in units of their standard deviations, group after group.

    Parameters
    ----------
    parameters : (19,)
        Values in the order of `DRIVE_PARAMETERS`.
    own : (states,)
        Turn of the first guess of the attitude (rad) and velocity at the start (m/s), both in navigation axes; then,
        interval after interval, drifts in units of their standard deviations, for attitude, then velocity;
        last, in the same units, the error of the receiver.
    stretch : Stretch
        Its data.

    Returns
    -------
    residuals : (observations,)
        East, North and up of all epochs, then wheel, sideways, upwards and right less left wheel of all samples.
    """
    p = dict(zip(DRIVE_PARAMETERS, parameters, strict=True))
    v_antenna, v_wheels = _motion(p, own, stretch)
    at_epochs = _at(stretch.t_gnss - p["gnss_delay"], v_antenna) + stretch.noise[2] * own[-3:]
    gnss = (stretch.v_gnss - at_epochs) / stretch.gnss_std[:, jnp.asarray([0, 0, 1])]
    turned = v_wheels[:, 0] * -p["wheel_difference"] + p["track_width"] * v_wheels[:, 3]
    rolled = jnp.stack([v_wheels[:, 0], turned], -1)
    bend = jnp.pad(jnp.diff(rolled, 2, axis=0), ((1, 1), (0, 0))) / STEP**2
    rolled, bend = jnp.split(_at(stretch.t_wheel - p["wheel_delay"], jnp.concatenate([rolled, bend], -1)), 2, -1)
    rolled = rolled + stretch.wheel_spread[:, None] ** 2 / 2 * bend
    # Standing still sideways and upwards holds at any time, whatever the wheels' stamps.
    still = _at(stretch.t_wheel, v_wheels[:, 1:3])
    at_samples = jnp.concatenate([rolled[:, :1], still, rolled[:, 1:]], -1)
    none = jnp.zeros_like(stretch.wheel)
    shown = p["wheel_scale"] * jnp.stack([stretch.wheel, none, none, stretch.apart], -1)
    wheel = (shown - at_samples) / stretch.wheel_std
    return jnp.concatenate([gnss.T.reshape(-1), wheel.T.reshape(-1)])


def _motion(p: dict[str, jax.Array], own: jax.Array, stretch: Stretch) -> tuple[jax.Array, jax.Array]:
    """Velocity (steps + 1, 3) of the antenna in navigation axes; speed, left, up and rate of turn (steps + 1, 4)."""
    bias, scale, gyro_bias = (
        jnp.stack([p[f"accelerometer_bias_{axis}"] for axis in "xyz"]),
        p["accelerometer_scale"],
        jnp.stack([p[f"gyro_bias_{axis}"] for axis in "xyz"]),
    )
    f = correct_accelerometer(Accelerometer(bias=bias, scale=scale), stretch.f)
    gyro_scale = jnp.stack([jnp.ones_like(p["gyro_scale_z"])] * 2 + [p["gyro_scale_z"]])
    w = correct_gyro(Gyro(bias=gyro_bias, scale=gyro_scale), stretch.w, f)
    start, drifts = own[:6], own[6:-3].reshape(-1, 6)
    turns = jax.lax.associative_scan(_product, rotvec_to_matrix(w * STEP))
    turns = _product(stretch.C_nb, jnp.concatenate([jnp.eye(3, dtype=f.dtype)[None], turns]))
    first_turn = rotvec_to_matrix(start[:3])
    # Constant rate and force in the body during a step: to first order the force is turned by half the step.
    force = _turned(turns[:-1], f + jnp.cross(w, f) * STEP / 2) @ first_turn.T
    # Drifts are so small that they add up as vectors.
    drift = drifts[jnp.arange(f.shape[0]) // STEPS_OF_INTERVAL] * jnp.repeat(stretch.noise[:2], 3)
    drift = drift * (STEP / STEPS_OF_INTERVAL) ** 0.5
    tilt = jnp.concatenate([jnp.zeros((1, 3), f.dtype), jnp.cumsum(drift[:, :3], 0)])
    force = force + jnp.cross((tilt[:-1] + tilt[1:]) / 2, force)
    change = (force - jnp.stack([0 * stretch.gravity, 0 * stretch.gravity, stretch.gravity])) * STEP + drift[:, 3:]
    v_n = start[3:] + jnp.concatenate([jnp.zeros((1, 3), f.dtype), jnp.cumsum(change, 0)])
    mounting = euler_to_matrix(jnp.stack([0 * p["mounting_pitch"], p["mounting_pitch"], p["mounting_yaw"]]))
    v_level = (v_n - jnp.cross(tilt, v_n)) @ first_turn
    v_vehicle = _turned(jnp.swapaxes(turns, -1, -2), v_level) @ mounting.T
    # Rates at the ends of the steps, and by them the velocity of a point one metre ahead of another.
    w = (jnp.concatenate([w[:1], w]) + jnp.concatenate([w, w[-1:]])) / 2 @ mounting.T
    per_metre = jnp.stack([jnp.zeros_like(w[:, 0]), w[:, 2], -w[:, 1]], -1)
    v_antenna = v_n + p["antenna_lever_arm"] * (_turned(turns, per_metre @ mounting) @ first_turn.T)
    forward, left, up = (v_vehicle - p["lever_arm"] * per_metre).T
    nodes = jnp.arange(forward.size)
    before, after = jnp.maximum(nodes - _LOOK, 0), jnp.minimum(nodes + _LOOK, forward.size - 1)
    acceleration = (forward[after] - forward[before]) / ((after - before) * STEP)
    squat = p["weight_transfer"] / stretch.gravity * acceleration
    cos, sin = jnp.cos(squat), jnp.sin(squat)
    forward, up = forward * cos - up * sin, forward * sin + up * cos
    shown = forward * (1 + p["wheel_slip"] * acceleration)
    return v_antenna, jnp.stack([shown, left, up, w[:, 2]], -1)


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix product without a call of a matrix routine for each of many small matrices."""
    return jnp.sum(a[..., :, :, None] * b[..., None, :, :], -2)


def _turned(matrices: jax.Array, vectors: jax.Array) -> jax.Array:
    return jnp.sum(matrices * vectors[..., None, :], -1)


def _at(t: jax.Array, values: jax.Array) -> jax.Array:
    """Rows of a uniform series at other times, by Catmull and Rom's cubic.

    Its slope is continuous in the time: else a delay finds a minimum of its own wherever neighbours change.
    """
    place = jnp.clip(t / STEP, 0, values.shape[0] - 1)
    i = jnp.clip(jax.lax.stop_gradient(jnp.floor(place)).astype(int), 1, values.shape[0] - 3)
    x = (place - i)[:, None]
    a, b, c, d = (values[i + k] for k in (-1, 0, 1, 2))
    slope = (c - a) / 2
    return b + x * (slope + x * (a - 2.5 * b + 2 * c - d / 2 + x * (1.5 * (b - c) + (d - a) / 2)))
