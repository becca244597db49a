"""Rotations: matrices, Euler angles, quaternions, rotation vectors, and interpolation between rotations.

``C_nb`` maps body vectors to navigation vectors and is the one currency for attitude; the other forms stand at the
boundary. Every conversion has finite values and derivatives for every rotation: at the identity, at 180 degrees, and
with the nose straight up, where roll and yaw turn about one axis (there yaw is zero and roll takes up the whole turn).
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, increasing


def wrap_angle(angle: ArrayLike) -> jax.Array:
    """Angle reduced to (-pi, pi].

    Parameters
    ----------
    angle : (...) rad
        Any angle.

    Returns
    -------
    angle : (...) rad
        The same direction in (-pi, pi].
    """
    angle = require_shape("angle", angle, (...,))
    return angle - 2 * jnp.pi * jnp.ceil((angle - jnp.pi) / (2 * jnp.pi))


def yaw_to_heading(yaw: ArrayLike) -> jax.Array:
    """Heading, clockwise from North, of a yaw, counter-clockwise from East.

    Parameters
    ----------
    yaw : (...) rad
        Counter-clockwise from East.

    Returns
    -------
    heading : (...) rad
        Clockwise from North, in [0, 2 pi).
    """
    heading = jnp.mod(jnp.pi / 2 - require_shape("yaw", yaw, (...,)), 2 * jnp.pi)
    # mod of a tiny negative number rounds up to the modulus itself
    return jnp.where(heading >= 2 * jnp.pi, 0, heading)


def heading_to_yaw(heading: ArrayLike) -> jax.Array:
    """Yaw, counter-clockwise from East, of a heading, clockwise from North.

    Parameters
    ----------
    heading : (...) rad
        Clockwise from North.

    Returns
    -------
    yaw : (...) rad
        Counter-clockwise from East, in (-pi, pi].
    """
    return wrap_angle(jnp.pi / 2 - require_shape("heading", heading, (...,)))


def skew(v: ArrayLike) -> jax.Array:
    """Matrix of the cross product: ``skew(v) @ u = v x u``.

    Parameters
    ----------
    v : (..., 3)
        Vector.

    Returns
    -------
    matrix : (..., 3, 3)
        Skew-symmetric matrix, in the unit of `v`.

    Raises
    ------
    ValueError
        If the trailing axis of `v` is not 3.
    """
    x, y, z = jnp.moveaxis(require_shape("v", v, (..., 3)), -1, 0)
    zero = jnp.zeros_like(x)
    return _matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def vee(matrix: ArrayLike) -> jax.Array:
    """Vector of the skew-symmetric part of a matrix; the inverse of `skew`.

    Parameters
    ----------
    matrix : (..., 3, 3)
        Matrix; its symmetric part is ignored.

    Returns
    -------
    v : (..., 3)
        Vector, in the unit of `matrix`.

    Raises
    ------
    ValueError
        If the trailing axes of `matrix` are not 3, 3.
    """
    m = require_shape("matrix", matrix, (..., 3, 3))
    return 0.5 * jnp.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1)


def euler_to_matrix(euler: ArrayLike) -> jax.Array:
    """Attitude matrix of roll, pitch and yaw.

    ``C_nb = Rz(yaw) Ry(-pitch) Rx(roll)`` in East-North-Up and forward-left-up axes: right side down, nose up and
    counter-clockwise from East are positive. The transpose is Eq. (2) of [chalko2010]_.

    Parameters
    ----------
    euler : (..., 3) rad
        Roll, pitch and yaw.

    Returns
    -------
    C_nb : (..., 3, 3)
        Maps body vectors to navigation vectors.

    Raises
    ------
    ValueError
        If the trailing axis of `euler` is not 3.
    """
    euler = jnp.moveaxis(require_shape("euler", euler, (..., 3)), -1, 0)
    (sr, sp, sy), (cr, cp, cy) = jnp.sin(euler), jnp.cos(euler)
    return _matrix(
        [
            [cy * cp, -sy * cr - cy * sp * sr, sy * sr - cy * sp * cr],
            [sy * cp, cy * cr - sy * sp * sr, -cy * sr - sy * sp * cr],
            [sp, cp * sr, cp * cr],
        ]
    )


def matrix_to_euler(C_nb: ArrayLike) -> jax.Array:
    """Roll, pitch and yaw of an attitude matrix; the inverse of `euler_to_matrix`.

    Parameters
    ----------
    C_nb : (..., 3, 3)
        Maps body vectors to navigation vectors.

    Returns
    -------
    euler : (..., 3) rad
        Roll in (-pi, pi], pitch in [-pi/2, pi/2] and yaw in (-pi, pi].

    Raises
    ------
    ValueError
        If the trailing axes of `C_nb` are not 3, 3.
    """
    C = require_shape("C_nb", C_nb, (..., 3, 3))
    yaw = _safe.arctan2(C[..., 1, 0], C[..., 0, 0])
    # Roll is read off after the yaw is undone, so that near the poles, where rounding makes both arbitrary, the two
    # still agree with each other and the matrix is kept to the last digit.
    sy, cy = jnp.sin(yaw), jnp.cos(yaw)
    roll = _safe.arctan2(sy * C[..., 0, 2] - cy * C[..., 1, 2], cy * C[..., 1, 1] - sy * C[..., 0, 1])
    pitch = _safe.arctan2(C[..., 2, 0], cy * C[..., 0, 0] + sy * C[..., 1, 0])
    return jnp.stack([roll, pitch, yaw], -1)


def quaternion_to_matrix(quaternion: ArrayLike) -> jax.Array:
    """Rotation matrix of a Hamilton quaternion (w, x, y, z).

    Parameters
    ----------
    quaternion : (..., 4)
        Scalar first; its length does not matter, and zero stands for the identity.

    Returns
    -------
    C : (..., 3, 3)
        Rotation matrix.

    Raises
    ------
    ValueError
        If the trailing axis of `quaternion` is not 4.
    """
    q = require_shape("quaternion", quaternion, (..., 4))
    squared = jnp.sum(q * q, axis=-1)
    s = jnp.where(squared > 0, 2 / jnp.where(squared > 0, squared, 1), 0)
    w, x, y, z = jnp.moveaxis(q, -1, 0)
    return _matrix(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


def matrix_to_quaternion(C: ArrayLike) -> jax.Array:
    """Hamilton quaternion (w, x, y, z) of a rotation matrix.

    Parameters
    ----------
    C : (..., 3, 3)
        Rotation matrix.

    Returns
    -------
    quaternion : (..., 4)
        Unit quaternion, scalar first and not negative.

    Raises
    ------
    ValueError
        If the trailing axes of `C` are not 3, 3.
    """
    C = require_shape("C", C, (..., 3, 3))
    xx, yy, zz = C[..., 0, 0], C[..., 1, 1], C[..., 2, 2]
    wx, wy, wz = C[..., 2, 1] - C[..., 1, 2], C[..., 0, 2] - C[..., 2, 0], C[..., 1, 0] - C[..., 0, 1]
    xy, xz, yz = C[..., 1, 0] + C[..., 0, 1], C[..., 0, 2] + C[..., 2, 0], C[..., 2, 1] + C[..., 1, 2]
    # Each row of 4 q q^T is the quaternion times 4 of its elements; the row of the largest element cannot vanish.
    diagonal = [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz]
    rows = _matrix(
        [
            [diagonal[0], wx, wy, wz],
            [wx, diagonal[1], xy, xz],
            [wy, xy, diagonal[2], yz],
            [wz, xz, yz, diagonal[3]],
        ]
    )
    largest = jnp.argmax(jnp.stack(diagonal, -1), axis=-1)
    row = jnp.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    return row * (jnp.where(row[..., :1] < 0, -1, 1) / _safe.norm(row)[..., None])


def rotvec_to_matrix(rotvec: ArrayLike) -> jax.Array:
    """Rotation matrix of a rotation vector (the exponential map).

    Parameters
    ----------
    rotvec : (..., 3) rad
        Axis times angle.

    Returns
    -------
    C : (..., 3, 3)
        Rotation matrix.

    Raises
    ------
    ValueError
        If the trailing axis of `rotvec` is not 3.
    """
    r = require_shape("rotvec", rotvec, (..., 3))
    squared = jnp.sum(r * r, axis=-1)[..., None, None]
    # (1 - cos a) / a^2 loses its digits for small angles; the half-angle form keeps them.
    half = _sinc_of_square(squared / 4)
    K = skew(r)
    outer = r[..., :, None] * r[..., None, :]
    identity = jnp.eye(3, dtype=r.dtype)
    return identity + _sinc_of_square(squared) * K + 0.5 * half * half * (outer - squared * identity)


def matrix_to_rotvec(C: ArrayLike) -> jax.Array:
    """Rotation vector of a rotation matrix (the logarithm); the inverse of `rotvec_to_matrix`.

    Parameters
    ----------
    C : (..., 3, 3)
        Rotation matrix.

    Returns
    -------
    rotvec : (..., 3) rad
        Axis times angle, the angle in [0, pi]. At 180 degrees either axis is right; one of them is returned.

    Raises
    ------
    ValueError
        If the trailing axes of `C` are not 3, 3.
    """
    q = matrix_to_quaternion(C)
    w, v = q[..., :1], q[..., 1:]
    squared = jnp.sum(v * v, axis=-1, keepdims=True)
    small = squared < 1e-6
    x2 = jnp.where(small, squared, 0) / jnp.where(small, w * w, 1)
    series = (1 - x2 * (1 / 3 - x2 * (1 / 5 - x2 / 7))) / jnp.where(small, w, 1)
    s = jnp.sqrt(jnp.where(small, 1, squared))
    return 2 * jnp.where(small, series, jnp.arctan2(s, w) / s) * v


@checked(t_knots=increasing)
def interpolate_rotations(t: ArrayLike, t_knots: ArrayLike, C_knots: ArrayLike) -> jax.Array:
    """Rotations between given ones, each pair joined by a turn at constant rate (slerp).

    Before the first and after the last knot the nearest knot's rotation is held.

    Parameters
    ----------
    t : (time,) s
        Times asked for.
    t_knots : (knots,) s
        Times of the given rotations, increasing.
    C_knots : (..., knots, 3, 3)
        Rotation matrices. Neighbours 180 degrees apart can be joined in two ways; one of them is taken.

    Returns
    -------
    C : (..., time, 3, 3)
        Rotation matrices at `t`.

    Raises
    ------
    ValueError
        If the shapes do not fit or there are fewer than two knots.
    """
    t = require_shape("t", t, (None,))
    t_knots = require_shape("t_knots", t_knots, (None,))
    C_knots = require_shape("C_knots", C_knots, (..., t_knots.size, 3, 3))
    if t_knots.size < 2:
        raise ValueError(f"t_knots must have at least 2 knots, got {t_knots.size}")
    k = jnp.clip(jnp.searchsorted(t_knots, t, side="right") - 1, 0, t_knots.size - 2)
    fraction = jnp.clip((t - t_knots[k]) / (t_knots[k + 1] - t_knots[k]), 0, 1)
    turns = matrix_to_rotvec(jnp.swapaxes(C_knots[..., :-1, :, :], -1, -2) @ C_knots[..., 1:, :, :])
    return C_knots[..., k, :, :] @ rotvec_to_matrix(fraction[:, None] * turns[..., k, :])


def _matrix(rows: list[list[jax.Array]]) -> jax.Array:
    return jnp.stack([jnp.stack(row, -1) for row in rows], -2)


def _sinc_of_square(squared: jax.Array) -> jax.Array:
    """sin(a) / a as a function of a^2, which makes every derivative at zero finite."""
    small = squared < 0.05
    x = jnp.where(small, squared, 0)
    series = 1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72)))
    a = jnp.sqrt(jnp.where(small, 1, squared))
    return jnp.where(small, series, jnp.sin(a) / a)
