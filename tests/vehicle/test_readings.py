"""Instants: at the epochs, dense enough, on the right clock."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.motion_estimate.intervals import instants_at
from altijax.vehicle.readings import instants_of, readings_of
from tests.vehicle.made import short_drive


@pytest.mark.parametrize(("shortest", "longest"), [(0.1, 1.0), (0.4, 0.5), (2.0, 1.0)])
def test_no_interval_is_too_long_or_too_short(shortest: float, longest: float) -> None:
    readings = readings_of(short_drive(), use_gyro=True, delay=0.1, shortest=shortest, longest=longest)
    steps = np.diff(instants_of(readings, 0.1))
    steps = steps[steps > 1e-9]
    assert steps.max() < 1.5 * longest + 1e-9
    assert np.median(steps) > 0.5 * min(shortest, longest)


def test_instants_cover_the_imu_and_move_with_the_delay() -> None:
    readings = readings_of(short_drive(), use_gyro=True, delay=0.1, shortest=0.1, longest=1.0)
    t = instants_of(readings, 0.1)
    assert t[0] == 0 and t[-1] >= short_drive().imu.index[-1] - 1e-6
    moved = instants_of(readings, 0.15)
    on_receiver = (np.asarray(readings.delayed) > 0) & (moved > 0)
    np.testing.assert_allclose((t - moved)[on_receiver], 0.05, atol=1e-9)
    np.testing.assert_allclose(moved, instants_at(readings, jnp.asarray(0.15)), atol=1e-12)


def test_without_a_receiver_all_is_on_the_clock_of_the_imu() -> None:
    readings = readings_of(replace(short_drive(), gnss=None), use_gyro=True, delay=0.0, shortest=0.4, longest=0.5)
    assert not np.asarray(readings.delayed).any()
