"""Sampled series in NumPy: what reading and aligning a recording needs, where nothing is differentiated or compiled.

`signals` has the same for JAX.
"""

import numpy as np


def interpolated(t: np.ndarray, t_samples: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Samples at other times by straight lines, the first and last one held beyond them.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_samples : (samples,) s
        Times of the samples, not decreasing.
    values : (samples,) or (samples, columns)
        Samples.

    Returns
    -------
    values : (time,) or (time, columns)
        Of the same unit.
    """
    if values.ndim == 1:
        return np.interp(t, t_samples, values)
    return np.stack([np.interp(t, t_samples, column) for column in values.T], -1)


def supported(t: np.ndarray, t_samples: np.ndarray, max_gap: float) -> np.ndarray:
    """Where samples support a value: on one, or between two that are near each other.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_samples : (samples,) s
        Times of the samples, not decreasing.
    max_gap : float
        Longest interval between neighbouring samples that may be bridged, s.

    Returns
    -------
    supported : (time,)
        True where it is so.
    """
    last = t_samples.size - 1
    after = np.clip(np.searchsorted(t_samples, t, side="left"), min(1, last), last)
    before = np.maximum(after - 1, 0)
    on_sample = (t == t_samples[before]) | (t == t_samples[after])
    between = (t >= t_samples[0]) & (t <= t_samples[-1]) & (t_samples[after] - t_samples[before] <= max_gap)
    return on_sample | between


def flanked(t: np.ndarray, t_samples: np.ndarray, usual: float) -> np.ndarray:
    """Where samples lie close on both sides, or on one beyond the first and the last.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_samples : (samples,) s
        Times of the samples, not decreasing.
    usual : float
        Usual time between samples, s.

    Returns
    -------
    flanked : (time,)
        True where the samples before and after are at most five usual intervals apart, or two seconds; beyond the ends,
        where the nearest one is at most two usual intervals away.
    """
    k = np.searchsorted(t_samples, t)
    before = t - t_samples[np.clip(k - 1, 0, t_samples.size - 1)]
    after = t_samples[np.clip(k, 0, t_samples.size - 1)] - t
    beyond = (k == 0) | (k == t_samples.size)
    near: np.ndarray = np.where(beyond, np.maximum(before, after) <= 2 * usual, before + after <= max(5 * usual, 2.0))
    return near


def longest_step(usual: float) -> float:
    """The longest interval between samples of an IMU that is no gap, s: five usual ones (s), or a tenth of a second."""
    return max(5 * usual, 0.1)


def after_gap(t: np.ndarray, usual: float) -> np.ndarray:
    """Whether samples of an IMU come after a gap.

    Parameters
    ----------
    t : (samples,) s
        Their times.
    usual : float
        Usual time between them, s.

    Returns
    -------
    after_gap : (samples,)
        True where the interval before is longer than `longest_step`.
    """
    gap: np.ndarray = np.diff(t, prepend=t[0]) > longest_step(usual)
    return gap


def means_between(edges: np.ndarray, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means over intervals of samples, the trapezoid between two neighbours spread evenly over the time between them.

    Exact where the edges are times of samples; `signals.interval_means` is so everywhere.

    Parameters
    ----------
    edges : (..., edges) s
        Ends of the intervals, increasing along the last axis, within the span of the samples.
    t : (samples,) s
        Times of the samples, increasing.
    values : (samples, columns)
        Samples.

    Returns
    -------
    means : (..., edges - 1, columns)
        Of the same unit.
    """
    areas = 0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, None]
    integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(areas, 0)])
    at_edges = np.stack([np.interp(edges, t, column) for column in integral.T], -1)
    return np.diff(at_edges, axis=-2) / np.diff(edges)[..., None]


def low_pass(t: np.ndarray, values: np.ndarray, cutoff: float) -> np.ndarray:
    """Zero-phase low pass, the same filter as `signals.low_pass`.

    Parameters
    ----------
    t : (time,) s
        Times, uniformly spaced. At least two.
    values : (..., time)
        Series.
    cutoff : float
        Frequency of half amplitude, Hz; at or above half the sampling rate nothing is filtered.

    Returns
    -------
    filtered : (..., time)
        Series of the same unit.
    """
    share = np.linspace(0, 1, t.size)
    line = values[..., :1] + (values[..., -1:] - values[..., :1]) * share
    rest = values - line
    odd = np.concatenate([rest, -rest[..., -2:0:-1]], -1)
    passed = (np.cos(np.pi / 2 * share) * np.tan(np.pi * min(cutoff * (t[-1] - t[0]) / (t.size - 1), 0.5))) ** 4
    response = passed / (passed + np.sin(np.pi / 2 * share) ** 4)
    return line + np.fft.irfft(np.fft.rfft(odd) * response, odd.shape[-1])[..., : t.size]
