"""The simulated drives obey mechanics, and are what they are said to be."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.samples.foreign_drives import MISMATCHES, foreign_drive

EXACT = {"vibration": 0.0, "gyro_vibration": 0.0, "gyro_noise": 0.0, "accelerometer_noise": 0.0}
EXACT |= {"accelerometer_bias": (0, 0, 0), "gyro_bias": (0, 0, 0)}


def test_exact_readings_lead_back_to_the_velocity() -> None:
    drive = foreign_drive(3, **EXACT, rate=100.0)
    t, reference = drive.imu.index.to_numpy(), drive.reference
    angles = np.stack([np.pi / 2 - reference["heading"], -reference["pitch"], reference["roll"]], -1)
    C = Rotation.from_euler("ZYX", angles).as_matrix()
    acceleration = np.einsum("tij,tj->ti", C, drive.imu[["ax", "ay", "az"]]) - [0, 0, 9.80665]
    v = reference[["v_e", "v_n", "v_u"]].to_numpy()
    gained = np.cumsum(0.5 * (acceleration[1:] + acceleration[:-1]) * np.diff(t)[:, None], 0)
    assert np.abs(v[1:] - v[0] - gained).max() < 0.01
    rate = Rotation.from_matrix(np.swapaxes(C[:-1], -1, -2) @ C[1:]).as_rotvec() / np.diff(t)[:, None]
    middle = drive.imu[["gx", "gy", "gz"]].to_numpy()
    assert np.abs(rate - 0.5 * (middle[1:] + middle[:-1])).max() < 1e-3


def test_the_same_seed_is_the_same_drive() -> None:
    assert foreign_drive(1).imu.equals(foreign_drive(1).imu)
    assert not foreign_drive(1).imu.equals(foreign_drive(2).imu)


@pytest.mark.parametrize("name", MISMATCHES)
def test_every_mismatch_changes_what_is_recorded(name: str) -> None:
    plain, odd = foreign_drive(1, duration=30.0), foreign_drive(1, name, duration=30.0)
    same = plain.imu.equals(odd.imu) and plain.gnss.equals(odd.gnss) and plain.wheel.equals(odd.wheel)
    assert same == (name == "nominal")
