"""Readings between any instants: exact where they run straight, and gaps counted."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.motion_estimate.intervals import MotionReadings, instants_at, intervals_between
from altijax.motion_estimate.readings import motion_readings
from altijax.recordings import Recording


def made(gap: bool = False) -> MotionReadings:
    t = np.arange(0, 10, 0.02)
    if gap:
        t = t[(t < 4.01) | (t > 4.99)]
    slopes = np.array([1.0, -0.5, 0.2, 0.01, 0.02, -0.03])
    imu = pd.DataFrame(t[:, None] * slopes, columns=["ax", "ay", "az", "gx", "gy", "gz"], index=t + 100.0)
    epochs = np.arange(0.5, 9, 1.0)
    gnss = pd.DataFrame({"v_e": epochs, "v_n": 0 * epochs, "v_u": np.nan}, index=epochs + 100.2)
    return motion_readings(Recording(name="made", imu=imu, gnss=gnss), use_gyro=True, delay=0.2)


def test_means_of_straight_readings_are_those_at_the_middles() -> None:
    readings = made()
    steps = np.count_nonzero(np.diff(readings.share))
    t = instants_at(readings, jnp.asarray(0.207))
    intervals = intervals_between(readings, t)
    middle = t[:-1, None] + intervals.duration[:, None] * (np.arange(steps) + 0.5) / steps
    whole = np.asarray(intervals.duration) > 0
    np.testing.assert_allclose(intervals.f_b[:, :steps, 0][whole], middle[whole], atol=1e-9)
    np.testing.assert_allclose(intervals.w_b[:, :steps, 2][whole], -0.03 * middle[whole], atol=1e-9)
    assert not intervals.gap.any()


def test_instants_follow_the_delay_and_stay_in_order() -> None:
    readings = made()
    there = np.isfinite(np.asarray(readings.std)[:, 0])
    np.testing.assert_allclose(np.asarray(instants_at(readings, jnp.asarray(0.25)))[there], np.arange(0.45, 8.5, 1.0))
    late = instants_at(replace(readings, instant=readings.instant), jnp.asarray(3.0))
    assert (np.diff(late) >= 0).all() and float(late[0]) == 0.0
    assert np.isinf(np.asarray(readings.std)[:, 2]).all()


def test_a_gap_of_the_imu_is_counted() -> None:
    readings = made(gap=True)
    intervals = intervals_between(readings, instants_at(readings, jnp.asarray(0.2)))
    assert abs(float(intervals.gap.sum()) - 1.0) < 0.03
    assert float(intervals.gap.max()) > 0.45
