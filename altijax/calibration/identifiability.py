"""What data can tell of parameters: which are determined, which combinations are not, and what was learnt of each.

A direction of the parameters, measured in units of their prior standard deviations, counts as determined where the data
know more of it than the prior: where its information, an eigenvalue of D J^T J D with D the prior standard deviations,
exceeds 1. That is the measure of `AttitudeFit.rank` too.
"""

import math
from dataclasses import dataclass, field
from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape

# Parameters are said to take part in a direction from this share of it on.
_TAKES_PART = 0.05


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Identification:
    """What data know of named parameters, of which something was known before; `str` says it in words.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters, which give the order of all else.
    prior_std : (terms,)
        Standard deviation of each parameter before.
    std : (terms,)
        Standard deviation afterwards, from data and prior.
    covariance : (terms, terms)
        Covariance afterwards, from data and prior.
    data_covariance : (terms, terms)
        What the data alone say, undamped: the inverse of J^T J, very large along what they say nothing of.
    information : (terms,)
        Information of the data relative to the prior along each direction, largest first; 1 where both know as much.
    directions : (terms, terms)
        The directions, in columns, in units of the prior standard deviations.
    gained : (terms,)
        Information gained on each parameter in bits: log2 of prior over posterior standard deviation.
    """

    names: tuple[str, ...] = field(metadata={"static": True})
    prior_std: jax.Array
    std: jax.Array
    covariance: jax.Array
    data_covariance: jax.Array
    information: jax.Array
    directions: jax.Array
    gained: jax.Array

    @property
    def correlation(self) -> jax.Array:
        """Correlation of the parameters, from data and prior."""
        return self.covariance / jnp.outer(self.std, self.std)

    @property
    def rank(self) -> jax.Array:
        """Number of directions of which the data know more than the prior."""
        return jnp.sum(self.information > 1)

    def __str__(self) -> str:
        rows = [
            f"{name:<28}{prior:>12.3g}{std:>12.3g}{bits:>8.1f}"
            for name, prior, std, bits in zip(
                self.names, self.prior_std.tolist(), self.std.tolist(), self.gained.tolist(), strict=True
            )
        ]
        head = f"{'parameter':<28}{'prior std':>12}{'std':>12}{'bits':>8}"
        return "\n".join([head, *rows, *describe_undetermined(self)])


def identify(jacobian: ArrayLike, prior_std: ArrayLike, names: tuple[str, ...]) -> Identification:
    """What data know of parameters, from the Jacobian of their residuals.

    Parameters
    ----------
    jacobian : (residuals, terms)
        Derivatives of the residuals, each in units of its standard deviation, by the parameters.
    prior_std : (terms,)
        Standard deviation of each parameter before the data came.
    names : tuple of str
        Names of the parameters.

    Returns
    -------
    identification : Identification
        Covariances, directions and information.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are not as many different names as parameters.
    """
    jacobian = require_shape("jacobian", jacobian, (None, None))
    if len(set(names)) != jacobian.shape[1]:
        raise ValueError(f"names must be {jacobian.shape[1]} different ones, one a column of jacobian, got {names}")
    return identify_information(jacobian.T @ jacobian, prior_std, names)


def identify_information(information: ArrayLike, prior_std: ArrayLike, names: tuple[str, ...]) -> Identification:
    """The same from J^T J, as a fit has it that has put the information of several recordings together.

    Parameters
    ----------
    information : (terms, terms)
        J^T J, the inverse of the covariance that the data alone give.
    prior_std : (terms,)
        Standard deviation of each parameter before the data came.
    names : tuple of str
        Names of the parameters.

    Returns
    -------
    identification : Identification
        Covariances, directions and information.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    return Identification(names=names, **_learnt(information, prior_std, len(names)))


@partial(jax.jit, static_argnames="terms")
def _learnt(information: ArrayLike, prior_std: ArrayLike, terms: int) -> dict[str, jax.Array]:
    information = require_shape("information", information, (terms, terms))
    prior_std = require_shape("prior_std", prior_std, (terms,))
    scale = jnp.outer(prior_std, prior_std)
    values, vectors = jnp.linalg.eigh(information * scale)
    values, vectors = values[::-1], vectors[:, ::-1]
    rounding = jnp.maximum(values[0] * jnp.finfo(values.dtype).eps * values.size, jnp.finfo(values.dtype).tiny)
    covariance = scale * ((vectors / (1 + jnp.maximum(values, 0))) @ vectors.T)
    std = _safe.sqrt(jnp.diag(covariance))
    return {
        "prior_std": prior_std,
        "std": std,
        "covariance": covariance,
        "data_covariance": scale * ((vectors / jnp.maximum(values, rounding)) @ vectors.T),
        "information": jnp.maximum(values, 0),
        "directions": vectors,
        "gained": jnp.log2(prior_std / std),
    }


def information_gain(jacobian: ArrayLike, prior_std: ArrayLike) -> jax.Array:
    """Information that data add to the prior on all parameters together, half of log2 det(1 + D J^T J D).

    Parameters
    ----------
    jacobian : (residuals, terms)
        Derivatives of the residuals, each in units of its standard deviation, by the parameters.
    prior_std : (terms,)
        Standard deviation of each parameter before the data came.

    Returns
    -------
    gain : ()
        In bits: by this power of two the volume of what is possible shrinks.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    jacobian = require_shape("jacobian", jacobian, (None, None))
    prior_std = require_shape("prior_std", prior_std, jacobian.shape[1:])
    scaled = jacobian * prior_std
    return jnp.linalg.slogdet(jnp.eye(prior_std.size, dtype=scaled.dtype) + scaled.T @ scaled)[1] / (2 * jnp.log(2.0))


def describe_undetermined(identification: Identification) -> list[str]:
    """In words, what the data do not determine, and which combinations of the same parameters they do.

    Parameters
    ----------
    identification : Identification
        From `identify`.

    Returns
    -------
    sentences : list of str
        One for each group of parameters that belong together; none if all is determined.
    """
    names, everything = identification.names, range(len(identification.names))
    if min(identification.information.tolist()) > 1:
        return []
    covariance, prior_std = identification.covariance.tolist(), identification.prior_std.tolist()
    known = identification.information, identification.directions
    share, _, _ = _undetermined(*known, [True for _ in everything])
    sentences = []
    for group in _groups(share.tolist()):
        # Directions of the group along which the data know less than the prior, in the parameters' own units.
        _, values, vectors = (x.tolist() for x in _undetermined(*known, [i in group for i in everything]))
        determined = [[vectors[i][k] / prior_std[i] for i in group] for k in everything if values[k] < 0.5]
        listed = " and ".join(names[i] for i in group)
        if not determined:
            sentences.append(f"The data say less of {listed} than was known before.")
            continue
        described = []
        for combination in _echelon(determined):
            terms = list(zip(combination, group, strict=True))
            std = math.sqrt(sum(a * b * covariance[i][j] for a, i in terms for b, j in terms))
            described.append(f"{_sum_of(combination, [names[i] for i in group])} can: std {std:.2g}")
        sentences.append(f"{listed} cannot be told apart here; {'; '.join(described)}.")
    return sentences


@jax.jit
def _undetermined(
    information: jax.Array, directions: jax.Array, group: list[ArrayLike]
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Projector on the undetermined directions, and eigenvalues and vectors of what of it is of a group.

    What is not of the group is taken for undetermined, of eigenvalue 1.
    """
    undetermined = jnp.where(information > 1, 0, directions)
    share = undetermined @ undetermined.T
    inside = jnp.asarray(group)
    return share, *jnp.linalg.eigh(jnp.where(inside[:, None] & inside, share, jnp.eye(inside.size, dtype=share.dtype)))


def _groups(share: list[list[float]]) -> list[list[int]]:
    """Parameters that take part in undetermined directions, those that do so together in one group."""
    left = [i for i, row in enumerate(share) if row[i] > _TAKES_PART]
    groups = []
    while left:
        group, waiting = [], [left[0]]
        while waiting:
            i = waiting.pop()
            if i in left:
                left.remove(i)
                group.append(i)
                waiting += [j for j in left if abs(share[i][j]) > _TAKES_PART]
        groups.append(sorted(group))
    return groups


def _echelon(rows: list[list[float]]) -> list[list[float]]:
    """Row-reduced form: each row has a 1 where all others have 0, so that it names as few parameters as may be."""
    reduced: list[list[float]] = []
    rows = [list(row) for row in rows]
    for column in range(len(rows[0])):
        if not rows:
            break
        pivot = max(rows, key=lambda row: abs(row[column]))
        if abs(pivot[column]) < 1e-6 * max(map(abs, pivot)):
            continue
        rows.remove(pivot)
        pivot = [value / pivot[column] for value in pivot]
        for other in (*rows, *reduced):
            factor = other[column]
            other[:] = [value - factor * p for value, p in zip(other, pivot, strict=True)]
        reduced.append(pivot)
    return reduced


def _sum_of(weights: list[float], names: list[str]) -> str:
    terms: list[str] = []
    largest = max(map(abs, weights))
    for weight, name in zip(weights, names, strict=True):
        if abs(weight) > 1e-3 * largest:
            size = "" if abs(abs(weight) - 1) < 5e-4 else f"{abs(weight):.3g} "
            sign = ("-" if weight < 0 else "") if not terms else ("- " if weight < 0 else "+ ")
            terms.append(f"{sign}{size}{name}")
    return " ".join(terms)
