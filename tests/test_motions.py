"""Exact motions: quadrature and scipy's rotations as oracles, the papers' sensor equations, and closed forms."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache, partial
from operator import itemgetter

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from scipy.spatial.transform import Rotation

from altijax import motions, roads
from altijax.motions import Readings, Windsurfer, flight_pose, ideal_readings, road_pose, windsurfer_pose
from altijax.roads import Road, SpeedProfile
from altijax.rotations import matrix_to_euler
from tests.quick import quick_jit

# Compiled whole, and with few shapes, these tests take a fraction of the time.
circular_road = quick_jit(roads.circular_road)
gybing_windsurfer = quick_jit(motions.gybing_windsurfer)

G = 9.79
WIND = np.array([3.0, -4.0, 0.5])

# Two bends and two hills of incommensurate lengths, canted, on soft springs.
HILLS = replace(
    quick_jit(roads.winding_road)([0.5, 0.3], [210.0, 97.0], [0.4, 2.0], [0.06, 0.04], [170.0, 83.0], [0.0, 1.0], 4.0),
    roll_gain=np.asarray(0.012),
)
# A figure of eight that climbs and falls by up to 17 %, canted by 3 degrees throughout.
EIGHT = Road(
    direction=np.zeros(3),
    amplitude=np.array([[0.0, 120.0, 0.0], [60.0, 0.0, 0.0], [0.0, 0.0, 12.0], [0.0, 0.0, 0.0]]),
    wavenumber=np.array([0.01, 0.02, 0.02, 0.0]),
    phase=np.array([0.0, 0.3, 1.0, np.pi / 2]),
    cant=np.array([0.1, 0.0, 0.05, 0.052]),
    roll_gain=np.asarray(-0.008),
)
# A stop on the way, a change of speed, uneven speed. The ramps start and end at multiples of PANEL: in between, all
# motions are analytic.
STOPS = SpeedProfile(
    start=np.array([1.0, 18.0, 24.0]),
    stop=np.array([10.0, 32.0, 28.0]),
    ramp=np.array([5.0, 6.0, 3.0]),
    speed=np.array([12.0, 14.0, 5.0]),
    modulation=np.array([1.5, 0.3]),
    wavenumber=np.array([0.1, 0.2]),
    phase=np.array([0.7, -2.0]),
)
PANEL, PANELS, STEPS = 0.1, 400, 64
EDGES = PANEL * np.arange(PANELS + 1)
# Gauss-Legendre points, two in each of the STEPS of a panel.
NODES = PANEL / STEPS * (np.arange(PANELS * STEPS)[:, None] + 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)).ravel()
TIMES = np.concatenate([EDGES, NODES])

SURFER = gybing_windsurfer(9.0, 1.0, 60.0, 39.5, 19.0)
ROADS = {
    "hills": HILLS,
    "eight": EIGHT,
    "slope": quick_jit(roads.slope_road)(163.969, 163.824, -5.459),
    "helix": circular_road(-25.0, 0.08, 0.1),
}
FLIGHT = (
    replace(EIGHT, amplitude=5 * EIGHT.amplitude, wavenumber=EIGHT.wavenumber / 5),
    replace(STOPS, speed=3 * STOPS.speed, wavenumber=STOPS.wavenumber / 3),
    WIND,
    np.asarray(G),
)
MOTIONS = [*ROADS, "flight", "windsurfer"]


def of_equal_shapes(road: Road, profile: SpeedProfile) -> tuple[Road, SpeedProfile]:
    """The same with terms of amplitude zero, legs of speed zero and no weak types: one compilation serves all."""

    def padded(record: object, size: int, **values: float) -> dict[str, np.ndarray]:
        leaves = {name: np.asarray(getattr(record, name)) for name in values}
        widths = {name: [(0, size - len(leaf))] + [(0, 0)] * (leaf.ndim - 1) for name, leaf in leaves.items()}
        return {name: np.pad(leaves[name], widths[name], constant_values=value) for name, value in values.items()}

    terms = padded(road, 4, amplitude=0.0, wavenumber=0.0, phase=0.0, cant=0.0)
    legs = padded(profile, 3, start=0.0, stop=0.0, ramp=1.0, speed=0.0)
    waves = padded(profile, 2, modulation=0.0, wavenumber=0.0, phase=0.0)
    return (
        replace(road, direction=np.asarray(road.direction), roll_gain=np.asarray(road.roll_gain), **terms),
        replace(profile, **legs, **waves),
    )


@jax.jit
def road_readings(road: Road, profile: SpeedProfile, t: np.ndarray) -> Readings:
    return ideal_readings(partial(road_pose, road, profile), t, G)


@quick_jit
def flight_readings(flight: tuple, t: np.ndarray) -> Readings:
    return ideal_readings(partial(flight_pose, *flight), t, G)


@quick_jit
def windsurfer_readings(windsurfer: Windsurfer, t: np.ndarray) -> Readings:
    return ideal_readings(partial(windsurfer_pose, windsurfer), t, G)


@jax.jit
def flight_poses(flight: tuple, t: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jax.vmap(partial(flight_pose, *flight))(t)


@jax.jit
def windsurfer_poses(windsurfer: Windsurfer, t: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jax.vmap(partial(windsurfer_pose, windsurfer))(t)


@jax.jit
def road_readings_and_rates(road: Road, profile: SpeedProfile, t: np.ndarray) -> tuple[Readings, tuple]:
    """Readings, and ((euler, speed), derivatives of both)."""

    def euler_and_speed(t: jax.Array) -> tuple[jax.Array, jax.Array]:
        (_, C_nb), (velocity, _) = jax.jvp(partial(road_pose, road, profile), (t,), (jnp.ones_like(t),))
        return matrix_to_euler(C_nb), C_nb[:, 0] @ velocity

    rates = jax.vmap(lambda t: jax.jvp(euler_and_speed, (t,), (jnp.ones_like(t),)))(t)
    return road_readings(road, profile, t), rates


def drive_with_rates(road: Road, profile: SpeedProfile, t: np.ndarray) -> tuple[Readings, tuple]:
    """The same, always at as many times."""
    results = road_readings_and_rates(*of_equal_shapes(road, profile), np.resize(t, TIMES.size))
    return jax.tree.map(lambda x: np.asarray(x)[: t.size], results)


def drive(road: Road, profile: SpeedProfile, t: np.ndarray) -> Readings:
    return drive_with_rates(road, profile, t)[0]


def at_edges(series: object) -> object:
    return jax.tree.map(lambda x: np.asarray(x)[: EDGES.size], series)


@cache
def drive_on(name: str) -> tuple[Readings, tuple]:
    return drive_with_rates(ROADS[name], STOPS, TIMES)


@cache
def edges_and_nodes(name: str) -> tuple[Readings, Readings]:
    """Readings at the edges of the panels, and at the nodes between."""
    if name in ROADS:
        readings, _ = drive_on(name)
    else:
        readings = flight_readings(FLIGHT, TIMES) if name == "flight" else windsurfer_readings(SURFER, TIMES)
    return at_edges(readings), jax.tree.map(lambda x: np.asarray(x)[EDGES.size :], readings)


def yaw_pitch_roll(C_nb: np.ndarray) -> np.ndarray:
    """Angles by scipy, in its signs: nose-up pitch is negative."""
    return Rotation.from_matrix(C_nb).as_euler("ZYX").T


def integral(values: np.ndarray) -> np.ndarray:
    """Integral over each panel of values at the nodes."""
    return PANEL * np.mean(values.reshape(PANELS, 2 * STEPS, *values.shape[1:]), axis=1)


def assert_small(residual: np.ndarray, magnitude: float) -> None:
    """A residual below 1e-9 of the magnitude of its terms."""
    np.testing.assert_allclose(residual / magnitude, 0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MOTIONS)
def test_velocity_integrates_to_position(name: str) -> None:
    edges, between = edges_and_nodes(name)
    assert np.abs(edges.velocity).max() > 4
    assert_small(integral(between.velocity) - np.diff(edges.position, axis=0), 1.0)


@pytest.mark.parametrize("name", MOTIONS)
def test_specific_force_integrates_to_velocity(name: str) -> None:
    edges, between = edges_and_nodes(name)
    force = integral(np.einsum("tij,tj->ti", between.C_nb, between.f_b))
    assert_small(force - np.diff(edges.velocity, axis=0) - PANEL * G * np.array([0, 0, 1]), PANEL * G)


@pytest.mark.parametrize("name", MOTIONS)
def test_angular_rate_integrates_to_attitude(name: str) -> None:
    edges, between = edges_and_nodes(name)
    w = between.w_b.reshape(PANELS, STEPS, 2, 3)
    assert np.abs(w).max() > 0.01
    h = PANEL / STEPS
    # Magnus' expansion to fourth order
    turns = h / 2 * (w[..., 0, :] + w[..., 1, :]) + np.sqrt(3) / 12 * h * h * np.cross(w[..., 0, :], w[..., 1, :])
    panels = Rotation.from_matrix(edges.C_nb[:-1])
    for k in range(STEPS):
        panels = panels * Rotation.from_rotvec(turns[:, k])
    assert_small(panels.as_matrix() - edges.C_nb[1:], 1.0)


@pytest.mark.parametrize("name", MOTIONS)
def test_attitude_is_a_rotation(name: str) -> None:
    C_nb = edges_and_nodes(name)[0].C_nb
    np.testing.assert_allclose(np.swapaxes(C_nb, -1, -2) @ C_nb, np.broadcast_to(np.eye(3), C_nb.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(C_nb), 1, rtol=1e-14)


@pytest.mark.parametrize("name", MOTIONS)
def test_chalko_equation_4(name: str) -> None:
    """R^T a = A + g U, hence |a| = |A + g U|."""
    r = edges_and_nodes(name)[0]
    force = r.acceleration + G * np.array([0, 0, 1])
    assert_small(np.einsum("tij,tj->ti", r.C_nb, r.f_b) - force, G)
    assert_small(np.linalg.norm(r.f_b, axis=-1) - np.linalg.norm(force, axis=-1), G)


@pytest.mark.parametrize("name", ROADS)
def test_patent_equations(name: str) -> None:
    """The patent's equations in forward-left-up axes, each with every term."""
    r = edges_and_nodes(name)[0]
    (euler, speed), (euler_rate, acceleration) = at_edges(drive_on(name)[1])
    (roll, pitch, _), (roll_rate, pitch_rate, yaw_rate) = np.asarray(euler).T, np.asarray(euler_rate).T
    assert np.ptp(roll) > 0.05 or name in ("slope", "helix")
    assert np.ptp(pitch) > 0.05 or name == "helix"
    assert np.max(np.abs(yaw_rate)) > 0.1 or name == "slope"
    (w_x, w_y, w_z), (f_x, f_y, f_z) = r.w_b.T, r.f_b.T
    assert_small(speed - np.linalg.norm(r.velocity, axis=-1), 10.0)
    assert_small(speed - r.speed, 10.0)
    turning = w_y * np.sin(roll) + w_z * np.cos(roll)
    assert_small(np.cos(pitch) * yaw_rate - turning, 1.0)
    assert_small(pitch_rate - (-w_y * np.cos(roll) + w_z * np.sin(roll)), 1.0)  # Eq. (1)
    assert_small(roll_rate - (w_x - np.tan(pitch) * turning), 1.0)  # Eq. (2)
    assert_small(f_x - G * np.sin(pitch) - acceleration, G)  # Eq. (4): all velocity is along body x
    assert_small(f_y - speed * w_z - G * np.cos(pitch) * np.sin(roll), G)  # Eq. (5)
    assert_small(f_z + speed * w_y - G * np.cos(pitch) * np.cos(roll), G)
    assert_small(np.arcsin((f_y - w_z * speed) / (G * np.cos(pitch))) - roll, 1.0)  # Eq. (10)


@pytest.mark.parametrize("name", ROADS)
def test_shirai_equation_1_up_to_its_remainder(name: str) -> None:
    """h = (G^2 - a_x^2 - a_y^2 - g^2) / 2g against the true vertical acceleration A_U.

    G^2 = |A|^2 + 2 g A_U + g^2, and along the path, to its left and up, A = (v', v cos(pitch) yaw', v pitch'). With the
    first two known, h - A_U = (v pitch')^2 / 2g. The body turns across its x axis by
    w_y^2 + w_z^2 = (cos(pitch) yaw')^2 + pitch'^2, so that h - A_U = (v w_y)^2 / 2g for a_y = v w_z.
    """
    r = edges_and_nodes(name)[0]
    (euler, v), (euler_rate, a_x) = at_edges(drive_on(name)[1])
    _, pitch_rate, yaw_rate = np.asarray(euler_rate).T
    excess = (np.sum(r.f_b**2, -1) - a_x**2 - G**2) / (2 * G) - r.acceleration[:, 2]
    curvature = (v * pitch_rate) ** 2 / (2 * G)
    curvature_seen_by_body = (v * r.w_b[:, 1]) ** 2 / (2 * G)
    assert np.max(curvature) > 1e-3 or name == "helix"
    assert np.max(curvature_seen_by_body) > 1e-3
    assert_small(excess - (v * np.cos(euler[:, 1]) * yaw_rate) ** 2 / (2 * G) - curvature, G)
    assert_small(excess - (v * r.w_b[:, 2]) ** 2 / (2 * G) - curvature_seen_by_body, G)


def cruise(speed: float) -> SpeedProfile:
    """Constant speed from progress 0 at t = 0 to t = 100 s."""
    none = np.zeros(3)
    return SpeedProfile(
        start=none - 0.5,
        stop=none + 100.0,
        ramp=none + 1.0,
        speed=np.array([speed, 0.0, 0.0]),
        modulation=none[:2],
        wavenumber=none[:2],
        phase=none[:2],
    )


SEVEN = np.linspace(1.0, 20.0, 7)


def test_uniform_slope() -> None:
    r = drive(quick_jit(roads.slope_road)(100.0, 100.0, -7.0), cruise(8.0), SEVEN)
    pitch = np.arctan(-0.07)
    np.testing.assert_allclose(r.speed, 8 / np.cos(pitch), rtol=1e-13)
    np.testing.assert_allclose(r.position, np.outer(SEVEN, [8.0, 0.0, -0.56]), rtol=1e-13)
    np.testing.assert_allclose(r.w_b, np.zeros((7, 3)), atol=1e-15)
    np.testing.assert_allclose(r.f_b, np.tile([G * np.sin(pitch), 0, G * np.cos(pitch)], (7, 1)), atol=1e-13)


@pytest.mark.parametrize("radius", [40.0, -25.0])
@pytest.mark.parametrize("grade", [0.0, 0.1])
def test_circle(radius: float, grade: float) -> None:
    """v^2 / radius to the left and g upwards, seen in axes that are canted and rolled outward."""
    v, cant, roll_gain = 9.0, 0.15, 0.02
    road = replace(circular_road(radius, grade, cant), roll_gain=roll_gain)
    r = drive(road, cruise(v), SEVEN)
    pitch, roll, yaw_rate, left = np.arctan(grade), cant + roll_gain * v * v / radius, v / radius, v * v / radius
    up = G * np.cos(pitch)
    f_b = [G * np.sin(pitch), left * np.cos(roll) + up * np.sin(roll), -left * np.sin(roll) + up * np.cos(roll)]
    across = yaw_rate * np.cos(pitch)
    w_b = [yaw_rate * np.sin(pitch), across * np.sin(roll), across * np.cos(roll)]
    np.testing.assert_allclose(r.f_b, np.tile(f_b, (7, 1)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(r.w_b, np.tile(w_b, (7, 1)), rtol=0, atol=1e-13)
    yaw = yaw_rate * SEVEN
    expected = np.stack([radius * np.sin(yaw), radius * (1 - np.cos(yaw)), grade * v * SEVEN], -1)
    np.testing.assert_allclose(r.position, expected, rtol=0, atol=1e-12)
    got = yaw_pitch_roll(r.C_nb)[0]
    np.testing.assert_allclose(np.unwrap(got), np.unwrap(np.angle(np.exp(1j * yaw))), atol=1e-13)


def test_coordinated_turn() -> None:
    """Bank atan(v^2 / (r g)), into the turn: no lateral specific force, and g / cos(bank) upwards."""
    v, radius = 60.0, 300.0
    flight = (*of_equal_shapes(circular_road(radius, 0.0, 0.3), cruise(v)), WIND, np.asarray(G))
    r = jax.tree.map(lambda x: np.asarray(x)[:7], flight_readings(flight, np.resize(SEVEN, TIMES.size)))
    bank = np.arctan(v * v / (radius * G))
    np.testing.assert_allclose(r.f_b, np.tile([0, 0, G / np.cos(bank)], (7, 1)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(yaw_pitch_roll(r.C_nb)[2], -bank, rtol=1e-13)
    through_air = np.einsum("tij,ti->tj", r.C_nb, r.velocity - WIND)
    np.testing.assert_allclose(through_air, np.tile([v, 0, 0], (7, 1)), rtol=0, atol=1e-12)


def test_flight_has_no_lateral_specific_force_on_any_path() -> None:
    r = edges_and_nodes("flight")[0]
    assert np.ptp(yaw_pitch_roll(r.C_nb)[2]) > 0.7
    assert_small(r.f_b[:, 1], G)
    assert r.f_b[:, 2].min() > 0


@pytest.mark.parametrize("name", ["hills", "eight", "helix"])
def test_standstill(name: str) -> None:
    """Before, between and after the legs nothing moves, and the accelerometer reads gravity in the road's axes."""
    t = np.array([-5.0, 0.0, 1.0, 16.5, 18.0, 38.0, 99.0])
    r = drive(ROADS[name], STOPS, t)
    for still in (r.velocity, r.acceleration, r.w_b, r.speed):
        np.testing.assert_allclose(still, 0, atol=1e-12)
    np.testing.assert_allclose(r.f_b, G * r.C_nb[:, 2], atol=1e-12)
    assert np.ptp(r.position[:, 0]) > 1


def test_windsurfer_leans_to_windward_and_falls() -> None:
    calm = replace(SURFER, displacement=0 * SURFER.displacement, sway=0 * SURFER.sway, head=0 * SURFER.head)
    helmet = at_edges(windsurfer_readings(calm, TIMES)).position
    board = drive(SURFER.road, SURFER.profile, EDGES)
    yaw = yaw_pitch_roll(board.C_nb)[0]
    assert np.max(yaw) > 0.95 and np.min(yaw) < -0.95
    upright = (EDGES < 18.99) | (EDGES > 25)
    # the wind is from the left on the reach to the left, and the other way round
    to_left = np.einsum("ti,ti->t", board.C_nb[:, :, 1], helmet - board.position)
    assert np.min((to_left * np.sign(yaw))[upright & (np.abs(yaw) > 0.5)]) > 0.1
    assert np.min(helmet[upright, 2]) > 1.5
    lying = (EDGES > 19.81) & (EDGES < 23.99)
    np.testing.assert_allclose(helmet[lying, 2], 1.7 * np.cos(1.3) * np.cos(0.6), rtol=1e-12)
    assert np.max(board.speed) == pytest.approx(9.0, rel=0.04)
    np.testing.assert_allclose(board.speed[(EDGES > 21.01) & (EDGES < 24.99)], 0, atol=1e-12)


def test_windsurfer_need_not_fall() -> None:
    surfer = gybing_windsurfer(9.0, 1.0, 60.0, 39.5, 39.5)
    r = at_edges(windsurfer_readings(surfer, TIMES))
    never = at_edges(windsurfer_readings(replace(surfer, fall=np.zeros(3)), TIMES))
    np.testing.assert_array_equal(r.position[EDGES <= 39.5], never.position[EDGES <= 39.5])
    board = drive(surfer.road, surfer.profile, EDGES)
    assert np.min(board.speed[(EDGES > 3.9) & (EDGES < 35.6)]) > 4


DIFFERENTIATED = {
    "hills": ((HILLS, STOPS), lambda motion, t: road_readings(*motion, t)),
    "flight": (FLIGHT, flight_poses),
    "windsurfer": (SURFER, windsurfer_poses),
}
STEP, OTHERS = 1e-4, 5


@cache
def neighbours(name: str) -> tuple:
    """A batch of motions near one: ((weighted sum of all that a motion yields, (motion and times, yield)), gradient).

    First the motion itself, then those one and two steps to either side of each parameter and time, last others at
    random. Some of the times lie on ends of ramps.
    """
    motion, outcome = DIFFERENTIATED[name]
    t = np.array([0.0, 1.0, 2.3, 8.0, 15.0, 19.3, 23.0])
    start, unravel = ravel_pytree((motion, t))
    start = np.asarray(start)
    scale = np.where(start == 0, 1e-2, np.abs(start))
    rng = np.random.default_rng(2)
    weights = [rng.standard_normal(leaf.shape) for leaf in jax.tree.leaves(jax.eval_shape(outcome, motion, t))]

    def weighted(relative: jax.Array) -> tuple:
        motion_and_t = unravel(start + scale * relative)
        outcomes = outcome(*motion_and_t)
        sums = [jnp.vdot(w, leaf) for w, leaf in zip(weights, jax.tree.leaves(outcomes), strict=True)]
        return jnp.stack(sums).sum(), (motion_and_t, outcomes)

    unit = STEP * np.eye(start.size)
    others = rng.uniform(-0.2, 0.2, (OTHERS, start.size))
    points = np.concatenate([0 * unit[:1], unit, -unit, 2 * unit, -2 * unit, others])
    return jax.tree.map(np.asarray, quick_jit(jax.vmap(jax.value_and_grad(weighted, has_aux=True)))(points))


@pytest.mark.parametrize("name", DIFFERENTIATED)
def test_gradients_are_finite_and_agree_with_differences(name: str) -> None:
    """In time and every parameter."""
    (values, _), gradients = neighbours(name)
    gradient = gradients[0]
    assert np.isfinite(gradients).all()
    assert np.mean(gradient != 0) > 0.6
    plus, minus, plus2, minus2 = values[1:-OTHERS].reshape(4, -1)
    differences = (8 * (plus - minus) - (plus2 - minus2)) / (12 * STEP)
    np.testing.assert_allclose(gradient, differences, rtol=2e-6, atol=1e-7 * np.max(np.abs(gradient)))


def test_batch_of_roads_is_a_loop() -> None:
    (_, ((motions_on_roads, t), batch)), _ = neighbours("hills")
    assert batch.f_b.shape == (len(t), 7, 3)
    for i in range(len(t) - OTHERS, len(t)):
        one = drive(*jax.tree.map(itemgetter(i), motions_on_roads), t[i])
        for field in fields(Readings):
            got, expected = getattr(batch, field.name)[i], getattr(one, field.name)
            np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-11)


def test_single_precision() -> None:
    single = quick_jit(lambda *drive: road_readings(*drive))(*jax.tree.map(np.float32, (HILLS, STOPS, EDGES)))
    exact = edges_and_nodes("hills")[0]
    for field in fields(Readings):
        got, expected = getattr(single, field.name), getattr(exact, field.name)
        assert got.dtype == jnp.float32
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("motion", "pose"), [(FLIGHT, lambda motion, t: flight_pose(*motion, t)), (SURFER, windsurfer_pose)]
)
def test_poses_keep_single_precision(motion: object, pose: Callable) -> None:
    single = jax.tree.map(np.float32, motion)
    assert {x.dtype for x in jax.eval_shape(pose, single, jnp.float32(1))} == {jnp.dtype(jnp.float32)}


def test_constructor_keeps_single_precision() -> None:
    surfer = jax.eval_shape(
        lambda one: motions.gybing_windsurfer(9 * one, one, 60 * one, 40 * one, 20 * one), jnp.float32(1)
    )
    assert {leaf.dtype for leaf in jax.tree.leaves(surfer)} == {jnp.dtype(jnp.float32)}


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("t", lambda: ideal_readings(partial(road_pose, HILLS, STOPS), 0.0, G)),
        ("gravity", lambda: ideal_readings(partial(road_pose, HILLS, STOPS), np.zeros(7), np.zeros(7))),
        ("t", lambda: road_pose(HILLS, STOPS, np.zeros(7))),
        ("t", lambda: flight_pose(HILLS, STOPS, WIND, G, np.zeros(7))),
        ("wind", lambda: flight_pose(HILLS, STOPS, np.zeros(2), G, 0.0)),
        ("gravity", lambda: flight_pose(HILLS, STOPS, WIND, np.zeros(7), 0.0)),
        ("t", lambda: windsurfer_pose(SURFER, np.zeros(7))),
        ("reach_angle", lambda: motions.gybing_windsurfer(9.0, np.zeros(7), 60.0, 39.5, 19.0)),
    ]
    + [
        (f"windsurfer.{name}", partial(lambda name: windsurfer_pose(replace(SURFER, **{name: 1.0}), 0.0), name))
        for name in ("frequency", "phase", "displacement", "sway", "head", "fall")
    ],
)
def test_wrong_shapes_are_named(name: str, call: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must have shape .*, got "):
        jax.eval_shape(call)
