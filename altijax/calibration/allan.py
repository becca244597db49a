"""Allan deviation of a resting sensor, and the noise levels that it shows: white noise, flicker and random walk.

The one-sided spectrum of the three together, with the densities as data sheets give them, is

    S(f) = noise_density^2 + bias_instability^2 / (pi f) + bias_random_walk^2 / (2 pi^2 f^2)

and their Allan variances at the averaging time tau (IEEE Std 952, annex C)

    noise_density^2 / (2 tau) + (2 ln 2 / pi) bias_instability^2 + bias_random_walk^2 tau / 3

so the lowest point of a flicker floor is 0.664 times the bias instability, and noise_density is sqrt(2) times what
some call the angle (or velocity) random walk. `noise_density` and `bias_random_walk` are those of `Accelerometer` and
`Gyro`.
"""

from dataclasses import dataclass
from math import log, pi

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax.least_squares import levenberg_marquardt

NOISES = ("noise_density", "bias_instability", "bias_random_walk")
"""Order of the noises on the axis `noises`."""

# Nodes of the integrals over frequency: dense enough for the lobes of the filters that still weigh something.
_NODES = 3000


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class AllanFit:
    """Noise levels fitted to an Allan deviation, in the order of `NOISES`.

    Attributes
    ----------
    level : (noises,)
        noise_density (unit/sqrt(Hz)), bias_instability (unit) and bias_random_walk (unit/sqrt(s)), of the readings'
        unit; zero where the best fit has none.
    std : (noises,)
        Standard deviation of each; of one that is not determined so large that zero is within 1.96 of it.
    upper : (noises,)
        What each is below with 97.5 % confidence: all that is known of one that is not determined.
    determined : (noises,)
        Whether the variance found is at least twice its standard deviation. A level is not determined if it is small
        against the others or its part of the curve lies beyond the longest averaging time.
    deviation : (factors,)
        Allan deviation of the fitted levels.
    freedom : (factors,)
        Equivalent degrees of freedom of each measured Allan variance, if the fitted levels are true.
    """

    level: jax.Array
    std: jax.Array
    upper: jax.Array
    determined: jax.Array
    deviation: jax.Array
    freedom: jax.Array


def averaging_factors(samples: int, per_decade: int = 8, most: float = 0.1) -> tuple[int, ...]:
    """Numbers of samples to average over, in steps that look even on a logarithmic axis.

    Parameters
    ----------
    samples : int
        Length of the series.
    per_decade : int, optional
        How many to have from one power of ten to the next.
    most : float, optional
        Largest, as a fraction of `samples`. Beyond a tenth hardly five independent differences are left.

    Returns
    -------
    factors : tuple of int
        Increasing, from 1.
    """
    steps = range(int(per_decade * log(max(most * samples, 1), 10)) + 1)
    return tuple(sorted({round(10 ** (step / per_decade)) for step in steps}))


def allan_deviation(values: ArrayLike, dt: ArrayLike, *, factors: tuple[int, ...]) -> tuple[jax.Array, jax.Array]:
    """Overlapping Allan deviation.

    Parameters
    ----------
    values : (..., time)
        Readings at rest, at uniform times.
    dt : () s
        Time between samples.
    factors : tuple of int
        Numbers of samples to average over, as from `averaging_factors`.

    Returns
    -------
    tau : (factors,) s
        Averaging times.
    deviation : (..., factors)
        Root of half the mean squared difference of neighbouring averages, of the readings' unit.

    Raises
    ------
    ValueError
        If the shapes do not fit, or a factor is below 1 or above half the number of samples.
    """
    values = require_shape("values", values, (..., None))
    dt = require_shape("dt", dt, ())
    n = values.shape[-1]
    if not factors or min(factors) < 1 or 2 * max(factors) > n:
        raise ValueError(f"factors must be from 1 to {n // 2}, half of the {n} samples, got {factors}")
    # Without the mean the sums stay small, and keep their digits.
    sums = jnp.cumsum(values - jnp.mean(values, -1, keepdims=True), -1)
    sums = jnp.concatenate([jnp.zeros_like(sums[..., :1]), sums], -1)
    variances = []
    for m in factors:
        difference = sums[..., 2 * m :] - 2 * sums[..., m:-m] + sums[..., : -2 * m]
        variances.append(0.5 * jnp.mean(difference**2, -1) / m**2)
    return jnp.asarray(factors, dt.dtype) * dt, _safe.sqrt(jnp.stack(variances, -1))


def allan_covariance(level: ArrayLike, dt: ArrayLike, *, factors: tuple[int, ...], samples: int) -> jax.Array:
    """Covariance of measured overlapping Allan variances, if the noise is normal and of the given levels.

    The variance of the variance at one averaging time, and how much the estimates at two have in common, are integrals
    of the squared spectrum through both filters; neighbours on the curve come from the same readings and agree closely.

    Parameters
    ----------
    level : (3,)
        Levels in the order of `NOISES`.
    dt : () s
        Time between samples.
    factors : tuple of int
        Numbers of samples averaged over.
    samples : int
        Length of the series.

    Returns
    -------
    covariance : (factors, factors)
        Of the readings' unit to the power of four.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    level = require_shape("level", level, (3,))
    dt = require_shape("dt", dt, ())
    m = jnp.asarray(factors, level.dtype)
    # From well below a cycle in the longest average up to half the sampling rate, evenly in the logarithm.
    lowest = 2e-3 / max(factors)
    fraction = lowest * (0.5 / lowest) ** jnp.linspace(0, 1, _NODES, dtype=level.dtype)
    f = fraction / dt
    spectrum = level[0] ** 2 + level[1] ** 2 / (pi * f) + level[2] ** 2 / (2 * pi**2 * f**2)
    turn = pi * fraction
    passed = 2 * jnp.sin(m[:, None] * turn) ** 4 / (m[:, None] * jnp.sin(turn)) ** 2 * spectrum
    width = log(0.5 / lowest) / (_NODES - 1) * f
    weight = width.at[jnp.asarray([0, -1])].multiply(0.5)
    terms = samples + 1 - 2 * m
    return jnp.einsum("if,jf,f->ij", passed, passed, weight) / (dt * jnp.maximum(terms[:, None], terms))


def fit_allan(deviation: ArrayLike, dt: ArrayLike, *, factors: tuple[int, ...], samples: int) -> AllanFit:
    """White noise, flicker floor and random walk in an Allan deviation, by least squares in the logarithm.

    No level can be negative. Each point counts by its equivalent degrees of freedom; what neighbouring points have in
    common is no information twice, and is accounted for in the standard deviations.

    Parameters
    ----------
    deviation : (factors,)
        Overlapping Allan deviation, positive.
    dt : () s
        Time between samples.
    factors : tuple of int
        Numbers of samples averaged over. Leave out those below the sensor's own averaging (a low pass makes the curve
        bend down at its beginning), which no level explains.
    samples : int
        Length of the series.

    Returns
    -------
    fit : AllanFit
        Levels, their standard deviations, and which are determined.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    deviation = require_shape("deviation", deviation, (len(factors),))
    dt = require_shape("dt", dt, ())
    tau = jnp.asarray(factors, deviation.dtype) * dt
    shapes = jnp.stack([0.5 / tau, jnp.full_like(tau, 2 * log(2) / pi), tau / 3], -1)
    measured = 2 * jnp.log(deviation)
    # In these units each noise alone would make up the whole of the point where it weighs most.
    unit = jnp.max(_safe.sqrt(jnp.min(deviation[:, None] ** 2 / shapes, 0)[None]), 0)

    def fitted(weight: jax.Array, freedom: jax.Array, start: jax.Array) -> jax.Array:
        # the logarithm of chi^2 over its degrees of freedom is below zero on average
        target = measured + 1 / freedom

        def residual(x: jax.Array) -> jax.Array:
            return weight * (jnp.log(shapes @ (unit * x) ** 2) - target)

        return levenberg_marquardt(residual, start).x

    def freedoms(x: jax.Array) -> tuple[jax.Array, jax.Array]:
        variance = shapes @ (unit * x) ** 2
        covariance = allan_covariance(unit * x, dt, factors=factors, samples=samples)
        return 2 * variance**2 / jnp.diag(covariance), covariance / jnp.outer(variance, variance)

    guess = jnp.maximum(samples / jnp.asarray(factors, deviation.dtype), 1)
    x = fitted(jnp.sqrt(guess), guess, jnp.full_like(unit, 0.5))
    freedom, _ = freedoms(x)
    # A level at zero would stay there: squares have no slope.
    x = jnp.abs(fitted(jnp.sqrt(freedom / 2), freedom, jnp.maximum(jnp.abs(x), 0.05)))
    freedom, relative = freedoms(x)
    variance = (unit * x) ** 2
    jacobian = shapes * unit**2 / (shapes @ variance)[:, None]
    weighted = jacobian.T * (freedom / 2)
    estimator = jnp.linalg.pinv(weighted @ jacobian, rtol=1e-12, hermitian=True) @ weighted
    variance_std = unit**2 * _safe.sqrt(jnp.diag(estimator @ relative @ estimator.T))
    level = unit * x
    determined = variance > 2 * variance_std
    # A variance that is known is skewed like chi^2: its logarithm is the more nearly normal.
    growth = jnp.exp(1.96 * variance_std / jnp.where(determined, variance, jnp.inf))
    upper = _safe.sqrt(jnp.where(determined, variance * growth, variance + 1.96 * variance_std))
    return AllanFit(
        level=level,
        std=jnp.where(determined, variance_std / (2 * jnp.where(determined, level, 1)), upper / 1.96),
        upper=upper,
        determined=determined,
        deviation=jnp.sqrt(shapes @ variance),
        freedom=freedom,
    )
