"""Error measures as the papers define them, and those that error bars are judged by."""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, samples


@checked(error=samples(1))
def rms(error: ArrayLike) -> jax.Array:
    """Root mean square of an error series.

    Parameters
    ----------
    error : (..., time)
        Estimate minus reference.

    Returns
    -------
    rms : (...)
        Of the same unit.
    """
    error = require_shape("error", error, (..., None))
    return _safe.sqrt(jnp.mean(error * error, -1))


@checked(error=samples(1))
def rms_without_offset(error: ArrayLike) -> jax.Array:
    """Root mean square of an error series less its mean: what is left when the height datum is free.

    Parameters
    ----------
    error : (..., time)
        Estimate minus reference.

    Returns
    -------
    rms : (...)
        Of the same unit.
    """
    error = require_shape("error", error, (..., None))
    return rms(error - jnp.mean(error, -1, keepdims=True))


def accuracy_denominator(actual: ArrayLike, error: ArrayLike) -> jax.Array:
    """The n of an accuracy 1/n, as surveyors and the tables of [shirai2000]_ state it: actual length over error.

    Parameters
    ----------
    actual : (...) m
        Measured length or height difference.
    error : (...) m
        Estimate minus actual.

    Returns
    -------
    n : (...)
        |actual / error|, infinite for no error.
    """
    actual, error = require_shape("actual", actual, (...,)), require_shape("error", error, (...,))
    exact = error == 0
    return jnp.where(exact, jnp.inf, jnp.abs(actual / jnp.where(exact, 1, error)))


@checked(error=samples(1))
def coverage(error: ArrayLike, std: ArrayLike, multiple: ArrayLike) -> jax.Array:
    """Share of samples whose error lies within a multiple of the stated standard deviation.

    An honest Gaussian error bar covers 68 % within one and 95 % within two.

    Parameters
    ----------
    error : (..., time)
        Estimate minus reference.
    std : (..., time)
        Stated standard deviation, of the same unit.
    multiple : ()
        How many standard deviations.

    Returns
    -------
    share : (...)
        Between 0 and 1.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    error = require_shape("error", error, (..., None))
    std = require_shape("std", std, (..., error.shape[-1]))
    multiple = require_shape("multiple", multiple, ())
    return jnp.mean((jnp.abs(error) <= multiple * std).astype(error.dtype), -1)
