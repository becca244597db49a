"""Attitude that several pairs of vectors share (Wahba's problem), for one set of pairs and for windows of epochs.

One pair of specific forces, in body and in navigation axes, fixes two of three angles: the turn about the force itself
stays as it was. Pairs of different directions that share an attitude fix all three.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape

# Vectors and matrices are kept as tuples of their elements, (...,) each, until the end: XLA fuses sums and products of
# such arrays into one pass, while batches of small matrices cost it a library call each.
Vector = tuple[jax.Array, ...]
Matrix = tuple[Vector, ...]
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SharedAttitude:
    """Attitude that pairs of vectors share, and how well they determine it.

    Attributes
    ----------
    C_nb : (..., 3, 3)
        Maps body vectors to navigation vectors.
    covariance : (..., 3, 3) rad^2
        Of the small rotation vector, in navigation axes, that would turn `C_nb` into the true attitude.
    rank : (...)
        Directions about which the pairs at least halved the variance of the prior, 0 to 3.
    misfit : (...)
        Root mean square of what the attitude leaves of the pairs, over `measurement_std`: near 1 where that is right.
    valid : (...)
        True where the rank is at least 2. With less than one direction measured the attitude is mostly the prior's.
    """

    C_nb: jax.Array
    covariance: jax.Array
    rank: jax.Array
    misfit: jax.Array
    valid: jax.Array


@jax.jit
def nearest_rotation(B: ArrayLike) -> jax.Array:
    """Rotation C that maximises the trace of C^T B, nearest to B in the sum of squares.

    For B the sum of ``w f_n f_b^T`` it is the attitude of Wahba's problem. Found by Markley's FOAM (Journal of the
    Astronautical Sciences 41, 1993), in a form that keeps its digits when B is nearly of rank one, and two steps of
    Newton's. Rounding is magnified by s1 / (s2 + s3), of the singular values with the sign of the determinant given to
    the last, as it is by the singular value decomposition. The derivative is that of the maximum; where there is no
    unique maximum, at rank below 2, a rotation is returned whose derivative is zero.

    Parameters
    ----------
    B : (..., 3, 3)
        Any matrix.

    Returns
    -------
    C : (..., 3, 3)
        Rotation matrix.

    Raises
    ------
    ValueError
        If the trailing axes of `B` are not 3, 3.
    """
    return _stacked(_nearest(_elements(require_shape("B", B, (..., 3, 3)))))


@jax.jit
def fit_shared_attitude(
    f_b: ArrayLike, f_n: ArrayLike, C_nb0: ArrayLike, prior_std: ArrayLike, measurement_std: ArrayLike
) -> SharedAttitude:
    """Attitude shared by pairs of vectors in body and in navigation axes (Wahba's problem), with a prior.

    Minimises the sum of ``|f_n - C_nb f_b|^2 / measurement_std^2`` and ``2 (1 - cos a) / prior_std^2``, a the angle
    from `C_nb0`: pairs of one direction turn `C_nb0` by the least angle.

    The covariance is H^-1 (G + P) H^-1: H is the second derivative of half the cost, P that of the prior's part, and G
    the covariance of the pairs' part of the gradient under errors of `measurement_std`. H sees only the spread of
    directions that both members of the pairs show, so a spread that is mere noise makes a large variance, not a small
    one.

    Parameters
    ----------
    f_b : (..., pairs, 3) m/s^2
        Specific force, or any vectors, in body axes.
    f_n : (..., pairs, 3) m/s^2
        The same vectors in navigation axes.
    C_nb0 : (..., 3, 3)
        Prior attitude.
    prior_std : (...) rad
        Its standard deviation about each axis. A prior a hundred thousand times weaker than the pairs together would
        drown in rounding and is taken as just so weak.
    measurement_std : (..., pairs) m/s^2
        Standard deviation of each component of ``f_n - C_nb f_b``; infinite where there is no pair.

    Returns
    -------
    attitude : SharedAttitude
        The attitude, its covariance, rank, misfit and validity.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b = require_shape("f_b", f_b, (..., None, 3))
    pairs = f_b.shape[-2]
    f_n = require_shape("f_n", f_n, (..., pairs, 3))
    C_nb0 = require_shape("C_nb0", C_nb0, (..., 3, 3))
    measurement_std = require_shape("measurement_std", measurement_std, (..., pairs))
    moments = _moments(_components(f_b), _components(f_n), measurement_std)
    sums = jax.tree.map(lambda x: jnp.sum(x, -1), moments)
    return _fit(sums, _elements(C_nb0), require_shape("prior_std", prior_std, (...,)))


def fit_windows(
    f_b: ArrayLike,
    f_n: ArrayLike,
    C_nb0: ArrayLike,
    prior_std: ArrayLike,
    measurement_std: ArrayLike,
    window: int | jax.Array = 9,
    C_gyro: ArrayLike | None = None,
) -> SharedAttitude:
    """Attitude at each epoch from the `window` epochs around it, fewer at the ends.

    Without gyros the attitude is taken as constant over the window. With them it may turn as `C_gyro` does: pairs are
    carried into the axes of one instant before they are summed, so the gyros' errors count only within a window. The
    covariance does not include these errors.

    Where the device turns within an epoch the mean force in body axes is not that in navigation axes. With gyros, take
    the mean of ``C_gyro f_b`` over the epoch at the full rate and turn it back by the transpose of `C_gyro` at
    mid-epoch.

    Parameters
    ----------
    f_b : (..., time, 3) m/s^2
        Mean specific force of each epoch in body axes.
    f_n : (..., time, 3) m/s^2
        The same in navigation axes: the difference quotient of velocities, and gravity upward.
    C_nb0 : (..., time, 3, 3)
        Prior attitude at each epoch.
    prior_std : (..., time) rad
        Its standard deviation about each axis.
    measurement_std : (..., time) m/s^2
        Standard deviation of each component of ``f_n - C_nb f_b``; infinite where an epoch is missing.
    window : int, optional
        Epochs that share an attitude, an odd number; may be traced.
    C_gyro : (..., time, 3, 3), optional
        Attitude at mid-epoch by gyros alone, from any start, as of `integrate_attitude`.

    Returns
    -------
    attitudes : SharedAttitude of (..., time)
        Attitude, covariance, rank, misfit and validity at each epoch, as of `fit_shared_attitude`.

    Raises
    ------
    ValueError
        If the shapes do not fit or `window` is not a positive odd number.
    """
    longest = 2 * jnp.shape(f_b)[-2] + 1
    if not isinstance(window, jax.Array):
        if window < 1 or window % 2 == 0:
            raise ValueError(f"window must be a positive odd number of epochs, got {window}")
        # Windows of as many binary digits share what is compiled.
        longest = min(longest, 2 ** int(window).bit_length() - 1)
    return _fit_windows(f_b, f_n, C_nb0, prior_std, measurement_std, window, C_gyro, longest)


@partial(jax.jit, static_argnames="longest")
def _fit_windows(
    f_b: ArrayLike,
    f_n: ArrayLike,
    C_nb0: ArrayLike,
    prior_std: ArrayLike,
    measurement_std: ArrayLike,
    window: jax.Array,
    C_gyro: ArrayLike | None,
    longest: int,
) -> SharedAttitude:
    f_b = require_shape("f_b", f_b, (..., None, 3))
    time = f_b.shape[-2]
    f_n = require_shape("f_n", f_n, (..., time, 3))
    C_nb0 = require_shape("C_nb0", C_nb0, (..., time, 3, 3))
    prior_std = require_shape("prior_std", prior_std, (..., time))
    measurement_std = require_shape("measurement_std", measurement_std, (..., time))
    force, prior = _components(f_b), _elements(C_nb0)
    if C_gyro is not None:
        carry = _elements(require_shape("C_gyro", C_gyro, (..., time, 3, 3)))
        force, prior = _apply(carry, force), _product(prior, _transpose(carry))
    moments = _moments(force, _components(f_n), measurement_std)
    leaves, structure = jax.tree.flatten(moments)
    sums = _sliding_sum(jnp.stack(jnp.broadcast_arrays(*leaves)), window, longest)
    return _fit(jax.tree.unflatten(structure, list(sums)), prior, prior_std, None if C_gyro is None else carry)


def _moments(f_b: Vector, f_n: Vector, measurement_std: jax.Array) -> tuple[Matrix, Matrix, jax.Array, jax.Array]:
    """Of each pair ``w f_n f_b^T``, ``w f_n f_n^T``, ``w |f_b|^2`` and the count."""
    w = 1 / (measurement_std * measurement_std)
    weighted = tuple(w * x for x in f_n)
    cross = tuple(tuple(x * y for y in f_b) for x in weighted)
    own = tuple(tuple(x * y for y in f_n) for x in weighted)
    return cross, own, w * _dot(f_b, f_b), (w > 0).astype(w.dtype)


def _sliding_sum(x: jax.Array, window: jax.Array, longest: int) -> jax.Array:
    """Sum of the `window` elements around each one along the last axis; `longest` is known when compiling."""
    n, half = x.shape[-1], longest // 2
    window = jnp.minimum(window, longest)
    x = jnp.pad(x, [(0, 0)] * (x.ndim - 1) + [(half, half)])
    # Sums of 1, 2, 4, ... elements, put together as the binary digits of `window` say: no cumulative sum, whose
    # differences lose the digits of a long record.
    total, start, length = jnp.zeros_like(x[..., :n]), half - window // 2, 1
    while True:
        digit = window & length
        total = total + jnp.where(digit, jax.lax.dynamic_slice_in_dim(x, start, n, -1), 0)
        start, length = start + digit, 2 * length
        if length > longest:
            return total
        x = x[..., : -length // 2] + x[..., length // 2 :]


def _fit(
    sums: tuple[Matrix, Matrix, jax.Array, jax.Array], prior: Matrix, prior_std: jax.Array, turn: Matrix | None = None
) -> SharedAttitude:
    cross, own, power_b, count = sums
    power_n = _trace(own)
    p = 1 / (prior_std * prior_std)
    weakest = jnp.finfo(power_n.dtype).eps ** (2 / 3) * _safe.sqrt(power_b * power_n)
    p = jnp.maximum(p, 2 * weakest)
    B = _map(lambda b, c: b + 0.5 * p * c, cross, prior)
    C = _nearest(B)
    H_inverse = _inverse(_hessian(B, C), singular=1.0)
    G = _map(lambda x, d: d * (power_n + p) - x, own, IDENTITY)
    covariance = _product(_product(H_inverse, G), H_inverse)
    less = _map(lambda c, d: d * (0.5 / p) - c, covariance, IDENTITY)
    rank = _positive_directions(less)
    left = power_n + power_b - 2 * _inner(C, cross)
    misfit = _safe.sqrt(left / (3 * jnp.maximum(count, 1)))
    if turn is not None:
        C = _product(C, turn)
    return SharedAttitude(C_nb=_stacked(C), covariance=_stacked(covariance), rank=rank, misfit=misfit, valid=rank >= 2)


@jax.custom_jvp
def _nearest(B: Matrix) -> Matrix:
    """`nearest_rotation` of elements; the polynomial for kappa is that of the quartic for s1 + s2 + s3."""
    tiny = jnp.finfo(B[0][0].dtype).tiny
    scale = _inner(B, B)
    scale = jnp.where(scale > tiny, jax.lax.rsqrt(jnp.maximum(scale, tiny)), 1)
    B = _map(lambda b: b * scale, B)
    cofactors = _cofactors(B)
    # By the cofactors of the cofactors: from B itself it would lose its digits squared at small s2 and s3.
    det = _inner(_cofactors(cofactors), B)
    squared = _inner(cofactors, cofactors)
    # kappa = s1 s2 + s1 s3 + s2 s3 and lambda = s1 + s2 + s3, where lambda^2 = |B|^2 + 2 kappa.
    kappa = _largest_root(squared, det)
    largest = jnp.sqrt(1 + 2 * kappa)
    cubed = _product(_product(B, _transpose(B)), B)
    C = _map(lambda b, c, bbb: (1 + kappa) * b + largest * c - bbb, B, cofactors, cubed)
    return _rotation(_refined(B, _quaternion(C)))


def _largest_root(squared: jax.Array, det: jax.Array) -> jax.Array:
    """Largest root kappa of ``kappa^2 = squared + 2 det sqrt(1 + 2 kappa)``, by Newton's method from above."""
    eps = jnp.finfo(det.dtype).eps

    def improve(state: tuple[jax.Array, jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array, jax.Array]:
        kappa, _, count = state
        largest = jnp.sqrt(1 + 2 * kappa)
        slope = 2 * (kappa - det / largest)
        step = (kappa * kappa - squared - 2 * det * largest) / jnp.where(slope > 0, slope, 1)
        step = jnp.where(slope > 0, jnp.maximum(step, 0), 0)
        return kappa - step, jnp.any(step > 4 * eps * jnp.abs(kappa)), count + 1

    # Three or four steps as a rule; where two roots meet, at s2 = -s3, each step halves what is left.
    above = jnp.sqrt(squared + 2 * 3**0.5 * jnp.maximum(det, 0))
    start = above, jnp.array(True), jnp.array(0)
    return jax.lax.while_loop(lambda state: state[1] & (state[2] < 40), improve, start)[0]


@_nearest.defjvp
def _nearest_jvp(primals: tuple[Matrix], tangents: tuple[Matrix]) -> tuple[Matrix, Matrix]:
    (B,), (dB,) = primals, tangents
    C = _nearest(B)
    turn = _apply(_inverse(_hessian(B, C), singular=0.0), _axial(_product(dB, _transpose(C))))
    return C, _turned(turn, C)


def _quaternion(A: Matrix) -> Vector:
    """Quaternion (w, x, y, z), of any length, of a rotation matrix times any positive number."""
    size = jnp.sqrt(_inner(A, A) / 3)
    x, y, z = _axial(A)
    xy, xz, yz = A[0][1] + A[1][0], A[0][2] + A[2][0], A[1][2] + A[2][1]
    a, b, c = A[0][0], A[1][1], A[2][2]
    rows = (
        (size + a + b + c, x, y, z),
        (x, size + a - b - c, xy, xz),
        (y, xy, size - a + b - c, yz),
        (z, xz, yz, size - a - b + c),
    )
    # Each row is the quaternion times 4 of its elements: that of the largest element cannot vanish.
    best: Vector = rows[0]
    square = rows[0][0]
    for i in (1, 2, 3):
        larger = rows[i][i] > square
        best = tuple(jnp.where(larger, new, old) for new, old in zip(rows[i], best, strict=True))
        square = jnp.maximum(square, rows[i][i])
    return best


def _refined(B: Matrix, q: Vector) -> Vector:
    """Two steps of Newton's: what B determines well comes out to the last digit."""

    def step(_: jax.Array, q: Vector) -> Vector:
        C = _rotation(q)
        turn = _apply(_inverse(_hessian(B, C), singular=0.0), _axial(_product(B, _transpose(C))))
        near = _dot(turn, turn) < 0.1
        x, y, z = (jnp.where(near, 0.5 * a, 0) for a in turn)
        w, i, j, k = q
        return (
            w - x * i - y * j - z * k,
            i + x * w + y * k - z * j,
            j + y * w + z * i - x * k,
            k + z * w + x * j - y * i,
        )

    return jax.lax.fori_loop(0, 2, step, q)


def _rotation(q: Vector) -> Matrix:
    """Rotation matrix of a quaternion of any length; the identity for zero."""
    w, x, y, z = q
    squared = w * w + x * x + y * y + z * z
    s = jnp.where(squared > 0, 2 / jnp.where(squared > 0, squared, 1), 0)
    return (
        (1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )


def _hessian(B: Matrix, C: Matrix) -> Matrix:
    """Second derivative of ``-trace(C^T B)`` by a rotation vector in navigation axes."""
    M = _product(B, _transpose(C))
    trace = _trace(M)
    return _map(lambda x, y, d: d * trace - 0.5 * (x + y), M, _transpose(M), IDENTITY)


def _inverse(A: Matrix, singular: float) -> Matrix:
    """Inverse of a symmetric matrix; `singular` times a very large one where it is singular to working precision."""
    adjugate = _cofactors(A)
    det = _dot(A[0], adjugate[0])
    least = jnp.finfo(det.dtype).eps ** 2 * jnp.abs(_trace(A)) ** 3 + jnp.finfo(det.dtype).tiny
    factor = jnp.where(det > least, 1, singular) / jnp.maximum(det, least)
    return _map(lambda x: x * factor, adjugate)


def _positive_directions(A: Matrix) -> jax.Array:
    """Number of positive eigenvalues of a symmetric matrix, by the signs of its leading minors."""
    second = A[0][0] * A[1][1] - A[0][1] * A[1][0]
    third = _dot(A[0], _cofactors(A)[0])
    return jnp.sum(jnp.stack([A[0][0] > 0, A[0][0] * second > 0, second * third > 0]), 0)


def _components(v: jax.Array) -> Vector:
    return tuple(v[..., i] for i in range(3))


def _elements(matrix: jax.Array) -> Matrix:
    return tuple(_components(matrix[..., i, :]) for i in range(3))


def _stacked(matrix: Matrix) -> jax.Array:
    return jnp.stack([jnp.stack(row, -1) for row in matrix], -2)


def _map(function: Callable[..., jax.Array], *matrices: Matrix | tuple[tuple[float, ...], ...]) -> Matrix:
    return tuple(
        tuple(function(*elements) for elements in zip(*rows, strict=True)) for rows in zip(*matrices, strict=True)
    )


def _transpose(matrix: Matrix) -> Matrix:
    return tuple(zip(*matrix, strict=True))


def _dot(u: Vector, v: Vector) -> jax.Array:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u: Vector, v: Vector) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def _apply(matrix: Matrix, v: Vector) -> Vector:
    return tuple(_dot(row, v) for row in matrix)


def _product(A: Matrix, B: Matrix) -> Matrix:
    columns = _transpose(B)
    return tuple(tuple(_dot(row, column) for column in columns) for row in A)


def _cofactors(A: Matrix) -> Matrix:
    return _cross(A[1], A[2]), _cross(A[2], A[0]), _cross(A[0], A[1])


def _trace(A: Matrix) -> jax.Array:
    return A[0][0] + A[1][1] + A[2][2]


def _inner(A: Matrix, B: Matrix) -> jax.Array:
    return _dot(A[0], B[0]) + _dot(A[1], B[1]) + _dot(A[2], B[2])


def _axial(A: Matrix) -> Vector:
    """Vector of A - A^T."""
    return A[2][1] - A[1][2], A[0][2] - A[2][0], A[1][0] - A[0][1]


def _turned(v: Vector, C: Matrix) -> Matrix:
    """``skew(v) @ C``."""
    return _transpose(tuple(_cross(v, column) for column in _transpose(C)))
