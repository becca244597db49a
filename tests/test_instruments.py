"""Named instruments: published figures in their own units, and figures that follow from the papers' tables."""

import jax
import numpy as np
import pytest

from altijax import instruments
from altijax.constants import STANDARD_GRAVITY
from altijax.instruments import (
    DOPPLER_1_HZ,
    FIBRE_OPTIC_GYRO,
    JA_5V,
    MEMS_ACCELEROMETER,
    MEMS_GYRO,
    ND_PG1,
    VIBRATION_GYRO,
)
from altijax.sensors import accelerometer_output, gyro_output
from altijax.wheels import pulse_distance, wheel_pulses

KEY = jax.random.key(0)
REST = np.zeros((20000, 3))
GRAVITY = REST + np.array([0, 0, STANDARD_GRAVITY])


def test_published_figures_in_their_units():
    assert JA_5V.range / STANDARD_GRAVITY == pytest.approx(20)
    assert np.degrees([VIBRATION_GYRO.range, FIBRE_OPTIC_GYRO.range]) == pytest.approx(90)
    assert (VIBRATION_GYRO.bandwidth, FIBRE_OPTIC_GYRO.bandwidth) == (7, 20)
    assert ND_PG1.pulses_per_turn == 2
    assert DOPPLER_1_HZ.rate == 1
    assert MEMS_ACCELEROMETER.resolution * 16384 == pytest.approx(STANDARD_GRAVITY)
    assert MEMS_GYRO.resolution * 131 == pytest.approx(np.radians(1))
    assert MEMS_GYRO.g_sensitivity * STANDARD_GRAVITY == pytest.approx(np.radians(0.1))


@pytest.mark.parametrize(("gyro", "resolution"), [(VIBRATION_GYRO, 0.1), (FIBRE_OPTIC_GYRO, 0.06)])
def test_noise_of_the_gyros_is_their_resolution(gyro, resolution):
    dt = 1e-3
    reading = np.degrees(np.asarray(gyro_output(gyro, REST, REST, dt, key=KEY)))
    independent = np.pi * gyro.bandwidth * 20 * 3
    # The walk of the bias in 20 s adds less than 1 %.
    assert reading.std() == pytest.approx(resolution, rel=5 / (2 * independent) ** 0.5 + 0.01)


def test_data_sheet_noise_of_the_mems_gyro_is_one_sided():
    """0.005 deg/s/sqrt(Hz) makes the 0.05 deg/s that the same table gives for 100 Hz."""
    assert np.degrees(MEMS_GYRO.noise_density) * 100**0.5 == pytest.approx(0.05)


def test_every_instrument_measures_rest():
    for name, record in vars(instruments).items():
        if not name.isupper() or name == "STANDARD_GRAVITY":
            continue
        kind = type(record).__name__
        if kind == "Accelerometer":
            reading = np.asarray(accelerometer_output(record, GRAVITY, 0.01, key=KEY))
            assert np.abs(reading.mean(0) - [0, 0, STANDARD_GRAVITY]).max() < 0.05, name
            assert 0 < reading.std(0).max() < 0.1, name
        elif kind == "Gyro":
            reading = np.asarray(gyro_output(record, REST, GRAVITY, 0.01, key=KEY))
            assert 0 < np.abs(np.degrees(reading)).max() < 0.7, name
        else:
            assert kind in ("WheelSensor", "DopplerReceiver")


def test_nd_pg1_on_the_level_course():
    """Ten metres are about ten pulses of each wheel: so coarse is the way of table 2."""
    t = np.linspace(0, 17, 171)
    speed = np.interp(t, [0, 2, 15, 17], [0, 10 / 15, 10 / 15, 0])
    _, count = wheel_pulses(ND_PG1, t, speed, 0 * t, max_pulses=20)
    assert (np.asarray(count) * np.asarray(pulse_distance(ND_PG1)) <= 10).all() and (np.asarray(count) == 9).all()


def test_printed_ways_are_no_counts_of_one_step():
    """What the docstring of ND_PG1 says of tables 2 and 5 of [shirai2000]."""
    ways = np.array([9.979, 168.510, 164.850, 167.082, 166.224])
    steps = np.geomspace(0.25, 0.56, 40001)

    def best_misfit(ways):
        turns = ways[:, None] / steps
        misfit = np.abs(turns - np.round(turns)).max(0)
        return misfit.min(), steps[misfit.argmin()]

    misfit, step = best_misfit(ways)
    assert misfit == pytest.approx(0.072, abs=0.001) and step == pytest.approx(0.454, abs=0.001)
    assert misfit > 30 * 0.0005 / step
    rng = np.random.default_rng(0)
    random = np.array([best_misfit(ways + rng.uniform(-0.4, 0.4, 5))[0] for _ in range(300)])
    assert (random <= misfit).mean() == pytest.approx(0.28, abs=0.03)
