"""Dead reckoning: the exact equations' speed, and bars that scattered starts and noise fall within."""

from collections.abc import Iterator

import jax
import numpy as np
import pytest

from altijax.speed import speed_error_growth
from altijax.speed_estimate.dead_reckoning import Reckoned, Start, reckon
from altijax.speed_estimate.model import SpeedNoise, state_names

NAMES = state_names("2+3")
GRAVITY, DT = 9.80665, 0.02
T = np.arange(0, 40, DT)
RATE = 0.2 * np.sin(0.4 * T)
SPEED = 12 + 3 * np.sin(0.3 * T)
NONE = SpeedNoise(
    acceleration=0.0, rotation=0.0, vibration=0.0, road_roll=0.0, lateral=0.0, accelerometer_walk=0.0, gyro_walk=0.0
)


@pytest.fixture(scope="module", autouse=True)
def double_precision() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


def reckoned(method: str, std: dict[str, float], noise: SpeedNoise = NONE, **off: float) -> Reckoned:
    """Error-free readings of a level road from a start with errors of this standard deviation, off by so much."""
    states = {"speed": 12.0} | off
    if "speed" in off:
        states["speed"] += 12.0
    start = Start(
        speed=np.float64(states["speed"]),
        roll=np.float64(0.0),
        states=np.array([states.get(name, 0.0) for name in NAMES]),
        covariance=np.diag([std.get(name, 0.0) ** 2 for name in NAMES]),
    )
    f = np.stack([0.9 * np.cos(0.3 * T), SPEED * RATE, np.full(T.size, GRAVITY)], -1)
    w = np.stack([0 * T, 0 * T, RATE], -1)
    levels = jax.tree.map(np.float64, noise)
    return reckon(method, NAMES, start, f, w, 0 * T, np.float64(GRAVITY), DT, levels, 0.2)


@pytest.mark.parametrize("method", ["conventional", "roll"])
def test_error_free_readings_give_the_speed_without_error(method: str) -> None:
    found = reckoned(method, {})
    np.testing.assert_allclose(found.speed, SPEED, atol=0.01)
    np.testing.assert_allclose(found.std, 0, atol=1e-9)


@pytest.mark.parametrize("name", ["speed", "pitch", "gyro_bias_y", "gyro_bias_z", "accelerometer_bias_x"])
@pytest.mark.parametrize("method", ["conventional", "roll", "aided"])
def test_one_standard_deviation_at_the_start_is_one_later(method: str, name: str) -> None:
    small = 1e-4
    exact, off = reckoned(method, {name: small}), reckoned(method, {}, **{name: small})
    false = np.asarray(reckoned(method, {}).std)
    moved = np.sqrt(np.asarray(off.speed - exact.speed) ** 2 + false**2)
    np.testing.assert_allclose(exact.std, moved, rtol=0.02, atol=1e-6)


def test_bars_of_the_loop_grow_as_its_errors_do() -> None:
    growth, _ = speed_error_growth(RATE, DT)
    np.testing.assert_allclose(reckoned("roll", {"speed": 0.5}).std, 0.5 * np.asarray(growth), rtol=0.03)


def test_noise_on_the_way_has_the_variance_of_its_integral() -> None:
    level = reckoned("conventional", {}, SpeedNoise(**{**vars(NONE), "acceleration": 0.03}))
    np.testing.assert_allclose(level.std, 0.03 * np.sqrt(T), atol=1e-6)
    tilt = reckoned("conventional", {}, SpeedNoise(**{**vars(NONE), "rotation": 0.002}))
    np.testing.assert_allclose(np.asarray(tilt.std)[100:], (GRAVITY * 0.002 * np.sqrt(T**3 / 3))[100:], rtol=0.02)


def test_what_the_conventional_method_neglects_is_in_its_bars_alone() -> None:
    roll = SpeedNoise(**{**vars(NONE), "road_roll": 0.03})
    neglected = np.asarray(reckoned("conventional", {}, roll).std)
    twice = np.cumsum(np.cumsum(np.abs(RATE))) * DT**2
    np.testing.assert_allclose(neglected[800:], (GRAVITY * 0.03 * twice)[800:], rtol=0.02)
    np.testing.assert_allclose(reckoned("roll", {}, roll).std, 0, atol=1e-9)
