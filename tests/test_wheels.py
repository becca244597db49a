"""Wheel pulses against closed forms, and way, speed and yaw rate back from pulses."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax import wheels
from altijax.wheels import WheelSensor
from tests.quick import quick_jit

# Compiled whole, and with few shapes, these tests take a fraction of the time.
wheel_pulses = jax.jit(wheels.wheel_pulses, static_argnames="max_pulses")
pulse_distance = jax.jit(wheels.pulse_distance)
wheel_speeds = jax.jit(wheels.wheel_speeds)
correct_wheel_speeds = jax.jit(wheels.correct_wheel_speeds)
yaw_rate_from_wheels = jax.jit(wheels.yaw_rate_from_wheels)


def sensor(n=2, **parameters):
    """With n magnets, and all elements of all parameters."""
    shapes = {"radius": 2, "scale": 2, "slip": 2, "track_width": (), "phase": 2, "magnet_error": (2, n)}
    nominal = {"radius": 0.33, "scale": 1.0, "slip": 0.0, "track_width": 1.4, "phase": 0.0, "magnet_error": 0.0}
    full = {name: np.broadcast_to((nominal | parameters)[name], shape) for name, shape in shapes.items()}
    return WheelSensor(pulses_per_turn=n, **full)


@jax.jit
def way_speed_and_standstill(t_pulses, t, distance, distance_std, quiet):
    speed, speed_std = wheels.speed_from_pulses(t_pulses, t, distance, distance_std)
    still = wheels.standstill_from_pulses(t_pulses, t, quiet)
    return wheels.way_from_pulses(t_pulses, t, distance), speed, speed_std, still


def from_pulses(t_pulses, t, distance, distance_std=0.0, quiet=1.0):
    """All there is to say of the pulses of one wheel or two, at one number of pulses, times and wheels."""
    pulses = np.full((2, 6000), np.inf)
    pulses[:, : np.shape(t_pulses)[-1]] = t_pulses
    numbers = np.broadcast_to(distance, 2), np.float64(distance_std), np.float64(quiet)
    results = way_speed_and_standstill(pulses, np.resize(t, 30001), *numbers)
    wheel = 0 if np.ndim(t_pulses) == 1 else slice(None)
    return [np.asarray(x)[wheel][..., : t.size] for x in results]


TWO = sensor()
D = np.pi * 0.33


def drive(t):
    """From rest, through varying speed, to rest."""
    return np.clip(t - 3, 0, 1) * np.clip(27 - t, 0, 2) / 2 * (4 + 2 * np.sin(0.9 * t))


def way_of(t, speed):
    return np.concatenate([[0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])


T = np.linspace(0, 30, 601)
DRIVE = drive(T)
STRAIGHT = np.zeros_like(T)


@pytest.mark.parametrize("speed", [0.3, 7.0])
def test_pulses_at_constant_speed(speed):
    wheel = sensor(phase=[0.0, 1.0])
    t_pulses, count = map(np.asarray, wheel_pulses(wheel, T, np.full_like(T, speed), STRAIGHT, max_pulses=300))
    for i, phase in enumerate((0.0, 1.0)):
        expected = (np.arange(1, 300) * np.pi - phase) * 0.33 / speed
        expected = expected[expected <= 30]
        assert count[i] == expected.size
        np.testing.assert_allclose(t_pulses[i, : count[i]], expected, rtol=1e-12)
        assert np.isinf(t_pulses[i, count[i] :]).all()


@pytest.mark.parametrize("acceleration", [0.5, 3.0])
def test_pulses_from_rest_at_constant_acceleration(acceleration):
    """t = sqrt(2 k d / a), exact although samples are a second apart; those without room are counted."""
    t = np.arange(601.0)
    t_pulses, count = wheel_pulses(TWO, t, acceleration * t, STRAIGHT, max_pulses=300)
    assert count[0] == int(acceleration * 180000 / D)
    np.testing.assert_allclose(t_pulses[0], np.sqrt(2 * np.arange(1, 301) * D / acceleration), rtol=1e-12)


def test_pulses_in_a_curve_tell_the_yaw_rate():
    """Left wheel slower in a left turn; both wheels' ways differ by the track times the turn."""
    wheel = sensor(48)
    speed, yaw_rate = np.full_like(T, 6.0), np.full_like(T, 0.3)
    t_pulses, count = wheel_pulses(wheel, T, speed, yaw_rate, max_pulses=6000)
    d = np.asarray(pulse_distance(wheel))
    np.testing.assert_allclose(count * d, [(6 - 0.21) * 30, (6 + 0.21) * 30], atol=d[0])
    _, wheel_speed, _, _ = from_pulses(t_pulses, T[40:-40], d)
    np.testing.assert_allclose(wheel_speed.mean(0), 6.0, rtol=1e-9)
    np.testing.assert_allclose(yaw_rate_from_wheels(wheel, wheel_speed), 0.3, rtol=1e-8)


def test_wheel_speeds_and_their_correction():
    rng = np.random.default_rng(0)
    wheel = WheelSensor(scale=jnp.array([1.02, 0.97]), slip=jnp.array([0.05, -0.02]), track_width=1.4)
    speed, yaw_rate = rng.standard_normal((2, 5, 7)), rng.standard_normal((2, 5, 7))
    shown = wheel_speeds(wheel, speed, yaw_rate)
    assert shown.shape == (2, 5, 2, 7)
    np.testing.assert_allclose(shown[..., 0, :], (speed - 0.7 * yaw_rate) * 1.05 / 1.02)
    true = correct_wheel_speeds(wheel, shown)
    np.testing.assert_allclose(true.mean(-2), speed, atol=1e-14)
    np.testing.assert_allclose(yaw_rate_from_wheels(wheel, true), yaw_rate, atol=1e-14)
    only_scaled = correct_wheel_speeds(WheelSensor(scale=1.02), shown)
    np.testing.assert_allclose(only_scaled, 1.02 * shown, rtol=1e-15)


def test_scale_and_slip_change_the_number_of_pulses_and_the_distance_undoes_it():
    wheel = sensor(scale=1.03, slip=0.1)
    t_pulses, count = wheel_pulses(wheel, T, np.full_like(T, 6.0), STRAIGHT, max_pulses=300)
    assert count[0] == int(180 * 1.1 / 1.03 / D)
    np.testing.assert_allclose(pulse_distance(wheel), D * 1.03 / 1.1)
    _, speed, _, _ = from_pulses(t_pulses, T[40:-40], pulse_distance(wheel))
    np.testing.assert_allclose(speed, 6.0, rtol=1e-9)


@pytest.mark.parametrize(("n", "room"), [(2, 300), (48, 6000)])
def test_pulses_integrate_to_the_way_within_one_pulse(n, room):
    wheel = sensor(n, phase=[0.0, 0.03])
    t_pulses, count = wheel_pulses(wheel, T, DRIVE, STRAIGHT, max_pulses=room)
    d = np.asarray(pulse_distance(wheel))
    true = way_of(T, DRIVE)
    assert true[-1] > 80 and count.max() < room
    way, _, _, _ = from_pulses(t_pulses, T, d)
    assert np.abs(way - way[:, :1] - true).max() <= d[0]
    assert np.diff(way).min() >= 0
    fine = np.linspace(0, 30, 30001)
    _, speed, _, _ = from_pulses(t_pulses, fine, d)
    by_speed = np.asarray([way_of(fine, s)[-1] for s in speed])
    assert np.abs(by_speed - true[-1]).max() <= d[0]


def test_speed_is_the_derivative_of_the_way():
    t_pulses, _ = wheel_pulses(TWO, T, DRIVE, STRAIGHT, max_pulses=300)
    at = np.linspace(0.013, 29.9, 400)

    @quick_jit
    def way_rate(t):
        return jax.jvp(lambda t: wheels.way_from_pulses(t_pulses[0], t, D), (t,), (jnp.ones_like(t),))[1]

    _, speed, _, _ = from_pulses(t_pulses[0], at, D)
    np.testing.assert_allclose(way_rate(at), speed, rtol=1e-8, atol=1e-10)


def test_way_at_pulses_is_their_number():
    t_pulses, count = wheel_pulses(TWO, T, DRIVE, STRAIGHT, max_pulses=300)
    way, _, _, _ = from_pulses(t_pulses[0], np.asarray(t_pulses)[0, : count[0]], D)
    np.testing.assert_allclose(way, np.arange(count[0]) * D, atol=1e-10)


@pytest.mark.parametrize("acceleration", [0.4, 2.0])
def test_speed_is_exact_at_constant_acceleration(acceleration):
    t_pulses = np.sqrt(2 * np.arange(1, 60) * D / acceleration)
    t = np.linspace(t_pulses[0], t_pulses[-1], 601)[:-1]
    _, speed, std, _ = from_pulses(t_pulses, t, D)
    np.testing.assert_allclose(speed, acceleration * t, rtol=1e-9)
    assert np.max(std) < 1e-8


def test_standstill_and_low_speed():
    """A stop of 20 s within one turn: speed falls below d / (4 T), never below zero, and the flag says standstill."""
    t = np.linspace(0, 60, 1201)
    speed = np.clip(np.where(t < 30, 20 - t, t - 40), 0, 3)
    # Every corner of the speed is among half of the samples.
    t_pulses, count = wheel_pulses(TWO, t[::2], speed[::2], STRAIGHT, max_pulses=300)
    pulses = np.asarray(t_pulses)[0, : count[0]]
    _, got, std, still = from_pulses(t_pulses[0], t, D, quiet=2.0)
    assert got.min() >= 0
    since = t - pulses[np.clip(np.searchsorted(pulses, t, "right") - 1, 0, None)]
    until = pulses[np.clip(np.searchsorted(pulses, t), None, pulses.size - 1)] - t
    gap = (since + until > 5) & (since > 0) & (until > 0)
    assert gap.sum() > 300
    assert (got[gap] <= D / (4 * np.minimum(since, until)[gap])).all()
    middle = (t > 25) & (t < 35)
    assert got[middle].max() < 0.06 and std[middle].max() < 0.2
    # Braking and starting: at most the last pulse's speed is in doubt, and the doubt says so.
    error = np.abs(got - speed)
    assert error[(t > pulses[0]) & (t < 17)].max() < 0.1 and error[gap].max() > 0.1
    assert (error[gap] < 4 * std[gap] + 0.05).all()

    assert still[(t > 23) & (t < 37)].all() and (speed[still] == 0).all()
    assert not still[(t < 17) | (t > 43)].any()


def test_after_the_last_pulse_speed_is_bounded_by_the_time_without_one():
    """What can be said in real time: below d / T after T seconds, and no more than one pulse of way."""
    t_pulses = np.concatenate([np.arange(1, 8) * 0.2, np.full(5, np.inf)])
    t = 1.4 + np.linspace(0, 100, 500)
    way, speed, std, _ = from_pulses(t_pulses, t, D)
    np.testing.assert_allclose(speed[0], D / 0.2, rtol=1e-9)
    assert (np.diff(speed) < 0).all() and (speed[1:] <= D / 4 / (t[1:] - 1.4)).all()
    assert np.isfinite(std).all()
    assert 6 <= way[0] / D + 1e-12 and 6.99 < way[-1] / D < 7


def test_pulses_need_no_infinity_after_the_last():
    t_pulses, t = np.array([0.3, 1.1, 1.6, 2.4, 2.9]), np.linspace(-1.0, 5.0, 7)
    full = quick_jit(lambda *arguments: way_speed_and_standstill(*arguments))(t_pulses, t, D, 0.01, 1.0)
    for got, expected in zip(full, from_pulses(t_pulses, t, D, 0.01), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-13)


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_pulses_are_standstill(count):
    t_pulses = np.where(np.arange(7) < count, 1.0, np.inf)
    *zero, still = from_pulses(t_pulses, T, D, quiet=0.5)
    np.testing.assert_array_equal(zero, 0)
    assert still.mean() == pytest.approx(1 - count / 30, abs=0.01)


@pytest.mark.parametrize("phase", [(0.0, 0.05), (2.05, 4.1), (4.3, 6.2)])
def test_every_magnet_after_the_start_gives_its_pulse(phase):
    """Against a list of all magnets' angles, from starts just before and after early and late magnets."""
    error = np.array([[0.1, -0.1, 0.2], [0.1, 0.0, -0.1]])
    wheel = sensor(3, magnet_error=error, phase=phase)
    t_pulses, count = map(np.asarray, wheel_pulses(wheel, T, np.full_like(T, 6.0), STRAIGHT, max_pulses=300))
    for i in range(2):
        angles = np.sort((2 * np.pi * np.arange(-2, 100)[:, None] + 2 * np.pi / 3 * np.arange(3) + error[i]).ravel())
        angles = angles[(angles > phase[i]) & (angles <= phase[i] + 180 / 0.33)]
        assert count[i] == angles.size
        np.testing.assert_allclose(t_pulses[i, : angles.size], (angles - phase[i]) * 0.33 / 6, rtol=1e-10)


def test_magnet_error_cancels_over_a_full_turn():
    wheel = sensor(3, magnet_error=[[0.0, 0.2, -0.1], [0.1, 0.0, 0.3]], phase=[0.5, 0.0])
    d = np.asarray(pulse_distance(wheel))
    t_pulses = np.asarray(wheel_pulses(wheel, T, np.full_like(T, 6.0), STRAIGHT, max_pulses=300)[0])
    interval = np.diff(t_pulses[:, :200])
    assert interval.max() / interval.min() > 1.2
    full = t_pulses[:, 3:203] - t_pulses[:, :200]
    np.testing.assert_allclose(full, 2 * np.pi * 0.33 / 6, rtol=1e-11)
    t = T[60:-60]
    _, uneven, std, _ = from_pulses(t_pulses, t, d, 0.33 * 0.15)
    _, even, _, _ = from_pulses(t_pulses[:, ::3], t, 3 * d)
    np.testing.assert_allclose(even, 6.0, rtol=1e-9)
    assert np.abs(uneven - 6).max() > 0.3
    assert from_pulses(t_pulses, T[-1:], d)[0][0, 0] == pytest.approx(180, abs=d[0])
    assert np.sqrt(np.mean((uneven - 6) ** 2)) == pytest.approx(np.sqrt(np.mean(std**2)), rel=0.5)


@pytest.mark.parametrize("distance_std", [0.005, 0.03])
def test_standard_deviation_of_speed_with_misplaced_pulses(distance_std):
    rng = np.random.default_rng(5)
    t_pulses = (np.arange(4000) * D + distance_std * rng.standard_normal(4000)) / 5.0
    t = np.linspace(10, 790, 20000)
    _, speed, std, _ = from_pulses(t_pulses, t, D, distance_std)
    assert np.sqrt(np.mean((speed - 5) ** 2)) == pytest.approx(np.sqrt(np.mean(std**2)), rel=0.25)


def test_reverse_counts_like_forward():
    forward = wheel_pulses(TWO, T, DRIVE, STRAIGHT, max_pulses=300)
    backward = wheel_pulses(TWO, T, -DRIVE, STRAIGHT, max_pulses=300)
    for a, b in zip(forward, backward, strict=True):
        np.testing.assert_array_equal(a, b)
    assert (wheel_speeds(TWO, -DRIVE, STRAIGHT) <= 0).all()


def test_too_little_room_is_said():
    t_pulses, count = wheel_pulses(TWO, T, DRIVE, STRAIGHT, max_pulses=7)
    full, _ = wheel_pulses(TWO, T, DRIVE, STRAIGHT, max_pulses=300)
    assert (np.asarray(count) > 7).all()
    np.testing.assert_array_equal(t_pulses, np.asarray(full)[:, :7])


def test_derivative_of_pulse_times():
    """dt / dradius against central differences, and finite for every parameter at rest too."""

    def times(radius):
        wheel = dataclasses.replace(TWO, radius=jnp.stack([radius, radius]))
        return wheels.wheel_pulses(wheel, T, DRIVE, STRAIGHT, max_pulses=300)[0][0, :60]

    step = 1e-6
    plus, minus = (
        np.asarray(wheel_pulses(sensor(radius=radius), T, DRIVE, STRAIGHT, max_pulses=300)[0])[0, :60]
        for radius in (0.33 + step, 0.33 - step)
    )
    numeric = (plus - minus) / (2 * step)
    np.testing.assert_allclose(quick_jit(jax.jacfwd(times))(0.33), numeric, rtol=1e-6)

    def total(wheel, t, speed, yaw_rate):
        t_pulses, _ = wheel_pulses(wheel, t, speed, yaw_rate, max_pulses=300)
        results = way_speed_and_standstill(t_pulses, t, pulse_distance(wheel), 0.01, 1.0)[:3]
        return jnp.where(jnp.isfinite(t_pulses), t_pulses, 0).sum() + sum(jnp.sin(x).sum() for x in results)

    gradient_of = quick_jit(jax.grad(total, argnums=(0, 1, 2, 3)))
    for speed in (DRIVE, STRAIGHT):
        gradient = gradient_of(TWO, T, speed, STRAIGHT)
        for leaf in jax.tree.leaves(gradient):
            assert np.isfinite(leaf).all()


def test_batches_jit_and_vmap():
    scale = np.linspace(0.6, 1.4, 10).reshape(2, 5, 1)
    speed, yaw_rate = scale * DRIVE, 0.1 * scale * np.ones_like(T)
    wheel = WheelSensor(radius=0.33, track_width=1.4, pulses_per_turn=2)

    def run(speed, yaw_rate):
        t_pulses, count = wheels.wheel_pulses(wheel, T, speed, yaw_rate, max_pulses=300)
        return t_pulses, count, *way_speed_and_standstill(t_pulses, T, wheels.pulse_distance(wheel), 0.0, 1.0)

    whole = quick_jit(run)(speed, yaw_rate)
    assert whole[0].shape == (2, 5, 2, 300) and whole[1].shape == (2, 5, 2) and whole[2].shape == (2, 5, 2, 601)
    mapped = quick_jit(jax.vmap(jax.vmap(run)))(speed, yaw_rate)
    for a, b in zip(mapped, whole, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-10)
    t_pulses, count = wheels.wheel_pulses(wheel, T, speed[1, 3], yaw_rate[1, 3], max_pulses=300)
    one = t_pulses, count, *from_pulses(t_pulses, T, pulse_distance(wheel))
    for a, b in zip(one, whole, strict=True):
        np.testing.assert_allclose(a, b[1, 3], rtol=1e-10, atol=1e-10)


def test_single_precision_stays():
    wheel, t, speed = jax.tree.map(np.float32, (TWO, T, DRIVE))

    def run():
        t_pulses, _ = wheels.wheel_pulses(wheel, t, speed, 0 * speed, max_pulses=300)
        d = wheels.pulse_distance(wheel)
        return t_pulses, d, *wheels.speed_from_pulses(t_pulses, t, d), wheels.way_from_pulses(t_pulses, t, d)

    assert {value.dtype for value in jax.eval_shape(run)} == {jnp.dtype(np.float32)}


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match="yaw_rate must have shape"):
        wheel_speeds(TWO, DRIVE, STRAIGHT[:5])
    with pytest.raises(ValueError, match=r"\bt must have shape"):
        wheel_pulses(TWO, T[:5], DRIVE, STRAIGHT, max_pulses=9)
    for function in (correct_wheel_speeds, yaw_rate_from_wheels):
        with pytest.raises(ValueError, match="wheel_speed must have shape"):
            function(TWO, np.zeros((4, 7)))
    for function in (wheels.speed_from_pulses, wheels.way_from_pulses, wheels.standstill_from_pulses):
        with pytest.raises(ValueError, match=r"\bt must have shape"):
            function(np.arange(7.0), np.zeros((2, 5)), 1.0)
        with pytest.raises(ValueError, match="t_pulses must have shape"):
            function(1.0, T, 1.0)
    with pytest.raises(ValueError, match="quiet must have shape"):
        wheels.standstill_from_pulses(np.arange(7.0), T, np.ones(2))
    with pytest.raises(ValueError, match=r"magnet_error must have shape \(2, 2\), got \(2,\)"):
        wheel_pulses(dataclasses.replace(TWO, magnet_error=np.zeros(2)), T, DRIVE, STRAIGHT, max_pulses=9)
    with pytest.raises(ValueError, match=r"radius must have shape \(2,\), got \(4,\)"):
        pulse_distance(WheelSensor(radius=np.ones(4)))
