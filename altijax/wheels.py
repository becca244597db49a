"""Wheel sensors: the pulses that magnets on turning wheels give, and way, speed and yaw rate from pulses.

An axle has a left and a right wheel, in this order on the axis `wheels`. A pulse says that a magnet passed and when; it
carries no sign, so reverse motion counts like forward motion, and where a wheel reverses the model is up to one pulse
off (the magnet that passed last would be the next one again).

Between pulses the way is a rational quadratic spline (Gregory and Delbourgo 1982): it never runs backward, gains one
pulse from pulse to pulse, and is exact for constant acceleration. In a long gap its speed falls from the last one by
itself, below 1 / (4 T) pulses per second after T seconds without a pulse. After the last pulse and before the first
the gap is taken as endless, so that from the pulses up to now it gives what can be said in real time.
"""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import record_field, require_shape
from altijax._values import checked, increasing
from altijax.signals import cumulative_integral


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class WheelSensor:
    """Parameters of the wheel sensors of one axle; by default perfect ones on an ordinary car (numbers assumed).

    Where an array is asked for, one number stands for all its elements.

    Attributes
    ----------
    radius : (wheels,) m
        Radius with which turns are made into way.
    scale : (wheels,)
        True speed over wheel speed: effective radius over `radius`.
    slip : (wheels,)
        By how much a wheel turns more than it would rolling, as a fraction: positive when driven, negative when braked.
    track_width : () m
        Distance between the wheels.
    phase : (wheels,) rad
        Angle since magnet 0 at the start.
    magnet_error : (wheels, magnets) rad
        Angle by which each magnet sits too far on, less than half a spacing.
    pulses_per_turn : int
        Number of magnets of a wheel.
    """

    radius: ArrayLike = 0.3
    scale: ArrayLike = 1.0
    slip: ArrayLike = 0.0
    track_width: ArrayLike = 1.5
    phase: ArrayLike = 0.0
    magnet_error: ArrayLike = 0.0
    pulses_per_turn: int = field(default=48, metadata={"static": True})


def wheel_speeds(wheel: WheelSensor, speed: ArrayLike, yaw_rate: ArrayLike) -> jax.Array:
    """Speeds that the wheels of a moving axle show: turning rates times `radius`.

    Parameters
    ----------
    wheel : WheelSensor
        Parameters.
    speed : (..., time) m/s
        True speed at the middle of the axle.
    yaw_rate : (..., time) rad/s
        Angular rate about body z.

    Returns
    -------
    wheel_speed : (..., wheels, time) m/s
        Left and right; negative in reverse.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    speed = require_shape("speed", speed, (..., None))
    yaw_rate = require_shape("yaw_rate", yaw_rate, (..., speed.shape[-1]))
    half = 0.5 * record_field(wheel, "track_width", (), speed.dtype) * yaw_rate
    true = jnp.stack(jnp.broadcast_arrays(speed - half, speed + half), -2)
    return true / _true_over_shown(wheel, speed.dtype)[:, None]


def correct_wheel_speeds(wheel: WheelSensor, wheel_speed: ArrayLike) -> jax.Array:
    """True speeds of the wheels' centres: ``scale / (1 + slip)`` times what the wheels show.

    Parameters
    ----------
    wheel : WheelSensor
        Parameters.
    wheel_speed : (..., wheels, time) m/s
        Left and right, as shown.

    Returns
    -------
    wheel_speed : (..., wheels, time) m/s
        Left and right, true; their mean is the speed of the axle.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    wheel_speed = require_shape("wheel_speed", wheel_speed, (..., 2, None))
    return wheel_speed * _true_over_shown(wheel, wheel_speed.dtype)[:, None]


def yaw_rate_from_wheels(wheel: WheelSensor, wheel_speed: ArrayLike) -> jax.Array:
    """Yaw rate from the speed difference of the wheels of one axle, as [shirai2000]_ takes it.

    Parameters
    ----------
    wheel : WheelSensor
        Its `track_width`.
    wheel_speed : (..., wheels, time) m/s
        Left and right, corrected.

    Returns
    -------
    yaw_rate : (..., time) rad/s
        Positive to the left.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    wheel_speed = require_shape("wheel_speed", wheel_speed, (..., 2, None))
    left, right = wheel_speed[..., 0, :], wheel_speed[..., 1, :]
    return (right - left) / record_field(wheel, "track_width", (), wheel_speed.dtype)


def pulse_distance(wheel: WheelSensor) -> jax.Array:
    """True way from pulse to pulse.

    Parameters
    ----------
    wheel : WheelSensor
        Parameters.

    Returns
    -------
    distance : (wheels,) m
        Effective circumference over the number of magnets.
    """
    radius = record_field(wheel, "radius", (2,), jnp.result_type(float, wheel.radius))
    return 2 * jnp.pi / wheel.pulses_per_turn * radius * _true_over_shown(wheel, radius.dtype)


@checked(t=increasing)
def wheel_pulses(
    wheel: WheelSensor, t: ArrayLike, speed: ArrayLike, yaw_rate: ArrayLike, *, max_pulses: int
) -> tuple[jax.Array, jax.Array]:
    """Times at which the magnets pass, exact for wheel speeds that are linear between samples.

    Parameters
    ----------
    wheel : WheelSensor
        Parameters.
    t : (time,) s
        Times, increasing.
    speed : (..., time) m/s
        True speed at the middle of the axle.
    yaw_rate : (..., time) rad/s
        Angular rate about body z.
    max_pulses : int
        Room for pulses of one wheel.

    Returns
    -------
    t_pulses : (..., wheels, max_pulses) s
        Times of pulses, increasing, then infinity.
    count : (..., wheels)
        Number of pulses there were; where it exceeds `max_pulses` the later ones are missing.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    shown = wheel_speeds(wheel, speed, yaw_rate)
    t = require_shape("t", t, (shown.shape[-1],))
    rate = jnp.abs(shown) / record_field(wheel, "radius", (2,), shown.dtype)[:, None]
    phase = record_field(wheel, "phase", (2,), shown.dtype)
    angle = phase[:, None] + cumulative_integral(t, rate)
    before = _passed(wheel, phase[:, None])
    level = _magnet_angle(wheel, before + 1 + jnp.arange(max_pulses), angle.dtype)
    reached = level <= angle[..., -1:]
    i = jnp.vectorize(jnp.searchsorted, signature="(t),(p)->(p)")(angle, level)
    i = jnp.clip(i - 1, 0, t.size - 2)
    at, after = (jnp.take_along_axis(rate, j, -1) for j in (i, i + 1))
    ahead = jnp.where(reached, level - jnp.take_along_axis(angle, i, -1), 0)
    # ahead = at s + (after - at) / (t[i + 1] - t[i]) s^2 / 2, solved for s without loss of digits
    arrival = _safe.sqrt(at * at + 2 * ahead * (after - at) / (t[i + 1] - t[i]))
    total = at + arrival
    moving = total > 0
    wait = 2 * ahead / jnp.where(moving, total, 1)
    return jnp.where(reached, t[i] + wait, jnp.inf), (_passed(wheel, angle[..., -1:]) - before)[..., 0]


@checked(t_pulses=increasing)
@jax.jit
def way_from_pulses(t_pulses: ArrayLike, t: ArrayLike, distance: ArrayLike) -> jax.Array:
    """Way of one wheel, counted from its first pulse; at each pulse it is the number of pulses times `distance`.

    Parameters
    ----------
    t_pulses : (..., pulses) s
        Times of pulses, increasing; infinity after the last.
    t : (time,) s
        Times asked for.
    distance : (...) m
        Way from pulse to pulse. With every n-th pulse of n magnets, n times that: unequal spacing then cancels.

    Returns
    -------
    way : (..., time) m
        Negative, above -distance, before the first pulse; zero where there are no two pulses.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    distance = require_shape("distance", distance, (...,))
    passed, _, _, _ = _pulse_motion(t_pulses, t)
    return distance[..., None] * passed


@checked(t_pulses=increasing)
@jax.jit
def speed_from_pulses(
    t_pulses: ArrayLike, t: ArrayLike, distance: ArrayLike, distance_std: ArrayLike = 0.0
) -> tuple[jax.Array, jax.Array]:
    """Speed of one wheel from its pulses, without sign: the derivative of `way_from_pulses`.

    The standard deviation has two parts: what misplaced pulses do to the mean speed between them, sqrt(2) times
    `distance_std` over the interval; and what a single pulse leaves open. At constant acceleration the speeds at two
    pulses add up to twice the mean speed between them; by how much they do not (outside, by the speed at the last or
    first pulse), at most by `distance` over the time to the nearer pulse, is taken as the width of a uniform
    distribution. It is an estimate of size, no exact law, and zero where perfect pulses fit a constant acceleration.

    Parameters
    ----------
    t_pulses : (..., pulses) s
        Times of pulses, increasing; infinity after the last.
    t : (time,) s
        Times asked for.
    distance : (...) m
        Way from pulse to pulse. With every n-th pulse of n magnets, n times that: unequal spacing then cancels.
    distance_std : (...) m, optional
        Standard deviation of the way at a pulse: magnets out of place, speed times the resolution of time / sqrt(12).

    Returns
    -------
    speed : (..., time) m/s
        Never negative; towards zero where pulses stay away; zero where there are no two pulses.
    speed_std : (..., time) m/s
        Its standard deviation.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    distance = require_shape("distance", distance, (...,))[..., None]
    distance_std = require_shape("distance_std", distance_std, (...,))[..., None]
    _, rate, mean_rate, width = _pulse_motion(t_pulses, t)
    parts = jnp.broadcast_arrays(2**0.5 * distance_std * mean_rate, distance * width / 12**0.5)
    return distance * rate, _safe.norm(jnp.stack(parts, -1))


@checked(t_pulses=increasing)
@jax.jit
def standstill_from_pulses(t_pulses: ArrayLike, t: ArrayLike, quiet: ArrayLike) -> jax.Array:
    """Whether a wheel is taken to stand still: no pulse for long, before and after.

    Parameters
    ----------
    t_pulses : (..., pulses) s
        Times of pulses, increasing; infinity after the last.
    t : (time,) s
        Times asked for.
    quiet : () s
        Time without a pulse on either side; the mean speed over both is then less than one pulse in `2 quiet`.

    Returns
    -------
    standstill : (..., time)
        True where no pulse is nearer than `quiet`.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t_pulses = require_shape("t_pulses", t_pulses, (..., None))
    t = require_shape("t", t, (None,))
    quiet = require_shape("quiet", quiet, ())
    return _count(t_pulses, t - quiet, "right") == _count(t_pulses, t + quiet, "left")


def _true_over_shown(wheel: WheelSensor, dtype: jnp.dtype) -> jax.Array:
    return record_field(wheel, "scale", (2,), dtype) / (1 + record_field(wheel, "slip", (2,), dtype))


def _magnet_angle(wheel: WheelSensor, number: jax.Array, dtype: jnp.dtype) -> jax.Array:
    """Angle at which magnet `number` (..., 2, any), counted on over the turns, passes."""
    n = wheel.pulses_per_turn
    errors = record_field(wheel, "magnet_error", (2, n), dtype)
    error = jnp.take_along_axis(jnp.broadcast_to(errors, (*number.shape[:-1], n)), jnp.mod(number, n), -1)
    return 2 * jnp.pi / n * number.astype(dtype) + error


def _passed(wheel: WheelSensor, angle: jax.Array) -> jax.Array:
    """Number of the last magnet that has passed at `angle` (..., 2, any)."""
    nearby = jnp.floor(angle * (wheel.pulses_per_turn / (2 * jnp.pi))).astype(int)
    # An error of less than half a spacing leaves only these two in doubt.
    here, next_one = (_magnet_angle(wheel, nearby + step, angle.dtype) <= angle for step in (0, 1))
    return nearby - 1 + here + next_one


def _count(t_pulses: jax.Array, t: jax.Array, side: str) -> jax.Array:
    count = jnp.vectorize(lambda pulses, t: jnp.searchsorted(pulses, t, side=side), signature="(p),(t)->(t)")
    return count(t_pulses, t)


def _pulse_motion(t_pulses: ArrayLike, t: ArrayLike) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """In pulses: way, speed, mean speed of the interval (zero outside), and width of what the interval leaves open."""
    t_pulses = require_shape("t_pulses", t_pulses, (..., None))
    t = require_shape("t", t, (None,))
    real = jnp.isfinite(t_pulses)
    times = jnp.where(real, t_pulses, 0)
    rate_at = _pulse_rates(times, real)

    last = _count(t_pulses, t, "right") - 1
    i = jnp.clip(last, 0, None)
    j = jnp.clip(last + 1, None, t_pulses.shape[-1] - 1)
    t_i, t_j, u_i, u_j = (jnp.take_along_axis(x, k, -1) for x in (times, rate_at) for k in (i, j))
    between = (last >= 0) & (j > i) & jnp.take_along_axis(real, j, -1)

    interval = jnp.where(between, t_j - t_i, 1)
    v = 1 / interval
    x = jnp.where(between, (t - t_i) / interval, 0)
    y = 1 - x
    surplus = u_i + u_j - 2 * v
    bend = 1 + surplus * interval * x * y
    way = (x * x + u_i * interval * x * y) / bend
    rate = (u_j * x * x + 2 * v * x * y + u_i * y * y) / (bend * bend)

    outside = jnp.where(between, 0, t - t_i)
    fall = 1 + u_i * jnp.abs(outside)
    width = jnp.where(between, jnp.abs(surplus), u_i)
    nearest = jnp.where(between, jnp.minimum(x, y) * interval, jnp.abs(outside))
    return (
        i + jnp.where(between, way, u_i * outside / fall),
        jnp.where(between, rate, u_i / (fall * fall)),
        jnp.where(between, v, 0),
        width / jnp.maximum(1, width * nearest),
    )


def _pulse_rates(times: jax.Array, real: jax.Array) -> jax.Array:
    """Pulses per second at each pulse: of the parabola through it and its neighbours, never negative."""
    joined = real[..., 1:]
    interval = jnp.where(joined, jnp.diff(times), 1)
    rate = jnp.where(joined, 1 / interval, 0)
    no, zero, one = jnp.zeros_like(real[..., :1]), jnp.zeros_like(times[..., :1]), jnp.ones_like(times[..., :1])
    has_left, has_right = jnp.concatenate([no, joined], -1), jnp.concatenate([joined, no], -1)
    t_left, t_right = jnp.concatenate([one, interval], -1), jnp.concatenate([interval, one], -1)
    left, right = jnp.concatenate([zero, rate], -1), jnp.concatenate([rate, zero], -1)
    both = has_left & has_right
    inner = jnp.where(both, (t_right * left + t_left * right) / (t_left + t_right), left + right)
    neighbour = jnp.where(
        has_right, jnp.concatenate([inner[..., 1:], zero], -1), jnp.concatenate([zero, inner[..., :-1]], -1)
    )
    at_end = jnp.clip(2 * (left + right) - neighbour, 0, None)
    return jnp.where(both, inner, jnp.where(has_left | has_right, at_end, 0))
