"""Parameters shared by many stretches of data, fitted together with what belongs to each stretch alone.

The most probable values under normal noise and priors, by Gauss-Newton steps with Levenberg's damping in units of the
priors' standard deviations (plain gradient descent stalls: the Jacobians' condition is 1e4) and bent along the curved
valleys that biases and tilts form together (geodesic acceleration, Transtrum and Sethna 2012: what the residuals bend
along a step is seen by a look a little way along it, as they do). What belongs to one
stretch (its initial velocity, an offset, the wandering of its sensors) touches no other stretch, so each step
eliminates it stretch by stretch (Schur complement) and solves for the few shared parameters. A stretch may as well be a
whole recording. `levenberg_marquardt`, and optimistix too, would ask for one dense Jacobian of everything by
everything, for a five-minute drive a hundred times larger, and neither returns the covariance of the shared parameters
with the others averaged over. So the solver of the epochs serves small problems and this one the long ones, and no
other optimiser is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape

LOSSES = ("squares", "huber", "cauchy")
# Tuning for 95 % efficiency on normal residuals (Holland and Welsch 1977).
_HUBER, _CAUCHY = 1.345, 2.385
# Largest bend of a step against its length, and where along the step it is looked for: nearer, rounding would show.
_MOST_BEND, _LOOK = 0.75, 1e-3


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


class _Seen(NamedTuple):
    """All stretches at one place; slopes by the parameters in units of their priors: shared ones, then own ones."""

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

    def seen(u: jax.Array, u_own: jax.Array, with_slopes: ArrayLike) -> _Seen:
        shared = shared0 + shared_std * u

        def one(at: tuple[jax.Array, Any]) -> _Seen:
            own, stretch = at
            r, along = _linearised(residual, shared, own, shared_std, own_std, stretch)
            w = _weights(r, loss)

            def slopes() -> tuple[jax.Array, jax.Array, jax.Array]:
                J = along()
                weighted = J * w
                return weighted @ J.T, weighted @ r, weighted

            none = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), jax.eval_shape(slopes))
            return _Seen(_loss(r, loss), r, w, *jax.lax.cond(with_slopes, slopes, lambda: none))

        # One stretch after the other: its arrays stay in the processor's cache, and its matrices are no batch.
        return jax.lax.map(one, (own0 + own_std * u_own, stretches))

    def cost_of(u: jax.Array, u_own: jax.Array, found: _Seen) -> jax.Array:
        return jnp.sum(found.loss) + u @ u + jnp.sum(u_own**2)

    def down(found: _Seen, damping: ArrayLike, slope: jax.Array, own_slope: jax.Array) -> tuple:
        """The step down given slopes, and the information on the shared parameters with the own ones averaged over."""
        ridge = 1 + damping

        def one(at: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
            hessian, own_slope = at
            across = hessian[terms:, :terms]
            # All that is asked of a stretch's matrix is solved for at once.
            known = jnp.linalg.cholesky(hessian[terms:, terms:] + ridge * jnp.eye(states, dtype=hessian.dtype))
            both = jax.scipy.linalg.cho_solve((known, True), jnp.concatenate([across, own_slope[:, None]], 1))
            back, own_down = both[:, :terms], both[:, terms]
            return hessian[:terms, :terms] - across.T @ back, across.T @ own_down, back, own_down

        information, passed_on, back, own_down = jax.lax.map(one, (found.hessian, own_slope))
        information = jnp.sum(information, 0)
        known = jnp.linalg.cholesky(information + ridge * jnp.eye(terms, dtype=information.dtype))
        du = -jax.scipy.linalg.cho_solve((known, True), slope - jnp.sum(passed_on, 0))
        return du, -own_down - back @ du, information

    def iterate(state: tuple) -> tuple:
        # Two kinds of visits take turns, to the end of a step and to a place a little way along it, so that the
        # residuals are compiled once. The first trial is the start itself.
        u, u_own, found, damping, step, (place, place_own), looking, steps, _ = state
        visited = seen(place, place_own, ~looking)
        first = steps == 0
        before, after = cost_of(u, u_own, found), cost_of(place, place_own, visited)
        accepted = ~looking & (first | (after <= before * (1 + 1e-9)))  # beyond the start, False for NaN
        small = (jnp.max(jnp.abs(place - u)) < 1e-5) | (jnp.abs(before - after) < 1e-7 * before)
        # How the slopes change along the step, beyond what is linear, is twice the bend.
        whole_step = jnp.concatenate([jnp.broadcast_to(step[0], (u_own.shape[0], terms)), step[1]], 1)
        linear = found.gradient + _LOOK * jnp.einsum("wij,wj->wi", found.hessian, whole_step)
        bending = 2 / _LOOK**2 * (jnp.einsum("wto,wo->wt", found.weighted_jacobian, visited.residuals) - linear)
        u, u_own = jnp.where(accepted, place, u), jnp.where(accepted, place_own, u_own)
        found = jax.tree.map(lambda new, old: jnp.where(accepted, new, old), visited, found)
        harder = jnp.where(accepted, damping / 5, jnp.maximum(damping, 1e-3) * 3)
        damping = jnp.where(first | looking, damping, harder)
        slopes = jnp.where(looking, bending, found.gradient)
        prior = jnp.where(looking, 0, 1)
        *way, _ = down(found, damping, jnp.sum(slopes[:, :terms], 0) + prior * u, slopes[:, terms:] + prior * u_own)
        length, bend = (jnp.sqrt(jnp.sum(v[0] ** 2) + jnp.sum(v[1] ** 2)) for v in (step, way))
        share = jnp.where(bend <= _MOST_BEND * length, 0.5, 0.0)
        step = tuple(jnp.where(looking, old, new) for old, new in zip(step, way, strict=True))
        place, place_own = (
            x + jnp.where(looking, whole + share * part, _LOOK * whole)
            for x, whole, part in zip((u, u_own), step, way, strict=True)
        )
        converged = accepted & ~first & small
        return u, u_own, found, damping, step, (place, place_own), ~looking, steps + ~looking, converged

    u, u_own = jnp.zeros_like(shared0), jnp.zeros_like(own0)
    none = (u, u_own)
    if start is not None:
        free = shared_std > 0
        u = jnp.where(free, (jnp.asarray(start[0]) - shared0) / jnp.where(free, shared_std, 1), 0)
        u_own = (jnp.asarray(start[1]) - own0) / own_std
    unknown = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), jax.eval_shape(seen, u, u_own, True))
    no, damping = jnp.asarray(False), jnp.asarray(1e-3, u.dtype)
    state = (u, u_own, unknown, damping, none, (u, u_own), no, jnp.asarray(0), no)
    u, u_own, found, *_, steps, converged = jax.lax.while_loop(
        lambda state: ~state[-1] & (state[-2] < max_steps), iterate, state
    )
    *_, information = down(found, 0.0, u, u_own)
    scale, identity = jnp.outer(shared_std, shared_std), jnp.eye(terms, dtype=u.dtype)
    r, w = found.residuals, found.weights
    observations = jnp.maximum(jnp.sum(r != 0), 1)
    return SharedFit(
        shared=shared0 + shared_std * u,
        own=own0 + own_std * u_own,
        information=information / jnp.where(scale > 0, scale, jnp.inf),
        covariance=jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(information + identity), True), identity) * scale,
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

    # Column by column, so that the information can be differentiated by the drive that is planned.
    def one(at: tuple[jax.Array, Any]) -> jax.Array:
        own, stretch = at
        _, A = _columns(lambda shared: residual(shared, own, stretch), shared, jnp.ones_like(shared))
        _, B = _columns(lambda own: residual(shared, own, stretch), own, own_std)
        inner = B.T @ B + jnp.eye(own.size, dtype=own.dtype)
        return A.T @ A - A.T @ B @ jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(inner), True), B.T @ A)

    return jnp.sum(jax.lax.map(one, (own, stretches)), 0)


def _columns(function: Callable[[jax.Array], jax.Array], x: jax.Array, units: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Value and Jacobian, each column for a change of one parameter by its unit."""
    return jax.vmap(lambda direction: jax.jvp(function, (x,), (direction,)), out_axes=(None, -1))(jnp.diag(units))


def _linearised(
    residual: Callable[[jax.Array, jax.Array, Any], jax.Array],
    shared: jax.Array,
    own: jax.Array,
    shared_unit: jax.Array,
    own_unit: jax.Array,
    stretch: Any,
) -> tuple[jax.Array, Callable[[], jax.Array]]:
    """Residuals of a stretch, and a function for their slopes (parameters, observations), shared ones first."""
    r, along = jax.linearize(
        lambda du, du_own: residual(shared + shared_unit * du, own + own_unit * du_own, stretch),
        jnp.zeros_like(shared),
        jnp.zeros_like(own),
    )
    directions = jnp.eye(shared.size + own.size, dtype=own.dtype)
    return r, lambda: jax.vmap(along)(directions[:, : shared.size], directions[:, shared.size :])


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
