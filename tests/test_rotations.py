"""Rotations: group laws, scipy as the oracle, and the edges where other libraries return NaN."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from altijax import rotations as r

TOLERANCE = 1e-12
ANGLES = np.array([0, 1e-300, 1e-12, 1e-8, 1e-4, 0.1, 0.2236, 1.0, 3.0, np.pi - 1e-4, np.pi - 1e-9, np.pi])
AXES = np.vstack([np.eye(3), -np.eye(3), Rotation.random(20, rng=np.random.default_rng(1)).as_matrix()[:, 0]])
ROTVECS = (ANGLES[:, None, None] * AXES).reshape(-1, 3)
EULERS = np.stack(
    np.meshgrid(
        [-np.pi, -2.0, 0.0, 1e-9, 0.5, np.pi],
        [-np.pi / 2, -1.5, -1e-9, 0.0, 0.7, np.pi / 2 - 1e-7, np.pi / 2],
        [-3.0, 0.0, 1e-9, 1.2, np.pi],
        indexing="ij",
    ),
    -1,
).reshape(-1, 3)
MATRICES = np.concatenate([Rotation.from_rotvec(ROTVECS).as_matrix(), np.asarray(r.euler_to_matrix(EULERS))])


def test_matrices_are_rotations() -> None:
    for C in (r.rotvec_to_matrix(ROTVECS), r.euler_to_matrix(EULERS), r.quaternion_to_matrix([[0.3, -2, 0.1, 5]])):
        np.testing.assert_allclose(C @ jnp.swapaxes(C, -1, -2), np.broadcast_to(np.eye(3), C.shape), atol=TOLERANCE)
        np.testing.assert_allclose(jnp.linalg.det(C), 1, atol=TOLERANCE)


def test_euler_angles_are_scipys() -> None:
    """The conventions page says how: ZYX of yaw, minus pitch, roll."""
    roll, pitch, yaw = EULERS.T
    expected = Rotation.from_euler("ZYX", np.stack([yaw, -pitch, roll], -1)).as_matrix()
    np.testing.assert_allclose(r.euler_to_matrix(EULERS), expected, atol=TOLERANCE)


def test_euler_signs() -> None:
    """Nose up lifts the x axis, right side down lowers the right (-y) side, yaw turns East towards North."""
    assert r.euler_to_matrix([0.0, 0.1, 0.0])[2, 0] > 0
    assert r.euler_to_matrix([0.1, 0.0, 0.0])[2, 1] > 0
    assert r.euler_to_matrix([0.0, 0.0, 0.1])[1, 0] > 0


def test_euler_is_the_transpose_of_chalkos_matrix() -> None:
    """Eq. (2) of [chalko2010] as printed: Rx(phi) Ry(theta) Rz(psi)."""
    phi, theta, psi = 0.3, -0.4, 2.0
    c, s = np.cos, np.sin
    x = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
    y = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    z = np.array([[c(psi), s(psi), 0], [-s(psi), c(psi), 0], [0, 0, 1]])
    np.testing.assert_allclose(r.euler_to_matrix([phi, theta, psi]), (x @ y @ z).T, atol=TOLERANCE)


def test_euler_round_trip_keeps_the_matrix_at_the_poles_too() -> None:
    back = r.euler_to_matrix(r.matrix_to_euler(MATRICES))
    np.testing.assert_allclose(back, MATRICES, atol=TOLERANCE)


def test_euler_ranges_and_regular_values() -> None:
    euler = np.asarray(r.matrix_to_euler(MATRICES))
    assert (np.abs(euler) <= np.array([np.pi, np.pi / 2, np.pi])).all()
    regular = EULERS[np.abs(EULERS[:, 1]) < 1.51]
    found = np.asarray(r.matrix_to_euler(r.euler_to_matrix(regular)))
    np.testing.assert_allclose(np.asarray(r.wrap_angle(found - regular)), 0, atol=1e-13 / np.cos(1.51))


def test_yaw_is_zero_at_the_pole() -> None:
    up = np.array([[0.0, -0.6, 0.8], [0.0, 0.8, 0.6], [-1.0, 0.0, 0.0]])[:, [0, 1, 2]]
    up[2, 0] = 1.0
    up[:, 2] = np.cross(up[:, 0], up[:, 1])
    roll, pitch, yaw = r.matrix_to_euler(up)
    assert (pitch, yaw) == (np.pi / 2, 0)
    np.testing.assert_allclose(r.euler_to_matrix([roll, pitch, yaw]), up, atol=TOLERANCE)


def test_rotation_vectors_are_scipys() -> None:
    np.testing.assert_allclose(r.rotvec_to_matrix(ROTVECS), Rotation.from_rotvec(ROTVECS).as_matrix(), atol=TOLERANCE)
    long = np.random.default_rng(2).normal(size=(50, 3)) * 20
    np.testing.assert_allclose(r.rotvec_to_matrix(long), Rotation.from_rotvec(long).as_matrix(), atol=TOLERANCE)


def test_exp_and_log_are_inverse() -> None:
    np.testing.assert_allclose(r.rotvec_to_matrix(r.matrix_to_rotvec(MATRICES)), MATRICES, atol=TOLERANCE)
    below = ROTVECS[np.linalg.norm(ROTVECS, axis=1) < 3.1]
    np.testing.assert_allclose(r.matrix_to_rotvec(r.rotvec_to_matrix(below)), below, atol=TOLERANCE)


def test_small_rotation_vectors_keep_their_digits() -> None:
    tiny = 1e-200 * AXES
    np.testing.assert_allclose(r.matrix_to_rotvec(r.rotvec_to_matrix(tiny)), tiny, rtol=1e-13)


def test_quaternions_are_scipys() -> None:
    found = np.asarray(r.matrix_to_quaternion(MATRICES))
    expected = Rotation.from_matrix(MATRICES).as_quat(scalar_first=True)
    np.testing.assert_allclose(np.abs(np.sum(found * expected, -1)), 1, atol=TOLERANCE)
    assert (found[:, 0] >= 0).all()
    np.testing.assert_allclose(r.quaternion_to_matrix(found), MATRICES, atol=TOLERANCE)
    np.testing.assert_allclose(r.quaternion_to_matrix(-3.7 * found), MATRICES, atol=TOLERANCE)
    np.testing.assert_array_equal(r.quaternion_to_matrix(jnp.zeros(4)), np.eye(3))


def test_skew_is_the_cross_product_and_vee_its_inverse() -> None:
    a, b = np.random.default_rng(3).normal(size=(2, 5, 3))
    np.testing.assert_allclose(jnp.einsum("...ij,...j->...i", r.skew(a), b), np.cross(a, b), atol=1e-15)
    np.testing.assert_allclose(r.vee(r.skew(a) + np.ones((3, 3))), a, atol=1e-15)


def test_headings() -> None:
    """North is heading 0 and yaw pi/2; the two conversions undo each other, and no heading is 2 pi."""
    np.testing.assert_allclose(
        r.yaw_to_heading([np.pi / 2, 0.0, -np.pi / 2, np.pi]), [0, np.pi / 2, np.pi, 1.5 * np.pi]
    )
    yaw = np.linspace(-9, 9, 101)
    back = r.heading_to_yaw(r.yaw_to_heading(yaw))
    np.testing.assert_allclose(back, r.wrap_angle(yaw), atol=TOLERANCE)
    assert r.yaw_to_heading(np.pi / 2 + 1e-17) == 0 and r.yaw_to_heading(np.nextafter(np.pi / 2, 4)) < 2 * np.pi
    assert r.wrap_angle(-np.pi) == np.pi and r.wrap_angle(np.pi) == np.pi and r.wrap_angle(3 * np.pi) == np.pi


def test_interpolation_is_slerp_and_holds_the_ends() -> None:
    t_knots = np.array([0.0, 0.5, 2.0, 2.1, 3.0])
    C_knots = Rotation.random(5, rng=np.random.default_rng(4)).as_matrix()
    t = np.linspace(0, 3, 61)
    expected = Slerp(t_knots, Rotation.from_matrix(C_knots))(t).as_matrix()
    np.testing.assert_allclose(r.interpolate_rotations(t, t_knots, C_knots), expected, atol=TOLERANCE)
    ends = r.interpolate_rotations([-1.0, 4.0], t_knots, C_knots)
    np.testing.assert_allclose(ends, C_knots[[0, -1]], atol=TOLERANCE)


def test_one_knot_is_too_few() -> None:
    with pytest.raises(ValueError, match="t_knots must have at least 2 knots, got 1"):
        r.interpolate_rotations([0.0], [0.0], np.eye(3)[None])


CONVERSIONS: list[tuple[Callable, np.ndarray]] = [
    (r.rotvec_to_matrix, ROTVECS),
    (r.euler_to_matrix, EULERS),
    (r.matrix_to_rotvec, MATRICES),
    (r.matrix_to_euler, MATRICES),
    (r.matrix_to_quaternion, MATRICES),
    (lambda v: r.matrix_to_rotvec(r.rotvec_to_matrix(v)), ROTVECS),
    (lambda e: r.matrix_to_euler(r.euler_to_matrix(e)), EULERS),
]
AT_THE_POLE = np.abs(EULERS[:, 1]) > np.pi / 2 - 1e-6


@pytest.mark.parametrize(("convert", "inputs"), CONVERSIONS)
def test_first_and_second_derivatives_are_finite_everywhere(convert: Callable, inputs: np.ndarray) -> None:
    """At the identity, at 180 degrees and at the poles, under jit and vmap, in forward and reverse mode."""
    first = jax.jit(jax.vmap(jax.jacfwd(convert)))(inputs)
    reverse = jax.jit(jax.vmap(jax.jacrev(convert)))(inputs)
    assert np.isfinite(first).all() and np.isfinite(reverse).all()
    if inputs is EULERS:
        # There roll and yaw have no derivative of their own: their rounding errors are divided by a cosine of 1e-17.
        first, reverse = first[~AT_THE_POLE], reverse[~AT_THE_POLE]
    np.testing.assert_allclose(reverse, first, rtol=1e-9, atol=1e-9 * np.abs(first).max())
    if convert is r.rotvec_to_matrix:
        assert np.isfinite(jax.jit(jax.vmap(jax.hessian(convert)))(inputs)).all()


def test_derivative_at_the_identity_is_exact() -> None:
    """d exp(r) = skew(dr) there, and the logarithm undoes it: the point where jax.scipy's Rotation returns NaN."""
    jacobian = jax.jacrev(r.rotvec_to_matrix)(jnp.zeros(3))
    np.testing.assert_allclose(jnp.moveaxis(jacobian, -1, 0), r.skew(jnp.eye(3)), atol=1e-15)
    loop = jax.jacrev(lambda v: r.matrix_to_rotvec(r.rotvec_to_matrix(v)))(jnp.zeros(3))
    np.testing.assert_allclose(loop, np.eye(3), atol=1e-15)


def test_derivatives_agree_with_differences() -> None:
    v = np.array([0.3, -1.1, 0.6])
    step = 1e-6
    for convert in (r.rotvec_to_matrix, lambda x: r.matrix_to_euler(r.rotvec_to_matrix(x))):
        numeric = np.stack([(convert(v + step * e) - convert(v - step * e)) / (2 * step) for e in np.eye(3)], -1)
        np.testing.assert_allclose(jax.jacfwd(convert)(v), numeric, atol=1e-9)
