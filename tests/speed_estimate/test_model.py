"""The model of the speed filter against exact motions: rates by differentiation, readings by `ideal_readings`."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.motions import Readings, ideal_readings, road_pose
from altijax.roads import SpeedProfile, winding_road
from altijax.rotations import euler_to_matrix, matrix_to_euler
from altijax.speed_estimate.model import SENSORS, STATES, SpeedNoise, Step, measurements, model_of, state_names

G = 9.81
ROAD = winding_road([0.5, 0.3], [210.0, 97.0], [0.4, 2.0], [0.06, 0.04], [170.0, 83.0], [0.0, 1.0], 4.0)
WITHOUT_CANT = replace(ROAD, cant=jnp.zeros_like(ROAD.cant))
PROFILE = SpeedProfile(
    start=jnp.array([1.0]),
    stop=jnp.array([60.0]),
    ramp=jnp.array([5.0]),
    speed=jnp.array([12.0]),
    modulation=jnp.array([1.5]),
    wavenumber=jnp.array([0.1]),
    phase=jnp.array([0.7]),
)
# Roll, pitch, yaw of the IMU on the car; where it lies, along its own x axis.
MOUNTING, LEVER = (0.04, -0.1, -0.08), 0.7
TIMES = jnp.linspace(8.0, 40.0, 7)


@cache
def motion(
    lever: float, mounting: tuple[float, float, float] = MOUNTING, canted: bool = True
) -> tuple[Readings, jax.Array, jax.Array]:
    """Readings of the IMU, the vehicle's speed, and the exact rates of speed, pitch and roll (time, 3)."""
    C_vb, road = euler_to_matrix(jnp.array(mounting)), ROAD if canted else WITHOUT_CANT

    def pose(t: jax.Array) -> tuple[jax.Array, jax.Array]:
        position, C_nv = road_pose(road, PROFILE, t)
        return position + C_nv @ C_vb[:, 0] * lever, C_nv @ C_vb

    def quantities(t: jax.Array) -> jax.Array:
        velocity = jax.jvp(lambda t: road_pose(road, PROFILE, t)[0], (t,), (1.0,))[1]
        _, C_nb = pose(t)
        roll, pitch, _ = matrix_to_euler(C_nb)
        return jnp.stack([jnp.linalg.norm(velocity), pitch, roll])

    found, rates = jax.jit(jax.vmap(lambda t: jax.jvp(quantities, (t,), (1.0,))))(TIMES)
    return jax.jit(lambda t: ideal_readings(pose, t, G))(TIMES), found, rates


def step_of(readings: Readings, i: int) -> Step:
    w, zero = readings.w_b[i], jnp.zeros(())
    return Step(
        f_b=readings.f_b[i],
        w_b=w,
        w_end=w,
        w_slow=w,
        w_dot=jnp.zeros(3),
        vibration=zero,
        shaking=zero,
        shaking_told=zero != 0,
        shaking_aided=zero != 0,
        still=zero != 0,
        aid_speed=zero,
        aid_acceleration=zero,
        aid_lead=zero,
        aided=zero != 0,
    )


def states_at(i: int, lever: float, sensors: str) -> dict[str, jax.Array]:
    """The true states, all constants those of error-free sensors."""
    readings, found, _ = motion(lever)
    x = dict.fromkeys(state_names(sensors), jnp.zeros(()))
    forward = euler_to_matrix(jnp.array(MOUNTING))[0]
    x |= {"speed": found[i, 0], "pitch": found[i, 1], "roll": found[i, 2], "lever_x": jnp.asarray(lever)}
    if sensors == "6":
        v_b = readings.C_nb[i].T @ readings.velocity[i]
        x |= dict(zip(("speed", "lateral_speed", "vertical_speed"), v_b, strict=True))
    return x | {"travel_yaw": jnp.arctan2(forward[1], forward[0]), "travel_pitch": jnp.arcsin(forward[2])}


@pytest.mark.parametrize("sensors", SENSORS)
def test_rates_are_the_derivatives_of_the_motion(sensors: str) -> None:
    readings, _, rates = motion(LEVER)
    for i in range(TIMES.size):
        found = model_of(sensors).rates(states_at(i, LEVER, sensors), step_of(readings, i), G, SpeedNoise())
        # without a roll gyro the roll rate is a guess
        names = ("speed", "pitch") if sensors == "2+2" else ("speed", "pitch", "roll")
        exact = dict(zip(("speed", "pitch", "roll"), rates[i], strict=True))
        if sensors == "6":
            del exact["speed"]
            names = names[1:]
        for name in names:
            assert found[name] == pytest.approx(float(exact[name]), abs=1e-9), (name, i)


@pytest.mark.parametrize("sensors", SENSORS)
def test_measurements_are_what_is_expected_of_the_true_states(sensors: str) -> None:
    """The lateral reading with five sensors; no lateral and vertical speed with six; the vehicle's speed always."""
    lever = LEVER if sensors == "6" else 0.0
    readings, found, _ = motion(lever)
    model = model_of(sensors)
    for i in range(TIMES.size):
        x, step = states_at(i, lever, sensors), step_of(readings, i)
        assert model.travel_speed(x, step) == pytest.approx(float(found[i, 0]), abs=1e-9)
        rates = model.rates(x, step, G, SpeedNoise())
        expected = model.expected(x, x, rates, step, G)
        measured = [value for value, _, _ in measurements(step, SpeedNoise(), sensors, jnp.array(True))]
        assert len(expected) == len(measured)
        # without a roll gyro w_x is a guess
        checked = {"2+2": 0, "2+3": 1, "6": 2}[sensors]
        np.testing.assert_allclose(expected[:checked], measured[:checked], atol=1e-9)


def test_without_a_roll_gyro_the_lateral_reading_is_that_of_a_car_that_keeps_its_roll() -> None:
    """On a road without cant that climbs and winds, whatever the IMU's pitch on the car."""
    readings, found, _ = motion(0.0, (0.0, 0.2, 0.0), canted=False)
    model = model_of("2+2")
    for i in range(TIMES.size):
        x = dict.fromkeys(state_names("2+2"), jnp.zeros(()))
        x |= {"speed": found[i, 0], "pitch": found[i, 1], "roll": found[i, 2], "travel_pitch": jnp.asarray(-0.2)}
        step = step_of(readings, i)
        rates = model.rates(x, step, G, SpeedNoise())
        assert rates["roll"] == pytest.approx(0.0, abs=1e-9)
        assert model.expected(x, x, rates, step, G)[0] == pytest.approx(float(readings.f_b[i, 1]), abs=1e-9)


def test_states_are_named_in_order() -> None:
    for sensors in SENSORS:
        names = state_names(sensors)
        assert names[0] == "speed" and [name for name in STATES if name in names] == list(names)
    with pytest.raises(ValueError, match="sensors must be one of"):
        state_names("3+3")
