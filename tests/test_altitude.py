"""Elevation on a motion whose every quantity is known in closed form, and the errors the formulas are known for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax import altitude
from tests.quick import quick_jit

G = 9.8
T = np.arange(0, 60, 0.01)
GRADE = 0.06


def straight_slope() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Up a uniform slope at a slowly changing speed: specific force (time, 3), speed and elevation."""
    speed = 12 + 4 * np.sin(2 * np.pi * T / 30)
    a = 4 * 2 * np.pi / 30 * np.cos(2 * np.pi * T / 30)
    way = 12 * T + 4 * 30 / (2 * np.pi) * (1 - np.cos(2 * np.pi * T / 30))
    f_b = np.stack([a + G * GRADE, np.zeros_like(T), np.full_like(T, G * np.sqrt(1 - GRADE**2))], -1)
    return f_b, speed, GRADE * way


def test_vertical_acceleration_is_exact_on_a_slope() -> None:
    f_b, _, _ = straight_slope()
    a = f_b[:, 0] - G * GRADE
    h = altitude.vertical_acceleration(np.linalg.norm(f_b, axis=-1), a, 0.0, G)
    np.testing.assert_allclose(h, a * GRADE, atol=1e-13)


def test_vertical_acceleration_is_zero_at_rest_and_in_a_level_turn() -> None:
    assert altitude.vertical_acceleration(G, 0.0, 0.0, G) == 0
    np.testing.assert_allclose(altitude.vertical_acceleration(np.hypot(G, 3.0), 0.0, 3.0, G), 0, atol=1e-14)


def test_both_ways_find_the_elevation() -> None:
    f_b, speed, elevation = straight_slope()
    by_slope, climb = altitude.elevation_by_slope(T, f_b[:, 0], speed, G)
    by_norm, climb_by_norm = altitude.elevation_by_norm(T, f_b, speed, np.zeros_like(T), G, GRADE * speed[0])
    # What the 1 Hz low pass and the trapezoid leave of 50 m: 1e-4 of a 30 s wave
    np.testing.assert_allclose(by_slope, elevation, atol=5e-3)
    np.testing.assert_allclose(by_norm, elevation, atol=5e-3)
    np.testing.assert_allclose(climb, GRADE * speed, atol=2e-3)
    np.testing.assert_allclose(climb_by_norm, climb, atol=2e-3)


def test_norm_way_does_not_see_the_mounting_and_slope_way_does() -> None:
    f_b, speed, _ = straight_slope()
    C = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    level = np.zeros_like(T)
    turned = altitude.elevation_by_norm(T, f_b @ C.T, speed, level, G, 0.0)[0]
    np.testing.assert_allclose(turned, altitude.elevation_by_norm(T, f_b, speed, level, G, 0.0)[0], atol=1e-8)
    assert np.ptp(altitude.elevation_by_slope(T, (f_b @ C.T)[:, 0], speed, G)[0]) > 100


def test_error_growth_of_a_constant_bias() -> None:
    """b t^2 / 2 in the norm way, b / g metres a metre in the slope way."""
    f_b, speed, elevation = straight_slope()
    way = elevation / GRADE
    bias = 0.01
    by_norm = altitude.elevation_by_norm(T, f_b + np.array([0, 0, bias]), speed, np.zeros_like(T), G, GRADE * speed[0])[
        0
    ]
    np.testing.assert_allclose(by_norm[-1] - elevation[-1], bias * T[-1] ** 2 / 2, rtol=0.01)
    by_slope = altitude.elevation_by_slope(T, f_b[:, 0] + bias, speed, G)[0]
    np.testing.assert_allclose(by_slope[-1] - elevation[-1], bias / G * way[-1], rtol=0.01)


def test_the_norm_rectifies_vibration_unless_the_triad_is_filtered_first() -> None:
    """E[h] = (sum of the variances) / 2g, in closed form for a sine: 0.5 m/s^2 RMS makes 0.0128 m/s^2."""
    f_b, speed, elevation = straight_slope()
    shaking = np.sqrt(2) * 0.5 * np.sin(2 * np.pi * 13.0 * T)[:, None] * [0.6, 0.0, 0.8]
    raw = altitude.vertical_acceleration(np.linalg.norm(f_b + shaking, axis=-1), f_b[:, 0] - G * GRADE, 0.0, G)
    still = altitude.vertical_acceleration(np.linalg.norm(f_b, axis=-1), f_b[:, 0] - G * GRADE, 0.0, G)
    np.testing.assert_allclose(np.mean(raw - still), 0.5**2 / (2 * G), rtol=0.01)
    filtered = altitude.elevation_by_norm(T, f_b + shaking, speed, np.zeros_like(T), G, GRADE * speed[0])[0]
    assert np.abs(filtered - elevation).max() < 0.02


def test_horizontal_acceleration_is_flagged_where_imaginary() -> None:
    x, valid = altitude.horizontal_acceleration([5.0, -5.0, 3.0, 0.0], [3.0, 3.0, 5.0, 0.0])
    assert x.tolist() == [4.0, -4.0, 0.0, 0.0] and valid.tolist() == [True, True, False, True]
    gradient = jax.jacrev(lambda a, h: altitude.horizontal_acceleration(a, h)[0], argnums=(0, 1))
    for a, h in ((3.0, 3.0), (0.0, 0.0), (1.0, 2.0)):
        assert np.isfinite(jnp.asarray(gradient(a, h))).all()


def test_horizontal_distance() -> None:
    _, speed, elevation = straight_slope()
    way = elevation / GRADE
    distance = altitude.horizontal_distance(T, speed, GRADE * speed)
    np.testing.assert_allclose(distance, way * np.sqrt(1 - GRADE**2), atol=1e-3)
    # straight up, or a climb faster than the speed: nothing horizontal, and a gradient
    stuck = jax.grad(lambda v: altitude.horizontal_distance(T[:7], v, 2.0 * jnp.ones(7)).sum())(jnp.full(7, 2.0))
    assert np.isfinite(stuck).all()


def test_gradients_of_the_pipelines_agree_with_differences() -> None:
    f_b, speed, _ = straight_slope()
    t, f_b, speed = T[:500], jnp.asarray(f_b[:500]), speed[:500]

    def end(bias: jax.Array) -> jax.Array:
        return altitude.elevation_by_norm(t, f_b - bias, speed, jnp.zeros(500), G, 0.1)[0][-1]

    gradient = quick_jit(jax.grad(end))(np.zeros(3))
    value = quick_jit(end)
    numeric = [(value(1e-5 * e) - value(-1e-5 * e)) / 2e-5 for e in np.eye(3)]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6)


def test_too_few_samples_and_wrong_shapes_are_named() -> None:
    with pytest.raises(ValueError, match="at least 3 samples"):
        altitude.elevation_by_slope([0.0, 0.1], [0.0, 0.0], [1.0, 1.0], G)
    with pytest.raises(ValueError, match=r"f_b must have shape \(\.\.\., 7, 3\), got \(7, 2\)"):
        altitude.elevation_by_norm(T[:7], np.zeros((7, 2)), np.zeros(7), np.zeros(7), G, 0.0)
