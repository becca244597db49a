"""Constants fitted to a reference: the most probable ones under normal priors and noise that the misfit itself shows.

Least squares by `levenberg_marquardt` in units of the priors' standard deviations. How far to trust the reference
against the priors nobody knows beforehand: the noise of each kind of residual is taken from its own size, neighbours
counted as one as far as they are correlated, and the fit repeated until both agree.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.identifiability import describe_undetermined
from altijax.calibration.priors import PARAMETERS
from altijax.calibration.records import Calibration, constants_table
from altijax.calibration.serial_correlation import statistical_inefficiency
from altijax.least_squares import levenberg_marquardt
from altijax.padding import bucket, padded

# Rounds of fit and noise. The first one trusts the data ten times more than they deserve at the prior.
_ROUNDS, _FIRST = 4, 0.1
# No reference and no model is better than this share of what the constants may change.
_LEAST = 1e-5

# As `levenberg_marquardt` has it.
_MOST_STEPS = 100
# The smallest length that residuals are filled up to.
_LEAST_TIMES = 1024

_together = jax.jit(statistical_inefficiency)

Residuals = Callable[[jax.Array], tuple[jax.Array, ...]]
Array = jax.Array | np.ndarray
Found = tuple[Array, Array, tuple[Array, ...]]
Linearised = Callable[[np.ndarray], list[tuple[np.ndarray, np.ndarray]]]


@dataclass(frozen=True, kw_only=True)
class ReferenceFit:
    """Unknowns in units of their prior standard deviations, counted from the prior means.

    Attributes
    ----------
    x : ndarray
        (unknowns,) Most probable values.
    covariance : ndarray
        (unknowns, unknowns) From data and prior.
    residuals : tuple of ndarray
        What is left, group by group.
    noise : ndarray
        (groups,) Standard deviation that each sample of a group counts with.
    """

    x: np.ndarray
    covariance: np.ndarray
    residuals: tuple[np.ndarray, ...]
    noise: np.ndarray


def weighted_fit(residuals: Residuals, x0: jax.Array, noise: jax.Array) -> Found:
    """Most probable unknowns for given noise, to be jitted; and the residuals there.

    Parameters
    ----------
    residuals : callable
        Groups of residuals (series, time), zero where there is none, of the unknowns as `ReferenceFit` has them.
    x0 : (unknowns,)
        Where to begin.
    noise : (groups,)
        Standard deviation of each group.

    Returns
    -------
    x : (unknowns,)
        Most probable values.
    covariance : (unknowns, unknowns)
        From data and prior.
    residuals : tuple of arrays
        At the minimum.
    """

    def all_of(x: jax.Array) -> jax.Array:
        groups = residuals(x)
        return jnp.concatenate([*((r / noise[k]).reshape(-1) for k, r in enumerate(groups)), x])

    fit = levenberg_marquardt(all_of, x0)
    return fit.x, fit.covariance, residuals(fit.x)


def stepwise_fit(linearised: Linearised, x0: np.ndarray, noise: np.ndarray) -> Found:
    """The same by the same steps in NumPy, for residuals whose program, compiled by itself, serves many problems.

    Parameters
    ----------
    linearised : callable
        For each group the residuals (series, time) of the unknowns, and their derivatives (series, time, unknowns).
    x0 : (unknowns,)
        Where to begin.
    noise : (groups,)
        Standard deviation of each group.

    Returns
    -------
    x : (unknowns,)
        Most probable values.
    covariance : (unknowns, unknowns)
        From data and prior.
    residuals : tuple of arrays
        At the minimum.
    """
    eps, identity = np.finfo(float).eps, np.eye(x0.size)

    def at(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
        groups = linearised(x)
        r = np.concatenate([*(r.reshape(-1) / std for (r, _), std in zip(groups, noise, strict=True)), x])
        slopes = (J.reshape(-1, x.size) / std for (_, J), std in zip(groups, noise, strict=True))
        J = np.concatenate([*slopes, identity])
        return r @ r, J.T @ r, J.T @ J, tuple(r for r, _ in groups)

    x, (cost, gradient, hessian, residuals) = x0, at(x0)
    damping = 1e-4 * np.max(np.diag(hessian))
    for _ in range(_MOST_STEPS):
        step = -np.linalg.solve(hessian + damping * identity, gradient)
        expected = step @ (damping * step - gradient)
        if expected <= eps * cost:
            break
        tried = at(x + step)
        if not (np.isfinite(tried[2]).all() and tried[0] <= cost):
            damping *= 8
            continue
        small = np.linalg.norm(step) <= eps**0.5 * (np.linalg.norm(x) + eps**0.5)
        damping *= np.clip(1 - (2 * (cost - tried[0]) / expected - 1) ** 3, 0.1, 2.0)
        x, (cost, gradient, hessian, residuals) = x + step, tried
        if small:
            break
    return x, np.linalg.inv(hessian), residuals


def fit_to_reference(solve: Callable[[Array, Array], Found], unknowns: int, first: Sequence[Array]) -> ReferenceFit:
    """Fit and noise in turns.

    Parameters
    ----------
    solve : callable
        What `weighted_fit` or `stepwise_fit` gives for a problem, by x0 and noise.
    unknowns : int
        How many.
    first : sequence of arrays
        Residuals at the prior means.

    Returns
    -------
    fit : ReferenceFit
        The last round's.
    """
    sizes = np.array([_size(np.asarray(r)) for r in first])
    least = np.maximum(_LEAST * sizes, np.finfo(float).tiny)
    x: Array = np.zeros(unknowns)
    noise = np.maximum(_FIRST * sizes, least)
    for _ in range(_ROUNDS):
        x, covariance, residuals = solve(x, noise)
        used = noise
        noise = np.maximum([_noise(np.asarray(r)) for r in residuals], least)
    return ReferenceFit(
        x=np.asarray(x),
        covariance=np.asarray(covariance),
        residuals=tuple(np.asarray(r) for r in residuals),
        noise=used,
    )


def calibration_from(
    method: str,
    names: Sequence[str],
    deviation: np.ndarray,
    covariance: np.ndarray,
    held_out: pd.DataFrame,
    *,
    prior: pd.DataFrame = PARAMETERS,
    absorbed: pd.DataFrame | None = None,
) -> Calibration:
    """The record of a fit.

    Parameters
    ----------
    method : str
        Method fitted.
    names : sequence of str
        Names of the constants.
    deviation : ndarray
        (names,) From the prior means, in prior standard deviations.
    covariance : ndarray
        (names, names) In the same units.
    held_out : DataFrame
        As in `Calibration`.
    prior : DataFrame, optional
        Columns nominal, uncertainty and unit by name.
    absorbed : DataFrame, optional
        As in `Calibration`.

    Returns
    -------
    calibration : Calibration
        With what the data do not determine in words.

    Raises
    ------
    ValueError
        If a constant changes nothing.
    """
    names = list(names)
    idle = [name for name, variance in zip(names, np.diag(covariance), strict=True) if 1 - variance < 1e-9]
    if idle:
        raise ValueError(f"{', '.join(idle)}: changes nothing in method {method!r} on these recordings; leave it out")
    known = prior.loc[names]
    units = known["uncertainty"].to_numpy(float)
    std = np.sqrt(np.diag(covariance))
    table = pd.DataFrame(
        {
            "value": known["nominal"] + units * deviation,
            "std": units * std,
            "unit": known["unit"],
            "prior": known["nominal"],
            "prior_std": units,
        }
    )
    found = Calibration(
        method=method,
        table=constants_table(table),
        correlation=pd.DataFrame(covariance / np.outer(std, std), names, names),
        absorbed=pd.DataFrame(index=names) if absorbed is None else absorbed,
        undetermined=(),
        held_out=held_out,
    )
    with jax.enable_x64(True):
        return replace(found, undetermined=tuple(describe_undetermined(found.identification)))


def _size(r: np.ndarray) -> float:
    there = r != 0
    return float(np.sqrt(np.mean(r[there] ** 2))) if there.any() else 1.0


def _noise(r: np.ndarray) -> float:
    """Root mean square times the root of the number of neighbours that count as one; a lasting mean is one error."""
    there = r != 0
    if not there.any():
        return 1.0
    means = np.sum(r, 1) / np.maximum(np.sum(there, 1), 1)
    rest = np.where(there, r - means[:, None], 0)
    # Zeros at the end, of no mean, add nothing to any product of neighbours.
    filled = padded(padded(rest, bucket(rest.shape[0], 1), 0.0), bucket(rest.shape[1], _LEAST_TIMES), 0.0, axis=1)
    together = np.asarray(_together(filled))[: rest.shape[0]]
    squares, counts = np.sum(rest**2, 1), np.sum(there, 1)
    return float(np.sqrt(np.sum(np.maximum(squares * together, (counts * means) ** 2)) / np.sum(counts)))
