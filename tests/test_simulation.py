"""Simulated recordings: what ideal instruments record is the truth, and equal keys make equal recordings."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.constants import STANDARD_GRAVITY
from altijax.doppler import DopplerReceiver
from altijax.instruments import DOPPLER_1_HZ, MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import flight_pose, gybing_windsurfer, ideal_readings, road_pose
from altijax.recordings import Recording
from altijax.roads import rest_to_rest, winding_road
from altijax.sensors import Accelerometer, Gyro
from altijax.simulation import _pose, simulate_recording
from altijax.wheels import WheelSensor

ROAD = winding_road([0.4], [200.0], [0.5], [0.06], [300.0], [0.3], -2.0)
PROFILE = rest_to_rest(200.0, 24.0, 5.0)
RATES = {"imu": 50.0}
STREAMS = ("imu", "wheel", "gnss", "reference")


def simulated(**options: object) -> Recording:
    noisy = dict(accelerometer=MEMS_ACCELEROMETER, gyro=MEMS_GYRO, wheel=WheelSensor(), receiver=DOPPLER_1_HZ)
    return simulate_recording((ROAD, PROFILE), **(noisy | {"rates": RATES} | options))


def test_equal_keys_make_equal_recordings_and_others_do_not() -> None:
    one, two, other = (simulated(key=jax.random.key(seed)) for seed in (3, 3, 4))
    for stream in STREAMS:
        pd.testing.assert_frame_equal(getattr(one, stream), getattr(two, stream))
    assert (one.imu != other.imu).to_numpy().any(0).all()
    pd.testing.assert_frame_equal(one.reference, other.reference)


def test_a_longer_recording_begins_as_a_shorter_one() -> None:
    whole, part = (
        simulated(),
        simulate_recording(
            ((ROAD, PROFILE), 10.0),
            accelerometer=MEMS_ACCELEROMETER,
            gyro=MEMS_GYRO,
            receiver=DOPPLER_1_HZ,
            rates=RATES,
        ),
    )
    for stream in ("imu", "gnss", "reference"):
        frame = getattr(part, stream)
        assert len(frame) < len(getattr(whole, stream))
        pd.testing.assert_frame_equal(frame, getattr(whole, stream)[: len(frame)])


def test_ideal_instruments_read_the_truth() -> None:
    receiver = DopplerReceiver(rate=5.0)
    found = simulated(accelerometer=None, gyro=Gyro(), receiver=receiver, rates=RATES | {"reference": 50.0})
    truth = jax.jit(partial(ideal_readings, partial(road_pose, ROAD, PROFILE)))(
        np.asarray(found.imu.index), STANDARD_GRAVITY
    )
    np.testing.assert_allclose(found.imu, np.hstack([truth.f_b, truth.w_b]), atol=1e-9)
    np.testing.assert_allclose(found.reference[["v_e", "v_n", "v_u"]], truth.velocity, atol=1e-9)
    np.testing.assert_allclose(found.reference["alt"], truth.position[:, 2], atol=1e-9)
    truth_then = found.reference.loc[found.gnss.index, ["v_e", "v_n", "v_u"]]
    assert len(truth_then) == 121
    np.testing.assert_allclose(found.gnss, truth_then, atol=1e-9)


def test_pulses_give_the_distance() -> None:
    found = simulated(wheel=WheelSensor(radius=0.31, pulses_per_turn=16))
    assert found.pulses_per_turn == 16 and found.wheel_radius == 0.31
    step = 2 * np.pi * 0.31 / 16
    speed = np.linalg.norm(found.reference[["v_e", "v_n", "v_u"]], axis=1)
    assert found.wheel["speed"].sum() * 0.02 == pytest.approx(np.trapezoid(speed, dx=0.1), abs=3 * step)


def test_a_flight_drifts_with_the_wind() -> None:
    wind = jnp.array([3.0, 0.0, 0.0])
    flight = partial(flight_pose, ROAD, PROFILE, wind, STANDARD_GRAVITY)
    found = simulate_recording(flight, receiver=DopplerReceiver(), rates=RATES)
    assert found.wheel is None and found.gnss["v_e"].iloc[0] == pytest.approx(3.0)
    assert found.imu.index[-1] == pytest.approx(24.0)


def test_a_motion_lasts_until_the_last_leg_that_goes_anywhere() -> None:
    falling, upright = (gybing_windsurfer(6.0, 0.5, 40.0, 24.0, fall_start) for fall_start in (8.0, 30.0))
    assert [_pose(motion)[1] for motion in (falling, upright)] == pytest.approx([24.0, 24.0])
    assert _pose((falling, 12.0))[1] == 12.0


def test_readings_may_have_been_shaken() -> None:
    t = 5.0 + np.arange(501) / 50
    readings = jax.jit(partial(ideal_readings, partial(road_pose, ROAD, PROFILE)))(t, STANDARD_GRAVITY)
    shaken = replace(readings, f_b=readings.f_b + jnp.array([0.0, 0.0, 1.0]))
    calm, rough = (simulate_recording(motion) for motion in (readings, shaken))
    np.testing.assert_array_equal(calm.imu.index, t)
    np.testing.assert_allclose(rough.imu - calm.imu, np.tile([0.0, 0.0, 1.0], (501, 1)), atol=1e-9)


def test_temperature_is_recorded_and_acts() -> None:
    warming = Accelerometer(bias_temperature=0.01)
    found = simulated(accelerometer=warming, temperature=lambda t: 25 + t)
    cold = simulated(accelerometer=warming, temperature=25.0)
    np.testing.assert_allclose(found.imu["temperature"], 25 + found.imu.index)
    np.testing.assert_allclose(found.imu["ax"] - cold.imu["ax"], 0.01 * found.imu.index, atol=1e-9)


def test_what_does_not_fit_is_told() -> None:
    with pytest.raises(ValueError, match=r"give \(motion, seconds\)"):
        simulate_recording(lambda t: (jnp.zeros(3), jnp.eye(3)))
    with pytest.raises(ValueError, match="a receiver has a rate"):
        simulated(rates={"gnss": 5.0})
    with pytest.raises(ValueError, match="whole multiple"):
        simulated(rates={"imu": 50.0, "reference": 20.0})
