"""Attitude, velocity and position by integrating what an IMU measures (strapdown integration).

The navigation frame is taken as inertial and flat: the Earth's rotation (7e-5 rad/s) and curvature are left out, which
is below what consumer sensors show within minutes.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax.rotations import rotvec_to_matrix


@jax.jit
def integrate_attitude(w_b: ArrayLike, C_nb0: ArrayLike, dt: ArrayLike) -> jax.Array:
    """Attitude from the rate of turn, of second order in the step and exact where the rate is constant.

    Between samples the rate is taken to run straight; each step turns by the rotation vector of its mean and of the
    first coning term, dt^2 / 12 of the cross product of the rates at its ends.

    Parameters
    ----------
    w_b : (..., time, 3) rad/s
        Angular rate in body axes at each sample.
    C_nb0 : (..., 3, 3)
        Attitude at the first sample, of the same batch axes as `w_b`.
    dt : () s
        Time between samples.

    Returns
    -------
    C_nb : (..., time, 3, 3)
        Attitude at each sample.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    w_b = require_shape("w_b", w_b, (..., None, 3))
    C_nb0 = require_shape("C_nb0", C_nb0, (..., 3, 3))
    dt = require_shape("dt", dt, ())
    before, after = w_b[..., :-1, :], w_b[..., 1:, :]
    turns = rotvec_to_matrix(dt / 2 * (before + after) + dt * dt / 12 * jnp.cross(before, after))

    def turn(C: jax.Array, by: jax.Array) -> tuple[jax.Array, jax.Array]:
        C = C @ by
        return C, C

    _, later = jax.lax.scan(turn, C_nb0, jnp.moveaxis(turns, -3, 0))
    return jnp.concatenate([C_nb0[..., None, :, :], jnp.moveaxis(later, 0, -3)], -3)


def integrate_velocity(
    f_b: ArrayLike, C_nb: ArrayLike, v_n0: ArrayLike, gravity: ArrayLike, dt: ArrayLike
) -> jax.Array:
    """Velocity from specific force and attitude, by the trapezoidal rule in navigation axes: second order.

    Parameters
    ----------
    f_b : (..., time, 3) m/s^2
        Specific force in body axes at each sample.
    C_nb : (..., time, 3, 3)
        Attitude at each sample.
    v_n0 : (..., 3) m/s
        Velocity at the first sample, of the same batch axes.
    gravity : (...) m/s^2
        Magnitude of gravity.
    dt : () s
        Time between samples.

    Returns
    -------
    v_n : (..., time, 3) m/s
        Velocity at each sample.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b = require_shape("f_b", f_b, (..., None, 3))
    C_nb = require_shape("C_nb", C_nb, (..., f_b.shape[-2], 3, 3))
    v_n0 = require_shape("v_n0", v_n0, (..., 3))
    gravity = require_shape("gravity", gravity, (...,))
    down = jnp.zeros(3, f_b.dtype).at[2].set(1) * gravity[..., None]
    a_n = jnp.einsum("...ij,...j->...i", C_nb, f_b) - down[..., None, :]
    return _integral(v_n0, a_n, require_shape("dt", dt, ()))


def integrate_position(v_n: ArrayLike, p_n0: ArrayLike, dt: ArrayLike) -> jax.Array:
    """Position from velocity, by the trapezoidal rule: second order.

    Parameters
    ----------
    v_n : (..., time, 3) m/s
        Velocity at each sample.
    p_n0 : (..., 3) m
        Position at the first sample, of the same batch axes.
    dt : () s
        Time between samples.

    Returns
    -------
    p_n : (..., time, 3) m
        Position at each sample.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    v_n = require_shape("v_n", v_n, (..., None, 3))
    return _integral(require_shape("p_n0", p_n0, (..., 3)), v_n, require_shape("dt", dt, ()))


def _integral(start: jax.Array, rate: jax.Array, dt: jax.Array) -> jax.Array:
    areas = dt / 2 * (rate[..., 1:, :] + rate[..., :-1, :])
    gained = jnp.concatenate([jnp.zeros_like(rate[..., :1, :]), jnp.cumsum(areas, -2)], -2)
    return start[..., None, :] + gained
