"""Series in time: low pass, derivative, integral, resampling of jittered and gapped samples, Fourier reconstruction.

Every function takes scalar series (..., time); `axis` -2 serves vector series (..., time, 3).
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax._values import checked, increasing, not_decreasing, positive


@checked(t=increasing)
def derivative(t: ArrayLike, values: ArrayLike, axis: int = -1) -> jax.Array:
    """Time derivative by the parabola through three neighbouring samples, exact for parabolas at the ends too.

    Parameters
    ----------
    t : (time,) s
        Times, increasing; spacing may vary. At least three.
    values : (..., time)
        Series.
    axis : int, optional
        Axis of time in `values`.

    Returns
    -------
    derivative : (..., time)
        Unit of `values` per second.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than three samples.
    """
    t, x = _series(t, values, axis, at_least=3)
    dt = jnp.diff(t)
    before, after = dt[:-1], dt[1:]
    slopes = jnp.diff(x) / dt
    left, right = slopes[..., :-1], slopes[..., 1:]
    inner = (after * left + before * right) / (before + after)
    first = left[..., :1] - (inner[..., :1] - left[..., :1])
    last = right[..., -1:] + (right[..., -1:] - inner[..., -1:])
    return jnp.moveaxis(jnp.concatenate([first, inner, last], -1), -1, axis)


@checked(t=not_decreasing)
@partial(jax.jit, static_argnames="axis")
def cumulative_integral(t: ArrayLike, values: ArrayLike, axis: int = -1) -> jax.Array:
    """Integral from the first sample to each sample by the trapezoidal rule.

    Parameters
    ----------
    t : (time,) s
        Times, increasing; spacing may vary.
    values : (..., time)
        Series.
    axis : int, optional
        Axis of time in `values`.

    Returns
    -------
    integral : (..., time)
        Unit of `values` times seconds; zero at the first sample.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t, x = _series(t, values, axis, at_least=1)
    areas = 0.5 * (x[..., 1:] + x[..., :-1]) * jnp.diff(t)
    integral = jnp.concatenate([jnp.zeros_like(x[..., :1]), areas], -1)

    def with_those_before(k: jax.Array, sums: jax.Array) -> jax.Array:
        # Each sum takes in the one that ends where it begins, and so is twice as long: fast to compile, unlike cumsum.
        before = jnp.concatenate([jnp.zeros_like(sums), sums], -1)
        return sums + jax.lax.dynamic_slice_in_dim(before, t.size - jnp.left_shift(1, k), t.size, -1)

    integral = jax.lax.fori_loop(0, (t.size - 1).bit_length(), with_those_before, integral)
    return jnp.moveaxis(integral, -1, axis)


@checked(t=increasing, cutoff=positive)
def low_pass(t: ArrayLike, values: ArrayLike, cutoff: ArrayLike, axis: int = -1) -> jax.Array:
    """Zero-phase low pass: a digital second-order Butterworth filter run forward and backward.

    The response is 1 / (1 + (tan(pi f dt) / tan(pi cutoff dt))^4), one half at the cutoff. It is applied in the
    frequency domain to the series continued by odd reflection about both its ends, so straight lines pass unchanged and
    the ends do not bend; this is what ``scipy.signal.filtfilt`` does, with an unlimited pad.

    Parameters
    ----------
    t : (time,) s
        Times, uniformly spaced. At least two.
    values : (..., time)
        Series.
    cutoff : () Hz
        Frequency of half amplitude; at or above half the sampling rate nothing is filtered.
    axis : int, optional
        Axis of time in `values`.

    Returns
    -------
    filtered : (..., time)
        Series of the same unit.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two samples.
    """
    t, x = _series(t, values, axis, at_least=2)
    cutoff = require_shape("cutoff", cutoff, ())
    n = t.size
    line, odd = _odd_reflection(x)
    phase = jnp.pi / 2 * jnp.linspace(0, 1, n, dtype=x.dtype)
    relative = jnp.minimum(cutoff * (t[-1] - t[0]) / (n - 1), 0.5)
    passed = (jnp.cos(phase) * jnp.tan(jnp.pi * relative)) ** 4
    response = passed / (passed + jnp.sin(phase) ** 4)
    filtered = jnp.fft.irfft(jnp.fft.rfft(odd) * response, odd.shape[-1])[..., :n]
    return jnp.moveaxis(line + filtered, -1, axis)


@checked(t_samples=not_decreasing)
def resample(
    t: ArrayLike, t_samples: ArrayLike, values: ArrayLike, max_gap: ArrayLike, axis: int = -1
) -> tuple[jax.Array, jax.Array]:
    """Jittered and gapped samples at other times by linear interpolation, with a mask of what samples support.

    Before the first and after the last sample the nearest one is held. Faster samples are not averaged: use `low_pass`
    first where the new rate is lower.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_samples : (samples,) s
        Times of the samples, not decreasing.
    values : (..., samples)
        Series.
    max_gap : () s
        Longest interval between neighbouring samples that interpolation may bridge.
    axis : int, optional
        Axis of time in `values`.

    Returns
    -------
    values : (..., time)
        Series at `t`, of the same unit.
    valid : (time,)
        True where `t` lies on a sample or between two that are at most `max_gap` apart.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    max_gap = require_shape("max_gap", max_gap, ())
    t_samples, x = _series(t_samples, values, axis, at_least=1, t_name="t_samples")
    held = jnp.where(t < t_samples[0], t_samples[0], jnp.where(t > t_samples[-1], t_samples[-1], t))
    # A time on a sample counts to the interval before it, so that the derivative by time is never that of a point.
    after = jnp.clip(jnp.searchsorted(t_samples, held, side="left"), min(1, t_samples.size - 1), t_samples.size - 1)
    before = jnp.clip(after - 1, 0, None)
    gap = t_samples[after] - t_samples[before]
    fraction = jnp.where(gap > 0, (held - t_samples[before]) / jnp.where(gap > 0, gap, 1), 0)
    at_t = x[..., before] + fraction * (x[..., after] - x[..., before])
    on_sample = (t == t_samples[before]) | (t == t_samples[after])
    return jnp.moveaxis(at_t, -1, axis), on_sample | ((t == held) & (gap <= max_gap))


@checked(t=increasing)
def fourier_reconstruction(t: ArrayLike, values: ArrayLike, t_new: ArrayLike) -> jax.Array:
    """Value, at any time, of the trigonometric polynomial through the samples, of period n dt.

    The band-limited reconstruction that [chalko2010]_ asks for. It is plain: what is not periodic rings at the ends.

    Parameters
    ----------
    t : (time,) s
        Sample times, uniformly spaced.
    values : (..., time)
        Series.
    t_new : (samples,) s
        Times asked for.

    Returns
    -------
    values : (..., samples)
        Series of the same unit.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two samples.
    """
    t_new = require_shape("t_new", t_new, (None,))
    return _fourier_means(t, values, t_new, jnp.zeros_like(t_new))


@checked(t=increasing, edges=not_decreasing)
def fourier_interval_means(t: ArrayLike, values: ArrayLike, edges: ArrayLike) -> jax.Array:
    """Exact means, between consecutive edges, of the trigonometric polynomial through the samples.

    The average acceleration of [chalko2010]_. The mean of each harmonic over an interval is its value at mid-interval
    times sin(x)/x of half its phase advance. The reconstruction is plain, of period n dt: treat ends that do not meet
    beforehand.

    Parameters
    ----------
    t : (time,) s
        Sample times, uniformly spaced.
    values : (..., time)
        Series.
    edges : (edges,) s
        Ends of the intervals, each one's end being the next one's beginning.

    Returns
    -------
    means : (..., edges - 1)
        Means of the same unit.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two samples.
    """
    edges = require_shape("edges", edges, (None,))
    return _fourier_means(t, values, 0.5 * (edges[1:] + edges[:-1]), jnp.diff(edges))


@checked(t=increasing, edges=not_decreasing)
def interval_means(t: ArrayLike, values: ArrayLike, edges: ArrayLike) -> jax.Array:
    """Exact means, between consecutive edges, of the straight lines through the samples.

    For jittered and gapped samples, and without any trouble at the ends: the plain counterpart of
    `fourier_interval_means`, which needs uniform samples. On what is well below half the sampling rate both agree.
    Beyond the first and the last sample these are held.

    Parameters
    ----------
    t : (time,) s
        Sample times, increasing; spacing may vary.
    values : (..., time)
        Series.
    edges : (edges,) s
        Ends of the intervals, increasing, each one's end being the next one's beginning.

    Returns
    -------
    means : (..., edges - 1)
        Means of the same unit; of an interval of no length the value there.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two samples.
    """
    t, x = _series(t, values, -1, at_least=2)
    edges = require_shape("edges", edges, (None,))
    areas = 0.5 * (x[..., 1:] + x[..., :-1]) * jnp.diff(t)
    integral = jnp.concatenate([jnp.zeros_like(x[..., :1]), jnp.cumsum(areas, -1)], -1)
    k = jnp.clip(jnp.searchsorted(t, edges, side="right") - 1, 0, t.size - 2)
    into = edges - t[k]
    inside = jnp.clip(into, 0, t[k + 1] - t[k])
    at_edge = x[..., k] + inside / (t[k + 1] - t[k]) * (x[..., k + 1] - x[..., k])
    up_to = integral[..., k] + 0.5 * inside * (x[..., k] + at_edge) + (into - inside) * at_edge
    width = jnp.diff(edges)
    some = width > 0
    return jnp.where(some, jnp.diff(up_to, axis=-1) / jnp.where(some, width, 1), at_edge[..., 1:])


@checked(t=increasing)
def periodic_extension(t: ArrayLike, values: ArrayLike) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Series continued so that its ends meet, for the Fourier functions, and the line that was taken off before.

    Less the line through its first and last samples, the series is followed by its odd reflection about the end: value
    and slope then go on across both ends, while a series that is repeated as it is jumps there and rings. Add the mean
    of the line, its value at mid-interval, to the means of what is returned.

    Parameters
    ----------
    t : (time,) s
        Sample times, uniformly spaced. At least two.
    values : (..., time)
        Series.

    Returns
    -------
    t_continued : (2 * time - 2,) s
        Times of the continued series, going on at the same spacing.
    continued : (..., 2 * time - 2)
        Periodic series, equal to `values` less the line at `t`.
    line : (..., time)
        The line through the first and the last sample.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two samples.
    """
    t, x = _series(t, values, -1, at_least=2)
    line, odd = _odd_reflection(x)
    return t[0] + (t[-1] - t[0]) / (t.size - 1) * jnp.arange(odd.shape[-1]).astype(t.dtype), odd, line


def _odd_reflection(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Line through the ends, and the rest with its odd reflection: its period is 2 (n - 1) exactly."""
    line = x[..., :1] + (x[..., -1:] - x[..., :1]) * jnp.linspace(0, 1, x.shape[-1], dtype=x.dtype)
    rest = x - line
    return line, jnp.concatenate([rest, -rest[..., -2:0:-1]], -1)


def _fourier_means(t: ArrayLike, values: ArrayLike, middles: jax.Array, widths: jax.Array) -> jax.Array:
    t, x = _series(t, values, -1, at_least=2)
    n = t.size
    period = (t[-1] - t[0]) * n / (n - 1)
    k = jnp.arange(n // 2 + 1)
    # Every harmonic stands for two coefficients, but the mean and, for even n, the one at half the sampling rate.
    weight = jnp.where((k == 0) | (2 * k == n), 1.0, 2.0).astype(x.dtype)
    coefficients = jnp.fft.rfft(x) / n * weight

    def mean(middle_and_width: tuple[jax.Array, jax.Array]) -> jax.Array:
        middle, width = middle_and_width
        # Whole turns are taken off before the sine sees them: k turns of a phase near 1 would cost digits.
        phase = 2 * jnp.pi * jnp.mod(k * jnp.mod((middle - t[0]) / period, 1), 1).astype(x.dtype)
        attenuation = jnp.sinc(k * (width / period)).astype(x.dtype)
        basis = attenuation * jnp.cos(phase), attenuation * jnp.sin(phase)
        return jnp.sum(coefficients.real * basis[0] - coefficients.imag * basis[1], -1)

    # In blocks: the full table of harmonics by intervals would not fit in memory for an hour of samples.
    means = jax.lax.map(mean, (middles, widths), batch_size=64)
    return jnp.moveaxis(means, 0, -1)


def _series(
    t: ArrayLike, values: ArrayLike, axis: int, at_least: int, t_name: str = "t"
) -> tuple[jax.Array, jax.Array]:
    """Times and values as arrays, time moved to the last axis."""
    t = require_shape(t_name, t, (None,))
    x = jnp.moveaxis(require_shape("values", values, (..., None)), axis, -1)
    if x.shape[-1] != t.size:
        raise ValueError(f"values must have shape (..., {t.size}) along axis {axis}, as {t_name} has, got {x.shape}")
    if t.size < at_least:
        raise ValueError(f"{t_name} must have at least {at_least} samples, got {t.size}")
    return t, x
