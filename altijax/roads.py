"""Roads and the ways of driving them: curves in space, and speed profiles that say when a vehicle is where.

Both are sums of smooth terms, a road of sines over progress and a speed profile of legs over time, so what is made of
them has exact derivatives in time and in every parameter: `altijax.motions` makes poses and ideal readings of them.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Road:
    """A curve in space, from the origin: a straight line and a sum of sines of the progress u along it.

        p(u) = direction u + sum_k amplitude_k (sin(wavenumber_k u + phase_k) - sin(phase_k))

    Straight roads, serpentines, hills, circles, figures of eight and Fourier series of real roads are all of this form.
    Where abs(dp/du) is 1, progress is the way. The horizontal part of dp/du must not vanish.

    Attributes
    ----------
    direction : (3,)
        Straight part of dp/du, East, North and up.
    amplitude : (terms, 3) m
        Amplitudes of the sines.
    wavenumber : (terms,) rad/m
        Their angle per progress.
    phase : (terms,) rad
        Their angle at the origin.
    cant : (terms,) rad
        Amplitudes of the same sines in the roll of the road's surface, right side down positive. A term of wavenumber 0
        and phase pi/2 makes a constant cant.
    roll_gain : () rad s^2/m
        Roll of the body on its springs per lateral acceleration, outward positive.
    """

    direction: jax.Array
    amplitude: jax.Array
    wavenumber: jax.Array
    phase: jax.Array
    cant: jax.Array
    roll_gain: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SpeedProfile:
    """Progress along a road against time: legs with a smooth start and stop, and a speed that varies on the way.

    The rate of progress is a sum of legs, speed_i (S((t - start_i) / ramp_i) - S((t - stop_i) / ramp_i)). The smooth
    step S rises from 0 to 1 between 0 and 1 and has three continuous derivatives. A leg makes exactly
    speed_i (stop_i - start_i) of progress. Between legs the vehicle stands still; legs that overlap add their rates.

    Attributes
    ----------
    start : (legs,) s
        Leaving standstill.
    stop : (legs,) s
        Beginning to slow down, not before `start`; at standstill `ramp` later.
    ramp : (legs,) s
        Time to reach the speed and to lose it, positive.
    speed : (legs,) m/s
        Progress per second in between, the speed where abs(dp/du) is 1.
    modulation : (waves,) m
        Amplitudes of an uneven speed: where the legs alone make the progress s, the vehicle is at
        s + sum_k modulation_k (sin(wavenumber_k s + phase_k) - sin(phase_k)). It never goes back as long as the sizes
        of the products modulation_k wavenumber_k, the relative variations of the rate, add up to less than 1.
    wavenumber : (waves,) rad/m
        Angle of these sines per progress. Whole waves over a distance leave the distance as it is.
    phase : (waves,) rad
        Their angle at the start.
    """

    start: jax.Array
    stop: jax.Array
    ramp: jax.Array
    speed: jax.Array
    modulation: jax.Array
    wavenumber: jax.Array
    phase: jax.Array


def road_curve(road: Road, u: ArrayLike) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """A road's curve at one progress along it: position, its first two derivatives, and the cant.

    Parameters
    ----------
    road : Road
        Curve and cant.
    u : () m
        Progress.

    Returns
    -------
    position : (3,) m
        East, North and up.
    tangent : (3,)
        Its derivative by progress, along the road.
    bend : (3,) 1/m
        Its second derivative, the curvature vector where the tangent is a unit vector throughout.
    cant : () rad
        Roll of the surface, right side down positive.

    Raises
    ------
    ValueError
        If `u` is not one number or the terms of `road` differ in number.
    """
    direction = require_shape("road.direction", road.direction, (3,))
    amplitude = require_shape("road.amplitude", road.amplitude, (None, 3))
    wavenumber = require_shape("road.wavenumber", road.wavenumber, amplitude.shape[:1])
    phase = require_shape("road.phase", road.phase, amplitude.shape[:1])
    cant = require_shape("road.cant", road.cant, amplitude.shape[:1])
    u = require_shape("u", u, ())
    angle = wavenumber * u + phase
    sin, cos = jnp.sin(angle), jnp.cos(angle)
    position = direction * u + (sin - jnp.sin(phase)) @ amplitude
    tangent = direction + (wavenumber * cos) @ amplitude
    bend = -(wavenumber * wavenumber * sin) @ amplitude
    return position, tangent, bend, sin @ cant


def progress(profile: SpeedProfile, t: ArrayLike) -> jax.Array:
    """Progress along a road at one time.

    Parameters
    ----------
    profile : SpeedProfile
        Legs and variation of the speed.
    t : () s
        Time.

    Returns
    -------
    u : () m
        Progress since before the first leg.

    Raises
    ------
    ValueError
        If `t` is not one time or the legs or waves of `profile` differ in number.
    """
    t = require_shape("t", t, ())
    start = require_shape("profile.start", profile.start, (None,))
    stop = require_shape("profile.stop", profile.stop, start.shape)
    ramp = require_shape("profile.ramp", profile.ramp, start.shape)
    speed = require_shape("profile.speed", profile.speed, start.shape)
    modulation = require_shape("profile.modulation", profile.modulation, (None,))
    wavenumber = require_shape("profile.wavenumber", profile.wavenumber, modulation.shape)
    phase = require_shape("profile.phase", profile.phase, modulation.shape)
    s = jnp.sum(speed * ramp * (_smooth_ramp((t - start) / ramp) - _smooth_ramp((t - stop) / ramp)))
    return s + jnp.sum(modulation * (jnp.sin(wavenumber * s + phase) - jnp.sin(phase)))


@jax.jit
def slope_road(way: ArrayLike, horizontal: ArrayLike, rise: ArrayLike) -> Road:
    """A straight slope to the East of given lengths, steepest in its middle; progress is its horizontal length.

    The height is grade u - c sin(2 pi u / horizontal), the simplest curve that has all three lengths. For the road of
    [shirai2000]_, 163.969 m, 163.824 m and 5.459 m, it is nearly level at both ends: a ramp between two levels.

    Parameters
    ----------
    way : () m
        Length along the slope. If it is no longer than the straight line, the slope is uniform.
    horizontal : () m
        Length of its plan.
    rise : () m
        Level difference from start to end, negative for a descent.

    Returns
    -------
    road : Road
        The road.

    Raises
    ------
    ValueError
        If an argument is not one number.
    """
    way = require_shape("way", way, ())
    horizontal = require_shape("horizontal", horizontal, ())
    rise = require_shape("rise", rise, ())
    grade = rise / horizontal
    # The integrand is periodic, for which the rectangle rule converges geometrically.
    cos = jnp.cos(jnp.arange(64, dtype=grade.dtype) * (2 * jnp.pi / 64))

    def improve(_: int, squared: jax.Array) -> jax.Array:
        slopes = grade - _safe.sqrt(squared) * cos
        # The mean of sqrt(1 + slope^2) grows with the squared swing by 1/4 on gentle slopes and by less on steep ones,
        # so this closes in from one side, by a factor of about 1.5 slope^2 each time.
        return squared + 4 * (way / horizontal - jnp.mean(jnp.sqrt(1 + slopes * slopes)))

    swing = _safe.sqrt(jax.lax.fori_loop(0, 30, improve, jnp.zeros_like(grade * way)))
    wavenumber = 2 * jnp.pi / horizontal
    zero = jnp.zeros_like(swing)
    return Road(
        direction=jnp.stack([zero + 1, zero, grade]),
        amplitude=jnp.stack([zero, zero, jnp.where(rise < 0, swing, -swing) / wavenumber])[None],
        wavenumber=wavenumber[None],
        phase=zero[None],
        cant=zero[None],
        roll_gain=zero,
    )


def circular_road(radius: ArrayLike, grade: ArrayLike, cant: ArrayLike) -> Road:
    """A circle, or a helix, that sets out to the East; progress is its horizontal length.

    Parameters
    ----------
    radius : () m
        Radius, positive for turning left and negative for turning right.
    grade : ()
        Rise per horizontal length.
    cant : () rad
        Roll of its surface, right side down positive.

    Returns
    -------
    road : Road
        The road.

    Raises
    ------
    ValueError
        If an argument is not one number.
    """
    radius = require_shape("radius", radius, ())
    grade = require_shape("grade", grade, ())
    cant = require_shape("cant", cant, ())
    zero = jnp.zeros_like(radius + grade + cant)
    return Road(
        direction=jnp.stack([zero, zero, grade]),
        amplitude=jnp.stack(
            [jnp.stack([radius, zero, zero]), jnp.stack([zero, -radius, zero]), jnp.zeros_like(zero, shape=3)]
        ),
        wavenumber=jnp.stack([1 / radius, 1 / radius, zero]),
        phase=jnp.stack([zero, zero + jnp.pi / 2, zero + jnp.pi / 2]),
        cant=jnp.stack([zero, zero, cant]),
        roll_gain=zero,
    )


def winding_road(
    heading_swing: ArrayLike,
    bend_length: ArrayLike,
    bend_phase: ArrayLike,
    slope_swing: ArrayLike,
    hill_length: ArrayLike,
    hill_phase: ArrayLike,
    superelevation: ArrayLike,
) -> Road:
    """A road to the East with bends and hills, canted inward in its bends; progress is its length along East.

    Parameters
    ----------
    heading_swing : (bends,) rad
        Largest angle from East that each series of bends alone would make, below pi/2.
    bend_length : (bends,) m
        Length of one left and one right bend.
    bend_phase : (bends,) rad
        Where in its series of bends the road sets out; at 0 it crosses the East axis.
    slope_swing : (hills,)
        Steepest rise per length of each series of hills.
    hill_length : (hills,) m
        From one hill to the next.
    hill_phase : (hills,) rad
        Where in its series of hills the road sets out; at 0 it climbs.
    superelevation : () rad m
        Cant per curvature d^2 North / d East^2, inward positive.

    Returns
    -------
    road : Road
        The road, of bends + hills terms.

    Raises
    ------
    ValueError
        If the series of bends or those of hills do not have one length.
    """
    heading_swing = require_shape("heading_swing", heading_swing, (None,))
    bend_length = require_shape("bend_length", bend_length, heading_swing.shape)
    bend_phase = require_shape("bend_phase", bend_phase, heading_swing.shape)
    slope_swing = require_shape("slope_swing", slope_swing, (None,))
    hill_length = require_shape("hill_length", hill_length, slope_swing.shape)
    hill_phase = require_shape("hill_phase", hill_phase, slope_swing.shape)
    superelevation = require_shape("superelevation", superelevation, ())
    bends, hills = 2 * jnp.pi / bend_length, 2 * jnp.pi / hill_length
    swing = jnp.tan(heading_swing)
    north, up = jnp.eye(2, 3, 1, dtype=swing.dtype)
    wavenumber = jnp.concatenate([bends, hills])
    return Road(
        direction=jnp.eye(1, 3, dtype=wavenumber.dtype)[0],
        amplitude=jnp.concatenate([(swing / bends)[:, None] * north, (slope_swing / hills)[:, None] * up]),
        wavenumber=wavenumber,
        phase=jnp.concatenate([bend_phase, hill_phase]),
        # The curvature of swing / k sin(k u) is -swing k sin(k u), and inward is right side down where it is negative.
        cant=jnp.concatenate([superelevation * swing * bends, jnp.zeros_like(hills)]),
        roll_gain=jnp.zeros_like(superelevation),
    )


def rest_to_rest(distance: ArrayLike, duration: ArrayLike, ramp: ArrayLike) -> SpeedProfile:
    """A single leg from standstill at t = 0 to standstill.

    Parameters
    ----------
    distance : () m
        Progress made.
    duration : () s
        Time from standstill to standstill, at least twice `ramp`.
    ramp : () s
        Time to reach the speed and to lose it.

    Returns
    -------
    profile : SpeedProfile
        The leg, at constant speed between its ramps.

    Raises
    ------
    ValueError
        If an argument is not one number.
    """
    distance = require_shape("distance", distance, ())
    duration = require_shape("duration", duration, ())
    ramp = require_shape("ramp", ramp, ())
    stop = duration - ramp
    none = jnp.zeros(0, distance.dtype)
    return SpeedProfile(
        start=jnp.zeros_like(stop)[None],
        stop=stop[None],
        ramp=ramp[None],
        speed=(distance / stop)[None],
        modulation=none,
        wavenumber=none,
        phase=none,
    )


def _smooth_ramp(x: jax.Array) -> jax.Array:
    """Integral of the smooth step S of `SpeedProfile`: 0 for x <= 0, x - 1/2 for x >= 1."""
    inside = (x > 0) & (x < 1)
    y = jnp.where(inside, x, 0)
    return jnp.where(inside, y**5 * (7 - y * (14 - y * (10 - y * 2.5))), jnp.where(x > 0, x - 0.5, 0))
