"""The patent's calculators and loops on exact drives, their instability, and their derivatives."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from altijax import speed
from altijax.motions import ideal_readings, road_pose
from altijax.roads import rest_to_rest, winding_road
from altijax.rotations import matrix_to_euler
from altijax.speed import (
    pitch_rate,
    pure_acceleration,
    roll_angle,
    speed_error_growth,
    speed_with_aided_roll,
    speed_with_roll,
    speed_without_roll,
)

G = 9.81
DT = 0.01
T = DT * np.arange(6001)
STEPPINGS = ["second_order", "literal"]


@jax.jit
def drive(heading_swing, roll_gain):
    """60 s at up to 14 m/s: bends left and right, hills, cant, and body roll outward."""
    road = winding_road(heading_swing, [130.0, 83.0], [0.0, 1.0], [0.05, 0.03], [300.0, 170.0], [0.5, 2.0], 2.0)
    road = dataclasses.replace(road, roll_gain=roll_gain)
    return ideal_readings(partial(road_pose, road, rest_to_rest(500.0, 60.0, 8.0)), T, G)


BENDS = drive(jnp.array([0.56, 0.3]), 0.006)
STRAIGHT = drive(jnp.array([0.0, 0.0]), 0.006)


def sensors(readings):
    """f_x, f_y, w_y, w_z."""
    return *readings.f_b[:, :2].T, *readings.w_b[:, 1:].T


def initial(readings):
    return readings.speed[0], matrix_to_euler(readings.C_nb)[0, 1]


def rms_error(readings, found):
    return float(np.sqrt(np.mean((found - readings.speed) ** 2)))


def turning(readings):
    return float(np.abs(readings.w_b[:, 2]).sum() * DT)


# --- calculators ------------------------------------------------------------------------------------------------------


def test_calculators_are_exact_on_an_exact_drive():
    roll, pitch, _ = matrix_to_euler(BENDS.C_nb).T
    f_x, f_y, w_y, w_z = sensors(BENDS)
    found, valid = roll_angle(f_y, w_z, BENDS.speed, pitch, G)
    assert valid.all()
    assert np.ptp(roll) > 0.1
    np.testing.assert_allclose(found, roll, atol=1e-12)
    middle = slice(1, -1)
    np.testing.assert_allclose(
        pitch_rate(w_y, w_z, roll)[middle], (pitch[2:] - pitch[:-2]) / (2 * DT), atol=2e-5 * np.ptp(w_y)
    )
    np.testing.assert_allclose(
        pure_acceleration(f_x, pitch, G)[middle], (BENDS.speed[2:] - BENDS.speed[:-2]) / (2 * DT), atol=2e-4
    )


@pytest.mark.parametrize(
    ("f_y", "pitch", "roll", "valid"),
    [
        (0.5 * G, 0.0, np.pi / 6, True),
        (G, 0.0, np.pi / 2, True),
        (-1.01 * G, 0.0, -np.pi / 2, False),
        (1.01 * G, 0.0, np.pi / 2, False),
        (0.0, np.pi / 2, np.pi / 2, False),
        (-1.0, -np.pi / 2, -np.pi / 2, False),
        (50.0, np.pi / 2, np.pi / 2, False),
    ],
)
def test_roll_angle_at_its_edges(f_y, pitch, roll, valid):
    def of(*arguments):
        return roll_angle(*arguments)[0]

    arguments = f_y, 0.3, 0.0, pitch, G
    found, flag = roll_angle(*arguments)
    assert found == pytest.approx(roll, rel=1e-12)
    assert flag == valid
    gradient = np.array(jax.grad(of, argnums=(0, 1, 2, 3, 4))(*arguments))
    assert np.isfinite(gradient).all()
    if not valid:
        assert not gradient.any()


# --- loops on exact drives --------------------------------------------------------------------------------------------


def test_second_order_stepping_follows_a_minute_of_bends():
    """0.05 m/s is the bound to hold for error-free readings at 100 Hz over about 10 rad of turning."""
    assert turning(BENDS) == pytest.approx(10.0, abs=0.5)
    second, literal = (
        rms_error(BENDS, speed_with_roll(*sensors(BENDS), *initial(BENDS), G, DT, stepping)[0])
        for stepping in STEPPINGS
    )
    assert second < 0.05
    assert literal > 5


def test_error_falls_with_the_square_of_the_step():
    errors = []
    for every in (1, 2, 4):
        found, *_ = speed_with_roll(*(x[::every] for x in sensors(BENDS)), *initial(BENDS), G, every * DT)
        errors.append(np.abs(found - BENDS.speed[::every])[: 3000 // every].max())
    assert 3.6 < errors[1] / errors[0] < 4.4
    assert 3.6 < errors[2] / errors[1] < 4.4


def test_all_outputs_on_bends():
    found, pitch, roll, valid = speed_with_roll(*sensors(BENDS), *initial(BENDS), G, DT)
    np.testing.assert_allclose(np.stack([roll, pitch]), matrix_to_euler(BENDS.C_nb)[:, :2].T, atol=5e-3)
    assert valid.all()
    np.testing.assert_allclose(found, BENDS.speed, atol=0.1)


def test_without_roll_is_exact_on_a_straight_road_and_wrong_in_bends():
    """A straight road has no cant here; its hills alone do not disturb the conventional method."""
    f_x, _, w_y, _ = sensors(STRAIGHT)
    assert rms_error(STRAIGHT, speed_without_roll(f_x, w_y, *initial(STRAIGHT), G, DT)[0]) < 1e-3
    assert rms_error(STRAIGHT, speed_with_roll(*sensors(STRAIGHT), *initial(STRAIGHT), G, DT)[0]) < 1e-3
    f_x, _, w_y, _ = sensors(BENDS)
    assert rms_error(BENDS, speed_without_roll(f_x, w_y, *initial(BENDS), G, DT)[0]) > 2


def test_without_roll_integrates_exactly_what_is_linear():
    """Constant pitch rate from level: the pitch is linear, and so its integral of a sine is known."""
    w_y = jnp.full(T.size, -0.01)
    for stepping, atol in (("second_order", 1e-5), ("literal", 3e-2)):
        found, pitch = speed_without_roll(jnp.zeros(T.size), w_y, 10.0, 0.0, G, DT, stepping)
        np.testing.assert_allclose(pitch, 0.01 * T, atol=1e-12)
        np.testing.assert_allclose(found, 10 - G * (1 - np.cos(0.01 * T)) / 0.01, atol=atol)


def test_literal_stepping_is_the_source_sample_by_sample():
    """Roll from this sample's readings and the last estimates, pitch from that roll, speed from that pitch."""
    f_x, f_y, w_y, w_z = (np.asarray(x[:300]) for x in sensors(BENDS))
    v, theta = 3.0, 0.02
    speeds = [v]
    for i in range(1, 300):
        phi = np.arcsin((f_y[i] - w_z[i] * v) / (G * np.cos(theta)))
        theta += DT * (w_z[i] * np.sin(phi) - w_y[i] * np.cos(phi))
        v += DT * (f_x[i] - G * np.sin(theta))
        speeds.append(v)
    found, *_ = speed_with_roll(f_x, f_y, w_y, w_z, 3.0, 0.02, G, DT, "literal")
    np.testing.assert_allclose(found, speeds, rtol=1e-12)


def test_aid_inside_the_roll_takes_the_instability_out():
    aid, everywhere = BENDS.speed, jnp.ones(T.size, bool)
    v0, pitch0 = initial(BENDS)
    found = {
        off: speed_with_aided_roll(*sensors(BENDS), aid, everywhere, v0 + off, pitch0, G, DT)[0] for off in (0.0, 0.1)
    }
    assert rms_error(BENDS, found[0.0]) < 1e-3
    np.testing.assert_allclose(found[0.1] - found[0.0], 0.1, atol=1e-12)


@pytest.mark.parametrize("stepping", STEPPINGS)
def test_without_aid_the_aided_loop_is_the_patents(stepping):
    nowhere = jnp.zeros(T.size, bool)
    aided = speed_with_aided_roll(*sensors(BENDS), nowhere, nowhere, *initial(BENDS), G, DT, stepping)
    plain = speed_with_roll(*sensors(BENDS), *initial(BENDS), G, DT, stepping)
    for a, b in zip(aided, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_through_a_gap_the_aid_goes_on_by_the_acceleration_found():
    """Aid 0.1 m/s too fast until 20 s: after that the loop runs freely from a speed 0.1 m/s too fast."""
    aided = T <= 20
    found, pitch, _, _ = speed_with_aided_roll(*sensors(BENDS), BENDS.speed + 0.1, aided, *initial(BENDS), G, DT)
    start = int(20 / DT)
    freely, *_ = speed_with_roll(*(x[start:] for x in sensors(BENDS)), BENDS.speed[start] + 0.1, pitch[start], G, DT)
    np.testing.assert_allclose(found[start:] - found[start], freely - freely[0], atol=1e-9)


# --- stability --------------------------------------------------------------------------------------------------------


def test_growth_at_a_constant_yaw_rate_is_cosh_and_sinh():
    for w in (0.1, -0.3):
        by_speed, by_acceleration = speed_error_growth(jnp.full(T.size, w), DT)
        np.testing.assert_allclose(by_speed, np.cosh(w * T), rtol=1e-4)
        np.testing.assert_allclose(by_acceleration[1:], (np.sinh(w * T) / w)[1:], rtol=1e-4)
    by_speed, by_acceleration = speed_error_growth(jnp.zeros(T.size), DT)
    np.testing.assert_allclose(by_speed, 1)
    np.testing.assert_allclose(by_acceleration, T, atol=1e-12)


def test_growth_ends_at_a_finite_number():
    for dtype in (np.float32, np.float64):
        for growth in speed_error_growth(jnp.full(200_000, 10.0, dtype).at[150_000:].set(0), 0.01):
            assert growth.dtype == dtype
            assert np.isfinite(growth).all()


def test_errors_grow_as_the_linearised_equation_says():
    """By simulation of a small error, and by the loop's own derivative."""
    v0, pitch0 = initial(BENDS)
    by_speed, by_acceleration = speed_error_growth(BENDS.w_b[:, 2], DT)
    assert by_speed[-1] > 100

    def of(v0, pitch0):
        return speed_with_roll(*sensors(BENDS), v0, pitch0, G, DT)[0]

    simulated = (of(v0 + 1e-6, pitch0) - of(v0, pitch0)) / 1e-6
    jacobian = jax.jacfwd(of, argnums=(0, 1))(v0, pitch0)
    np.testing.assert_allclose(simulated, by_speed, rtol=0.05)
    np.testing.assert_allclose(jacobian[0], by_speed, rtol=0.05)
    np.testing.assert_allclose(jacobian[1] / (-G * np.cos(pitch0)), by_acceleration, rtol=0.05, atol=1e-9)


# --- derivatives ------------------------------------------------------------------------------------------------------

N = 60
SHORT = tuple(jnp.asarray(x[2000 : 2000 + N]) for x in sensors(BENDS))
START = (BENDS.speed[2000], matrix_to_euler(BENDS.C_nb)[2000, 1], jnp.asarray(G), jnp.asarray(0.05))
GAPS = (BENDS.speed[2000 : 2000 + N], jnp.arange(N) % 9 < 4)


def plain_scan(f_x, f_y, w_y, w_z, v0, pitch0, gravity, dt):
    """Heun's method in its textbook form, of the angle, for JAX to differentiate as it is."""

    def rate(v, s, f_y, w_y, w_z):
        roll = jnp.arcsin((f_y - w_z * v) / (gravity * jnp.cos(jnp.arcsin(s))))
        return jnp.sqrt(1 - s * s) * (w_z * jnp.sin(roll) - w_y * jnp.cos(roll))

    def body(state, pair):
        (v, s), (before, now) = state, pair
        k = rate(v, s, *before[1:])
        guess = s + dt * k
        v_guess = v + dt * (0.5 * (before[0] + now[0]) - 0.5 * gravity * (s + guess))
        later = s + 0.5 * dt * (k + rate(v_guess, guess, *now[1:]))
        v = v + dt * (0.5 * (before[0] + now[0]) - 0.5 * gravity * (s + later))
        return (v, later), v

    series = f_x, f_y, w_y, w_z
    pairs = tuple(x[:-1] for x in series), tuple(x[1:] for x in series)
    return jnp.append(v0, jax.lax.scan(body, (v0, jnp.sin(pitch0)), pairs)[1])


def test_values_and_derivatives_are_those_of_the_plain_scan():
    arguments = (*SHORT, *START)
    weights = jnp.asarray(np.random.default_rng(0).standard_normal(N))
    every = tuple(range(len(arguments)))

    def ours(*arguments):
        return weights @ speed_with_roll(*arguments)[0]

    def plain(*arguments):
        return weights @ plain_scan(*arguments)

    np.testing.assert_allclose(speed_with_roll(*arguments)[0], jax.jit(plain_scan)(*arguments), rtol=1e-12)
    backward = jax.jit(jax.grad(ours, every))(*arguments)
    for a, b in zip(backward, jax.jit(jax.grad(plain, every))(*arguments), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-10)
    for a, b in zip(jax.jit(jax.jacfwd(ours, every[4:]))(*arguments), backward[4:], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10)


@pytest.mark.parametrize("stepping", STEPPINGS)
@pytest.mark.parametrize("name", ["speed_without_roll", "speed_with_roll", "speed_with_aided_roll"])
def test_derivatives_agree_with_finite_differences(name, stepping):
    series = {
        "speed_without_roll": SHORT[::2],
        "speed_with_roll": SHORT,
        "speed_with_aided_roll": (*SHORT, *GAPS),
    }[name]
    arguments = (*(x.astype(float) for x in series), *START)
    rng = np.random.default_rng(1)
    directions = tuple(jnp.asarray(rng.standard_normal(x.shape)) for x in arguments)
    if name == "speed_with_aided_roll":
        directions = (*directions[:5], jnp.zeros(N), *directions[6:])

    @jax.jit
    def along(e):
        moved = [x + e * d for x, d in zip(arguments, directions, strict=True)]
        return jnp.stack(getattr(speed, name)(*moved, stepping)[:2])

    @jax.jit
    def derivatives(e):
        return *jax.jvp(along, (e,), (1.0,)), jax.grad(lambda e: along(e)[0].sum())(e)

    value, forward, backward = derivatives(0.0)
    np.testing.assert_allclose(value, along(0.0), rtol=1e-14)
    difference = (along(1e-6) - along(-1e-6)) / 2e-6
    np.testing.assert_allclose(forward, difference, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(backward, forward[0].sum(), rtol=1e-10)


def test_reverse_mode_is_the_transpose_of_forward_mode_over_several_blocks():
    assert T.size > speed._BLOCK
    rng = np.random.default_rng(3)
    arguments = (*(jnp.asarray(x) for x in sensors(BENDS)), *initial(BENDS), jnp.asarray(G), jnp.asarray(DT))
    tangents = tuple(jnp.asarray(0.01 * rng.standard_normal(x.shape)) for x in arguments)
    cotangent = jnp.asarray(rng.standard_normal(T.size))

    @jax.jit
    def both(*arguments):
        def found(*arguments):
            return speed_with_roll(*arguments)[0]

        return jax.jvp(found, arguments, tangents)[1], jax.vjp(found, *arguments)[1](cotangent)

    forward, backward = both(*arguments)
    transposed = sum(float(jnp.vdot(b, t)) for b, t in zip(backward, tangents, strict=True))
    assert transposed == pytest.approx(float(cotangent @ forward), rel=1e-9)
    moved = (tuple(x + e * d for x, d in zip(arguments, tangents, strict=True)) for e in (1e-7, -1e-7))
    ahead, behind = (speed_with_roll(*x)[0] for x in moved)
    np.testing.assert_allclose(forward, (ahead - behind) / 2e-7, rtol=1e-3, atol=1e-3)


def test_second_derivatives_exist():
    def end(v0):
        return speed_with_roll(*SHORT, v0, *START[1:])[0][-1]

    slope = jax.jit(jax.grad(end))
    step = 1e-3
    difference = (slope(START[0] + step) - slope(START[0] - step)) / (2 * step)
    assert jax.jit(jax.grad(slope))(START[0]) == pytest.approx(float(difference), rel=1e-4)


READING = st.floats(-50, 50, width=32)
RATE = st.floats(-10, 10, width=32)


@pytest.mark.parametrize("stepping", STEPPINGS)
@settings(max_examples=40, deadline=None)
@given(
    series=st.lists(st.tuples(READING, READING, RATE, RATE), min_size=1, max_size=12),
    v0=st.floats(-100, 100, width=32),
    pitch0=st.one_of(st.floats(-1.5, 1.5, width=32), st.sampled_from([0.0, np.pi / 2, -np.pi / 2])),
    dt=st.sampled_from([0.01, 0.1]),
)
def test_everything_is_finite_for_finite_input(stepping, series, v0, pitch0, dt):
    readings = jnp.asarray((144 * series)[:144]).T
    aided = readings[1] > 0 if series[0][0] > 0 else jnp.zeros(144, bool)
    values, *derivatives = values_and_derivatives(readings, v0, pitch0, readings[0], aided, dt, stepping)
    for leaf in jax.tree.leaves((values, derivatives)):
        assert np.isfinite(leaf).all()
    assert np.abs(values[0]).max() <= abs(v0) + (50 + G) * dt * 144 + 1e-9
    if stepping == "second_order":
        assert np.abs(values[1]).max() <= np.pi / 2


@partial(jax.jit, static_argnames="stepping")
def values_and_derivatives(readings, v0, pitch0, aid, aided, dt, stepping):
    """Without aid this is the loop of speed_with_roll, as another test shows."""

    def of(readings, v0, pitch0, gravity, dt):
        return speed_with_aided_roll(*readings, aid, aided, v0, pitch0, gravity, dt, stepping)[:3]

    arguments = readings, v0, pitch0, jnp.asarray(G), jnp.asarray(dt)
    values, tangents = jax.jvp(of, arguments, jax.tree.map(jnp.ones_like, arguments))
    return values, tangents, jax.vjp(of, *arguments)[1](jax.tree.map(jnp.ones_like, values))


def test_a_pitch_that_reaches_the_pole_stays_there_flagged():
    n = 400
    still = jnp.zeros(n)
    found, pitch, roll, valid = speed_with_roll(still, still, jnp.full(n, -1.0), still, 0.0, 0.0, G, DT)
    assert valid[:150].all()
    np.testing.assert_allclose(pitch[:150], T[:150], atol=1e-3)
    assert not valid[200:].any()
    np.testing.assert_allclose(pitch[200:], np.pi / 2, atol=0.02)
    assert np.isfinite(found).all() and np.isfinite(roll).all()


# --- shapes -----------------------------------------------------------------------------------------------------------


def test_batches_over_trajectories_and_over_parameters():
    rng = np.random.default_rng(2)
    batch = jnp.stack(SHORT)[:, None] + 0.01 * rng.standard_normal((4, 5, N))
    v0 = START[0] + jnp.arange(5.0)
    rest = START[1:]
    single = [speed_with_roll(*batch[:, i], v0[i], *rest) for i in range(5)]
    first = jax.vmap(speed_with_roll, (0, 0, 0, 0, 0, None, None, None))(*batch, v0, *rest)
    last = jax.vmap(speed_with_roll, (-1, -1, -1, -1, 0, None, None, None), -1)(*jnp.swapaxes(batch, 1, 2), v0, *rest)
    for output, (a, b) in enumerate(zip(first, last, strict=True)):
        expected = np.stack([one[output] for one in single])
        np.testing.assert_allclose(a, expected, atol=1e-12)
        np.testing.assert_allclose(b.T, expected, atol=1e-12)
    over_gravity = jax.vmap(lambda g: speed_with_roll(*SHORT, *START[:2], g, START[3])[0])(jnp.array([9.7, 9.9]))
    np.testing.assert_allclose(over_gravity[1], speed_with_roll(*SHORT, *START[:2], 9.9, START[3])[0], atol=1e-12)


@pytest.mark.parametrize("stepping", STEPPINGS)
def test_one_sample_gives_the_initial_values(stepping):
    one = (jnp.array([0.3]),) * 4
    found, pitch, *_ = speed_with_roll(*one, 7.0, 0.1, G, DT, stepping)
    np.testing.assert_allclose((found[0], pitch[0]), (7.0, 0.1), rtol=1e-14)
    found, pitch = speed_without_roll(*one[:2], 7.0, 0.1, G, DT, stepping)
    np.testing.assert_allclose((found[0], pitch[0]), (7.0, 0.1), rtol=1e-14)


def test_wrong_stepping_is_named():
    with pytest.raises(ValueError, match="stepping must be 'second_order' or 'literal', got 'euler'"):
        speed_with_roll(*SHORT, *START, stepping="euler")
    with pytest.raises(ValueError, match="stepping must be"):
        speed_without_roll(*SHORT[:2], *START, stepping="heun")


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"w_z must have shape \(60,\), got \(59,\)"):
        speed_with_roll(*SHORT[:3], SHORT[3][1:], *START)
    with pytest.raises(ValueError, match=r"speed0 must have shape \(\), got \(1,\)"):
        speed_with_roll(*SHORT, START[0][None], *START[1:])
    with pytest.raises(ValueError, match=r"aided must have shape \(60,\)"):
        speed_with_aided_roll(*SHORT, GAPS[0], True, *START)


@pytest.mark.parametrize("stepping", STEPPINGS)
def test_what_a_series_is_filled_up_with_changes_nothing_before(stepping):
    series = sensors(BENDS)
    filled = [jnp.concatenate([x, jnp.full(2191, x[-1])]) for x in series]
    start = *initial(BENDS), G, DT, stepping
    aid = BENDS.speed, jnp.ones(T.size)
    filled_aid = [jnp.concatenate([x, jnp.full(2191, x[-1])]) for x in aid]
    pairs = [
        (speed_without_roll(filled[0], filled[2], *start), speed_without_roll(series[0], series[2], *start)),
        (speed_with_roll(*filled, *start), speed_with_roll(*series, *start)),
        (speed_with_aided_roll(*filled, *filled_aid, *start), speed_with_aided_roll(*series, *aid, *start)),
        (speed_error_growth(filled[3], DT), speed_error_growth(series[3], DT)),
    ]
    for longer, alone in pairs:
        for x, y in zip(longer, alone, strict=True):
            np.testing.assert_allclose(x[: T.size], y, rtol=1e-12, atol=1e-12)
