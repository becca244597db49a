"""How many independent observations a correlated series is worth, and the standard deviation of its mean."""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax._values import checked, samples


@checked(series=samples(2))
def statistical_inefficiency(series: ArrayLike) -> jax.Array:
    """Number of neighbouring samples that count as one: 1 + 2 times the sum of the autocorrelations.

    The sum ends where the sample autocorrelation first is not positive, beyond which there is only noise; so it is
    never below 1, and a series that alternates counts as an independent one.

    Parameters
    ----------
    series : (..., time)
        Stationary series at uniform times; its mean does not matter.

    Returns
    -------
    inefficiency : (...)
        At least 1, and 1 for a constant series.

    Raises
    ------
    ValueError
        If `series` has no axis of time.
    """
    series = require_shape("series", series, (..., None))
    n = series.shape[-1]
    rest = series - jnp.mean(series, -1, keepdims=True)
    spectrum = jnp.abs(jnp.fft.rfft(rest, 2 * n)) ** 2
    covariance = jnp.fft.irfft(spectrum, 2 * n)[..., :n]
    # What rounding leaves of a constant is no variance.
    rounding = 8 * jnp.finfo(series.dtype).eps * jnp.max(jnp.abs(series), -1, keepdims=True)
    varies = covariance[..., :1] > n * rounding**2
    correlation = jnp.where(varies, covariance / jnp.where(varies, covariance[..., :1], 1), 0)
    together = jnp.cumprod(jax.lax.stop_gradient(correlation) > 0, -1)
    return jnp.maximum(2 * jnp.sum(together * correlation, -1) - 1, 1)


@checked(series=samples(2))
def mean_with_std(series: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Mean of a correlated series and its standard deviation.

    Parameters
    ----------
    series : (..., time)
        Stationary series at uniform times, long against its correlation.

    Returns
    -------
    mean : (...)
        Mean, of the same unit.
    mean_std : (...)
        Its standard deviation: that of independent samples, times the root of the statistical inefficiency.

    Raises
    ------
    ValueError
        If `series` has no axis of time.
    """
    series = require_shape("series", series, (..., None))
    n = series.shape[-1]
    together = jnp.minimum(statistical_inefficiency(series), n / 2)
    # The spread about the sample's own mean is smaller than that about the true one by just the mean's variance.
    variance_of_mean = jnp.var(series, -1) * together / (n - together)
    positive = variance_of_mean > 0
    return jnp.mean(series, -1), jnp.where(positive, jnp.sqrt(jnp.where(positive, variance_of_mean, 1)), 0)
