"""Standstills are found, and nothing else is taken for one."""

from dataclasses import replace

import numpy as np

from altijax.datasets import load_dataset
from altijax.vehicle.measurements.standstill import expected, measured, still
from tests.vehicle.measurements.state import AT, NOW, driving


def test_rest_is_no_velocity_and_no_turning() -> None:
    np.testing.assert_allclose(expected(driving(), AT, NOW), [0, 10, 0, 0, 0, 0.2])


def test_only_what_stands_is_still() -> None:
    recording = load_dataset("hill-road")
    t = np.arange(0.0, 90.0, 0.5)
    quiet = still(recording, t)
    reference = recording.reference
    speed = np.interp(t, reference.index, np.sqrt((reference[["v_e", "v_n", "v_u"]] ** 2).sum(axis=1)))
    assert quiet.sum() > 10
    assert speed[quiet].max() < 0.1
    assert np.isfinite(measured(recording, t).std[quiet]).all()
    assert np.isinf(measured(recording, t).std[~quiet]).all()


def test_without_a_gyro_nothing_is_said_to_stand() -> None:
    recording = load_dataset("hill-road")
    bare = replace(recording, imu=recording.imu[["ax", "ay", "az"]])
    assert not still(bare, np.arange(0.0, 90.0)).any()
