"""Nonlinear least squares for one small problem; batches take `jax.vmap`."""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape

CONVERGED, STEPS_USED_UP, NOT_FINITE = 0, 1, 2
"""Values of `Fit.status`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Fit:
    """What a least-squares fit found, and what the data know of it.

    Attributes
    ----------
    x : (parameters,)
        Minimiser.
    cost : ()
        Sum of squared residuals there.
    covariance : (parameters, parameters)
        Inverse of J^T J at the minimiser, undamped: the covariance of `x` if the residuals are independent with unit
        variance. Directions the residuals do not depend on have a very large variance.
    rank : ()
        Number of directions that the residuals determine to working precision.
    steps : ()
        Evaluations of the residual and its Jacobian.
    status : ()
        0 converged, 1 steps used up, 2 residuals not finite at the start.
    """

    x: jax.Array
    cost: jax.Array
    covariance: jax.Array
    rank: jax.Array
    steps: jax.Array
    status: jax.Array


def levenberg_marquardt(
    residual: Callable[[jax.Array], jax.Array], x0: ArrayLike, max_steps: int = 100, tolerance: float | None = None
) -> Fit:
    """Minimiser of the sum of squared residuals.

    Levenberg's damping: a multiple of the identity is added to J^T J, so a direction that the data do not determine
    stays where it began (Marquardt's scaling, as in MINPACK, lets it wander). Scale the parameters to comparable sizes.

    Parameters
    ----------
    residual : callable
        Maps parameters (parameters,) to residuals (residuals,); differentiable by JAX.
    x0 : (parameters,)
        Where to begin.
    max_steps : int, optional
        Bound on the evaluations, those of rejected steps included.
    tolerance : float, optional
        Stop when a step changes the parameters, or is expected to lower the cost, by less than this fraction.
        Default: the square root of the precision for the step, the precision itself for the cost.

    Returns
    -------
    fit : Fit
        Minimiser, cost, covariance, rank and status.

    Raises
    ------
    ValueError
        If `x0` is not a vector.
    """
    x0 = require_shape("x0", x0, (None,))
    eps = float(jnp.finfo(x0.dtype).eps)
    step_tolerance = eps**0.5 if tolerance is None else tolerance
    cost_tolerance = eps if tolerance is None else tolerance
    identity = jnp.eye(x0.size, dtype=x0.dtype)

    def linearised(x: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        r, J = jax.vmap(lambda direction: jax.jvp(residual, (x,), (direction,)), out_axes=(None, -1))(identity)
        return r @ r, J.T @ r, J.T @ J

    def proceed(state: tuple) -> jax.Array:
        *_, steps, done = state
        return ~done & (steps < max_steps)

    def iterate(state: tuple) -> tuple:
        # The residual is traced at this one place, which keeps compilation short: the first trial is the start itself.
        x, found, damping, trial, expected, steps, _ = state
        tried = linearised(trial)
        cost, new_cost = found[0], tried[0]
        first = steps == 0
        accepted = jnp.isfinite(tried[2]).all() & (new_cost <= cost)  # False for NaN
        small = jnp.linalg.norm(trial - x) <= step_tolerance * (jnp.linalg.norm(x) + step_tolerance)
        x = jnp.where(accepted, trial, x)
        found = jax.tree.map(lambda new, old: jnp.where(accepted, new, old), tried, found)
        # A good prediction earns less damping (Nielsen's rule, without its memory).
        gain = (cost - new_cost) / jnp.where(expected > 0, expected, 1)
        eased = damping * jnp.clip(1 - (2 * gain - 1) ** 3, 0.1, 2.0)
        damping = jnp.where(accepted, eased, 8 * damping)
        cost, gradient, hessian = found
        initial = 1e-4 * jnp.maximum(jnp.max(jnp.diag(hessian)), jnp.finfo(x0.dtype).tiny)
        damping = jnp.where(first, initial, damping)
        step = -jnp.linalg.solve(hessian + damping * identity, gradient)
        expected = step @ (damping * step - gradient)
        done = jnp.where(first, ~accepted, accepted & small) | (expected <= cost_tolerance * cost)
        return x, found, damping, x + step, expected, steps + 1, done

    unknown = (jnp.full((), jnp.inf, x0.dtype), jnp.zeros_like(x0), identity)
    zero = jnp.zeros((), x0.dtype)
    start = (x0, unknown, zero, x0, zero, jnp.asarray(0), jnp.asarray(False))
    x, (cost, _, hessian), _, _, _, steps, done = jax.lax.while_loop(proceed, iterate, start)
    finite = jnp.isfinite(cost)

    values, vectors = jnp.linalg.eigh(hessian)
    floor = jnp.maximum(values[-1] * eps * x0.size, jnp.finfo(x0.dtype).tiny)
    covariance = (vectors / jnp.maximum(values, floor)) @ vectors.T
    status = jnp.where(finite, jnp.where(done, CONVERGED, STEPS_USED_UP), NOT_FINITE)
    return Fit(x=x, cost=cost, covariance=covariance, rank=jnp.sum(values > floor), steps=steps, status=status)
