"""Constants that a simulated drive of the tests was recorded with."""

import numpy as np

from altijax.calibration.drive_model import DRIVE_PARAMETERS

PLANTED = {"wheel_scale": 1.01, "wheel_delay": -0.03, "gnss_delay": 0.16, "accelerometer_scale": 1.005}
PLANTED |= {"accelerometer_bias_x": 0.1, "accelerometer_bias_y": -0.2, "accelerometer_bias_z": 0.05}
PLANTED |= {"gyro_bias_x": 0.002, "gyro_bias_y": -0.003, "gyro_bias_z": 0.004, "gyro_scale_z": 1.004}
PLANTED |= {"mounting_pitch": 0.05, "mounting_yaw": -0.02, "weight_transfer": 0.05, "wheel_slip": 0.001}
PLANTED |= {"lever_arm": 1.2, "antenna_lever_arm": -0.4, "wheel_difference": 0.01, "track_width": 1.6}


def planted(**others: float) -> np.ndarray:
    """The constants, some of them others, in the order of `DRIVE_PARAMETERS`."""
    constants = PLANTED | others
    assert set(constants) == set(DRIVE_PARAMETERS)
    return np.array([constants[name] for name in DRIVE_PARAMETERS])
