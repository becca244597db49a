"""Kalman filter and smoother of a linear state-space model with any matrices, differentiable and free of inverses.

    x_0 ~ N(x0, P0),   x_{k+1} = F_k x_k + c_k + noise of covariance Q_k,   z_k = H_k x_k + noise of variance R_k

The smoother is the one of Bierman (modified Bryson-Frazier): it inverts no covariance of states, so states may be known
exactly or not change at all. A measurement that is missing is a row of zeros in z and H with any variance in R.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Filtered:
    """States before each measurement, and how the measurement met them.

    Attributes
    ----------
    x : (time, states)
        Mean of the state before the measurement.
    P : (time, states, states)
        Its covariance.
    gain : (time, states, rows)
        Kalman gain.
    innovation : (time, rows)
        Measurement less its prediction.
    precision : (time, rows, rows)
        Inverse of the innovation's covariance.
    log_likelihood : (time,)
        Logarithm of the probability density of each measurement given those before it.
    """

    x: jax.Array
    P: jax.Array
    gain: jax.Array
    innovation: jax.Array
    precision: jax.Array
    log_likelihood: jax.Array


def filter_states(
    F: ArrayLike,
    c: ArrayLike,
    Q: ArrayLike,
    z: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    used: ArrayLike | bool = True,
    moving: int | None = None,
) -> Filtered:
    """Run the filter forward.

    Parameters
    ----------
    F : (time - 1, states, states)
        Transition from each instant to the next.
    c : (time - 1, states)
        Constant part of the transition.
    Q : (time - 1, states, states)
        Covariance of its noise.
    z : (time, rows)
        Measurements.
    H : (time, rows, states)
        Their derivative by the state.
    R : (time, rows)
        Variances of their independent errors, positive.
    x0 : (states,)
        Mean of the state before the first measurement.
    P0 : (states, states)
        Its covariance.
    used : (time,), optional
        False where an instant only fills the arrays up: nothing is measured there, nothing changes after it, and no
        time is spent on it.
    moving : int, optional
        How many states, the first ones, others have a part in: each of the rest depends on itself alone, and less is
        to be multiplied. All by default.

    Returns
    -------
    filtered : Filtered
        Predicted states, innovations and likelihood.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    x0 = require_shape("x0", x0, (None,))
    states = x0.size
    F = require_shape("F", F, (None, states, states))
    intervals = F.shape[0]
    c, Q = require_shape("c", c, (intervals, states)), require_shape("Q", Q, (intervals, states, states))
    z = require_shape("z", z, (intervals + 1, None))
    rows = z.shape[1]
    H = require_shape("H", H, (intervals + 1, rows, states))
    R = require_shape("R", R, (intervals + 1, rows))
    P0 = require_shape("P0", P0, (states, states))

    def update(x: jax.Array, P: jax.Array, z: jax.Array, H: jax.Array, R: jax.Array) -> tuple:
        cross = P @ H.T
        root = jnp.linalg.cholesky(H @ cross + jnp.diag(R))
        whitener = jax.scipy.linalg.solve_triangular(root, jnp.eye(rows, dtype=x.dtype), lower=True)
        precision = whitener.T @ whitener
        gain = cross @ precision
        innovation = z - H @ x
        white = whitener @ innovation
        log_likelihood = -0.5 * white @ white - jnp.sum(jnp.log(jnp.diagonal(root)))
        P_after = P - gain @ cross.T
        return x + gain @ innovation, 0.5 * (P_after + P_after.T), (gain, innovation, precision, log_likelihood)

    def advance(state: tuple, inputs: tuple) -> tuple[tuple, tuple]:
        x, P = state
        z, H, R, F, c, Q = inputs
        x_after, P_after, met = update(x, P, z, H, R)
        ahead = _times(F, _times(F, P_after, moving).T, moving)
        return (_times(F, x_after[:, None], moving)[:, 0] + c, ahead + Q), (x, P, *met)

    def rest(state: tuple, inputs: tuple) -> tuple[tuple, tuple]:
        nothing, none = jnp.zeros((states, rows), x0.dtype), jnp.zeros(rows, x0.dtype)
        return state, (*state, nothing, none, jnp.eye(rows, dtype=x0.dtype), none[0])

    def step(state: tuple, inputs: tuple) -> tuple[tuple, tuple]:
        return jax.lax.cond(inputs[0], advance, rest, state, inputs[1:])

    # The last instant too is followed by a transition, which leads nowhere: one loop compiles the update once.
    F, c, Q = (jnp.concatenate([a, jnp.zeros_like(P0[None] if a.ndim > 2 else x0[None])]) for a in (F, c, Q))
    used = jnp.broadcast_to(jnp.asarray(used), (intervals + 1,))
    seen = jax.lax.scan(step, (x0, P0), (used, z, H, R, F, c, Q))[1]
    return Filtered(x=seen[0], P=seen[1], gain=seen[2], innovation=seen[3], precision=seen[4], log_likelihood=seen[5])


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Adjoint:
    """Derivatives of the log-likelihood by each state: what the smoother and the gradients are made of.

    Attributes
    ----------
    slope : (time, states)
        First derivative by the state before the measurement.
    information : (time, states, states)
        Second derivative by the same, negated.
    slope_after : (time, states)
        First derivative by the state after the measurement.
    information_after : (time, states, states)
        Second derivative by the same, negated.
    """

    slope: jax.Array
    information: jax.Array
    slope_after: jax.Array
    information_after: jax.Array


def adjoint_states(
    F: ArrayLike, H: ArrayLike, filtered: Filtered, used: ArrayLike | bool = True, moving: int | None = None
) -> Adjoint:
    """Run backward over what `filter_states` found.

    Parameters
    ----------
    F : (time - 1, states, states)
        Transition from each instant to the next.
    H : (time, rows, states)
        Derivative of the measurements by the state.
    filtered : Filtered
        What the filter found with the same.
    used : (time,), optional
        As of `filter_states`; filling comes after all that is used.
    moving : int, optional
        As of `filter_states`.

    Returns
    -------
    adjoint : Adjoint
        The derivatives.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    states = filtered.x.shape[-1]
    F = require_shape("F", F, (None, states, states))
    H = require_shape("H", H, (F.shape[0] + 1, filtered.innovation.shape[-1], states))
    identity = jnp.eye(states, dtype=filtered.x.dtype)

    def advance(later: tuple, inputs: tuple) -> tuple:
        slope, information = later
        F, H, gain, innovation, precision = inputs
        slope_after = _transposed_times(F, slope[:, None], moving)[:, 0]
        information_after = _transposed_times(F, _transposed_times(F, information, moving).T, moving)
        slope = slope_after + H.T @ (precision @ innovation - gain.T @ slope_after)
        # With (I - gain H) on both sides, multiplied out: rows are few.
        by_gain = information_after @ gain
        across = by_gain @ H
        information = information_after - across - across.T + H.T @ (precision + gain.T @ by_gain) @ H
        information = 0.5 * (information + information.T)
        return (slope, information), (slope, information, slope_after, information_after)

    def step(later: tuple, inputs: tuple) -> tuple:
        return jax.lax.cond(inputs[0], advance, lambda later, _: (later, (*later, *later)), later, inputs[1:])

    start = jnp.zeros_like(filtered.x[0]), jnp.zeros_like(filtered.P[0])
    after = jnp.concatenate([F, identity[None]])
    used = jnp.broadcast_to(jnp.asarray(used), (len(after),))
    seen = (used, after, H, filtered.gain, filtered.innovation, filtered.precision)
    found: tuple[jax.Array, ...] = jax.lax.scan(step, start, seen, reverse=True)[1]
    return Adjoint(slope=found[0], information=found[1], slope_after=found[2], information_after=found[3])


def _times(F: jax.Array, x: jax.Array, moving: int | None) -> jax.Array:
    """F x, where rows of F from `moving` on are diagonal."""
    if moving is None:
        return F @ x
    return jnp.concatenate([F[:moving] @ x, jnp.diagonal(F)[moving:, None] * x[moving:]])


def _transposed_times(F: jax.Array, x: jax.Array, moving: int | None) -> jax.Array:
    """The transpose of F times x, where rows of F from `moving` on are diagonal."""
    if moving is None:
        return F.T @ x
    rest = jnp.diagonal(F)[moving:, None] * x[moving:]
    return F[:moving].T @ x[:moving] + jnp.concatenate([jnp.zeros_like(x[:moving]), rest])


def smooth_states(filtered: Filtered, adjoint: Adjoint) -> tuple[jax.Array, jax.Array]:
    """States given all measurements.

    Parameters
    ----------
    filtered : Filtered
        What the filter found.
    adjoint : Adjoint
        What `adjoint_states` made of it.

    Returns
    -------
    x : (time, states)
        Mean of the state given all measurements.
    P : (time, states, states)
        Its covariance.
    """
    x = filtered.x + jnp.einsum("tij,tj->ti", filtered.P, adjoint.slope)
    return x, filtered.P - filtered.P @ adjoint.information @ filtered.P


def likelihood_gradients(F: ArrayLike, H: ArrayLike, filtered: Filtered, adjoint: Adjoint) -> dict[str, jax.Array]:
    """Derivatives of the sum of log-likelihoods by the arguments of `filter_states` but H.

    Exact, and cheap beside the smoother: its adjoint variables are the derivatives by states and covariances. So the
    gradient by whatever a model depends on is the vector-Jacobian product of the model alone, no scan within.

    Parameters
    ----------
    F : (time - 1, states, states)
        Transition from each instant to the next.
    H : (time, rows, states)
        Derivative of the measurements by the state.
    filtered : Filtered
        What the filter found with the same.
    adjoint : Adjoint
        What `adjoint_states` made of it.

    Returns
    -------
    gradients : dict of str to array
        By name of the argument, of its shape; by Q and P0 the symmetric one.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    states, rows = filtered.x.shape[-1], filtered.innovation.shape[-1]
    F = require_shape("F", F, (None, states, states))
    H = require_shape("H", H, (F.shape[0] + 1, rows, states))
    slope, information = adjoint.slope, adjoint.information
    by_P = 0.5 * (slope[:, :, None] * slope[:, None, :] - information)
    gain = filtered.gain
    P_after = filtered.P - gain @ H @ filtered.P
    x_after = filtered.x + jnp.einsum("tij,tj->ti", gain, filtered.innovation)
    by_F = slope[1:, :, None] * x_after[:-1, None, :] + 2 * by_P[1:] @ F @ P_after[:-1]
    # Residual over variance, and its second moment.
    u = jnp.einsum("tij,tj->ti", filtered.precision, filtered.innovation) - jnp.einsum(
        "tij,ti->tj", gain, adjoint.slope_after
    )
    turned = jnp.swapaxes(gain, -1, -2) @ adjoint.information_after @ gain
    by_R = 0.5 * (u * u - jnp.diagonal(filtered.precision + turned, axis1=-2, axis2=-1))
    return {
        "F": by_F,
        "c": slope[1:],
        "Q": by_P[1:],
        "z": -u,
        "R": by_R,
        "x0": slope[0],
        "P0": by_P[0],
    }
