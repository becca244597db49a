"""Readings of a whole record as arrays, and what lies between any instants of it."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp


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
class MotionReadings:
    """Readings of a recording, times counted from the first IMU sample.

    Attributes
    ----------
    t : (samples,) s
        Times of the IMU; past the end the last reading goes on.
    readings : (samples, 7)
        Specific force (m/s^2), angular rate (rad/s), and 1 within gaps.
    sums : (samples, 7)
        Their integral from the first sample.
    instant : (time,) s
        GNSS epochs, as stamped, and instants between and beyond them.
    delayed : (time,)
        1 where the instant is as late as the receiver's stamps, 0 where it is on the IMU's clock.
    v_gnss : (time, 3) m/s
        Velocities; any value where there is none.
    std : (time, 3) m/s
        Their standard deviations as far as known beforehand; infinite where there is none.
    spacing : () s
        Usual time between epochs.
    share : (steps + 1,)
        Where the steps of an interval begin and end, from 0 to 1; the last ones only fill up and have no length.
    gravity : () m/s^2
        Magnitude of gravity.
    """

    t: jax.Array
    readings: jax.Array
    sums: jax.Array
    instant: jax.Array
    delayed: jax.Array
    v_gnss: jax.Array
    std: jax.Array
    spacing: jax.Array
    share: jax.Array
    gravity: jax.Array


def instants_at(readings: MotionReadings, delay: jax.Array) -> jax.Array:
    """Times of the instants on the IMU's clock, within its span and never backwards."""
    t = jnp.clip(readings.instant - delay * readings.delayed, readings.t[0], readings.t[-1])
    # The latest so far, by its place: JAX differentiates a running maximum by a tree of many copies.
    latest = jax.lax.cummax(jax.lax.stop_gradient(t))
    return t[jnp.searchsorted(latest, latest)]


def intervals_between(readings: MotionReadings, t: jax.Array) -> Intervals:
    """Mean readings over equal steps between instants, exact for readings that run straight between samples."""
    t_imu, share = jnp.asarray(readings.t), jnp.asarray(readings.share)
    duration = jnp.diff(t)
    edges = t[:-1, None] + duration[:, None] * share
    k = jnp.clip(jnp.searchsorted(t_imu, edges, side="right") - 1, 0, t_imu.size - 2)

    def taken(series: jax.Array, k: jax.Array) -> jax.Array:
        return jnp.asarray(series).at[k].get(mode="promise_in_bounds", wrap_negative_indices=False)

    later = edges - taken(t_imu, k)
    part = (later / (taken(t_imu, k + 1) - taken(t_imu, k)))[..., None]
    value, total = taken(readings.readings, k), taken(readings.sums, k)
    rise = taken(readings.readings, k + 1) - value
    sums = total + later[..., None] * (value + 0.5 * part * rise)
    lost = total[..., 6] + part[..., 0] * (taken(readings.sums, k + 1)[..., 6] - total[..., 6])
    dt = duration[:, None] * jnp.diff(share)
    # A step of no length has the reading of its instant.
    short = ((duration <= 1e-9)[:, None] | (dt <= 0))[..., None]
    means = jnp.diff(sums[..., :6], axis=1) / jnp.where(short, 1, dt[..., None])
    means = jnp.where(short, (value + part * rise)[:, :-1, :6], means)
    return Intervals(f_b=means[..., :3], w_b=means[..., 3:], dt=dt, duration=duration, gap=lost[:, -1] - lost[:, 0])
