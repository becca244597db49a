"""Attitude from one epoch of specific force, after [chalko2010].

The velocities of a GNSS receiver tell the mean acceleration A of an epoch in East-North-Up axes, hence its specific
force ``f_n = A + g up``; the accelerometers tell the same in body axes, ``f_b``. The attitude is what turns one into
the other, Eqs. (4) and (5).

A rotation keeps length, so three equations hold two conditions: no epoch tells anything of a turn about its own
specific force, which on level ground is the yaw. That angle is supplied by the initial value. So the fit states how far
the initial value is believed, and reports what it took from the data and what from there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax.custom_derivatives import zero_from_primal
from jax.typing import ArrayLike

from altijax import _safe
from altijax._epoch_fit import cost as _epoch_cost, steps as _epoch_steps
from altijax._shapes import require_shape
from altijax.doppler import velocity_to_course
from altijax.least_squares import CONVERGED, NOT_FINITE, STEPS_USED_UP
from altijax.rotations import euler_to_matrix, heading_to_yaw, matrix_to_euler, rotvec_to_matrix, wrap_angle

RESCUED = 3
"""Value of `AttitudeFit.status` beside those of `Fit.status`."""

CHUNK, RESCUED_AT_ONCE = 4096, 64


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class AttitudeFit:
    """Attitude that fits an epoch, and what the epoch knows of it.

    Attributes
    ----------
    euler : (..., 3) rad
        Roll in (-pi, pi], pitch in [-pi/2, pi/2] and yaw in (-pi, pi].
    C_nb : (..., 3, 3)
        Maps body vectors to navigation vectors.
    covariance : (..., 3, 3) rad^2
        Covariance of roll, pitch and yaw as the fit found them, before they were brought into their ranges.
    data_share : (..., 3)
        Part of each angle that comes from the data, between 0 and 1; the rest is the initial value. One less the ratio
        of the variance to that of the prior; the sum is the number of angles that the epoch determines.
    rank : (...)
        Number of directions in which the data outweigh the prior: 2 as a rule, 0 near free fall.
    cost : (...)
        Sum of the squared residuals, in units of their variances.
    status : (...)
        0 converged, 1 steps used up, 2 data not finite: the result is the prior, 3 converged at the second attempt
        (`fit_attitudes` alone).
    """

    euler: jax.Array
    C_nb: jax.Array
    covariance: jax.Array
    data_share: jax.Array
    rank: jax.Array
    cost: jax.Array
    status: jax.Array


@partial(jax.jit, static_argnames="starts")
def fit_attitude(
    f_b: ArrayLike,
    f_n: ArrayLike,
    euler0: ArrayLike,
    *,
    prior_std: ArrayLike,
    measurement_std: ArrayLike,
    starts: int = 1,
) -> AttitudeFit:
    """Attitude of one epoch by Levenberg-Marquardt, Eq. (5) of [chalko2010]_ with the initial value as a prior.

    Minimises ``|C_nb^T f_n - f_b|^2 / measurement_std^2 + |wrap(euler - euler0)|^2 / prior_std^2`` from `euler0`. Where
    `prior_std` exceeds about 0.3 rad there may be several minima; this is the one that lies downhill. Derivatives by
    every argument are those of the minimum, by the implicit function theorem. Take `jax.vmap` for a batch, or
    `fit_attitudes`, which is much faster.

    Parameters
    ----------
    f_b : (3,) m/s^2
        Mean specific force of the epoch in body axes.
    f_n : (3,) m/s^2
        The same in navigation axes: mean acceleration plus gravity upwards.
    euler0 : (3,) rad
        Roll, pitch and yaw believed beforehand.
    prior_std : () or (3,) rad
        Standard deviation of `euler0`.
    measurement_std : () m/s^2
        Standard deviation of each component of ``C_nb^T f_n - f_b``.
    starts : int, optional
        Number of starts, spread over a turn about the specific force, of which the lowest minimum is taken: for a
        prior so wide that there are several.

    Returns
    -------
    fit : AttitudeFit
        Attitude, covariance, share of the data, rank and status.

    Raises
    ------
    ValueError
        If the shapes do not fit, or there is no start.
    """
    f_b, f_n = require_shape("f_b", f_b, (3,)), require_shape("f_n", f_n, (3,))
    euler0 = require_shape("euler0", euler0, (3,))
    if starts < 1:
        raise ValueError(f"starts must be at least 1, got {starts}")
    minimiser = _minimum if starts == 1 else partial(_lowest, starts)
    return _fit(minimiser, f_b, f_n, euler0, prior_std, measurement_std)


@jax.jit
def fit_attitudes(
    f_b: ArrayLike, f_n: ArrayLike, euler0: ArrayLike, *, prior_std: ArrayLike, measurement_std: ArrayLike
) -> AttitudeFit:
    """Attitudes of many epochs, each as `fit_attitude` has it, in a small part of the time.

    All epochs take the same few Gauss-Newton and Newton steps; each is then proved to be at its minimum, and those that
    are not go through `fit_attitude`.

    Parameters
    ----------
    f_b : (epochs, 3) m/s^2
        Mean specific force of each epoch in body axes.
    f_n : (epochs, 3) m/s^2
        The same in navigation axes: mean acceleration plus gravity upwards.
    euler0 : (epochs, 3) rad
        Roll, pitch and yaw believed beforehand.
    prior_std : () or (3,) rad
        Standard deviation of `euler0`.
    measurement_std : () m/s^2
        Standard deviation of each component of ``C_nb^T f_n - f_b``.

    Returns
    -------
    fits : AttitudeFit of (epochs,)
        What `fit_attitude` returns, with a leading axis `epochs`; `status` is 3 for epochs that converged after the
        second attempt.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b = require_shape("f_b", f_b, (None, 3))
    f_n, euler0 = require_shape("f_n", f_n, f_b.shape), require_shape("euler0", euler0, f_b.shape)
    return _fit(_minima, f_b, f_n, euler0, prior_std, measurement_std)


@jax.jit
def hold_attitudes(
    euler: ArrayLike, covariance: ArrayLike, valid: ArrayLike, *, drift_std: ArrayLike
) -> tuple[jax.Array, jax.Array]:
    """Attitudes with those that are not valid replaced by the last valid one, as [chalko2010]_ suggests.

    An epoch is not valid where its velocity is missing or its fit has a `rank` below 2, as near free fall. Epochs
    before the first valid one stay as they are.

    Parameters
    ----------
    euler : (..., epochs, 3) rad
        Roll, pitch and yaw.
    covariance : (..., epochs, 3, 3) rad^2
        Their covariances.
    valid : (..., epochs)
        True where an attitude is to be used.
    drift_std : () rad
        Standard deviation of the change of each angle from an epoch to the next; the variance grows by its square with
        each epoch held.

    Returns
    -------
    euler : (..., epochs, 3) rad
        Roll, pitch and yaw.
    covariance : (..., epochs, 3, 3) rad^2
        Their covariances.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    euler = require_shape("euler", euler, (..., None, 3))
    epochs = euler.shape[-2]
    covariance = require_shape("covariance", covariance, (..., epochs, 3, 3))
    valid = require_shape("valid", valid, (..., epochs)) != 0
    drift_std = require_shape("drift_std", drift_std, ()).astype(covariance.dtype)
    number = jnp.broadcast_to(jnp.arange(epochs), valid.shape)
    last = jax.lax.cummax(jnp.where(valid, number, -1), valid.ndim - 1)
    last = jnp.where(last < 0, number, last)
    held = (number - last).astype(covariance.dtype)[..., None, None] * drift_std**2
    return (
        jnp.take_along_axis(euler, last[..., None], -2),
        jnp.take_along_axis(covariance, last[..., None, None], -3) + held * jnp.eye(3, dtype=covariance.dtype),
    )


def course_attitude(v_n: ArrayLike) -> jax.Array:
    """Attitude of a body that is level and heads where it moves: the initial value of Eq. (5) of [chalko2010]_.

    Parameters
    ----------
    v_n : (..., 3) m/s
        Velocity, East, North and up.

    Returns
    -------
    euler : (..., 3) rad
        Roll and pitch, zero, and the yaw of the course; all zero without horizontal motion.

    Raises
    ------
    ValueError
        If the trailing axis of `v_n` is not 3.
    """
    yaw = heading_to_yaw(velocity_to_course(v_n)[1])
    return jnp.stack([jnp.zeros_like(yaw), jnp.zeros_like(yaw), yaw], -1)


@jax.custom_jvp
def _minimum(f_b: jax.Array, f_n: jax.Array, euler0: jax.Array, ratio: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Change of `euler0` that minimises the cost, and the status of the fit; for one epoch or some."""
    f_b, f_n = _finite(f_b, f_n)
    change, converged = _epoch_steps.descend(
        *map(_components, (f_b, f_n, euler0, jnp.zeros_like(euler0), jnp.broadcast_to(ratio, euler0.shape)))
    )
    return jnp.stack(change, -1), jnp.where(converged, CONVERGED, STEPS_USED_UP)


@_minimum.defjvp
def _minimum_jvp(primals: tuple, tangents: tuple) -> tuple:
    return _with_derivative(_minimum(*primals), primals, tangents)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _lowest(
    starts: int, f_b: jax.Array, f_n: jax.Array, euler0: jax.Array, ratio: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The lowest of the minima found from `_minimum` and from there turned about the specific force."""
    f_b, f_n = _finite(f_b, f_n)
    first, _ = _minimum(f_b, f_n, euler0, ratio)
    angles = jnp.arange(starts, dtype=euler0.dtype) * (2 * jnp.pi / starts)
    length = _safe.norm(f_n)
    turns = rotvec_to_matrix(angles[:, None] * f_n / jnp.where(length > 0, length, 1))
    start = wrap_angle(matrix_to_euler(turns @ euler_to_matrix(euler0 + first)) - euler0).at[0].set(first)
    b, n, e, x, r = (_components(jnp.broadcast_to(v, start.shape)) for v in (f_b, f_n, euler0, start, ratio))
    change, converged = _epoch_steps.descend(b, n, e, x, r)
    forces = _epoch_cost.turned_by(b, n, e, change)
    residuals = _epoch_cost.residuals(forces, _epoch_cost.each(wrap_angle, change), r)
    lowest = jnp.argmin(_epoch_cost.sum_of_squares(residuals))
    return jnp.stack(change, -1)[lowest], jnp.where(converged, CONVERGED, STEPS_USED_UP)[lowest]


@_lowest.defjvp
def _lowest_jvp(starts: int, primals: tuple, tangents: tuple) -> tuple:
    return _with_derivative(_lowest(starts, *primals), primals, tangents)


@jax.custom_jvp
def _minima(f_b: jax.Array, f_n: jax.Array, euler0: jax.Array, ratio: jax.Array) -> tuple[jax.Array, jax.Array]:
    """`_minimum` of each epoch along the first axis."""
    epochs, dtype = len(f_b), f_b.dtype
    chunk = min(epochs, CHUNK)
    ratios = _components(ratio)

    def fit_chunk(number: jax.Array, found: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        # The last chunk reaches back into the one before: nothing is padded.
        start = jnp.minimum(number * chunk, epochs - chunk)
        b, n, e = (jax.lax.dynamic_slice(v, (start, 0), (chunk, 3)) for v in (f_b, f_n, euler0))
        b, n = _finite(b, n)
        change, arrived = _epoch_steps.stride(_components(b), _components(n), _components(e), ratios)
        return (
            jax.lax.dynamic_update_slice(found[0], jnp.stack(change, -1), (start, 0)),
            jax.lax.dynamic_update_slice(found[1], arrived, (start,)),
        )

    found = jnp.zeros((epochs, 3), dtype), jnp.zeros(epochs, bool)
    change, arrived = jax.lax.fori_loop(0, -(-epochs // max(chunk, 1)), fit_chunk, found) if epochs else found

    def rescue(found: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        left = jnp.nonzero(~arrived, size=epochs + RESCUED_AT_ONCE, fill_value=epochs)[0]

        def fit_some(number: jax.Array, found: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
            some = jax.lax.dynamic_slice(left, (number * RESCUED_AT_ONCE,), (RESCUED_AT_ONCE,))
            these = (v.at[some].get(mode="clip") for v in (f_b, f_n, euler0))
            change, status = _minimum(*these, ratio)
            status = jnp.where(status == CONVERGED, RESCUED, status)
            return found[0].at[some].set(change, mode="drop"), found[1].at[some].set(status, mode="drop")

        return jax.lax.fori_loop(0, -(-jnp.sum(~arrived) // RESCUED_AT_ONCE), fit_some, found)

    found = change, jnp.full(epochs, CONVERGED)
    return jax.lax.cond(arrived.all(), lambda found: found, rescue, found) if epochs else found


@_minima.defjvp
def _minima_jvp(primals: tuple, tangents: tuple) -> tuple:
    return _with_derivative(_minima(*primals), primals, tangents)


def _with_derivative(minimum: tuple[jax.Array, jax.Array], primals: tuple, tangents: tuple) -> tuple:
    change, status = minimum
    f_b, f_n, euler0, ratio = primals
    primals = *_finite(f_b, f_n), euler0, ratio
    arguments, directions = tuple(map(_components, primals)), tuple(map(_components, tangents))
    direction = _epoch_cost.derivative_of_minimum(_components(change), arguments, directions)
    return minimum, (jnp.stack(direction, -1), zero_from_primal(status))


def _fit(
    minimiser: Callable,
    f_b: jax.Array,
    f_n: jax.Array,
    euler0: jax.Array,
    prior_std: ArrayLike,
    measurement_std: ArrayLike,
) -> AttitudeFit:
    dtype = jnp.result_type(f_b, f_n, euler0)
    prior_std = require_shape("prior_std", prior_std, () if jnp.ndim(prior_std) == 0 else (3,))
    prior_std = jnp.broadcast_to(prior_std, 3).astype(dtype)
    measurement_std = require_shape("measurement_std", measurement_std, ()).astype(dtype)
    f_b, f_n, euler0 = (v.astype(dtype) for v in (f_b, f_n, euler0))
    change, status = minimiser(f_b, f_n, euler0, measurement_std / prior_std)
    status = jnp.where(_are_finite(f_b, f_n), status, NOT_FINITE)
    return _described(change, status, *_finite(f_b, f_n), euler0, prior_std, measurement_std)


def _are_finite(f_b: jax.Array, f_n: jax.Array) -> jax.Array:
    return (jnp.isfinite(f_b) & jnp.isfinite(f_n)).all(-1)


def _finite(f_b: jax.Array, f_n: jax.Array) -> tuple[jax.Array, jax.Array]:
    """An epoch without finite data is one without data; said chunk by chunk, as copies of the whole batch are slow."""
    finite = _are_finite(f_b, f_n)[..., None]
    return jnp.where(finite, f_b, 0), jnp.where(finite, f_n, 0)


def _components(vectors: jax.Array) -> _epoch_cost.Vector:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _described(
    change: jax.Array,
    status: jax.Array,
    f_b: jax.Array,
    f_n: jax.Array,
    euler0: jax.Array,
    prior_std: jax.Array,
    measurement_std: jax.Array,
) -> AttitudeFit:
    """The fit of one epoch, or of many along the first axis, of which only the change from `euler0` was known."""
    euler = euler0 + change
    forces = _epoch_cost.turned_by(*map(_components, (f_b, f_n, euler0, change)))
    ratio = measurement_std / prior_std
    residuals = _epoch_cost.residuals(forces, _components(wrap_angle(change)), _components(ratio))

    # In units of the prior: there the prior's own information is the identity, whatever its size.
    scale = (1 / (ratio[:, None] * ratio))[jnp.triu_indices(3)]
    data = _epoch_cost.Symmetric(*(m * s for m, s in zip(_epoch_cost.information(forces), scale, strict=True)))
    total = data._replace(xx=data.xx + 1, yy=data.yy + 1, zz=data.zz + 1)
    one, zero = jnp.ones_like(total.xx), jnp.zeros_like(total.xx)
    xx, xy, xz = _epoch_cost.solve(total, (one, zero, zero))
    _, yy, yz = _epoch_cost.solve(total, (zero, one, zero))
    zz = _epoch_cost.solve(total, (zero, zero, one))[2]
    inverse = jnp.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], -1).reshape(*change.shape, 3)
    return AttitudeFit(
        euler=_in_range(euler),
        C_nb=euler_to_matrix(euler),
        covariance=inverse * prior_std[:, None] * prior_std,
        data_share=1 - jnp.stack([xx, yy, zz], -1),
        rank=_epoch_cost.count_above_one(data),
        cost=_epoch_cost.sum_of_squares(residuals) / measurement_std**2,
        status=status,
    )


def _in_range(euler: jax.Array) -> jax.Array:
    """The angles of the same attitude in the ranges of `matrix_to_euler`."""
    roll, pitch, yaw = _components(wrap_angle(euler))
    over = jnp.abs(pitch) > jnp.pi / 2
    half_turn = jnp.where(over, jnp.pi, 0)
    return wrap_angle(jnp.stack([roll + half_turn, jnp.where(over, jnp.pi - pitch, pitch), yaw + half_turn], -1))
