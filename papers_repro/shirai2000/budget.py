"""Why it drifts: what each error source makes of the results, from derivatives of the simulation.

An error source enters a run as a standard deviation times something drawn, so the derivative of a run's results by that
standard deviation, at zero, is what a unit of it does in this run. Most sources act linearly, either sign alike.
Vibration and misplaced magnets act by their square, and always in one direction: their second derivative counts.
"""

from dataclasses import dataclass, fields, replace
from functools import partial

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from altijax.altitude import horizontal_acceleration, vertical_acceleration
from altijax.instruments import ND_PG1
from altijax.signals import cumulative_integral
from papers_repro.shirai2000.experiments import (
    DT,
    GRAVITY,
    Course,
    Sensors,
    at_fractions,
    by_speed,
    drawn_wheel,
    motion,
)

SOURCES = tuple(field.name for field in fields(Sensors))
CONSTANTS = ("bias_z", "gravity", "initial_vertical_speed", "wheel_scale", "track_width")
VIBRATION, SPREAD, SCALE = (SOURCES.index(name) for name in ("vibration", "vibration_spread", "wheel_scale"))


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Responses:
    """Results of runs at arrival as a series in the size of each source alone: at zero + linear s + quadratic s^2.

    Attributes
    ----------
    at_zero : (runs, chains, outputs) m
        Results with perfect sensors but for pulses: what the pace and the wheels' first position make.
    linear : (runs, sources, chains, outputs)
        Metres per unit of a source.
    quadratic : (runs, sources, chains, outputs)
        Metres per its square.
    """

    at_zero: jax.Array
    linear: jax.Array
    quadratic: jax.Array


def responses(course: Course, keys: jax.Array, samples: int) -> Responses:
    """Responses of the runs of these keys, by second-order forward differentiation of whole runs."""
    zero, sensors_of = ravel_pytree(Sensors(**{name: jnp.zeros(()) for name in SOURCES}))

    def results(sizes: jax.Array, key: jax.Array) -> jax.Array:
        return at_fractions(sensors_of(sizes), course, key, samples=samples, points=2)[-1]

    def along(direction: jax.Array, key: jax.Array) -> Responses:
        def slope(sizes: jax.Array) -> tuple[jax.Array, jax.Array]:
            return jax.jvp(lambda x: results(x, key), (sizes,), (direction,))

        (at_zero, linear), (_, twice) = jax.jvp(slope, (zero,), (direction,))
        return Responses(at_zero=at_zero, linear=linear, quadratic=twice / 2)

    def of_run(key: jax.Array) -> Responses:
        found = jax.vmap(along, (0, None))(jnp.eye(zero.size), key)
        return replace(found, at_zero=found.at_zero[0])

    return jax.vmap(of_run)(keys)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Moments:
    """Of the elevations of many runs: mean and mean product between chains of what a unit of each source makes.

    Attributes
    ----------
    linear, quadratic : (sources, chains)
        Means.
    linear_pairs, quadratic_pairs : (sources, chains, chains)
        Means of the products.
    at_zero : (chains,)
        Mean error with perfect sensors.
    covariance_at_zero : (chains, chains)
        Its covariance.
    """

    linear: jax.Array
    quadratic: jax.Array
    linear_pairs: jax.Array
    quadratic_pairs: jax.Array
    at_zero: jax.Array
    covariance_at_zero: jax.Array


def elevation_moments(found: Responses, rise: jax.Array) -> Moments:
    """Moments over the runs."""
    d, q, zero = found.linear[..., 2], found.quadratic[..., 2], found.at_zero[..., 2] - rise
    return Moments(
        linear=d.mean(0),
        quadratic=q.mean(0),
        linear_pairs=jnp.einsum("rsa,rsb->sab", d, d) / d.shape[0],
        quadratic_pairs=jnp.einsum("rsa,rsb->sab", q, q) / q.shape[0],
        at_zero=zero.mean(0),
        covariance_at_zero=jnp.cov(zero, rowvar=False),
    )


def elevation_errors(moments: Moments, sensors: Sensors) -> tuple[jax.Array, jax.Array]:
    """Mean (sources, chains) and covariance (sources, chains, chains) of the errors that each source makes alone.

    The vibration of a run is log-normal: its squares have the mean vibration^2 exp(2 spread^2).
    """
    size = jnp.stack([getattr(sensors, name) for name in SOURCES])
    at = jnp.arange(len(SOURCES))
    # A linear effect has the mean zero, but that of the wheel's scale, which is the same in all runs.
    drawn = (at != SCALE)[:, None]
    squared = size**2 * jnp.where(at == VIBRATION, jnp.exp(2 * size[SPREAD] ** 2), 1)
    fourth = size**4 * jnp.where(at == VIBRATION, jnp.exp(8 * size[SPREAD] ** 2), 1)
    mean_of_square = squared[:, None] * moments.quadratic
    mean = jnp.where(drawn, 0, size[:, None] * moments.linear) + mean_of_square
    covariance = (
        jnp.where(drawn[..., None], squared[:, None, None] * moments.linear_pairs, 0)
        + fourth[:, None, None] * moments.quadratic_pairs
        - mean_of_square[:, :, None] * mean_of_square[:, None, :]
    )
    return mean, covariance


def predicted_rms(moments: Moments, sensors: Sensors) -> jax.Array:
    """Root mean square error of elevation (chains,) that all sources make together, being independent."""
    mean, covariance = elevation_errors(moments, sensors)
    variance = jnp.einsum("saa->a", covariance) + jnp.diagonal(moments.covariance_at_zero)
    return jnp.sqrt((mean.sum(0) + moments.at_zero) ** 2 + variance)


def rectified(vibration: float, time: float) -> float:
    """Elevation that Eq. (1) makes of vibration (RMS of each of three axes) in this time: 3 sigma^2 / 2g time^2 / 2."""
    return 3 * vibration**2 / (2 * GRAVITY) * time**2 / 2


def sensitivities(course: Course, samples: int, key: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """What no drawing of sensors is needed for, from one run with perfect ones.

    Derivatives of the elevation at arrival by `CONSTANTS`, a bias of z being one that comes after standing; what the
    vertical curvature of the road adds to the elevation, the double integral of (speed times pitch rate)^2 / 2g; and
    the share of samples while moving whose horizontal acceleration x is imaginary.
    """
    t = DT * jnp.arange(samples)
    true = motion(course, t, key)
    wheel = drawn_wheel(ND_PG1, jnp.zeros(()), key)
    end = jnp.round(course.duration / DT).astype(int)

    def elevation(constants: jax.Array) -> jax.Array:
        bias, gravity, vertical_speed, scale, track = constants
        f_b = true.f_b + bias * jnp.array([0.0, 0.0, 1.0])
        of_track = replace(wheel, track_width=track)
        profile = by_speed(t, f_b, true.speed, gravity, of_track, 1 + scale)
        return profile[end, 2] + vertical_speed * course.duration

    constants = jnp.array([0.0, GRAVITY, 0.0, 0.0, ND_PG1.track_width])
    curvature = (true.speed * true.w_b[:, 1]) ** 2 / (2 * GRAVITY)
    added = cumulative_integral(t, cumulative_integral(t, curvature))[end]
    a_x = true.acceleration @ jnp.array([1.0, 0.0, 0.0])
    h = vertical_acceleration(jnp.linalg.norm(true.f_b, axis=-1), a_x, jnp.zeros_like(t), GRAVITY)
    imaginary = ~horizontal_acceleration(a_x, h)[1] & (t < course.duration)
    return jax.jacfwd(elevation)(constants), added, jnp.sum(imaginary) * DT / course.duration


@partial(jax.jit, static_argnames=("wheel_pulses_per_turn", "samples"))
def elevations_with_pulses(
    course: Course, magnet_error: jax.Array, keys: jax.Array, *, wheel_pulses_per_turn: int, samples: int
) -> jax.Array:
    """Elevations at arrival (runs,) of a perfect accelerometer and wheels with this many magnets."""
    t = DT * jnp.arange(samples)
    end = jnp.round(course.duration / DT).astype(int)

    def one(key: jax.Array) -> jax.Array:
        pace_key, wheel_key = jax.random.split(key)
        true = motion(course, t, pace_key)
        wheel = drawn_wheel(replace(ND_PG1, pulses_per_turn=wheel_pulses_per_turn), magnet_error, wheel_key)
        return by_speed(t, true.f_b, true.speed, jnp.asarray(GRAVITY), wheel, jnp.ones(()))[end, 2]

    return jax.vmap(one)(keys)
