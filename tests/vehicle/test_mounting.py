"""The mounting of an IMU is found from its readings and the speed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.datasets import load_dataset
from altijax.recordings import Recording
from altijax.vehicle.mounting import mounting_of


def mounted(recording: Recording, angles: tuple[float, float, float]) -> Recording:
    """The same with the IMU turned in the vehicle (yaw, pitch, roll in degrees)."""
    turn = Rotation.from_euler("ZYX", angles, degrees=True).inv()
    imu = recording.imu.copy()
    for triad in (["ax", "ay", "az"], ["gx", "gy", "gz"]):
        imu[triad] = turn.apply(imu[triad].to_numpy(float, copy=True))
    return replace(recording, imu=imu)


@pytest.mark.parametrize("angles", [(30.0, 20.0, -30.0), (180.0, 0.0, 0.0), (-90.0, 0.0, 20.0), (0.0, 0.0, 170.0)])
def test_any_mounting_is_found(angles: tuple[float, float, float]) -> None:
    recording = load_dataset("hill-road")
    found = mounting_of(mounted(recording, angles), recording.wheel["speed"])
    true = Rotation.from_euler("ZYX", angles, degrees=True)
    assert np.degrees((found * true.inv()).magnitude()) < 6


def test_a_small_one_is_left_to_the_smoother() -> None:
    recording = load_dataset("hill-road")
    assert mounting_of(mounted(recording, (3.0, 2.0, -2.0)), recording.wheel["speed"]).magnitude() == 0


def test_a_vehicle_that_never_changes_its_speed_tells_gravity_alone() -> None:
    recording = load_dataset("hill-road")
    still = mounted(recording, (0.0, 0.0, 40.0))
    still = replace(still, imu=still.imu[:3.0])
    found = mounting_of(still, recording.wheel["speed"] * 0)
    assert np.degrees(np.abs(found.as_rotvec()[2])) < 5
    assert np.degrees(found.magnitude()) == pytest.approx(40, abs=3)
