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
    turn_by_gyro : (..., 3, 6)
        Derivative of the final attitude, as a rotation vector, by gyro bias (rad/s) and inverse gyro scale.
    velocity_by_gyro : (..., 3, 6)
        Derivative of the final velocity by the same.
    velocity_by_bias : (..., 3, 3) s
        Derivative of the final velocity by the accelerometer bias.
    velocity_by_turn : (..., 3, 3) m/s
        Derivative of the final velocity by a rotation vector that grows evenly over the interval.
    """

    C: jax.Array
    velocity: jax.Array
    turn_by_gyro: jax.Array
    velocity_by_gyro: jax.Array
    velocity_by_bias: jax.Array
    velocity_by_turn: jax.Array


def relative_attitudes(w_b: ArrayLike, dt: ArrayLike) -> jax.Array:
    """Attitude at the end of each step relative to the beginning, with the second-order coning term.

    Parameters
    ----------
    w_b : (..., time, 3) rad/s
        Mean angular rate of each step.
    dt : (...) s
        Length of a step.

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
    turns = w_b * require_shape("dt", dt, (...,))[..., None, None]
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
    dt : (...) s
        Length of a step.

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
    dt = require_shape("dt", dt, (...,))
    step = dt[..., None, None]
    C = require_shape("C", C, (..., steps, 3, 3))
    middle = C @ rotvec_to_matrix(-0.5 * step * w_b)
    ends = (jnp.arange(steps, dtype=f_b.dtype) + 1) / steps
    share = ends - 0.5 / steps
    C = rotvec_to_matrix(ends[:, None] * turn[..., None, :]) @ C
    middle = rotvec_to_matrix(share[:, None] * turn[..., None, :]) @ middle
    gains = jnp.einsum("...ij,...j->...i", middle, f_b) * step
    by_gyro = jnp.concatenate([-middle, middle * w_b[..., None, :]], -1) * step[..., None]
    summed = jnp.cumsum(by_gyro, -3)
    until_middle = summed - 0.5 * by_gyro
    lever = skew(gains)
    return Preintegrated(
        C=C,
        velocity=jnp.cumsum(gains, -2),
        turn_by_gyro=summed[..., -1, :, :],
        velocity_by_gyro=-jnp.einsum("...tij,...tjk->...ik", lever, until_middle),
        velocity_by_bias=-jnp.sum(middle, -3) * step,
        velocity_by_turn=-jnp.einsum("t,...tij->...ij", share, lever),
    )
