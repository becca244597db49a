"""What an IMU says between two instants, whatever the attitude and velocity at the first (preintegration).

The readings of an interval are summed up once, in the body axes of its beginning, together with the derivatives by the
sensors' constants. An estimator over many intervals then handles each as one step, and all intervals are summed at the
same time.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax.rotations import rotvec_to_matrix, skew


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Preintegrated:
    """One interval of readings, in the body axes of its beginning.

    Attributes
    ----------
    C : (..., time, 3, 3)
        Maps body vectors at the end of each step to the axes of the beginning.
    velocity : (..., time, 3) m/s
        Integral of the specific force up to the end of each step.
    turn_by_gyro : (..., 3, 12)
        Derivative of the final attitude, as a rotation vector, by gyro bias (rad/s) and by the rows of a matrix that
        the rate is multiplied with.
    velocity_by_gyro : (..., 3, 12)
        Derivative of the final velocity by the same.
    velocity_by_bias : (..., 3, 3) s
        Derivative of the final velocity by the accelerometer bias.
    velocity_by_matrix : (..., 3, 3, 3) m/s
        Derivative of the final velocity by a matrix that the specific force is multiplied with.
    velocity_by_turn : (..., 3, 3) m/s
        Derivative of the final velocity by a rotation vector that grows evenly over the interval.
    """

    C: jax.Array
    velocity: jax.Array
    turn_by_gyro: jax.Array
    velocity_by_gyro: jax.Array
    velocity_by_bias: jax.Array
    velocity_by_matrix: jax.Array
    velocity_by_turn: jax.Array


def relative_attitudes(w_b: ArrayLike, dt: ArrayLike) -> jax.Array:
    """Attitude at the end of each step relative to the beginning, with the second-order coning term.

    Parameters
    ----------
    w_b : (..., time, 3) rad/s
        Mean angular rate of each step.
    dt : (..., time) s
        Length of each step; zero where steps only fill an interval up.

    Returns
    -------
    C : (..., time, 3, 3)
        Maps body vectors at the end of each step to the axes of the beginning.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    w_b = require_shape("w_b", w_b, (..., None, 3))
    turns = w_b * require_shape("dt", dt, (..., w_b.shape[-2]))[..., None]
    before = jnp.concatenate([turns[..., :1, :], turns[..., :-1, :]], -2)
    steps = rotvec_to_matrix(turns + jnp.cross(before, turns) / 12)

    def chain(C: jax.Array, step: jax.Array) -> tuple[jax.Array, jax.Array]:
        C = C @ step
        return C, C

    start = jnp.broadcast_to(jnp.eye(3, dtype=w_b.dtype), (*steps.shape[:-3], 3, 3))
    return jnp.moveaxis(jax.lax.scan(chain, start, jnp.moveaxis(steps, -3, 0))[1], 0, -3)


def preintegrate(f_b: ArrayLike, w_b: ArrayLike, C: ArrayLike, turn: ArrayLike, dt: ArrayLike) -> Preintegrated:
    """Sum up the readings of an interval.

    Parameters
    ----------
    f_b : (..., time, 3) m/s^2
        Mean specific force of each step, corrected.
    w_b : (..., time, 3) rad/s
        Mean angular rate of each step, corrected.
    C : (..., time, 3, 3)
        Attitude at the end of each step by the gyro, as of `relative_attitudes`.
    turn : (..., 3) rad
        Rotation vector, in the axes of the beginning, by which the gyro missed the final attitude; it is spread evenly.
    dt : (..., time) s
        Length of each step; zero where steps only fill an interval up.

    Returns
    -------
    preintegrated : Preintegrated
        Attitude and velocity gained, with their derivatives.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b = require_shape("f_b", f_b, (..., None, 3))
    steps = f_b.shape[-2]
    w_b = require_shape("w_b", w_b, (..., steps, 3))
    turn = require_shape("turn", turn, (..., 3))
    dt = require_shape("dt", dt, (..., steps))
    C = require_shape("C", C, (..., steps, 3, 3))
    ends = jnp.cumsum(dt, -1)
    whole = jnp.where(ends[..., -1:] > 0, ends[..., -1:], 1)
    ends, middles = ends / whole, (ends - 0.5 * dt) / whole
    middle = C @ rotvec_to_matrix(-0.5 * dt[..., None] * w_b)
    middle = rotvec_to_matrix(middles[..., None] * turn[..., None, :]) @ middle * dt[..., None, None]
    gains = jnp.einsum("...ij,...j->...i", middle, f_b)
    velocity = jnp.cumsum(gains, -2)
    # What turns the body at the middle of a step turns all the velocity that is gained after it.
    after = velocity[..., -1:, :] - velocity + 0.5 * gains
    by_matrix = -middle[..., :, None] * w_b[..., None, None, :]
    by_gyro = jnp.concatenate([middle, by_matrix.reshape(*middle.shape[:-1], 9)], -1)
    rows = jnp.concatenate([jnp.ones_like(after[..., :1]), after], -1)
    sums = jnp.einsum("...ta,...tbj->...abj", rows, by_gyro)
    # Of the outer products of two vectors, the cross product.
    outer = sums[..., 1:, :, :]
    pairs = ((1, 2), (2, 0), (0, 1))
    levered = jnp.stack([outer[..., a, b, :] - outer[..., b, a, :] for a, b in pairs], -2)
    return Preintegrated(
        C=rotvec_to_matrix(ends[..., None] * turn[..., None, :]) @ C,
        velocity=velocity,
        turn_by_gyro=-sums[..., 0, :, :],
        velocity_by_gyro=levered,
        velocity_by_bias=-sums[..., 0, :, :3],
        velocity_by_matrix=jnp.einsum("...tai,...tj->...aij", middle, f_b),
        velocity_by_turn=-skew(jnp.sum(middles[..., None] * gains, -2)),
    )
