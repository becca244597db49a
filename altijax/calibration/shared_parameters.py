"""Parameters shared by many stretches of data, fitted together with what belongs to each stretch alone.

The most probable values under normal noise and priors, by Gauss-Newton steps with Levenberg's damping in units of the
priors' standard deviations (plain gradient descent stalls: the Jacobians' condition is 1e4) and bent along the curved
valleys that biases and tilts form together (geodesic acceleration, Transtrum and Sethna 2012). What belongs to one
stretch (its initial velocity, an offset, the wandering of its sensors) touches no other stretch, so each step
eliminates it stretch by stretch (Schur complement) and solves for the few shared parameters. A stretch may as well be a
whole recording. `levenberg_marquardt`, and optimistix too, would ask for one dense Jacobian of everything by
everything, for a five-minute drive a hundred times larger, and neither returns the covariance of the shared parameters
with the others averaged over. So the solver of the epochs serves small problems and this one the long ones, and no
other optimiser is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape

LOSSES = ("squares", "huber", "cauchy")
# Tuning for 95 % efficiency on normal residuals (Holland and Welsch 1977).
_HUBER, _CAUCHY = 1.345, 2.385
# Largest bend of a step against its length (Transtrum and Sethna 2012).
_MOST_BEND = 0.75


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SharedFit:
    """Most probable values of shared and of own parameters, and what the data know of the shared ones.

    Attributes
    ----------
    shared : (terms,)
        Values of the parameters common to all stretches.
    own : (stretches, states)
        Values of those of each stretch.
    information : (terms, terms)
        What the data alone say of the shared parameters, those of the stretches averaged over: inverse of their
        covariance, undamped and without the prior. For `identify_information`.
    covariance : (terms, terms)
        Covariance of the shared parameters from data and prior.
    residuals : (stretches, observations)
        Residuals in units of their standard deviation.
    weights : (stretches, observations)
        Weights that the loss has given them, 1 for squares.
    nis : ()
        Normalised innovation squared per degree of freedom: squares of residuals and of deviations from the priors
        over the number of observations; about 1 if noise and priors are as stated.
    steps : ()
        Steps tried.
    converged : ()
        False where the steps were used up.
    """

    shared: jax.Array
    own: jax.Array
    information: jax.Array
    covariance: jax.Array
    residuals: jax.Array
    weights: jax.Array
    nis: jax.Array
    steps: jax.Array
    converged: jax.Array


class _Linearised(NamedTuple):
    """All stretches about one place, by the parameters in units of their priors: shared ones, then own ones."""

    loss: jax.Array
    residuals: jax.Array
    weights: jax.Array
    hessian: jax.Array
    gradient: jax.Array
    weighted_jacobian: jax.Array


def fit_shared(
    residual: Callable[[jax.Array, jax.Array, Any], jax.Array],
    stretches: Any,
    shared0: ArrayLike,
    shared_std: ArrayLike,
    own0: ArrayLike,
    own_std: ArrayLike,
    loss: str = "squares",
    start: tuple[ArrayLike, ArrayLike] | None = None,
    max_steps: int = 30,
) -> SharedFit:
    """Most probable parameters, common and of each stretch, with normal priors about their initial values.

    Parameters
    ----------
    residual : callable
        ``residual(shared, own, stretch)`` gives the residuals (observations,) of one stretch, each in units of its
        standard deviation; zero for an observation that is missing. Differentiable by JAX.
    stretches : pytree
        Data of the stretches, stacked along the first axis of each array.
    shared0 : (terms,)
        Prior means of the shared parameters.
    shared_std : (terms,)
        Their prior standard deviations; zero fixes a parameter.
    own0 : (stretches, states)
        Prior means of the own parameters.
    own_std : (states,)
        Their prior standard deviations, the same in all stretches.
    loss : {"squares", "huber", "cauchy"}, optional
        How large residuals count, by weights from the residuals of the step before.
    start : pair of arrays, optional
        Shared and own values to begin with, as from a fit before; the prior means by default.
    max_steps : int, optional
        Bound on the steps tried.

    Returns
    -------
    fit : SharedFit
        Values, covariance and residuals.

    Raises
    ------
    ValueError
        If the shapes do not fit or the loss is unknown.
    """
    if loss not in LOSSES:
        raise ValueError(f"loss must be one of {', '.join(LOSSES)}, got {loss!r}")
    shared0 = require_shape("shared0", shared0, (None,))
    shared_std = require_shape("shared_std", shared_std, shared0.shape)
    own0 = require_shape("own0", own0, (None, None))
    own_std = require_shape("own_std", own_std, own0.shape[1:])
    terms, states = shared0.size, own_std.size

    def linearised(u: jax.Array, u_own: jax.Array) -> _Linearised:
        shared = shared0 + shared_std * u

        def one(own: jax.Array, stretch: Any) -> _Linearised:
            # Two passes: what depends on the shared parameters alone is then not differentiated by the many own ones.
            r, by_shared = _columns(lambda shared: residual(shared, own, stretch), shared, shared_std)
            _, by_own = _columns(lambda own: residual(shared, own, stretch), own, own_std)
            J = jnp.concatenate([by_shared, by_own], -1)
            w = _weights(r, loss)
            weighted = J * w[:, None]
            return _Linearised(_loss(r, loss), r, w, J.T @ weighted, weighted.T @ r, weighted)

        return jax.vmap(one)(own0 + own_std * u_own, stretches)

    def cost_of(u: jax.Array, u_own: jax.Array, found: _Linearised) -> jax.Array:
        return jnp.sum(found.loss) + u @ u + jnp.sum(u_own**2)

    def reduced(found: _Linearised, damping: ArrayLike) -> tuple[jax.Array, Callable]:
        """Information on the shared parameters with the own ones averaged over, and the step down given slopes."""
        hessian = found.hessian
        identity = partial(jnp.eye, dtype=hessian.dtype)
        block = hessian[:, terms:, terms:] + (1 + damping) * identity(states)
        across = hessian[:, terms:, :terms]
        back = jnp.linalg.solve(block, across)
        information = jnp.sum(hessian[:, :terms, :terms] - jnp.swapaxes(across, 1, 2) @ back, 0)

        def down(slope: jax.Array, own_slope: jax.Array) -> tuple[jax.Array, jax.Array]:
            rest = slope - jnp.einsum("wst,ws->t", back, own_slope)
            du = -jnp.linalg.solve(information + (1 + damping) * identity(terms), rest)
            return du, -jnp.linalg.solve(block, own_slope[..., None])[..., 0] - jnp.einsum("wst,t->ws", back, du)

        return information, down

    def bent(u: jax.Array, u_own: jax.Array, found: _Linearised, step: tuple, down: Callable) -> tuple:
        """The step with its correction of second order, where that is the smaller part."""

        def second(own0: jax.Array, u_own: jax.Array, own_step: jax.Array, stretch: Any) -> jax.Array:
            def along(s: jax.Array) -> jax.Array:
                return residual(
                    shared0 + shared_std * (u + s * step[0]), own0 + own_std * (u_own + s * own_step), stretch
                )

            zero, one = jnp.zeros_like(u[0]), jnp.ones_like(u[0])
            return jax.jvp(lambda s: jax.jvp(along, (s,), (one,))[1], (zero,), (one,))[1]

        slopes = jnp.einsum("wot,wo->wt", found.weighted_jacobian, jax.vmap(second)(own0, u_own, step[1], stretches))
        bend = down(jnp.sum(slopes[:, :terms], 0), slopes[:, terms:])
        length, bending = (jnp.sqrt(jnp.sum(v[0] ** 2) + jnp.sum(v[1] ** 2)) for v in (step, bend))
        share = jnp.where(bending <= _MOST_BEND * length, 0.5, 0.0)
        return step[0] + share * bend[0], step[1] + share * bend[1]

    def iterate(state: tuple) -> tuple:
        # Linearised at this one place, which halves the time of compilation: the first trial is the start itself.
        u, u_own, found, damping, (trial, trial_own), steps, _ = state
        tried = linearised(trial, trial_own)
        first = steps == 0
        before, after = cost_of(u, u_own, found), cost_of(trial, trial_own, tried)
        accepted = first | (after <= before * (1 + 1e-9))  # beyond the start, False for NaN
        small = (jnp.max(jnp.abs(trial - u)) < 1e-5) | (jnp.abs(before - after) < 1e-7 * before)
        u, u_own = jnp.where(accepted, trial, u), jnp.where(accepted, trial_own, u_own)
        found = jax.tree.map(lambda new, old: jnp.where(accepted, new, old), tried, found)
        harder = jnp.where(accepted, damping / 5, jnp.maximum(damping, 1e-3) * 3)
        damping = jnp.where(first, damping, harder)
        _, down = reduced(found, damping)
        gradient = found.gradient
        step = down(jnp.sum(gradient[:, :terms], 0) + u, gradient[:, terms:] + u_own)
        du, du_own = bent(u, u_own, found, step, down)
        return u, u_own, found, damping, (u + du, u_own + du_own), steps + 1, ~first & accepted & small

    u, u_own = jnp.zeros_like(shared0), jnp.zeros_like(own0)
    if start is not None:
        free = shared_std > 0
        u = jnp.where(free, (jnp.asarray(start[0]) - shared0) / jnp.where(free, shared_std, 1), 0)
        u_own = (jnp.asarray(start[1]) - own0) / own_std
    unknown = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), jax.eval_shape(linearised, u, u_own))
    state = (u, u_own, unknown, jnp.asarray(1e-3, u.dtype), (u, u_own), jnp.asarray(0), jnp.asarray(False))
    u, u_own, found, _, _, steps, converged = jax.lax.while_loop(
        lambda state: ~state[-1] & (state[-2] < max_steps), iterate, state
    )
    information, _ = reduced(found, 0.0)
    scale = jnp.outer(shared_std, shared_std)
    r, w = found.residuals, found.weights
    observations = jnp.maximum(jnp.sum(r != 0), 1)
    return SharedFit(
        shared=shared0 + shared_std * u,
        own=own0 + own_std * u_own,
        information=information / jnp.where(scale > 0, scale, jnp.inf),
        covariance=jnp.linalg.inv(information + jnp.eye(terms, dtype=u.dtype)) * scale,
        residuals=r,
        weights=w,
        nis=(jnp.sum(w * r**2) + u @ u + jnp.sum(u_own**2)) / observations,
        steps=steps,
        converged=converged,
    )


def shared_information(
    residual: Callable[[jax.Array, jax.Array, Any], jax.Array],
    stretches: Any,
    shared: ArrayLike,
    own: ArrayLike,
    own_std: ArrayLike,
) -> jax.Array:
    """What data would say of the shared parameters, those of the stretches averaged over: of a planned drive, say.

    Parameters
    ----------
    residual : callable
        As for `fit_shared`.
    stretches : pytree
        Data of the stretches, stacked along the first axis of each array; of noise-free ones only what the Jacobian
        depends on matters.
    shared : (terms,)
        Values of the shared parameters.
    own : (stretches, states)
        Values of the own ones.
    own_std : (states,)
        Their prior standard deviations.

    Returns
    -------
    information : (terms, terms)
        Inverse of the covariance that the data alone give.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    shared = require_shape("shared", shared, (None,))
    own = require_shape("own", own, (None, None))
    own_std = require_shape("own_std", own_std, own.shape[1:])

    def one(own: jax.Array, stretch: Any) -> jax.Array:
        _, A = _columns(lambda shared: residual(shared, own, stretch), shared, jnp.ones_like(shared))
        _, B = _columns(lambda own: residual(shared, own, stretch), own, own_std)
        inner = B.T @ B + jnp.eye(own.size, dtype=own.dtype)
        return A.T @ A - A.T @ B @ jnp.linalg.solve(inner, B.T @ A)

    return jnp.sum(jax.vmap(one)(own, stretches), 0)


def _columns(function: Callable[[jax.Array], jax.Array], x: jax.Array, units: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Value and Jacobian, each column for a change of one parameter by its unit."""
    return jax.vmap(lambda direction: jax.jvp(function, (x,), (direction,)), out_axes=(None, -1))(jnp.diag(units))


def _weights(r: jax.Array, loss: str) -> jax.Array:
    if loss == "huber":
        size = jnp.abs(r)
        return jnp.where(size > _HUBER, _HUBER / jnp.maximum(size, _HUBER), 1)
    if loss == "cauchy":
        return 1 / (1 + (r / _CAUCHY) ** 2)
    return jnp.ones_like(r)


def _loss(r: jax.Array, loss: str) -> jax.Array:
    """The sum that the weights minimise."""
    if loss == "huber":
        size = jnp.abs(r)
        return jnp.sum(jnp.where(size > _HUBER, 2 * _HUBER * size - _HUBER**2, r * r))
    if loss == "cauchy":
        return jnp.sum(_CAUCHY**2 * jnp.log1p((r / _CAUCHY) ** 2))
    return jnp.sum(r * r)
