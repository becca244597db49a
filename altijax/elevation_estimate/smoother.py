"""Elevation as a linear Gaussian model: what the road, the car and the sensors do, conditioned on what is known.

All errors are series at knots in time, known by their covariance, and the constants enter linearly. Then heights,
a second estimate of the elevation and what roads are like are three kinds of one thing, observations, and one update
gives the mean and the standard deviation everywhere.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import cho_factor, cho_solve
from jax.typing import ArrayLike

from altijax._shapes import require_shape


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class ElevationNoise:
    """How far the two ways to an elevation wander when their constants are right, and how roads wander.

    The levels of the slope's way are of the car (trim, squat, wheels on a rough road) more than of its sensor.

    Attributes
    ----------
    slope : () m^(1/2)
        Random walk of the elevation by the slope over a metre of way: white noise in the slope.
    trim : () m/s^2
        Standard deviation of an error of the forward specific force that stays for `trim_time`.
    trim_time : () s
        Its correlation time.
    vertical : () m/s^2/Hz^(1/2)
        White noise of the vertical acceleration of Eq. (1) in [shirai2000]_.
    kinematic : () m/s^2/Hz^(1/2)
        White noise of the horizontal acceleration taken from speed and rate of turn; Eq. (1) squares it, and so errs by
        its product with the acceleration over gravity.
    rectified : () m/s^2
        Standard deviation of an error of the same vertical acceleration that stays for `rectified_time`, such as
        rectified vibration.
    rectified_time : () s
        Its correlation time.
    road : ()
        Standard deviation of the slope of roads.
    road_length : () m
        Way over which a road keeps its slope.
    """

    slope: jax.Array | float = 0.015
    trim: jax.Array | float = 0.03
    trim_time: jax.Array | float = 5.0
    vertical: jax.Array | float = 0.01
    kinematic: jax.Array | float = 0.3
    rectified: jax.Array | float = 0.01
    rectified_time: jax.Array | float = 30.0
    road: jax.Array | float = 0.05
    road_length: jax.Array | float = 200.0


def slope_way_covariance(t: ArrayLike, way: ArrayLike, gravity: ArrayLike, noise: ElevationNoise) -> jax.Array:
    """Covariance of the error of an elevation that is the integral of a slope.

    Parameters
    ----------
    t : (time,) s
        Knots.
    way : (time,) m
        Way at them, never decreasing, zero at the first.
    gravity : () m/s^2
        Magnitude of gravity.
    noise : ElevationNoise
        Levels.

    Returns
    -------
    covariance : (time, time) m^2
        Zero at the first knot.
    """
    t = require_shape("t", t, (None,))
    way = require_shape("way", way, t.shape)
    gain = _steps_before(t) * jnp.diff(way) / gravity
    return noise.slope**2 * jnp.minimum(way[:, None], way) + gain @ _lasting(t, noise.trim, noise.trim_time) @ gain.T


def norm_way_covariance(t: ArrayLike, acceleration: ArrayLike, gravity: ArrayLike, noise: ElevationNoise) -> jax.Array:
    """Covariance of the error of an elevation by Eq. (1) of [shirai2000]_, integrated twice.

    Parameters
    ----------
    t : (time,) s
        Knots.
    acceleration : (steps,) m/s^2
        Root mean square of the horizontal acceleration between them.
    gravity : () m/s^2
        Magnitude of gravity.
    noise : ElevationNoise
        Levels.

    Returns
    -------
    covariance : (time, time) m^2
        Zero at the first knot.
    """
    t = require_shape("t", t, (None,))
    acceleration = require_shape("acceleration", acceleration, (t.size - 1,))
    step, middle = jnp.diff(t), 0.5 * (t[1:] + t[:-1])
    gain = _steps_before(t) * step * (t[:, None] - middle)
    white = (noise.vertical**2 + (noise.kinematic * acceleration / gravity) ** 2) / step
    return gain @ (jnp.diag(white) + _lasting(t, noise.rectified, noise.rectified_time)) @ gain.T


def road_covariance(way: ArrayLike, noise: ElevationNoise) -> jax.Array:
    """Covariance of the elevation of roads whose slope is a stationary Gauss-Markov process of the way.

    Parameters
    ----------
    way : (time,) m
        Way at the knots, never decreasing, zero at the first.
    noise : ElevationNoise
        Its `road` and `road_length`.

    Returns
    -------
    covariance : (time, time) m^2
        Zero at the first knot.
    """
    s = require_shape("way", way, (None,)) / noise.road_length
    fade = -jnp.expm1(-s)
    between = fade[:, None] + fade + jnp.expm1(-jnp.abs(s[:, None] - s))
    return (noise.road * noise.road_length) ** 2 * (2 * jnp.minimum(s[:, None], s) - between)


def gaussian_update(
    prior_covariance: ArrayLike, design: ArrayLike, observed: ArrayLike, covariance: ArrayLike
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Unknowns of zero prior mean, given ``observed = design @ unknowns + error``.

    Parameters
    ----------
    prior_covariance : (unknowns, unknowns)
        Covariance of the unknowns before.
    design : (rows, unknowns)
        How the observations depend on them.
    observed : (rows,)
        Observations.
    covariance : (rows, rows)
        Covariance of their errors.

    Returns
    -------
    mean : (unknowns,)
        Their mean afterwards.
    posterior_covariance : (unknowns, unknowns)
        Their covariance afterwards.
    log_likelihood : ()
        Logarithm of the probability density of the observations, without its constant.
    """
    prior_covariance, design = jnp.asarray(prior_covariance), jnp.asarray(design)
    cross = prior_covariance @ design.T
    factor = cho_factor(design @ cross + covariance, lower=True)
    whitened = cho_solve(factor, observed)
    log_likelihood = -0.5 * jnp.dot(observed, whitened) - jnp.sum(jnp.log(jnp.diagonal(factor[0])))
    return cross @ whitened, prior_covariance - cross @ cho_solve(factor, cross.T), log_likelihood


def quadrature_nodes(
    best: ArrayLike, curvature: ArrayLike, least_curvature: float, count: int = 3
) -> tuple[jax.Array, jax.Array]:
    """Nodes of an adaptive Gauss-Hermite quadrature, about the maximum of a density and as wide as that is there.

    Parameters
    ----------
    best : (unknowns,)
        Where the density is largest.
    curvature : (unknowns, unknowns)
        Minus the second derivatives of its logarithm there.
    least_curvature : float
        Taken in directions in which it is less.
    count : int
        Nodes in each direction.

    Returns
    -------
    nodes : (nodes, unknowns)
        ``count ** unknowns`` of them.
    log_weights : (nodes,)
        An integral over the density is the sum of what is integrated times ``exp(log_weights) * density``, but for a
        factor common to all.
    """
    best = require_shape("best", best, (None,))
    curvature = require_shape("curvature", curvature, (best.size, best.size))
    values, vectors = jnp.linalg.eigh(curvature)
    node, weight = np.polynomial.hermite_e.hermegauss(count)
    z, weights = (np.stack(np.meshgrid(*[x] * best.size), -1).reshape(-1, best.size) for x in (node, weight))
    nodes = best + z @ (vectors / jnp.sqrt(jnp.maximum(values, least_curvature))).T
    return nodes, jnp.asarray(np.log(weights).sum(1) + 0.5 * np.square(z).sum(1), best.dtype)


def mixture_moments(means: ArrayLike, covariances: ArrayLike, log_weights: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Mean and covariance of a mixture.

    Parameters
    ----------
    means : (parts, unknowns)
        Of its parts.
    covariances : (parts, unknowns, unknowns)
        Of its parts.
    log_weights : (parts,)
        Logarithms of their weights, but for a constant.

    Returns
    -------
    mean : (unknowns,)
        Of all.
    covariance : (unknowns, unknowns)
        Of all: that within the parts and that between them.
    """
    means = require_shape("means", means, (None, None))
    weights = jax.nn.softmax(require_shape("log_weights", log_weights, means.shape[:1]))
    covariances = require_shape("covariances", covariances, (*means.shape, means.shape[1]))
    mean = weights @ means
    apart = jnp.sqrt(weights)[:, None] * (means - mean)
    return mean, jnp.tensordot(weights, covariances, 1) + apart.T @ apart


def _steps_before(t: jax.Array) -> jax.Array:
    """Which of the steps between knots (columns) are over at each knot (rows)."""
    return jnp.tril(jnp.ones((t.size, t.size - 1), t.dtype), -1)


def _lasting(t: jax.Array, std: jax.Array | float, time: jax.Array | float) -> jax.Array:
    """Covariance, step by step, of a stationary error that stays for some time."""
    middle = 0.5 * (t[1:] + t[:-1])
    return std**2 * jnp.exp(-jnp.abs(middle[:, None] - middle) / time)
