"""The rotation spline against its knots, exact motions, scipy's spline and its own derivative."""

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from altijax.rotation_splines import rotation_spline
from altijax.rotations import interpolate_rotations, matrix_to_rotvec, rotvec_to_matrix, vee


def tumbling(t):
    """A motion about all axes, through more than a turn."""
    return Rotation.from_euler(
        "ZYX", np.stack([2.0 * t + 0.5 * np.sin(1.1 * t), 0.8 * np.sin(0.9 * t), 0.6 * np.cos(1.3 * t)], -1)
    )


def rate(t, h=1e-5):
    return (tumbling(t - h).inv() * tumbling(t + h)).as_rotvec() / (2 * h)


def errors(C, w, t):
    attitude = np.linalg.norm(matrix_to_rotvec(np.swapaxes(tumbling(t).as_matrix(), -1, -2) @ C), axis=-1)
    return attitude.max(), np.linalg.norm(w - rate(t), axis=-1).max()


KNOTS = np.linspace(0, 6, 25) + 0.05 * np.sin(np.arange(25))
FINE = np.linspace(0.0, 5.9, 601)


def test_spline_passes_through_its_knots_and_turns_as_its_rate_says():
    C_knots = tumbling(KNOTS).as_matrix()
    np.testing.assert_allclose(rotation_spline(KNOTS, KNOTS, C_knots)[0], C_knots, atol=1e-13)
    h = 1e-5
    inner = FINE + 2 * h
    C, w = rotation_spline(inner, KNOTS, C_knots)
    before, after = (rotation_spline(inner + x, KNOTS, C_knots)[0] for x in (-h, h))
    np.testing.assert_allclose(w, vee(np.swapaxes(C, -1, -2) @ (after - before)) / (2 * h), atol=1e-3)
    middle = np.abs(inner[:, None] - KNOTS).min(1) > 2 * h
    np.testing.assert_allclose(w[middle], vee(np.swapaxes(C, -1, -2) @ (after - before))[middle] / (2 * h), atol=1e-8)


def test_rates_are_continuous_at_the_knots():
    C_knots = tumbling(KNOTS).as_matrix()
    before, after = (rotation_spline(KNOTS[1:-1] + x, KNOTS, C_knots)[1] for x in (-1e-9, 1e-9))
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_error_falls_with_the_third_power_of_the_spacing():
    """scipy's spline, of continuous accelerations, is of the fourth: where motions are that smooth it is better."""
    found = []
    for n in (13, 25, 49, 97):
        knots = np.linspace(-0.5, 6.5, n)
        found.append(errors(*rotation_spline(FINE, knots, tumbling(knots).as_matrix()), FINE))
    attitude, turn = np.array(found).T
    assert (attitude[:-1] / attitude[1:] > 7).all()
    assert (turn[:-1] / turn[1:] > 3.5).all()
    theirs = RotationSpline(knots, tumbling(knots))(FINE).as_matrix()
    apart = np.swapaxes(theirs, -1, -2) @ rotation_spline(FINE, knots, tumbling(knots).as_matrix())[0]
    assert np.linalg.norm(matrix_to_rotvec(apart), axis=-1).max() < 1e-4
    slerp = errors(interpolate_rotations(FINE, knots, tumbling(knots).as_matrix()), np.zeros(3), FINE)[0]
    assert attitude[-1] < 0.1 * slerp


def test_turning_at_a_constant_rate_is_exact():
    w = np.array([0.7, -1.1, 2.0])
    start = Rotation.random(rng=0).as_matrix()
    C, found = rotation_spline(FINE, KNOTS, start @ rotvec_to_matrix(KNOTS[:, None] * w))
    np.testing.assert_allclose(C, start @ rotvec_to_matrix(FINE[:, None] * w), atol=1e-13)
    np.testing.assert_allclose(found, np.tile(w, (FINE.size, 1)), atol=1e-12)


def test_spline_turns_with_its_knots():
    R, S = Rotation.random(2, rng=1).as_matrix()
    C_knots = tumbling(KNOTS).as_matrix()
    C, w = rotation_spline(FINE, KNOTS, C_knots)
    D, u = rotation_spline(FINE, KNOTS, R @ C_knots @ S)
    np.testing.assert_allclose(D, R @ C @ S, atol=1e-13)
    np.testing.assert_allclose(u, w @ S, atol=1e-12)


def test_outside_and_at_rest():
    C_knots = np.tile(np.eye(3), (4, 1, 1))
    t_knots = np.arange(4.0)
    t = np.array([-1.0, 0.5, 2.0, 9.0])
    assert np.isfinite(jax.jacrev(lambda C: rotation_spline(t, t_knots, C)[1])(C_knots)).all()
    moving = tumbling(t_knots).as_matrix()
    C, w = map(np.asarray, rotation_spline(t, t_knots, moving))
    np.testing.assert_allclose(C[[0, 3]], moving[[0, 3]], atol=1e-13)
    assert not w[[0, 3]].any()


def test_two_knots_are_too_few():
    with pytest.raises(ValueError, match="t_knots must have at least 3 knots, got 2"):
        rotation_spline([0.5], [0.0, 1.0], np.tile(np.eye(3), (2, 1, 1)))
