"""Smooth rotations through knots: attitude and rate of turn, both continuous, from attitudes at slower epochs."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax._values import checked, increasing
from altijax.rotations import matrix_to_rotvec, rotvec_to_matrix, skew


@checked(t_knots=increasing)
@jax.jit
def rotation_spline(t: ArrayLike, t_knots: ArrayLike, C_knots: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Rotations and rates of turn of a smooth curve through given rotations.

    Between two knots the curve is the earlier rotation times the exponential of a cubic in time, a Hermite spline in
    rotation vectors: it passes through both and has at each knot the rate of turn found from the three knots around it,
    by the parabola through their rotation vectors. So rates are continuous, the error falls with the third power of the
    spacing (that of scipy's RotationSpline, which solves for all knots at once, with the fourth), turning at a constant
    rate is met exactly, and what one knot does reaches two intervals far. It turns with its knots: other axes on either
    side turn the curve alike.

    Before the first and after the last knot the nearest knot's rotation is held, with no rate.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_knots : (knots,) s
        Times of the given rotations, increasing. At least three.
    C_knots : (..., knots, 3, 3)
        Rotation matrices C_nb. Neighbours well below 180 degrees apart.

    Returns
    -------
    C : (..., time, 3, 3)
        Rotation matrices at `t`.
    w_b : (..., time, 3) rad/s
        Rate of turn in body axes.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than three knots.
    """
    t = require_shape("t", t, (None,))
    t_knots = require_shape("t_knots", t_knots, (None,))
    C_knots = require_shape("C_knots", C_knots, (..., t_knots.size, 3, 3))
    if t_knots.size < 3:
        raise ValueError(f"t_knots must have at least 3 knots, got {t_knots.size}")
    dt = jnp.diff(t_knots)[:, None]
    turns = matrix_to_rotvec(jnp.swapaxes(C_knots[..., :-1, :, :], -1, -2) @ C_knots[..., 1:, :, :])
    w_knots = _rates_at_knots(dt, turns)
    # Derivatives of the rotation vector at both ends: those whose rates of turn are the knots'.
    starts, ends = w_knots[..., :-1, :], _apply(_inverse_jacobian(turns), w_knots[..., 1:, :])
    k = jnp.clip(jnp.searchsorted(t_knots, t, side="right") - 1, 0, t_knots.size - 2)
    width = t_knots[k + 1] - t_knots[k]
    into = (t - t_knots[k]) / width
    x = jnp.clip(into, 0, 1)[:, None]
    width = width[:, None]
    turn, start, end = turns[..., k, :], starts[..., k, :] * width, ends[..., k, :] * width
    r = x * x * (3 - 2 * x) * turn + x * (1 - x) * ((1 - x) * start - x * end)
    slope = 6 * x * (1 - x) * turn + (1 - x) * (1 - 3 * x) * start + x * (3 * x - 2) * end
    inside = ((into >= 0) & (into <= 1))[:, None]
    w_b = jnp.where(inside, _apply(_jacobian(r), slope) / width, 0)
    return C_knots[..., k, :, :] @ rotvec_to_matrix(r), w_b


def _rates_at_knots(dt: jax.Array, turns: jax.Array) -> jax.Array:
    """Rate of turn at each knot in its own body axes.

    In axes of the middle one of three knots the rotation vectors to its neighbours are minus the turn before and the
    turn after. At the ends the parabola of the first and last three is taken where it ends.
    """
    mean = turns / dt
    before, after = mean[..., :-1, :], mean[..., 1:, :]
    h0, h1 = dt[:-1], dt[1:]
    inner = (h1 * before + h0 * after) / (h0 + h1)
    # To the ends, carried in rotation vectors about the neighbouring knot.
    first = _apply(_jacobian(-turns[..., :1, :]), 2 * mean[..., :1, :] - inner[..., :1, :])
    last = _apply(_jacobian(turns[..., -1:, :]), 2 * mean[..., -1:, :] - inner[..., -1:, :])
    return jnp.concatenate([first, inner, last], -2)


def _apply(matrix: jax.Array, v: jax.Array) -> jax.Array:
    return jnp.sum(matrix * v[..., None, :], -1)


def _jacobian(r: jax.Array) -> jax.Array:
    """Right Jacobian: the rate of turn in body axes is this times the derivative of the rotation vector."""
    squared = jnp.sum(r * r, -1)[..., None, None]
    K = skew(r)
    return jnp.eye(3, dtype=r.dtype) - _one_minus_cos(squared) * K + _minus_sin(squared) * (K @ K)


def _inverse_jacobian(r: jax.Array) -> jax.Array:
    squared = jnp.sum(r * r, -1)[..., None, None]
    K = skew(r)
    return jnp.eye(3, dtype=r.dtype) + 0.5 * K + _inverse_term(squared) * (K @ K)


def _series_or(exact: Callable[[jax.Array], jax.Array], series: tuple[float, ...], squared: jax.Array) -> jax.Array:
    """`exact` of an angle, or, where that loses its digits, the series in its square."""
    small = squared < 0.1
    x = jnp.where(small, squared, 0)
    near = jnp.zeros_like(x)
    for coefficient in reversed(series):
        near = near * x + coefficient
    return jnp.where(small, near, exact(jnp.sqrt(jnp.where(small, 1, squared))))


def _one_minus_cos(squared: jax.Array) -> jax.Array:
    series = (1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800, -1 / 479001600)
    return _series_or(lambda a: (1 - jnp.cos(a)) / (a * a), series, squared)


def _minus_sin(squared: jax.Array) -> jax.Array:
    series = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800)
    return _series_or(lambda a: (a - jnp.sin(a)) / a**3, series, squared)


def _inverse_term(squared: jax.Array) -> jax.Array:
    series = (1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000, 1 / 74724249600)
    return _series_or(lambda a: (1 - a / 2 / jnp.tan(a / 2)) / (a * a), series, squared)
