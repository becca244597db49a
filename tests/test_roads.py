"""Roads and speed profiles: quadrature and the papers' printed lengths as oracles, and derivatives of closed forms."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from altijax import roads
from altijax.roads import Road, SpeedProfile

# Compiled whole, and with few shapes, these tests take a fraction of the time.
progress = jax.jit(jax.vmap(roads.progress, (None, 0)))
road_curve = jax.jit(jax.vmap(roads.road_curve, (None, 0)))
slope_road = jax.jit(roads.slope_road)
rest_to_rest = jax.jit(roads.rest_to_rest)
circular_road = jax.jit(roads.circular_road)
winding_road = jax.jit(roads.winding_road)

# A stop on the way, a change of speed, uneven speed.
STOPS = SpeedProfile(
    start=np.array([1.0, 18.0, 24.0]),
    stop=np.array([10.0, 32.0, 28.0]),
    ramp=np.array([5.0, 6.0, 3.0]),
    speed=np.array([12.0, 14.0, 5.0]),
    modulation=np.array([1.5, 0.3]),
    wavenumber=np.array([0.1, 0.2]),
    phase=np.array([0.7, -2.0]),
)
# A figure of eight that climbs and falls, canted.
EIGHT = Road(
    direction=np.array([0.1, 0.0, 0.02]),
    amplitude=np.array([[0.0, 120.0, 0.0], [60.0, 0.0, 0.0], [0.0, 0.0, 12.0], [0.0, 0.0, 0.0]]),
    wavenumber=np.array([0.01, 0.02, 0.02, 0.0]),
    phase=np.array([0.0, 0.3, 1.0, np.pi / 2]),
    cant=np.array([0.1, 0.0, 0.05, 0.052]),
    roll_gain=np.asarray(-0.008),
)


def test_profile_is_smooth_and_never_goes_back() -> None:
    """Rate and three derivatives are continuous at the ends of the ramps, where a value is taken from one side."""

    def with_derivatives(order: int, t: jax.Array) -> tuple:
        if order == 0:
            return (roads.progress(STOPS, t),)
        lower, rates = jax.jvp(partial(with_derivatives, order - 1), (t,), (jnp.ones_like(t),))
        return (*lower, rates[-1])

    @jax.jit
    @jax.vmap
    def derivatives(t: jax.Array) -> jax.Array:
        return jnp.stack(with_derivatives(4, t))

    ends = np.concatenate([STOPS.start, STOPS.start + STOPS.ramp, STOPS.stop, STOPS.stop + STOPS.ramp])
    times = np.linspace(0.0, 40.0, 401)
    every = np.asarray(derivatives(np.concatenate([ends, ends - 1e-9, ends + 1e-9, times])))
    at, before, after, rate = np.split(every, 12 * np.arange(1, 4))
    np.testing.assert_allclose(before, at, rtol=0, atol=1e-5)
    np.testing.assert_allclose(after, at, rtol=0, atol=1e-5)
    assert np.min(rate[:, 1]) == 0 and np.max(rate[:, 1]) > 10


@pytest.mark.parametrize("modulation", [[0.0, 0.0], [15.0, 3.0]])
def test_legs_make_speed_times_duration_of_progress(modulation: list[float]) -> None:
    """Whole waves of an uneven speed leave the distance as it is."""
    legs = STOPS.speed @ (STOPS.stop - STOPS.start)
    waves = 2 * np.pi / legs * np.array([1.0, 2.0])
    profile = replace(STOPS, modulation=np.array(modulation), wavenumber=waves)
    first_leg, end = np.asarray(progress(profile, np.array([17.0, 40.0])))
    assert end == pytest.approx(legs, rel=1e-14)
    assert (abs(first_leg - 108.0) < 1e-12) == (modulation[0] == 0)


@jax.jit
@partial(jax.vmap, in_axes=(None, None, 0))
def velocity(road: Road, profile: SpeedProfile, t: jax.Array) -> jax.Array:
    def position(t: jax.Array) -> jax.Array:
        return roads.road_curve(road, roads.progress(profile, t))[0]

    return jax.jvp(position, (t,), (jnp.ones_like(t),))[1]


@pytest.mark.parametrize("rise", [5.459, -5.459])
def test_shirai_outdoor_slope(rise: float) -> None:
    """The printed way, horizontal distance and level difference, and the slopes that they imply."""
    duration, ramp = 118.6, 3.0
    x, w = np.polynomial.legendre.leggauss(200)
    pieces = np.array([[0, ramp], [ramp, duration - ramp], [duration - ramp, duration]])
    t = (pieces.mean(1)[:, None] + np.diff(pieces) / 2 * x).ravel()
    dt = (np.diff(pieces) / 2 * w).ravel()
    still = np.array([-1.0, 0.0, duration, 200.0])
    road, profile = slope_road(163.969, 163.824, rise), rest_to_rest(163.824, duration, ramp)
    both = np.asarray(velocity(road, profile, np.concatenate([t, still])))
    v = both[: t.size]
    assert dt @ np.linalg.norm(v, axis=-1) == pytest.approx(163.969, abs=1e-9)
    assert dt @ np.hypot(v[:, 0], v[:, 1]) == pytest.approx(163.824, abs=1e-9)
    assert dt @ v[:, 2] == pytest.approx(rise, abs=1e-9)
    slope = v[:, 2] / v[:, 0]
    assert np.sqrt(dt @ (slope**2 * v[:, 0]) / 163.824) == pytest.approx(0.0421, abs=5e-5)
    assert dt @ (slope * v[:, 0]) / 163.824 == pytest.approx(np.sign(rise) * 0.0333, abs=5e-5)
    np.testing.assert_allclose(both[t.size :], 0, atol=1e-13)


def test_slope_road_solves_steep_slopes_too() -> None:
    road = slope_road(130.0, 100.0, 20.0)
    swing = np.abs(float(road.amplitude[0, 2]) * float(road.wavenumber[0]))
    way = quad(lambda u: np.sqrt(1 + (0.2 - swing * np.cos(0.02 * np.pi * u)) ** 2), 0, 100)[0]
    assert way == pytest.approx(130.0, abs=1e-6)


def test_slope_road_descends_as_it_climbs() -> None:
    up, down = slope_road(163.969, 163.824, 5.459), slope_road(163.969, 163.824, -5.459)
    np.testing.assert_allclose(down.direction, up.direction * np.array([1, 0, -1]))
    np.testing.assert_allclose(down.amplitude, -np.asarray(up.amplitude))


def test_level_passage() -> None:
    road = slope_road(10.012, 10.012, 0.0)
    u = progress(rest_to_rest(10.012, 23.1, 2.0), np.array([0.0, 5.0, 23.1]))
    position = road_curve(road, u)[0]
    np.testing.assert_allclose(position, [[0, 0, 0], [10.012 / 21.1 * 4, 0, 0], [10.012, 0, 0]], atol=1e-13)
    np.testing.assert_array_equal(position[:, 2], 0)


def test_curve_starts_at_the_origin_and_has_the_derivatives_it_says() -> None:
    u = np.linspace(0.0, 700.0, 7)

    @jax.jit
    @jax.vmap
    def by_differentiation(u: jax.Array) -> tuple:
        def position(u: jax.Array) -> jax.Array:
            return roads.road_curve(EIGHT, u)[0]

        def tangent(u: jax.Array) -> jax.Array:
            return jax.jvp(position, (u,), (jnp.ones_like(u),))[1]

        return position(u), *jax.jvp(tangent, (u,), (jnp.ones_like(u),))

    position, tangent, bend, cant = road_curve(EIGHT, u)
    np.testing.assert_array_equal(position[0], 0)
    for got, expected in zip((position, tangent, bend), by_differentiation(u), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(cant, 0.052 + 0.1 * np.sin(0.01 * u) + 0.05 * np.sin(0.02 * u + 1.0), rtol=1e-12)


@pytest.mark.parametrize("radius", [40.0, -25.0])
def test_circular_road(radius: float) -> None:
    """Sets out to the East and bends to the left, by 1 / radius, at constant grade and cant."""
    u = np.linspace(0.0, 200.0, 7)
    position, tangent, bend, cant = road_curve(circular_road(radius, 0.1, 0.05), u)
    sin, cos, one = np.sin(u / radius), np.cos(u / radius), np.ones(7)
    np.testing.assert_allclose(position, np.stack([radius * sin, radius * (1 - cos), 0.1 * u], -1), atol=1e-12)
    np.testing.assert_allclose(tangent, np.stack([cos, sin, 0.1 * one], -1), atol=1e-14)
    np.testing.assert_allclose(bend, np.stack([-sin, cos, 0 * one], -1) / radius, atol=1e-15)
    np.testing.assert_allclose(cant, 0.05, rtol=1e-14)


def test_winding_road_swings_and_is_canted_inward() -> None:
    road = winding_road([0.6], [300.0], [0.0], [0.08], [200.0], [0.0], 20.0)
    # On the East axis where its bends begin, or in the middle of a right, a left and a right bend.
    u = np.array([300.0, 375.0, 450.0, 525.0, 600.0, 675.0, 350.0])
    position, tangent, bend, cant = (np.asarray(x) for x in road_curve(road, u))
    yaw = np.arctan2(tangent[:6, 1], tangent[:6, 0])
    np.testing.assert_allclose(yaw, [0.6, 0, -0.6, 0, 0.6, 0], atol=1e-14)
    curvature = np.tan(0.6) * 2 * np.pi / 300
    inward = np.array([0, 1, 0, -1, 0, 1])
    np.testing.assert_allclose(cant[:6], 20 * curvature * inward, atol=1e-14)
    np.testing.assert_allclose(bend[:6, 1], -curvature * inward, atol=1e-14)
    np.testing.assert_allclose(position[[0, 2, 4], 1], 0, atol=1e-12)
    # At 350 m on a hill's top; at 300 m and 600 m going down and up at the steepest.
    np.testing.assert_allclose(tangent[[6, 0, 4], 2], [0, -0.08, 0.08], atol=1e-14)


def test_lengths_of_a_slope_have_gradients() -> None:
    @jax.jit
    @jax.vmap
    def top(lengths: jax.Array) -> jax.Array:
        return roads.slope_road(*lengths).amplitude[0, 2]

    lengths, step = np.array([163.969, 163.824, 5.459]), 1e-5
    plus, minus = np.split(np.asarray(top(lengths + step * np.concatenate([np.eye(3), -np.eye(3)]))), 2)
    gradient = jax.jit(jax.grad(lambda lengths: roads.slope_road(*lengths).amplitude[0, 2]))
    np.testing.assert_allclose(gradient(lengths), (plus - minus) / (2 * step), rtol=1e-4)
    assert np.isfinite(gradient(np.array([10.0, 10.0, 0.0]))).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda one: roads.slope_road(164 * one, 163 * one, 5 * one),
        lambda one: roads.circular_road(20 * one, 0 * one, 0 * one),
        lambda one: roads.winding_road(*[0.1 * jnp.full(2, one)] * 3, *[0.1 * jnp.full(3, one)] * 3, one),
        lambda one: roads.rest_to_rest(10 * one, 20 * one, 2 * one),
    ],
    ids=["slope_road", "circular_road", "winding_road", "rest_to_rest"],
)
def test_constructors_keep_single_precision(make: Callable[[jax.Array], object]) -> None:
    leaves = jax.tree.leaves(jax.eval_shape(make, jnp.float32(1)))
    assert {leaf.dtype for leaf in leaves} == {jnp.dtype(jnp.float32)}


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("t", lambda: roads.progress(STOPS, np.zeros(7))),
        ("u", lambda: roads.road_curve(EIGHT, np.zeros(7))),
        ("way", lambda: roads.slope_road(np.zeros(7), 1.0, 1.0)),
        ("horizontal", lambda: roads.slope_road(1.0, np.zeros(7), 1.0)),
        ("rise", lambda: roads.slope_road(1.0, 1.0, np.zeros(7))),
        ("radius", lambda: roads.circular_road(np.zeros(7), 0.0, 0.0)),
        ("grade", lambda: roads.circular_road(1.0, np.zeros(7), 0.0)),
        ("cant", lambda: roads.circular_road(1.0, 0.0, np.zeros(7))),
        ("bend_phase", lambda: roads.winding_road([0.1], [9.0], [0.0, 1.0], [0.1], [9.0], [0.0], 0.0)),
        ("hill_length", lambda: roads.winding_road([0.1], [9.0], [0.0], [0.1], [9.0, 8.0], [0.0], 0.0)),
        ("superelevation", lambda: roads.winding_road([0.1], [9.0], [0.0], [0.1], [9.0], [0.0], [0.0])),
        ("distance", lambda: roads.rest_to_rest(np.zeros(7), 1.0, 1.0)),
        ("duration", lambda: roads.rest_to_rest(1.0, np.zeros(7), 1.0)),
        ("ramp", lambda: roads.rest_to_rest(1.0, 1.0, np.zeros(7))),
    ]
    + [
        (f"road.{name}", partial(lambda name: roads.road_curve(replace(EIGHT, **{name: np.zeros(7)}), 0.0), name))
        for name in ("direction", "amplitude", "wavenumber", "phase", "cant")
    ]
    + [
        (f"profile.{name}", partial(lambda name: roads.progress(replace(STOPS, **{name: np.zeros((2, 5))}), 0.0), name))
        for name in ("start", "stop", "ramp", "speed", "modulation", "wavenumber", "phase")
    ],
)
def test_wrong_shapes_are_named(name: str, call: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must have shape .*, got "):
        jax.eval_shape(call)
