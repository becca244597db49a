"""Elevation of a drive given all that is known: constants with their priors, surveyed heights, what roads are like."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag
from scipy.optimize import minimize

from altijax.drives import Drive
from altijax.elevation_estimate.model import elevation_and_sensitivity
from altijax.elevation_estimate.smoother import (
    ElevationNoise,
    gaussian_update,
    mixture_moments,
    norm_way_covariance,
    quadrature_nodes,
    road_covariance,
    slope_way_covariance,
)
from altijax.signals import cumulative_integral, derivative, low_pass

_KNOT_SPACING, _MOST_KNOTS = 2.0, 256
# Of a surveyed height against the sensor's, of any height before one is known, and of the road under each wheel.
_SURVEY_STD, _ANY_HEIGHT, _TEXTURE = 0.03, 1e3, 0.01
# Of the low pass, in Hz, as the elevations have it.
_CUTOFF = 1.0
# Where no speed is known, the slope could be 5 %.
_UNKNOWN_SLOPE = 0.05
# By what factor, as a logarithm, the noise of a car differs from the nominal one.
_NOISE_SPREAD = {"slope": 0.7, "trim": 0.7}
# The elevation is nearly linear in the constants.
_LINEARISATIONS = 2


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Constants that are not known exactly.

    Attributes
    ----------
    names : tuple of str
        Out of `PARAMETERS`.
    mean : ndarray
        (names,)
    covariance : ndarray
        (names, names)
    """

    names: tuple[str, ...]
    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """What is known afterwards.

    Attributes
    ----------
    series : dict of str to ndarray
        elevation (m), elevation_std (m), vertical_speed (m/s), way (m), horizontal (m) and valid, on the drive's grid.
    constants : Constants
        Of the same names as before.
    noise : ElevationNoise
        Levels of largest posterior probability; the rest is the mean over all levels by theirs.
    """

    series: dict[str, np.ndarray]
    constants: Constants
    noise: ElevationNoise


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class _System:
    """Elevation at knots, linear in the constants, and what observes it."""

    t: jax.Array
    way: jax.Array
    unsupported: jax.Array
    acceleration: jax.Array  # root mean square between the knots
    gravity: jax.Array
    spread: jax.Array  # covariance of the constants
    height: jax.Array
    sensitivity: jax.Array
    second: tuple[jax.Array, jax.Array] | None  # height and sensitivity by Eq. (1)
    heights: tuple[jax.Array, jax.Array] | None  # surveyed, and the mean of the knots that each belongs to


def elevation_posterior(
    drive: Drive,
    constants: Constants,
    method: str,
    known: tuple[np.ndarray, np.ndarray] | None = None,
    fixed: dict[str, float] | None = None,
) -> Posterior:
    """Mean and standard deviation of the elevation, and of the constants, by a linear Gaussian update.

    Parameters
    ----------
    drive : Drive
        With its rate of turn, but for "slope".
    constants : Constants
        Prior of what is not known exactly.
    method : {"shirai", "slope", "fused"}
        "fused" is the elevation by the slope, observed by Eq. (1) of [shirai2000]_ and by what roads are like.
    known : pair of ndarray, optional
        Times from the first IMU sample, in s, and heights, in m above anything.
    fixed : dict of str to float, optional
        Constants known exactly.

    Returns
    -------
    posterior : Posterior
        The series and the constants.
    """
    fused = method == "fused"
    base = "slope" if fused else method
    knots = _knots(drive)
    names, mean, noise = constants.names, constants.mean, ElevationNoise()
    if not fused and known is None:
        system, found = _linearised(drive, constants, mean, base, None, fixed or {}, knots)
        covariance = np.asarray(_elevation_covariance(system, noise, base))
        return Posterior(
            series=_series(found, drive, knots, np.zeros(knots.size), covariance), constants=constants, noise=noise
        )
    for step in range(_LINEARISATIONS):
        system, found = _linearised(drive, constants, mean, method, known, fixed or {}, knots)
        if step == 0:
            noise, nodes, log_weights = _likely_noise(system, noise, base)
        state, state_covariance = map(np.asarray, _over_levels(nodes, log_weights, system, ElevationNoise(), base))
        mean = constants.mean + state[: len(names)]
    reading = np.hstack([np.asarray(system.sensitivity), np.eye(knots.size)])
    change = np.asarray(system.height) + reading @ state[: reading.shape[1]] - np.asarray(found["elevation"])[knots]
    covariance = state_covariance[: reading.shape[1], : reading.shape[1]]
    return Posterior(
        series=_series(found, drive, knots, change, reading @ covariance @ reading.T),
        constants=Constants(names=names, mean=mean, covariance=covariance[: len(names), : len(names)]),
        noise=noise,
    )


def _knots(drive: Drive) -> np.ndarray:
    """Samples of the grid that serve as knots: one a second, fewer on a long drive."""
    duration = float(drive.t[-1])
    count = int(min(np.ceil(duration / _KNOT_SPACING), _MOST_KNOTS))
    return np.unique(np.round(np.linspace(0, drive.t.size - 1, count + 1)).astype(int))


def _linearised(
    drive: Drive,
    prior: Constants,
    about: np.ndarray,
    method: str,
    known: tuple[np.ndarray, np.ndarray] | None,
    fixed: dict[str, float],
    knots: np.ndarray,
) -> tuple[_System, dict[str, jax.Array]]:
    values = {
        name: jnp.asarray(float(v)) for name, v in {**fixed, **dict(zip(prior.names, about, strict=True))}.items()
    }
    back = prior.mean - about
    found, sensitivity = elevation_and_sensitivity(values, drive, prior.names, "slope" if method == "fused" else method)
    at_prior = found["elevation"] + sensitivity @ back
    second = None
    if method == "fused":
        other, others = elevation_and_sensitivity(values, drive, prior.names, "shirai")
        second = ((other["elevation"] + others @ back)[knots], others[knots])
    heights = None
    if known is not None:
        heights = _binned(np.asarray(drive.t)[knots], known, np.interp(known[0], drive.t, at_prior))
    unsupported = np.where(drive.supported, 0.0, np.maximum(found["speed"], 1.0)) * float(drive.t[1])
    speed = low_pass(drive.t, found["speed"], _CUTOFF)
    squared = derivative(drive.t, speed) ** 2 + (speed * drive.yaw_rate) ** 2
    mean_square = jnp.diff(cumulative_integral(drive.t, squared)[knots]) / jnp.diff(drive.t[knots])
    system = _System(
        t=drive.t[knots],
        way=jnp.maximum.accumulate(found["way"])[knots],
        unsupported=jnp.cumsum(unsupported)[knots],
        acceleration=jnp.sqrt(jnp.maximum(mean_square, 0)),
        gravity=drive.gravity,
        spread=jnp.asarray(prior.covariance),
        height=at_prior[knots],
        sensitivity=sensitivity[knots],
        second=second,
        heights=heights,
    )
    return system, found


def _binned(t: np.ndarray, known: tuple[np.ndarray, np.ndarray], estimated: np.ndarray) -> tuple[jax.Array, jax.Array]:
    """Known heights above the estimated ones, and how the knots weigh in them, their mean around each knot."""
    times, heights = known
    before = np.clip(np.searchsorted(t, times, side="right") - 1, 0, t.size - 2)
    part = np.clip((times - t[before]) / (t[before + 1] - t[before]), 0, 1)
    weights = np.zeros((times.size, t.size))
    rows = np.arange(times.size)
    weights[rows, before] = 1 - part
    weights[rows, before + 1] = part
    nearest = np.where(part < 0.5, before, before + 1)
    bins = nearest == np.unique(nearest)[:, None]
    bins = bins / bins.sum(1, keepdims=True)
    above = heights - estimated
    return jnp.asarray(bins @ (above - above[0])), jnp.asarray(bins @ weights)


def _elevation_noise(system: _System, noise: ElevationNoise, base: str) -> jax.Array:
    """Covariance of the elevation's error when the constants are right."""
    unknown = _UNKNOWN_SLOPE**2 * jnp.outer(system.unsupported, system.unsupported)
    if base == "shirai":
        return norm_way_covariance(system.t, system.acceleration, system.gravity, noise) + unknown
    return slope_way_covariance(system.t, system.way, system.gravity, noise) + unknown


@partial(jax.jit, static_argnames="base")
def _elevation_covariance(system: _System, noise: ElevationNoise, base: str) -> jax.Array:
    constants = system.sensitivity @ system.spread @ system.sensitivity.T
    return constants + _elevation_noise(system, noise, base)


def _update(system: _System, noise: ElevationNoise, base: str) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Constants, error of the elevation at the knots, and height of the first sample, as deviations from the prior."""
    n, k = system.sensitivity.shape[1], system.t.size
    own = _elevation_noise(system, noise, base)
    prior = block_diag(system.spread, own, jnp.full((1, 1), _ANY_HEIGHT**2))
    reading = jnp.hstack([system.sensitivity, jnp.eye(k), jnp.zeros((k, 1))])
    designs, observed, covariances = [], [], []
    # At the first knot both elevations and the road are zero by definition.
    if system.second is not None:
        height, sensitivity = system.second
        difference = reading.at[:, :n].add(-sensitivity)
        designs += [difference[1:], reading[1:]]
        observed += [(height - system.height)[1:], -system.height[1:]]
        texture = _TEXTURE**2 * jnp.eye(k - 1)
        covariances += [
            _elevation_noise(system, noise, "shirai")[1:, 1:] + 1e-4 * texture,
            road_covariance(system.way, noise)[1:, 1:] + texture,
        ]
    if system.heights is not None:
        above, weights = system.heights
        designs.append((weights @ reading).at[:, -1].set(1.0))
        observed.append(above)
        covariances.append(_SURVEY_STD**2 * jnp.eye(above.size))
    return gaussian_update(prior, jnp.concatenate(designs), jnp.concatenate(observed), block_diag(*covariances))


def _levels(z: jax.Array, nominal: ElevationNoise) -> ElevationNoise:
    """Noise whose levels differ from the nominal ones by these numbers of spreads."""
    factors = {name: jnp.exp(spread * x) for (name, spread), x in zip(_NOISE_SPREAD.items(), z, strict=True)}
    return replace(nominal, **{name: getattr(nominal, name) * factor for name, factor in factors.items()})


@partial(jax.jit, static_argnames="base")
@jax.value_and_grad
def _misfit(z: jax.Array, system: _System, nominal: ElevationNoise, base: str) -> jax.Array:
    return 0.5 * jnp.sum(z**2) - _update(system, _levels(z, nominal), base)[2]


def _likely_noise(system: _System, nominal: ElevationNoise, base: str) -> tuple[ElevationNoise, jax.Array, jax.Array]:
    """Levels of largest posterior probability, and the nodes of a quadrature over all of them."""

    def misfit(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _misfit(jnp.asarray(z), system, nominal, base)
        return float(value), np.asarray(slope)

    start = np.zeros(len(_NOISE_SPREAD))
    best = minimize(misfit, start, jac=True, method="L-BFGS-B", options={"maxiter": 15, "ftol": 1e-4}).x
    # Of slopes a tenth of a spread to either side: that compiles nothing new, and the nodes need no better.
    steps = 0.1 * np.eye(best.size)
    curvature = np.stack([misfit(best + step)[1] - misfit(best - step)[1] for step in steps]) / 0.2
    # The prior's own curvature is 1: farther than that no node needs to be.
    return _levels(jnp.asarray(best), nominal), *quadrature_nodes(best, (curvature + curvature.T) / 2, 1.0)


@partial(jax.jit, static_argnames="base")
def _over_levels(
    nodes: jax.Array, log_weights: jax.Array, system: _System, nominal: ElevationNoise, base: str
) -> tuple[jax.Array, jax.Array]:
    """Mean and covariance over the levels of the noise, by their posterior probabilities."""

    def of_node(z: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        state, covariance, log_likelihood = _update(system, _levels(z, nominal), base)
        return state, covariance, log_likelihood - 0.5 * jnp.sum(z**2)

    states, covariances, log_posterior = jax.lax.map(of_node, nodes)
    return mixture_moments(states, covariances, log_weights + log_posterior)


def _series(
    found: dict[str, jax.Array], drive: Drive, knots: np.ndarray, change: np.ndarray, covariance: np.ndarray
) -> dict[str, np.ndarray]:
    """Series on the grid, moved by a change at the knots."""
    t = np.asarray(drive.t)
    series = {name: np.asarray(values) for name, values in found.items()}
    std = np.sqrt(np.maximum(np.diag(np.asarray(covariance)), 0.0))
    series["elevation"] = series["elevation"] + np.interp(t, t[knots], change)
    series["vertical_speed"] = series["vertical_speed"] + np.interp(
        t, t[knots], np.gradient(np.asarray(change), t[knots])
    )
    series["elevation_std"] = np.interp(t, t[knots], std)
    return series
