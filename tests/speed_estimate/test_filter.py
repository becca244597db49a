"""The speed filter on drives made up exactly: what it holds, what it learns, and that its numbers stay numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.programs import count_programs
from altijax.speed_estimate.filter import MARGIN, SpeedState, SpeedTrack, filter_speed, first_state
from altijax.speed_estimate.model import SENSORS, STATES, SpeedNoise, state_names

GRAVITY, DT, N = 9.81, 0.2, 600
run = jax.jit(filter_speed, static_argnames="sensors")


def drive(mounting: tuple[float, float, float] = (0.0, 0.0, 0.0), noise: float = 0.0, seed: int = 0) -> dict:
    """Readings of two minutes of S-curves on a level road; roll, pitch, yaw of the IMU on the car in rad."""
    t = DT * np.arange(N + 1)
    speed = 10 + 3 * np.sin(0.25 * t)
    yaw = 1.2 * np.sin(0.35 * t)
    rate = np.diff(yaw) / DT
    middle = 0.5 * (speed[1:] + speed[:-1])
    f_v = np.stack([np.diff(speed) / DT, rate * middle, np.full(N, GRAVITY)], -1)
    w_v = np.stack([np.zeros(N), np.zeros(N), rate], -1)
    roll, pitch, turned = mounting
    C_vb = Rotation.from_euler("ZYX", [turned, -pitch, roll]).as_matrix()
    rng = np.random.default_rng(seed)
    return {
        "f_b": f_v @ C_vb + noise * rng.normal(size=(N, 3)),
        "w_b": w_v @ C_vb + 0.02 * noise * rng.normal(size=(N, 3)),
        "vibration": np.zeros(N),
        "still": np.zeros(N),
        "aid_speed": speed[1:],
        "aid_acceleration": np.gradient(speed, DT)[1:],
        "aid_lead": np.zeros(N),
        "aided": np.ones(N),
        "speed0": speed[0],
        "pitch0": pitch,
        "gravity": GRAVITY,
        "dt": DT,
    }


def state(track: SpeedTrack, sensors: str, name: str) -> tuple[float, float]:
    index = state_names(sensors).index(name)
    return float(track.states[-1, index]), float(track.states_std[-1, index])


@pytest.mark.parametrize("sensors", SENSORS)
def test_an_outage_in_curves_is_bridged(sensors: str) -> None:
    made = drive((0.03, -0.1, -0.08), noise=0.05, seed=1)
    made["f_b"] = made["f_b"] + np.array([0.1, -0.1, 0.05])
    made["w_b"] = made["w_b"] + np.array([0.002, -0.003, 0.004])
    aided = np.arange(N) < 300
    track = run(**made | {"aided": aided}, noise=SpeedNoise(aid=0.02, lateral=0.1), sensors=sensors)
    error = np.asarray(track.speed) - made["aid_speed"]
    assert np.abs(error[250:300]).max() < 0.1
    assert np.sqrt(np.mean(error[300:] ** 2)) < 0.5
    assert np.mean(np.abs(error[300:]) < 2 * np.asarray(track.speed_std[300:])) > 0.8


def test_mounting_is_found() -> None:
    track = run(**drive((0.0, -0.115, -0.077), noise=0.05, seed=2), noise=SpeedNoise(aid=0.02), sensors="6")
    for name, truth in (("travel_yaw", 0.077), ("travel_pitch", 0.115)):
        value, std = state(track, "6", name)
        assert abs(value - truth) < 3 * std, name
        assert std < 0.5 * STATES[name]


def test_the_delay_of_the_imu_is_found() -> None:
    made = drive(noise=0.02, seed=3)
    t = DT * np.arange(1, N + 1)
    late = {"aid_speed": 10 + 3 * np.sin(0.25 * (t + 0.15)), "aid_acceleration": 0.75 * np.cos(0.25 * (t + 0.15))}
    track = run(**made | late, noise=SpeedNoise(aid=0.02, acceleration=0.01, rotation=0.0002))
    value, std = state(track, "2+2", "imu_delay")
    assert abs(value - 0.15) < 3 * std < 0.12


def test_turning_tells_the_speed_and_going_straight_does_not() -> None:
    made = drive() | {"aided": np.zeros(N), "pitch0": 0.0}
    curves = run(**made | {"speed0": made["speed0"] + 1.0})
    straight = run(**made | {"w_b": np.zeros((N, 3)), "f_b": np.tile([0.0, 0.0, GRAVITY], (N, 1))})
    assert jnp.max(jnp.abs(curves.speed - made["aid_speed"])[200:]) < 1.5
    assert jnp.max(curves.speed_std[200:]) < 2 and jnp.min(straight.speed_std[200:]) > 50


@pytest.mark.parametrize("phase", [0, 3])
def test_what_shakes_a_car_tells_its_speed_where_it_does_not_turn(phase: int) -> None:
    """An aid once a second teaches it whichever steps have it, and bumps of a second count once."""
    rng = np.random.default_rng(6)
    speed = 10 + 6 * np.sin(0.25 * DT * np.arange(1, N + 1))
    bumps = np.repeat(rng.normal(size=N // 5 + 1), 5)[2 : N + 2]
    acceleration = np.gradient(speed, DT)
    made = drive() | {
        "f_b": np.stack([acceleration + 0.1 * (np.arange(N) >= 300), 0 * speed, np.full(N, GRAVITY)], -1),
        "w_b": np.zeros((N, 3)),
        "aid_speed": speed,
        "aid_acceleration": acceleration,
        "aided": (np.arange(N) < 300) & (np.arange(N) % 5 == phase),
    }
    shaking = 0.004 * (1 + (speed / 3) ** 2) ** 0.75 * np.exp(0.5 * bumps)
    noise = SpeedNoise(aid=0.02, roughness=0.3, roughness_scatter=0.5)
    shaken, smooth = (run(**made | {"vibration": x}, noise=noise) for x in (shaking, np.zeros(N)))
    assert shaken.speed_std[-1] < 0.4 * smooth.speed_std[-1]
    assert abs(shaken.speed[-1] - speed[-1]) < 2 * shaken.speed_std[-1]
    gain, std = state(shaken, "2+2", "vibration_gain")
    assert abs(gain - 1.5) < 3 * std < 1.5


def test_a_wild_reading_of_the_aid_does_little() -> None:
    made = drive(noise=0.02, seed=4)
    wild = made["aid_speed"].copy()
    wild[400] += 30
    change = run(**made | {"aid_speed": wild}).speed - run(**made).speed
    assert 0 < jnp.max(jnp.abs(change)) < 0.5


@pytest.mark.parametrize("sensors", SENSORS)
def test_standing_still_gives_zero_speed_and_the_gyros_biases(sensors: str) -> None:
    bias = np.array([0.004, -0.003, 0.002])
    made = drive() | {
        "f_b": np.tile([0.1, 0.2, GRAVITY], (N, 1)),
        "w_b": np.tile(bias, (N, 1)),
        "still": np.ones(N),
        "aided": np.zeros(N),
        "speed0": 0.5,
    }
    track = run(**made, sensors=sensors)
    assert jnp.max(track.speed[-50:]) < 0.02
    for axis in "xyz" if sensors != "2+2" else "yz":
        assert state(track, sensors, f"gyro_bias_{axis}")[0] == pytest.approx(bias["xyz".index(axis)], abs=3e-4)


def test_what_the_aid_says_where_it_is_not_used_does_not_matter() -> None:
    made = drive() | {"aided": np.arange(N) < 200}
    garbage = np.where(made["aided"], made["aid_speed"], np.nan)
    np.testing.assert_array_equal(run(**made | {"aid_speed": garbage}).speed, run(**made).speed)


def test_parts_filled_up_and_joined_are_the_whole() -> None:
    """Two parts with their margins, the second one filled up to the length of the first."""
    rng = np.random.default_rng(9)
    made = drive(noise=0.05, seed=9) | {"vibration": rng.uniform(0, 0.01, N), "aided": np.arange(N) % 3 == 1}
    whole = run(**made)
    state = first_state(made["f_b"][0], made["w_b"][0], made["speed0"], made["pitch0"], GRAVITY)
    found = []
    for begin, end in ((0, 350), (350, N)):
        steps = np.arange(begin - MARGIN, begin + 350 + MARGIN)
        counted = (steps >= begin) & (steps < end)
        part = {name: value[np.clip(steps, 0, N - 1)] if np.ndim(value) else value for name, value in made.items()}
        track = run(**part | {"speed0": 0.0, "pitch0": 0.0}, counted=counted, start=state)
        state = SpeedState(states=track.states[-1], covariance=track.last_covariance)
        assert jnp.all(track.log_likelihood[~counted] == 0)
        found.append({name: np.asarray(values)[counted] for name, values in vars(track).items() if len(values) == 360})
    assert len(found[0]) == 7
    for name in found[0]:
        joined, expected = np.concatenate([part[name] for part in found]), np.asarray(getattr(whole, name))
        np.testing.assert_allclose(joined, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max(), err_msg=name)
    np.testing.assert_allclose(state.covariance, whole.last_covariance, rtol=1e-12, atol=1e-12)


def test_calling_it_again_compiles_nothing() -> None:
    made = drive()
    filter_speed(**made)
    with count_programs() as programs:
        filter_speed(**made | {"speed0": np.float64(9.0)})
    assert programs.names == []


@pytest.mark.parametrize("sensors", ["2+2", "6"])
def test_extreme_readings_keep_values_and_gradients_finite(sensors: str) -> None:
    rng = np.random.default_rng(5)
    n = 60
    made = {name: value[:n] if np.ndim(value) else value for name, value in drive().items()}
    made |= {
        "f_b": rng.uniform(-50, 50, (n, 3)),
        "w_b": rng.uniform(-10, 10, (n, 3)),
        "vibration": rng.uniform(0, 10, n),
        "aid_speed": rng.uniform(0, 100, n),
        "aided": rng.integers(0, 2, n),
        "still": rng.integers(0, 2, n),
        "pitch0": np.pi / 2,
    }

    def found(f_b: jax.Array, w_b: jax.Array) -> SpeedTrack:
        return filter_speed(**made | {"f_b": f_b, "w_b": w_b}, sensors=sensors)

    @jax.jit
    def with_slope(readings: tuple, direction: tuple) -> tuple:
        return jax.jvp(found, readings, direction)

    # Reverse mode is the transpose of this; test_contracts holds the two against each other.
    track, slope = with_slope((made["f_b"], made["w_b"]), tuple(rng.normal(size=(2, n, 3))))
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves((track, slope)))
    assert jnp.min(track.speed) >= 0


def test_the_likelihood_peaks_at_the_noise_that_was_there() -> None:
    rng = np.random.default_rng(6)
    made = drive(noise=0.02, seed=6)
    made["aid_speed"] = made["aid_speed"] + 0.2 * rng.normal(size=N)

    def log_likelihood(level: float) -> float:
        return float(jnp.sum(run(**made, noise=SpeedNoise(aid=level, lateral=0.05)).log_likelihood))

    assert log_likelihood(0.2) > max(log_likelihood(0.1), log_likelihood(0.4))


def test_the_gradient_is_the_difference_quotient() -> None:
    made = drive(noise=0.02, seed=8) | {"aided": np.arange(N) < 10, "pitch0": 0.01}

    def track(pitch0: jax.Array) -> SpeedTrack:
        return run(**made | {"pitch0": pitch0})

    speed, slope = jax.jvp(lambda pitch0: track(pitch0).speed[50], (0.01,), (1.0,))
    step = 1e-5
    quotient = (track(0.01 + step).speed[50] - track(0.01 - step).speed[50]) / (2 * step)
    assert speed == pytest.approx(float(track(0.01).speed[50]), rel=1e-12)
    assert slope == pytest.approx(float(quotient), rel=1e-4) and abs(slope) > 1e-3


def test_a_batch_is_the_single_problems() -> None:
    made = drive(noise=0.02, seed=7)
    speeds = made["speed0"] + np.linspace(-1, 1, 5)
    batch = jax.jit(jax.vmap(lambda speed0: filter_speed(**made | {"speed0": speed0}).speed))(speeds)
    np.testing.assert_allclose(batch[3], run(**made | {"speed0": speeds[3]}).speed, rtol=1e-9)


def test_float32_stays_float32() -> None:
    made = {name: np.asarray(value, np.float32) for name, value in drive(noise=0.02).items()}
    track = run(**made)
    assert track.speed.dtype == jnp.float32
    assert jnp.max(jnp.abs(track.speed - made["aid_speed"])) < 0.3


def test_wrong_arguments_are_named() -> None:
    made = drive()
    with pytest.raises(ValueError, match="f_b must have shape"):
        filter_speed(**made | {"f_b": np.zeros((N, 2))})
    with pytest.raises(ValueError, match="w_b must have shape"):
        filter_speed(**made | {"w_b": np.zeros((N - 1, 3))})
    with pytest.raises(ValueError, match="vibration must have shape"):
        filter_speed(**made | {"vibration": np.zeros(N - 1)})
    with pytest.raises(ValueError, match="speed0 must have shape"):
        filter_speed(**made | {"speed0": np.zeros(2)})
    with pytest.raises(ValueError, match="sensors must be one of"):
        filter_speed(**made, sensors="3+3")
