"""Readings of a whole record as arrays, and what lies between any instants of it."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from altijax.motion_estimate.model import Intervals


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
    spacing : (time,) s
        Usual time between epochs.
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
    gravity: jax.Array


def instants_at(readings: MotionReadings, delay: jax.Array) -> jax.Array:
    """Times of the instants on the IMU's clock, within its span and never backwards."""
    t = readings.instant - delay * readings.delayed
    return jax.lax.cummax(jnp.clip(t, readings.t[0], readings.t[-1]))


def intervals_between(readings: MotionReadings, t: jax.Array, steps: int) -> Intervals:
    """Mean readings over equal steps between instants, exact for readings that run straight between samples."""
    duration = jnp.diff(t)
    share = jnp.arange(steps + 1, dtype=t.dtype) / steps
    edges = t[:-1, None] + duration[:, None] * share
    k = jnp.clip(jnp.searchsorted(readings.t, edges, side="right") - 1, 0, readings.t.size - 2)
    later = edges - readings.t[k]
    part = (later / (readings.t[k + 1] - readings.t[k]))[..., None]
    value, rise = readings.readings[k], readings.readings[k + 1] - readings.readings[k]
    sums = readings.sums[k] + later[..., None] * (value + 0.5 * part * rise)
    lost = readings.sums[k, 6] + part[..., 0] * (readings.sums[k + 1, 6] - readings.sums[k, 6])
    # A step of no length has the reading of its instant.
    short = (duration <= 1e-9)[:, None, None]
    means = jnp.diff(sums[..., :6], axis=1) / jnp.where(short, 1, duration[:, None, None] / steps)
    means = jnp.where(short, (value + part * rise)[:, :-1, :6], means)
    return Intervals(f_b=means[..., :3], w_b=means[..., 3:], duration=duration, gap=lost[:, -1] - lost[:, 0])
