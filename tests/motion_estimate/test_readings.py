"""What of a recording the motion estimators see."""

import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.readings import motion_readings
from altijax.recordings import Recording


def made(**gnss: object) -> Recording:
    t, epochs = np.arange(0, 10, 0.02), np.arange(-2.0, 14.0, 1.0)
    imu = pd.DataFrame({name: np.ones(t.size) for name in ("ax", "ay", "az", "gx", "gy", "gz")}, index=t + 50)
    columns = {"v_e": 1.0, "v_n": 2.0, "v_u": 0.5} | gnss
    return Recording(name="made", imu=imu, gnss=pd.DataFrame(columns, index=epochs + 50))


def test_epochs_outside_the_imu_are_left_out_and_none_counts_twice() -> None:
    readings = motion_readings(made(), use_gyro=True, delay=0.1)
    there = np.isfinite(np.asarray(readings.std)[:, 0])
    np.testing.assert_allclose(np.asarray(readings.instant)[there], np.arange(1.0, 11.0))
    steps = np.count_nonzero(np.diff(readings.share))
    assert steps % 2 == 0 and readings.instant.size % 64 == 0


def test_stated_accuracies_are_used_and_missing_ones_filled() -> None:
    sd = np.full(16, 0.04)
    sd[5] = np.nan
    readings = motion_readings(made(sd_e=sd), use_gyro=False, delay=0.0)
    std = np.asarray(readings.std)[np.isfinite(np.asarray(readings.std)[:, 0])]
    np.testing.assert_allclose(std[:, 0], 0.04)
    np.testing.assert_allclose(std[:, 1], 0.1)
    assert not np.asarray(readings.readings)[:, 3:6].any()


def test_instants_between_epochs_keep_intervals_short() -> None:
    readings = motion_readings(made(), use_gyro=False, delay=0.1, longest=0.5)
    instants = np.asarray(readings.instant)
    there = np.isfinite(np.asarray(readings.std)[:, 0])
    np.testing.assert_allclose(instants[there], np.arange(1.0, 11.0))
    inner = (instants >= 1.0) & (instants <= 10.0) & (np.asarray(readings.delayed) > 0)
    np.testing.assert_allclose(instants[inner], np.arange(1.0, 10.1, 0.5))


def test_streams_that_do_not_meet_are_named() -> None:
    with pytest.raises(ValueError, match="'made': 2 GNSS velocities lie within"):
        motion_readings(made(), use_gyro=True, delay=-10.5)
