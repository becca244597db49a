"""Elevation of a drive given all that is known: constants with their priors, surveyed heights, what roads are like."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize

from altijax.drives import Array, Drive
from altijax.elevation_estimate.model import NAMES, elevation_and_sensitivity
from altijax.elevation_estimate.smoother import (
    ElevationNoise,
    gaussian_update,
    mixture_moments,
    norm_way_covariance,
    quadrature_nodes,
    road_covariance,
    slope_way_covariance,
)
from altijax.padding import bucket, padded

_KNOT_SPACING, _MOST_KNOTS = 2.0, 256
# Steps between knots that a drive is filled up to.
_LEAST_STEPS = 32
# Of a surveyed height against the sensor's, of any height before one is known, and of the road under each wheel.
_SURVEY_STD, _ANY_HEIGHT, _TEXTURE = 0.03, 1e3, 0.01
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
    """Elevation at knots, linear in the constants, and what observes it.

    Knots, constants and surveyed heights are filled up with ones that nothing depends on.
    """

    t: Array
    there: Array  # False for knots that are filling
    way: Array
    unsupported: Array
    acceleration: Array  # root mean square between the knots
    gravity: Array
    spread: Array  # covariance of the constants
    height: Array
    sensitivity: Array
    second: tuple[Array, Array] | None  # height and sensitivity by Eq. (1)
    heights: tuple[Array, Array] | None  # surveyed, and the mean of the knots that each belongs to


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
    n = knots.size
    if not fused and known is None:
        system, found = _linearised(drive, constants, mean, base, None, fixed or {}, knots)
        covariance = np.asarray(_elevation_covariance(system, noise, base))[:n, :n]
        return Posterior(series=_series(found, drive, knots, np.zeros(n), covariance), constants=constants, noise=noise)
    levels = None
    for _ in range(_LINEARISATIONS):
        system, found = _linearised(drive, constants, mean, method, known, fixed or {}, knots)
        levels = _likely_levels(system, noise, base) if levels is None else levels
        likely, *moments = _over_levels(*levels, system, noise, base)
        state, state_covariance = map(np.asarray, moments)
        mean = constants.mean + state[: len(names)]
    rows = np.r_[: len(names), len(NAMES) : len(NAMES) + n]
    reading = np.hstack([system.sensitivity[:n, : len(names)], np.eye(n)])
    change = system.height[:n] + reading @ state[rows] - found["elevation"][knots]
    covariance = state_covariance[np.ix_(rows, rows)]
    return Posterior(
        series=_series(found, drive, knots, change, reading @ covariance @ reading.T),
        constants=Constants(names=names, mean=mean, covariance=covariance[: len(names), : len(names)]),
        noise=jax.tree.map(float, likely),
    )


def _knots(drive: Drive) -> np.ndarray:
    """Samples of the grid that serve as knots: one a second, fewer on a long drive."""
    duration = float(drive.t[-1])
    count = int(min(np.ceil(duration / _KNOT_SPACING), _MOST_KNOTS))
    return np.unique(np.round(np.linspace(0, drive.t.shape[0] - 1, count + 1)).astype(int))


def _linearised(
    drive: Drive,
    prior: Constants,
    about: np.ndarray,
    method: str,
    known: tuple[np.ndarray, np.ndarray] | None,
    fixed: dict[str, float],
    knots: np.ndarray,
) -> tuple[_System, dict[str, np.ndarray]]:
    values = {**fixed, **dict(zip(prior.names, about, strict=True))}
    back = prior.mean - about
    base = "slope" if method == "fused" else method
    found, sensitivity = elevation_and_sensitivity(values, drive, prior.names, base)
    t, at_prior = np.asarray(drive.t), found["elevation"] + sensitivity @ back
    # Nothing is differentiated from here on, so the integrals need not be compiled.
    speed, smooth, climb = (found[name] for name in ("speed", "smooth_speed", "vertical_speed"))
    level = np.sqrt(np.maximum((speed - climb) * (speed + climb), 0))  # as `horizontal_distance` has it
    squared = np.gradient(smooth, t, edge_order=2) ** 2 + (smooth * drive.yaw_rate) ** 2
    way, horizontal, squares = (cumulative_trapezoid(x, t, initial=0) for x in (speed, level, squared))
    size = bucket(knots.size - 1, _LEAST_STEPS) + 1
    unknowns = partial(padded, size=len(NAMES), fill=0.0, axis=1)
    at_knots = partial(padded, size=size, fill=0.0)
    second = None
    if method == "fused":
        other, others = elevation_and_sensitivity(values, drive, prior.names, "shirai")
        second = (at_knots((other["elevation"] + others @ back)[knots]), at_knots(unknowns(others[knots])))
    heights = None
    if known is not None:
        above, weights = _binned(t[knots], known, np.interp(known[0], t, at_prior))
        heights = (at_knots(above), at_knots(padded(weights, size, 0.0, axis=1)))
    unsupported = np.where(drive.supported, 0.0, np.maximum(speed, 1.0)) * t[1]
    mean_square = np.diff(squares[knots]) / np.diff(t[knots])
    # The times of the filling go on, for there are divisions by their differences.
    after = t[-1] + np.arange(1, size - knots.size + 1)
    system = _System(
        t=np.append(t[knots], after),
        there=np.arange(size) < knots.size,
        way=padded(np.maximum.accumulate(way)[knots], size),
        unsupported=at_knots(np.cumsum(unsupported)[knots]),
        acceleration=padded(np.sqrt(np.maximum(mean_square, 0)), size - 1),
        gravity=drive.gravity,
        spread=padded(unknowns(prior.covariance), len(NAMES), 0.0),
        height=at_knots(at_prior[knots]),
        sensitivity=at_knots(unknowns(sensitivity[knots])),
        second=second,
        heights=heights,
    )
    return system, {**found, "way": way, "horizontal": horizontal, "valid": np.asarray(drive.supported)}


def _binned(
    t: np.ndarray, known: tuple[np.ndarray, np.ndarray], estimated: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
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
    return bins @ (above - above[0]), bins @ weights


def _elevation_noise(system: _System, noise: ElevationNoise, base: str) -> jax.Array:
    """Covariance of the elevation's error when the constants are right."""
    if base == "shirai":
        own = norm_way_covariance(system.t, system.acceleration, system.gravity, noise)
    else:
        own = slope_way_covariance(system.t, system.way, system.gravity, noise)
    unsupported = jnp.asarray(system.unsupported)
    return _of_those_there(own + _UNKNOWN_SLOPE**2 * jnp.outer(unsupported, unsupported), system)


def _of_those_there(covariance: jax.Array, system: _System) -> jax.Array:
    return jnp.where(system.there[:, None] & system.there, covariance, 0)


@partial(jax.jit, static_argnames="base")
def _elevation_covariance(system: _System, noise: ElevationNoise, base: str) -> jax.Array:
    constants = jnp.asarray(system.sensitivity @ system.spread @ system.sensitivity.T)
    return constants + _elevation_noise(system, noise, base)


def _update(system: _System, noise: ElevationNoise, base: str) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Constants, error of the elevation at the knots, and height of the first sample, as deviations from the prior."""
    n, k = system.sensitivity.shape[1], system.t.size
    own = _elevation_noise(system, noise, base)
    prior = block_diag(system.spread, own, jnp.full((1, 1), _ANY_HEIGHT**2))
    reading = jnp.hstack([system.sensitivity, jnp.diag(jnp.where(system.there, 1.0, 0.0)), jnp.zeros((k, 1))])
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
            _of_those_there(road_covariance(system.way, noise), system)[1:, 1:] + texture,
        ]
    if system.heights is not None:
        above, weights = system.heights
        # A height is that of its knots, whose weights add to 1, above the first sample's; filling has no weights.
        designs.append(jnp.asarray(weights @ reading).at[:, -1].set(jnp.sum(weights, 1)))
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


def _likely_levels(system: _System, nominal: ElevationNoise, base: str) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of spreads of largest posterior probability, and minus the second derivatives of its logarithm there."""

    def misfit(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _misfit(z, system, nominal, base)
        return float(value), np.asarray(slope)

    start = np.zeros(len(_NOISE_SPREAD))
    best = minimize(misfit, start, jac=True, method="L-BFGS-B", options={"maxiter": 15, "ftol": 1e-4}).x
    # Of slopes a tenth of a spread to either side: that compiles nothing new, and the nodes need no better.
    steps = 0.1 * np.eye(best.size)
    curvature = np.stack([misfit(best + step)[1] - misfit(best - step)[1] for step in steps]) / 0.2
    return best, (curvature + curvature.T) / 2


@partial(jax.jit, static_argnames="base")
def _over_levels(
    best: jax.Array, curvature: jax.Array, system: _System, nominal: ElevationNoise, base: str
) -> tuple[ElevationNoise, jax.Array, jax.Array]:
    """Likely levels of the noise, and mean and covariance over all levels by their posterior probabilities."""

    def of_node(z: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        state, covariance, log_likelihood = _update(system, _levels(z, nominal), base)
        return state, covariance, log_likelihood - 0.5 * jnp.sum(z**2)

    # The prior's own curvature is 1: farther than that no node needs to be.
    nodes, log_weights = quadrature_nodes(best, curvature, 1.0)
    states, covariances, log_posterior = jax.lax.map(of_node, nodes)
    return _levels(best, nominal), *mixture_moments(states, covariances, log_weights + log_posterior)


def _series(
    found: dict[str, np.ndarray], drive: Drive, knots: np.ndarray, change: np.ndarray, covariance: np.ndarray
) -> dict[str, np.ndarray]:
    """Series on the grid, moved by a change at the knots."""
    t = np.asarray(drive.t)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    moved = np.interp(t, t[knots], np.gradient(change, t[knots]))
    return {
        **{name: found[name] for name in ("way", "horizontal", "valid")},
        "elevation": found["elevation"] + np.interp(t, t[knots], change),
        "elevation_std": np.interp(t, t[knots], std),
        "vertical_speed": found["vertical_speed"] + moved,
    }
