"""Attitude, velocity and sensor constants between GNSS epochs, as a linear model of small errors about a trajectory.

The error state of each instant, about the trajectory it is linearised at:

    0-2    attitude, a rotation vector in navigation axes: C_nb true = exp(error) C_nb
    3-5    velocity, m/s
    6-8    accelerometer bias, m/s^2
    9-11   gyro bias, rad/s
    12-14  inverse gyro scale less one
    15-16  yaw and pitch of body x from the direction of travel through the air, on average, rad
    17-18  wind towards East and North, m/s
    19     how much later than the horizontal velocities the vertical ones are, s
    20-21  sideslip and attack: by how much yaw and pitch of body x differ from that average, rad

Of these 12 to 19 are constants. A state that does not exist has zero prior variance. Without a gyro the readings of the
rate are zero: the attitude walks at random, and the bias takes the part of the rate of turn that lasts.

The trajectory need not obey its own dynamics: what is missing at each step is part of the model, so that repeating
linearisation and smoothing is the Gauss-Newton method on the whole record and ends at its most probable trajectory.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax.motion_estimate.preintegration import Preintegrated, preintegrate, relative_attitudes
from altijax.rotations import matrix_to_rotvec, rotvec_to_matrix, skew

STATES = 22

# Speed through the air below which body x says little of the direction of travel, m/s.
_SLIP = 0.5
# How fast attitude and velocity may change unseen in a gap of the IMU: rad/s and m/s^2.
_UNSEEN_TURN, _UNSEEN_ACCELERATION = 0.5, 3.0


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class MotionNoise:
    """Noise levels of the model.

    Attributes
    ----------
    rotation : () rad/s^0.5
        Random walk of the attitude: the gyro's noise, or without a gyro the turning itself.
    acceleration : () m/s^1.5
        Random walk of the velocity: noise and vibration of the accelerometer.
    gyro_walk : () rad/s^1.5
        Random walk of the gyro bias.
    accelerometer_walk : () m/s^2.5
        Random walk of the accelerometer bias.
    horizontal : ()
        Factor on the standard deviations of the horizontal velocities.
    vertical : ()
        The same of the vertical ones.
    sideslip : () rad
        Standard deviation of the sideslip: the yaw of body x from the direction of travel.
    attack : () rad
        The same of the angle of attack: its pitch from there.
    slip_time : () s
        How long both last: the correlation time of a Gauss-Markov process of the first order.
    """

    rotation: ArrayLike = 0.005
    acceleration: ArrayLike = 0.05
    gyro_walk: ArrayLike = 1e-4
    accelerometer_walk: ArrayLike = 1e-3
    horizontal: ArrayLike = 1.0
    vertical: ArrayLike = 1.0
    sideslip: ArrayLike = 0.1
    attack: ArrayLike = 0.1
    slip_time: ArrayLike = 3.0


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """States at a series of instants.

    Attributes
    ----------
    C_nb : (time, 3, 3)
        Attitude.
    v_n : (time, 3) m/s
        Velocity, East, North and up.
    accelerometer_bias : (time, 3) m/s^2
        Bias.
    gyro_bias : (time, 3) rad/s
        Bias.
    slip : (time, 2) rad
        Sideslip and attack.
    constants : (8,)
        Inverse gyro scales less one (3), yaw and pitch of body x from the direction of travel (rad), wind to East and
        North (m/s), delay of the vertical velocities beside the horizontal ones (s).
    """

    C_nb: jax.Array
    v_n: jax.Array
    accelerometer_bias: jax.Array
    gyro_bias: jax.Array
    slip: jax.Array
    constants: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Intervals:
    """Readings between the instants.

    Attributes
    ----------
    f_b : (intervals, steps, 3) m/s^2
        Mean specific force of equal steps.
    w_b : (intervals, steps, 3) rad/s
        Mean angular rate of the same; zero without a gyro.
    dt : (intervals, steps) s
        Length of each step; zero where steps only fill an interval up.
    duration : (intervals,) s
        Length of each interval.
    gap : (intervals,) s
        How much of it no reading supports.
    """

    f_b: jax.Array
    w_b: jax.Array
    dt: jax.Array
    duration: jax.Array
    gap: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Gains:
    """What the readings say of each interval, in navigation axes: all that depends on when its instants are.

    Attributes
    ----------
    velocity : (intervals, 3) m/s
        Integral of the specific force.
    turn_by_gyro : (intervals, 3, 6)
        Derivative of the final attitude, as a rotation vector, by gyro bias (rad/s) and inverse gyro scale.
    velocity_by_gyro : (intervals, 3, 6)
        Derivative of the final velocity by the same.
    velocity_by_bias : (intervals, 3, 3) s
        Derivative of the final velocity by the accelerometer bias.
    velocity_by_turn : (intervals, 3, 3) m/s
        Derivative of the final velocity by a rotation vector that grows evenly over the interval.
    miss : (intervals, 3) rad
        Rotation vector from the attitude that the gyro leads to to the trajectory's own.
    duration : (intervals,) s
        Length of each interval.
    gap : (intervals,) s
        How much of it no reading supports.
    """

    velocity: jax.Array
    turn_by_gyro: jax.Array
    velocity_by_gyro: jax.Array
    velocity_by_bias: jax.Array
    velocity_by_turn: jax.Array
    miss: jax.Array
    duration: jax.Array
    gap: jax.Array


def preintegrated_intervals(trajectory: Trajectory, intervals: Intervals) -> tuple[Preintegrated, jax.Array]:
    """Readings corrected by the trajectory's constants and summed over each interval.

    Returns
    -------
    preintegrated : Preintegrated
        Of each interval.
    miss : (intervals, 3) rad
        Rotation vector, in navigation axes, from the attitude that the gyro leads to to the trajectory's own.
    """
    C, scale = trajectory.C_nb[:-1], 1 + trajectory.constants[:3]
    w_b = intervals.w_b * scale - trajectory.gyro_bias[:-1, None]
    f_b = intervals.f_b - trajectory.accelerometer_bias[:-1, None]

    by_gyro = relative_attitudes(w_b, intervals.dt)
    reached = jnp.swapaxes(C, -1, -2) @ trajectory.C_nb[1:]
    turn = matrix_to_rotvec(reached @ jnp.swapaxes(by_gyro[:, -1], -1, -2))
    summed = preintegrate(f_b, w_b, by_gyro, turn, intervals.dt)
    bias = trajectory.gyro_bias[:-1, None]

    def by_raw_rate(columns: jax.Array) -> jax.Array:
        """The scale multiplies the reading before the bias is taken off."""
        by_bias, by_scale = columns[..., :3], columns[..., 3::4]
        return jnp.concatenate([by_bias, (by_scale - bias * by_bias) / scale], -1)

    summed = replace(
        summed,
        turn_by_gyro=by_raw_rate(summed.turn_by_gyro),
        velocity_by_gyro=by_raw_rate(summed.velocity_by_gyro),
    )
    return summed, jnp.einsum("kij,kj->ki", C, turn)


def interval_gains(C: jax.Array, preintegrated: Preintegrated, miss: jax.Array, intervals: Intervals) -> Gains:
    """Preintegrated intervals in navigation axes, C the attitude (intervals, 3, 3) at the beginning of each."""
    return Gains(
        velocity=jnp.einsum("kij,kj->ki", C, preintegrated.velocity[:, -1]),
        turn_by_gyro=C @ preintegrated.turn_by_gyro,
        velocity_by_gyro=C @ preintegrated.velocity_by_gyro,
        velocity_by_bias=C @ preintegrated.velocity_by_bias,
        velocity_by_turn=C @ preintegrated.velocity_by_turn @ jnp.swapaxes(C, -1, -2),
        miss=miss,
        duration=intervals.duration,
        gap=intervals.gap,
    )


def motion_transitions(
    trajectory: Trajectory, gains: Gains, noise: MotionNoise, gravity: ArrayLike
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Transition of the error state over each interval.

    Parameters
    ----------
    trajectory : Trajectory
        Where to linearise.
    gains : Gains
        What the readings say of each interval, about the same trajectory.
    noise : MotionNoise
        Noise levels.
    gravity : () m/s^2
        Magnitude of gravity.

    Returns
    -------
    F : (intervals, 22, 22)
        Derivative of the state by the one before.
    c : (intervals, 22)
        What is missing for the trajectory to obey its own dynamics.
    Q : (intervals, 22, 22)
        Covariance of the noise.
    """
    gravity = require_shape("gravity", gravity, ())
    gained, by_turn, dt, gap = gains.velocity, gains.velocity_by_turn, gains.duration, gains.gap
    dtype, count = dt.dtype, dt.size
    down = jnp.array([0, 0, -1], dtype) * gravity
    identity = jnp.eye(STATES, dtype=dtype)
    lever = skew(gained)
    kept = jnp.exp(-dt / noise.slip_time)

    def zeros(*shape: int) -> jax.Array:
        return jnp.zeros((count, *shape), dtype)

    attitude = jnp.concatenate([zeros(3, 9), gains.turn_by_gyro, zeros(3, 7)], -1)
    velocity = [-lever, zeros(3, 3), gains.velocity_by_bias, gains.velocity_by_gyro, zeros(3, 7)]
    fading = (jnp.arange(STATES) >= 20) * (kept - 1)[:, None]
    F = identity + jnp.concatenate([attitude, jnp.concatenate(velocity, -1), zeros(16, STATES)], -2)
    F = F + fading[:, None] * identity

    before, after = slice(None, -1), slice(1, None)
    missing = trajectory.v_n[before] + down * dt[:, None] + gained - trajectory.v_n[after]
    missing = missing - jnp.einsum("kij,kj->ki", by_turn, gains.miss)
    walked = [b[before] - b[after] for b in (trajectory.accelerometer_bias, trajectory.gyro_bias)]
    slipped = kept[:, None] * trajectory.slip[before] - trajectory.slip[after]
    c = jnp.concatenate([-gains.miss, missing, *walked, zeros(8), slipped], -1)

    turned = (noise.rotation**2 * dt + (_UNSEEN_TURN * gap) ** 2)[:, None, None]
    # An even turn is what the ends of a random walk leave on average; about it the walk still wanders.
    wander = lever @ jnp.swapaxes(lever, -1, -2) / 12
    spread = by_turn @ jnp.swapaxes(by_turn, -1, -2) + wander
    upper = jnp.concatenate(
        [jnp.broadcast_to(jnp.eye(3, dtype=dtype), by_turn.shape), jnp.swapaxes(by_turn, -1, -2)], -1
    )
    moving = turned * jnp.concatenate([upper, jnp.concatenate([by_turn, spread], -1)], -2)
    shaken = noise.acceleration**2 * dt + (_UNSEEN_ACCELERATION * gap) ** 2
    forgotten = -jnp.expm1(-2 * dt / noise.slip_time)
    variances = [shaken, noise.accelerometer_walk**2 * dt, noise.gyro_walk**2 * dt]
    slips = [noise.sideslip**2 * forgotten, noise.attack**2 * forgotten]
    alone = jnp.concatenate([zeros(3), jnp.repeat(jnp.stack(variances, -1), 3, -1), zeros(8), jnp.stack(slips, -1)], -1)
    Q = jnp.pad(moving, [(0, 0), (0, STATES - 6), (0, STATES - 6)]) + alone[:, None] * identity
    return F, c, Q


def motion_measurements(
    trajectory: Trajectory, v_gnss: ArrayLike, variance: ArrayLike, slip_variance: ArrayLike, climbing: ArrayLike
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Measurements at each instant: three velocities, and the direction of travel against body x.

    Parameters
    ----------
    trajectory : Trajectory
        Where to linearise.
    v_gnss : (time, 3) m/s
        Measured velocity.
    variance : (time, 3) m^2/s^2
        Its variances; infinite where there is no measurement.
    slip_variance : (time,) rad^2
        Variance of what mount and slips leave of the angles between body x and the direction of travel; infinite where
        these are not to be used.
    climbing : (time,) m/s^2
        Vertical acceleration just before each instant.

    Returns
    -------
    z : (time, 5)
        Measurement less what the trajectory has.
    H : (time, 5, 22)
        Derivative by the error state.
    R : (time, 5)
        Variances.
    """
    v_gnss = require_shape("v_gnss", v_gnss, (None, 3))
    variance = require_shape("variance", variance, v_gnss.shape)
    slip_variance = require_shape("slip_variance", slip_variance, v_gnss.shape[:1])
    climbing = require_shape("climbing", climbing, v_gnss.shape[:1])
    constants, count, dtype = trajectory.constants, len(v_gnss), v_gnss.dtype
    air = trajectory.v_n - jnp.append(constants[5:7], 0.0)
    C_bn = jnp.swapaxes(trajectory.C_nb, -1, -2)
    in_body = jnp.einsum("kij,kj->ki", C_bn, air)

    def angles(v_b: jax.Array) -> jax.Array:
        """Yaw and pitch of the direction of travel in body axes."""
        forward, left, up = v_b
        return jnp.stack([_safe.arctan2(left, forward), _safe.arctan2(up, _safe.norm(v_b[:2]))])

    missed = jax.vmap(angles)(in_body) + trajectory.slip + constants[3:5]
    by_velocity = jax.vmap(jax.jacfwd(angles))(in_body) @ C_bn
    late = -constants[7] * climbing * jnp.eye(3, dtype=dtype)[2][:, None]
    at = jnp.concatenate([trajectory.v_n + late.T, missed], -1)

    def fixed(matrix: jax.Array) -> jax.Array:
        return jnp.broadcast_to(matrix, (count, *matrix.shape))

    two, none = jnp.eye(2, dtype=dtype), jnp.zeros
    later = -climbing[:, None, None] * jnp.eye(3, dtype=dtype)[:, 2:]
    velocity = [fixed(none((3, 3), dtype)), fixed(jnp.eye(3, dtype=dtype)), fixed(none((3, 13), dtype)), later]
    velocity.append(fixed(none((3, 2), dtype)))
    slip = [by_velocity @ skew(air), by_velocity, fixed(none((2, 9), dtype)), fixed(two), -by_velocity[..., :2]]
    slip += [fixed(none((2, 1), dtype)), fixed(two)]
    H = jnp.concatenate([jnp.concatenate(velocity, -1), jnp.concatenate(slip, -1)], -2)

    slip_variance = slip_variance + _SLIP**2 / jnp.maximum(jnp.sum(air * air, -1), 1e-6)
    R = jnp.concatenate([variance, slip_variance[:, None], slip_variance[:, None]], -1)
    there = jnp.isfinite(R)
    z = jnp.concatenate([v_gnss, jnp.zeros_like(v_gnss[:, :2])], -1) - at
    return jnp.where(there, z, 0), jnp.where(there[..., None], H, 0), jnp.where(there, R, 1)


def moved(trajectory: Trajectory, x: ArrayLike) -> Trajectory:
    """The trajectory with an error state added at each instant, the constants' from the last."""
    x = require_shape("x", x, (trajectory.v_n.shape[0], STATES))
    return Trajectory(
        C_nb=rotvec_to_matrix(x[:, :3]) @ trajectory.C_nb,
        v_n=trajectory.v_n + x[:, 3:6],
        accelerometer_bias=trajectory.accelerometer_bias + x[:, 6:9],
        gyro_bias=trajectory.gyro_bias + x[:, 9:12],
        slip=trajectory.slip + x[:, 20:],
        constants=trajectory.constants + x[-1, 12:20],
    )
