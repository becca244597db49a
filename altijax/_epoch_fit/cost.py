"""The cost of an attitude from one epoch of specific force: its derivatives in closed form, component by component.

With roll, pitch and yaw changed by (x_1, x_2, x_3) from where they are believed to be, an epoch costs

    |C_nb^T f_n - f_b|^2 + sum (ratio_i x_i)^2

in units of the measurement's variance, `ratio` being the standard deviation of the measurement over that of the angle.
A rotation keeps length, so all that varies with the attitude in the first term is -2 f_b . C_nb^T f_n, and derivatives
of every order are as cheap as this product, which needs no matrix: it is taken in the axes between the yaw, which is
undone on `f_n`, and roll and pitch, which are undone on `f_b`.

Components stand apart, so that the same lines serve one epoch and, as whole-array arithmetic, a million of them.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from altijax._epoch_fit.trigonometry import cosine, sine
from altijax.rotations import wrap_angle

Vector = tuple[jax.Array, jax.Array, jax.Array]


class Symmetric(NamedTuple):
    """The six different elements of a symmetric matrix."""

    xx: jax.Array
    xy: jax.Array
    xz: jax.Array
    yy: jax.Array
    yz: jax.Array
    zz: jax.Array


class Turned(NamedTuple):
    """Both specific forces seen from the axes between the turns of ``C_nb = Rz(yaw) Ry(-pitch) Rx(roll)``."""

    a: Vector  # f_n after the yaw
    b: Vector  # f_n after yaw and pitch
    n: Vector  # f_b before the roll
    k: Vector  # f_b before roll and pitch
    sin_pitch: jax.Array


def turned(f_b: Vector, f_n: Vector, sines: Vector, cosines: Vector) -> Turned:
    """Specific forces in the axes between the turns, from the sines and cosines of roll, pitch and yaw."""
    (sr, sp, sy), (cr, cp, cy) = sines, cosines
    a = cy * f_n[0] + sy * f_n[1], cy * f_n[1] - sy * f_n[0], f_n[2]
    b = cp * a[0] + sp * a[2], a[1], cp * a[2] - sp * a[0]
    n = f_b[0], cr * f_b[1] - sr * f_b[2], sr * f_b[1] + cr * f_b[2]
    k = cp * n[0] - sp * n[2], n[1], sp * n[0] + cp * n[2]
    return Turned(a, b, n, k, sp)


def turned_by(f_b: Vector, f_n: Vector, euler0: Vector, change: Vector) -> Turned:
    """`turned` for the initial angles and their change."""
    angles = [e + x for e, x in zip(euler0, change, strict=True)]
    return turned(f_b, f_n, each(sine, angles), each(cosine, angles))


def residuals(forces: Turned, change: Vector, ratio: Vector) -> list[jax.Array]:
    """What the cost is the sum of squares of; the misfits stand in the axes between pitch and roll."""
    misfits = [b - n for b, n in zip(forces.b, forces.n, strict=True)]
    return misfits + [r * x for r, x in zip(ratio, change, strict=True)]


def gradient(forces: Turned, change: Vector, ratio: Vector) -> Vector:
    """Half the gradient of the cost by roll, pitch and yaw."""
    a, b, n, k, _ = forces
    slope = b[1] * n[2] - b[2] * n[1], a[0] * k[2] - a[2] * k[0], a[0] * k[1] - a[1] * k[0]
    x, y, z = (s + r * r * x for s, r, x in zip(slope, ratio, change, strict=True))
    return x, y, z


def hessian(forces: Turned, ratio: Vector) -> Symmetric:
    """Half the matrix of second derivatives of the cost."""
    a, b, n, k, sp = forces
    return _with_prior(
        Symmetric(
            xx=b[1] * n[1] + b[2] * n[2],
            xy=b[0] * n[1],
            xz=a[1] * sp * n[1] - a[0] * n[2],
            yy=a[0] * k[0] + a[2] * k[2],
            yz=a[1] * k[2],
            zz=a[0] * k[0] + a[1] * k[1],
        ),
        ratio,
    )


def information(forces: Turned) -> Symmetric:
    """J^T J of the data alone: the Hessian of the first term where the attitude explains the epoch exactly.

    Its rank is 2, or 0 in free fall: no angle tells of a turn about the specific force itself.
    """
    a, b, _, _, sp = forces
    return Symmetric(
        xx=b[1] * b[1] + b[2] * b[2],
        xy=a[1] * b[0],
        xz=a[1] * a[1] * sp - a[0] * b[2],
        yy=a[0] * a[0] + a[2] * a[2],
        yz=a[1] * a[2],
        zz=a[0] * a[0] + a[1] * a[1],
    )


def count_above_one(data: Symmetric) -> jax.Array:
    """Number of eigenvalues above one of a matrix that is singular as `information` is, however scaled."""
    m = data
    total = m.xx + m.yy + m.zz
    product = (m.xx * m.yy - m.xy * m.xy) + (m.xx * m.zz - m.xz * m.xz) + (m.yy * m.zz - m.yz * m.yz)
    between = product - total + 1  # (one eigenvalue - 1) (other eigenvalue - 1)
    return jnp.where(between < 0, 1, jnp.where(total > 2, 2, 0))


def gauss_newton(forces: Turned, ratio: Vector) -> Symmetric:
    """The positive definite stand-in for `hessian`, of first derivatives alone."""
    return _with_prior(information(forces), ratio)


def solve(matrix: Symmetric, v: Vector) -> Vector:
    """Solution x of ``matrix x = v`` for a positive definite matrix."""
    # Elimination in sequence: accurate for any condition, which cofactors are not
    inverse, p, q, d, e, g = _eliminated(matrix)
    y = v[1] - p * v[0]
    z = ((v[2] - q * v[0]) * d - e * y) / g
    y = (y - e * z) / d
    return (v[0] - matrix.xy * y - matrix.xz * z) * inverse, y, z


def is_positive_definite(matrix: Symmetric) -> jax.Array:
    """Whether `solve` may be asked."""
    *_, d, _, g = _eliminated(matrix)
    return (matrix.xx > 0) & (d > 0) & (g > 0)  # False for NaN


def _eliminated(m: Symmetric) -> tuple[jax.Array, ...]:
    inverse = 1 / m.xx
    p, q = m.xy * inverse, m.xz * inverse
    d, e = m.yy - p * m.xy, m.yz - p * m.xz
    return inverse, p, q, d, e, (m.zz - q * m.xz) * d - e * e


def _with_prior(m: Symmetric, ratio: Vector) -> Symmetric:
    x, y, z = (r * r for r in ratio)
    return m._replace(xx=m.xx + x, yy=m.yy + y, zz=m.zz + z)


def derivative_of_minimum(change: Vector, arguments: tuple[Vector, ...], tangents: tuple[Vector, ...]) -> Vector:
    """Derivative of the minimising change along the tangents of `f_b`, `f_n`, the initial angles and the ratios.

    The implicit function theorem: the gradient stays zero.
    """

    def gradient_of(f_b: Vector, f_n: Vector, euler0: Vector, ratio: Vector) -> Vector:
        return gradient(turned_by(f_b, f_n, euler0, change), within, ratio)

    within = each(wrap_angle, change)
    pull = jax.jvp(gradient_of, arguments, tangents)[1]
    f_b, f_n, euler0, ratio = arguments
    x, y, z = newton_step(turned_by(f_b, f_n, euler0, change), ratio, pull)
    return -x, -y, -z


def newton_step(forces: Turned, ratio: Vector, v: Vector) -> Vector:
    """Solution x of ``hessian x = v``; with `gauss_newton` where no minimum is near and `hessian` shows it."""
    exact = hessian(forces, ratio)
    return solve(choose(is_positive_definite(exact), exact, gauss_newton(forces, ratio)), v)


def choose(condition: jax.Array, one: Symmetric, other: Symmetric) -> Symmetric:
    """`one` where the condition holds, else the `other`."""
    return Symmetric(*(jnp.where(condition, a, b) for a, b in zip(one, other, strict=True)))


def sum_of_squares(numbers: Iterable[jax.Array]) -> jax.Array:
    """Sum of the squares of some arrays."""
    first, *others = (v * v for v in numbers)
    return sum(others, first)


def each(function: Callable[[jax.Array], jax.Array], components: Iterable[jax.Array]) -> Vector:
    """The function's value at each component."""
    x, y, z = map(function, components)
    return x, y, z
