"""Where a sensor rests: the still parts of a long series, and the mean reading in each."""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape


def still_samples(readings: ArrayLike, threshold: ArrayLike, window: int = 100) -> jax.Array:
    """Whether a sample lies in a stretch in which a triad of accelerometers or gyros reads the same throughout.

    Parameters
    ----------
    readings : (..., time, 3)
        Readings, m/s^2 or rad/s, at uniform times.
    threshold : () same unit
        Largest standard deviation, over all three axes together, in a still stretch: some twice that of the sensor's
        noise. An even motion, such as a car on a smooth road, may be below any threshold; a gyro and an accelerometer
        that must both be still are harder to deceive.
    window : int, optional
        Length of a stretch in samples, about a second. It is also the shortest standstill that can be found.

    Returns
    -------
    still : (..., time)
        True in each stretch of `window` samples whose standard deviation is below the threshold.

    Raises
    ------
    ValueError
        If the shapes do not fit or `window` is below 2.
    """
    readings = require_shape("readings", readings, (..., None, 3))
    threshold = require_shape("threshold", threshold, ())
    if window < 2:
        raise ValueError(f"window must be 2 samples or more, got {window}")
    n = readings.shape[-2]
    window = min(window, n)
    centred = jnp.moveaxis(readings - jnp.mean(readings, -2, keepdims=True), -1, 0)
    mean = _moving_sum(centred, window) / window
    variance = jnp.sum(_moving_sum(centred**2, window) / window - mean**2, 0)
    quiet = (variance < threshold**2).astype(readings.dtype)
    beside = [(0, 0)] * (quiet.ndim - 1) + [(window - 1, window - 1)]
    return _moving_sum(jnp.pad(quiet, beside), window) > 0


def means_at_rest(readings: ArrayLike, still: ArrayLike, *, max_intervals: int) -> tuple[jax.Array, jax.Array]:
    """Mean reading of each still interval of a series, in their order.

    Parameters
    ----------
    readings : (time, 3)
        Readings, m/s^2 or rad/s.
    still : (time,)
        Whether each sample belongs to a still interval.
    max_intervals : int
        Room for intervals; those beyond are left out.

    Returns
    -------
    mean : (max_intervals, 3)
        Mean of each interval, zero where there is none.
    samples : (max_intervals,)
        Number of samples in it, zero where there is none.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    readings = require_shape("readings", readings, (None, 3))
    resting = require_shape("still", still, readings.shape[:1]) > 0
    begins = resting & ~jnp.concatenate([jnp.zeros(1, bool), resting[:-1]])
    number = jnp.where(resting, jnp.cumsum(begins) - 1, max_intervals)
    samples = jax.ops.segment_sum(resting.astype(readings.dtype), number, max_intervals)
    total = jax.ops.segment_sum(readings, number, max_intervals)
    return total / jnp.maximum(samples, 1)[:, None], samples


def _moving_sum(x: jax.Array, window: int) -> jax.Array:
    """Sum of each `window` neighbours along the last axis, without the rounding of a running total."""
    sizes = (1,) * (x.ndim - 1) + (window,)
    return jax.lax.reduce_window(x, x.dtype.type(0), jax.lax.add, sizes, (1,) * x.ndim, "valid")
