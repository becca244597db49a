"""Attitude from one epoch of specific force, after [chalko2010].

The velocities of a GNSS receiver tell the mean acceleration A of an epoch in East-North-Up axes, hence its specific
force ``f_n = A + g up``; the accelerometers tell the same in body axes, ``f_b``. The attitude is what turns one into
the other, Eqs. (4) and (5).

A rotation keeps length, so three equations hold two conditions: no epoch tells anything of a turn about its own
specific force, which on level ground is the yaw. That angle is supplied by the initial value. So the fit states how far
the initial value is believed, and reports what it took from the data and what from there.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.custom_derivatives import zero_from_primal
from jax.typing import ArrayLike

from altijax import _epoch_cost
from altijax._shapes import require_shape
from altijax.least_squares import CONVERGED, NOT_FINITE, levenberg_marquardt
from altijax.rotations import euler_to_matrix, wrap_angle


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class AttitudeFit:
    """Attitude that fits one epoch, and what the epoch knows of it.

    Attributes
    ----------
    euler : (3,) rad
        Roll in (-pi, pi], pitch in [-pi/2, pi/2] and yaw in (-pi, pi].
    C_nb : (3, 3)
        Maps body vectors to navigation vectors.
    covariance : (3, 3) rad^2
        Covariance of roll, pitch and yaw as the fit found them, before they were brought into their ranges.
    data_share : (3,)
        Part of each angle that comes from the data, between 0 and 1; the rest is the initial value. One less the ratio
        of the variance to that of the prior; the sum is the number of angles that the epoch determines.
    rank : ()
        Number of directions in which the data outweigh the prior: 2 as a rule, 0 near free fall.
    cost : ()
        Sum of the squared residuals, in units of their variances.
    status : ()
        0 converged, 1 steps used up, 2 data not finite: the result is the prior.
    """

    euler: jax.Array
    C_nb: jax.Array
    covariance: jax.Array
    data_share: jax.Array
    rank: jax.Array
    cost: jax.Array
    status: jax.Array


def fit_attitude(
    f_b: ArrayLike, f_n: ArrayLike, euler0: ArrayLike, *, prior_std: ArrayLike, measurement_std: ArrayLike
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

    Returns
    -------
    fit : AttitudeFit
        Attitude, covariance, share of the data, rank and status.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b, f_n = require_shape("f_b", f_b, (3,)), require_shape("f_n", f_n, (3,))
    euler0 = require_shape("euler0", euler0, (3,))
    prior_std, measurement_std = _deviations(prior_std, measurement_std, euler0.dtype)
    # An epoch without finite data is one without data.
    finite = jnp.isfinite(f_b).all() & jnp.isfinite(f_n).all()
    f_b, f_n = jnp.where(finite, f_b, 0), jnp.where(finite, f_n, 0)
    change, status = _minimum(f_b, f_n, euler0, measurement_std / prior_std)
    status = jnp.where(finite, status, NOT_FINITE)
    return _described(change, status, f_b, f_n, euler0, prior_std, measurement_std)


@jax.custom_jvp
def _minimum(f_b: jax.Array, f_n: jax.Array, euler0: jax.Array, ratio: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Change of `euler0` that minimises the cost, and the status of the fit."""

    b, n, start, ratios = map(_components, (f_b, f_n, euler0, ratio))

    def residuals(change: jax.Array) -> jax.Array:
        x = _components(change)
        return jnp.stack(_epoch_cost.residuals(_epoch_cost.turned_by(b, n, start, x), x, ratios))

    fit = levenberg_marquardt(residuals, jnp.zeros_like(euler0))
    # The fit stops where the cost stays the same to rounding, the change to its square root; one more step is Newton's.
    x = _components(fit.x)
    forces = _epoch_cost.turned_by(b, n, start, x)
    step = _epoch_cost.newton_step(forces, ratios, _epoch_cost.gradient(forces, x, ratios))
    return jnp.where(fit.status == CONVERGED, fit.x - jnp.stack(step), fit.x), fit.status


@_minimum.defjvp
def _minimum_jvp(primals: tuple, tangents: tuple) -> tuple:
    change, status = _minimum(*primals)
    arguments, directions = tuple(map(_components, primals)), tuple(map(_components, tangents))
    direction = _epoch_cost.derivative_of_minimum(_components(change), arguments, directions)
    return (change, status), (jnp.stack(direction, -1), zero_from_primal(status))


def _deviations(prior_std: ArrayLike, measurement_std: ArrayLike, dtype: jnp.dtype) -> tuple[jax.Array, jax.Array]:
    prior = require_shape("prior_std", prior_std, () if jnp.ndim(prior_std) == 0 else (3,))
    measurement = require_shape("measurement_std", measurement_std, ())
    return jnp.broadcast_to(prior, 3).astype(dtype), measurement.astype(dtype)


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
    residuals = _epoch_cost.residuals(forces, _components(change), _components(ratio))

    data = _epoch_cost.information(forces)
    # In units of the prior: there the prior's own information is the identity, whatever its size.
    scale = (1 / (ratio[:, None] * ratio))[jnp.triu_indices(3)]
    data = _epoch_cost.Symmetric(*(element * s for element, s in zip(data, scale, strict=True)))
    total = data._replace(xx=data.xx + 1, yy=data.yy + 1, zz=data.zz + 1)
    inverse = jnp.stack(
        [jnp.stack(_epoch_cost.solve(total, tuple(column)), -1) for column in jnp.eye(3, dtype=change.dtype)], -1
    )
    return AttitudeFit(
        euler=_in_range(euler),
        C_nb=euler_to_matrix(euler),
        covariance=inverse * prior_std[:, None] * prior_std,
        data_share=1 - jnp.diagonal(inverse, axis1=-2, axis2=-1),
        rank=_epoch_cost.count_above_one(data),
        cost=sum(r * r for r in residuals) / measurement_std**2,
        status=status,
    )


def _in_range(euler: jax.Array) -> jax.Array:
    """The angles of the same attitude in the ranges of `matrix_to_euler`."""
    roll, pitch, yaw = _components(wrap_angle(euler))
    over = jnp.abs(pitch) > jnp.pi / 2
    half_turn = jnp.where(over, jnp.pi, 0)
    return wrap_angle(jnp.stack([roll + half_turn, jnp.where(over, jnp.pi - pitch, pitch), yaw + half_turn], -1))
