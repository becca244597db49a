"""Exact motions: drives, flights and windsurfers in closed form, and what ideal sensors on them read.

A motion is a pure function ``pose(t) -> (position, C_nb)`` of one time. It is a formula, so its derivatives in time and
in every parameter of its record are exact too: `ideal_readings` differentiates it and integrates nothing. A road is a
curve in space, a speed profile says when its vehicle is where, and `functools.partial` joins them to a motion:

    pose = partial(road_pose, slope_road(163.969, 163.824, 5.459), rest_to_rest(163.824, 110.0, 3.0))
    readings = ideal_readings(pose, t, gravity)

A vehicle's x axis lies along its path, also at standstill. Its velocity in body axes is (speed, 0, 0) and, exactly,

    f_x = speed' + g sin(pitch)
    f_y = speed w_z + g cos(pitch) sin(roll)
    f_z = -speed w_y + g cos(pitch) cos(roll)
    roll' = w_x - tan(pitch) (w_y sin(roll) + w_z cos(roll))
    pitch' = -w_y cos(roll) + w_z sin(roll)
    cos(pitch) yaw' = w_y sin(roll) + w_z cos(roll)

which are Eqs. (1), (2), (4) and (5) of [us20060293826]_ in our axes. With a_x = speed', the vertical acceleration by
Eq. (1) of [shirai2000]_ is too large by (speed w_y)^2 / 2g where a_y = speed w_z, and by (speed pitch')^2 / 2g where
a_y = speed cos(pitch) yaw'.

The navigation frame is taken as inertial and gravity as constant: the Earth's rotation and curvature are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax.roads import Road, SpeedProfile, progress, road_curve, winding_road
from altijax.rotations import euler_to_matrix, vee

Pose = Callable[[jax.Array], tuple[jax.Array, jax.Array]]


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Windsurfer:
    """A helmet on a windsurfer: the board's track, the sailor's leaning, chop, a turning head, and a fall.

    Board, sailor and head move by the sums sum_k amplitude_k sin(frequency_k t + phase_k).

    Attributes
    ----------
    road : Road
        The board's track.
    profile : SpeedProfile
        Its progress.
    wind_from : () rad
        Where the wind comes from, counter-clockwise from East.
    lean : () rad
        Roll of the sailor to windward with the wind abeam; less by its sine on other courses.
    height : () m
        Helmet above the sailor's feet.
    frequency : (terms,) rad/s
        Angular frequencies.
    phase : (terms,) rad
        Angles at t = 0.
    displacement : (terms, 3) m
        Amplitudes of the board's position, East, North and up.
    sway : (terms, 3) rad
        Amplitudes of the sailor's roll, pitch and yaw relative to the board.
    head : (terms, 3) rad
        Amplitudes of the head's roll, pitch and yaw relative to the sailor.
    fall : (3,) rad
        Roll, pitch and yaw of the sailor lying in the water, relative to the board; zero for no fall.
    fall_start : () s
        Beginning to fall.
    fall_stop : () s
        Beginning to get up again.
    fall_ramp : () s
        Time of falling and of getting up, positive.
    """

    road: Road
    profile: SpeedProfile
    wind_from: jax.Array
    lean: jax.Array
    height: jax.Array
    frequency: jax.Array
    phase: jax.Array
    displacement: jax.Array
    sway: jax.Array
    head: jax.Array
    fall: jax.Array
    fall_start: jax.Array
    fall_stop: jax.Array
    fall_ramp: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Readings:
    """An exact motion at a series of times, and what ideal sensors on it read.

    Attributes
    ----------
    t : (..., time) s
        Times.
    position : (..., time, 3) m
        East, North and up.
    velocity : (..., time, 3) m/s
        Its derivative.
    acceleration : (..., time, 3) m/s^2
        Its second derivative.
    C_nb : (..., time, 3, 3)
        Attitude.
    w_b : (..., time, 3) rad/s
        Angular rate in body axes, as an ideal gyro reads it.
    f_b : (..., time, 3) m/s^2
        Specific force in body axes, as an ideal accelerometer reads it.
    speed : (..., time) m/s
        Velocity along body x, as an ideal wheel reads it.
    """

    t: jax.Array
    position: jax.Array
    velocity: jax.Array
    acceleration: jax.Array
    C_nb: jax.Array
    w_b: jax.Array
    f_b: jax.Array
    speed: jax.Array


def ideal_readings(pose: Pose, t: ArrayLike, gravity: ArrayLike) -> Readings:
    """What ideal sensors read on a motion, by differentiating it.

    Parameters
    ----------
    pose : callable
        Position (3,) and C_nb (3, 3) as a function of one time, twice differentiable.
    t : (time,) s
        Times.
    gravity : () m/s^2
        Magnitude of gravity.

    Returns
    -------
    readings : Readings
        Position, velocity, acceleration and attitude, angular rate, specific force and speed.

    Raises
    ------
    ValueError
        If `t` is not one series of times or `gravity` not one number.
    """
    t = require_shape("t", t, (None,))
    gravity = require_shape("gravity", gravity, ())

    def reading(t: jax.Array) -> Readings:
        def rates(t: jax.Array) -> tuple:
            return jax.jvp(pose, (t,), (jnp.ones_like(t),))

        ((position, C_nb), (velocity, C_rate)), (_, (acceleration, _)) = jax.jvp(rates, (t,), (jnp.ones_like(t),))
        return Readings(
            t=t,
            position=position,
            velocity=velocity,
            acceleration=acceleration,
            C_nb=C_nb,
            w_b=vee(C_nb.T @ C_rate),
            f_b=C_nb.T @ acceleration + gravity * C_nb[2],
            speed=C_nb[:, 0] @ velocity,
        )

    return jax.vmap(reading)(t)


def road_pose(road: Road, profile: SpeedProfile, t: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Pose of a vehicle on a road at one time: x along the road, rolled by its cant and, on its springs, outward.

    Parameters
    ----------
    road : Road
        Curve, cant and body roll.
    profile : SpeedProfile
        Progress along it.
    t : () s
        Time.

    Returns
    -------
    position : (3,) m
        East, North and up.
    C_nb : (3, 3)
        Attitude.

    Raises
    ------
    ValueError
        If `t` is not one time or the terms of `road` or `profile` do not fit together.
    """
    position, axes, cant, lateral, _ = _path(road, profile, t)
    return position, _rolled(axes, cant + road.roll_gain * lateral)


def flight_pose(
    road: Road, profile: SpeedProfile, wind: ArrayLike, gravity: ArrayLike, t: ArrayLike
) -> tuple[jax.Array, jax.Array]:
    """Pose of an aircraft at one time: x along its path through the air, banked for no lateral specific force.

    Parameters
    ----------
    road : Road
        Path through the air; its cant and roll gain do not matter.
    profile : SpeedProfile
        Progress along it.
    wind : (3,) m/s
        Velocity of the air, East, North and up. The aircraft drifts with it from t = 0, so heading is not course.
    gravity : () m/s^2
        Magnitude of gravity.
    t : () s
        Time.

    Returns
    -------
    position : (3,) m
        East, North and up.
    C_nb : (3, 3)
        Attitude.

    Raises
    ------
    ValueError
        If `wind`, `gravity` or `t` has the wrong shape or the terms of `road` or `profile` do not fit together.
    """
    wind = require_shape("wind", wind, (3,))
    gravity = require_shape("gravity", gravity, ())
    t = require_shape("t", t, ())
    position, axes, _, lateral, normal = _path(road, profile, t)
    bank = _safe.arctan2(lateral, normal + gravity * axes[2][2])
    return position + wind * t, _rolled(axes, -bank)


def windsurfer_pose(windsurfer: Windsurfer, t: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Pose of a windsurfer's helmet at one time.

    Parameters
    ----------
    windsurfer : Windsurfer
        Track, sailor, chop, head and fall.
    t : () s
        Time.

    Returns
    -------
    position : (3,) m
        East, North and up of the helmet.
    C_nb : (3, 3)
        Attitude of the helmet.

    Raises
    ------
    ValueError
        If `t` is not one time or the terms of `windsurfer` do not fit together.
    """
    t = require_shape("t", t, ())
    frequency = require_shape("windsurfer.frequency", windsurfer.frequency, (None,))
    phase = require_shape("windsurfer.phase", windsurfer.phase, frequency.shape)
    displacement = require_shape("windsurfer.displacement", windsurfer.displacement, (*frequency.shape, 3))
    sway = require_shape("windsurfer.sway", windsurfer.sway, (*frequency.shape, 3))
    head = require_shape("windsurfer.head", windsurfer.head, (*frequency.shape, 3))
    fall = require_shape("windsurfer.fall", windsurfer.fall, (3,))
    position, C_board = road_pose(windsurfer.road, windsurfer.profile, t)
    sines = jnp.sin(frequency * t + phase)
    fallen = _smooth_step((t - windsurfer.fall_start) / windsurfer.fall_ramp) - _smooth_step(
        (t - windsurfer.fall_stop) / windsurfer.fall_ramp
    )
    windward = C_board[0, 1] * jnp.cos(windsurfer.wind_from) + C_board[1, 1] * jnp.sin(windsurfer.wind_from)
    roll = -(1 - fallen) * windsurfer.lean * windward
    lean = jnp.stack([roll, jnp.zeros_like(roll), jnp.zeros_like(roll)])
    C_sailor = C_board @ euler_to_matrix(sines @ sway + fallen * fall + lean)
    position = position + sines @ displacement + windsurfer.height * C_sailor[:, 2]
    return position, C_sailor @ euler_to_matrix(sines @ head)


def gybing_windsurfer(
    speed: ArrayLike, reach_angle: ArrayLike, reach_length: ArrayLike, duration: ArrayLike, fall_start: ArrayLike
) -> Windsurfer:
    """A windsurfer who runs before a westerly wind in broad reaches, gybing in between, and falls once.

    The sizes of chop, lean and head movement are assumed, and so is the fall: over in 0.8 s, up again after 5 s, under
    way after 6 s.

    Parameters
    ----------
    speed : () m/s
        Speed on the reaches; in the gybes it drops by the cosine of `reach_angle`.
    reach_angle : () rad
        Course of the reaches off downwind, to either side.
    reach_length : () m
        Progress downwind from one gybe to the next.
    duration : () s
        Time from standstill to standstill.
    fall_start : () s
        Time of the fall, around which the board stops; at `duration` or later there is none.

    Returns
    -------
    windsurfer : Windsurfer
        The windsurfer.

    Raises
    ------
    ValueError
        If an argument is not one number.
    """
    speed = require_shape("speed", speed, ())
    reach_angle = require_shape("reach_angle", reach_angle, ())
    reach_length = require_shape("reach_length", reach_length, ())
    duration = require_shape("duration", duration, ())
    fall_start = require_shape("fall_start", fall_start, ())
    dtype = jnp.result_type(speed, reach_angle, reach_length, duration, fall_start)
    # The Fourier series of a zigzag; Lanczos' factors (sinc) keep its bends from ringing.
    odd = jnp.array([1, 3, 5, 7], dtype)
    slopes = jnp.array([1, -1, 1, -1], dtype) * 4 / (jnp.pi * odd) * jnp.sinc(odd / 9) * jnp.tan(reach_angle)
    none, zero = jnp.zeros(0, dtype), jnp.zeros((), dtype)
    ramp, in_water, under_way = 4, 5, 6
    restart = fall_start + under_way
    end = duration - ramp
    return Windsurfer(
        road=winding_road(jnp.arctan(slopes), 2 * reach_length / odd, 0 * odd, none, none, none, zero),
        profile=SpeedProfile(
            start=jnp.stack([zero, restart]),
            stop=jnp.stack([jnp.minimum(fall_start - ramp / 2, end), jnp.maximum(restart, end)]),
            ramp=jnp.full(2, ramp, dtype),
            speed=jnp.full(2, speed * jnp.cos(reach_angle), dtype),
            modulation=none,
            wavenumber=none,
            phase=none,
        ),
        wind_from=jnp.full((), jnp.pi, dtype),
        lean=jnp.full((), 0.35, dtype),
        height=jnp.full((), 1.7, dtype),
        # Chop at 0.4, 0.9 and 1.7 Hz; the head looks around at 0.06 and 0.19 Hz.
        frequency=2 * jnp.pi * jnp.array([0.4, 0.9, 1.7, 0.06, 0.19], dtype),
        phase=jnp.array([0.0, 1.0, 2.0, 0.5, 4.0], dtype),
        displacement=jnp.array([[0, 0, 0.15], [0, 0, 0.05], [0, 0, 0.02], [0, 0, 0], [0, 0, 0]], dtype),
        sway=jnp.array([[0.05, 0.04, 0], [0.03, 0.06, 0], [0.02, 0.02, 0], [0, 0, 0], [0, 0, 0]], dtype),
        head=jnp.array([[0, 0, 0], [0.03, 0.03, 0], [0.02, 0.05, 0], [0, 0.1, 0.7], [0.05, 0.05, 0.3]], dtype),
        fall=jnp.array([-1.3, -0.6, 0], dtype),
        fall_start=fall_start,
        fall_stop=fall_start + in_water,
        fall_ramp=jnp.full((), 0.8, dtype),
    )


def _path(
    road: Road, profile: SpeedProfile, t: ArrayLike
) -> tuple[jax.Array, tuple[jax.Array, jax.Array, jax.Array], jax.Array, jax.Array, jax.Array]:
    """Position, axes (along the path, left, up), cant, and the accelerations to the left and up by the path's bends."""
    t = require_shape("t", t, ())
    u, rate = jax.jvp(lambda t: progress(profile, t), (t,), (jnp.ones_like(t),))
    position, tangent, bend, cant = road_curve(road, u)
    forward = _unit(tangent)
    left = _unit(jnp.stack([-forward[1], forward[0], jnp.zeros_like(forward[0])]))
    up = jnp.stack([-forward[2] * left[1], forward[2] * left[0], forward[0] * left[1] - forward[1] * left[0]])
    squared = rate * rate
    return position, (forward, left, up), cant, squared * (bend @ left), squared * (bend @ up)


def _unit(v: jax.Array) -> jax.Array:
    length = _safe.norm(v)
    return v / jnp.where(length > 0, length, 1)


def _rolled(axes: tuple[jax.Array, jax.Array, jax.Array], roll: jax.Array) -> jax.Array:
    """C_nb of axes forward, left and up after a roll about the first."""
    forward, left, up = axes
    sin, cos = jnp.sin(roll), jnp.cos(roll)
    return jnp.stack([forward, cos * left + sin * up, cos * up - sin * left], -1)


def _smooth_step(x: jax.Array) -> jax.Array:
    """The smooth step S of `SpeedProfile`."""
    x = jnp.clip(x, 0, 1)
    return x**4 * (35 - x * (84 - x * (70 - x * 20)))
