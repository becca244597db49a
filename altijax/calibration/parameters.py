"""Constants of a car's sensors that can be calibrated: their names, what is known beforehand, and by which methods."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from altijax.calibration.drive_model import DRIVE_PARAMETERS

PARAMETERS = pd.DataFrame.from_dict(
    {
        "accelerometer_bias_x": (0.0, 0.3, "m/s^2"),
        "accelerometer_bias_y": (0.0, 0.3, "m/s^2"),
        "accelerometer_bias_z": (0.0, 0.3, "m/s^2"),
        "accelerometer_scale": (1.0, 0.01, "1"),
        "accelerometer_scale_x": (1.0, 0.01, "1"),
        "accelerometer_scale_y": (1.0, 0.01, "1"),
        "accelerometer_scale_z": (1.0, 0.01, "1"),
        "gyro_bias_x": (0.0, 0.02, "rad/s"),
        "gyro_bias_y": (0.0, 0.02, "rad/s"),
        "gyro_bias_z": (0.0, 0.02, "rad/s"),
        "gyro_scale_x": (1.0, 0.03, "1"),
        "gyro_scale_y": (1.0, 0.03, "1"),
        "gyro_scale_z": (1.0, 0.03, "1"),
        "mounting_pitch": (0.0, 0.05, "rad"),
        "mounting_yaw": (0.0, 0.05, "rad"),
        "lever_arm": (0.0, 1.0, "m"),
        "weight_transfer": (0.0, 0.05, "1"),
        "yaw_rate_bias": (0.0, 0.005, "rad/s"),
        "wheel_scale": (1.0, 0.01, "1"),
        "wheel_delay": (0.0, 0.1, "s"),
        "gnss_delay": (0.0, 0.1, "s"),
        "initial_vertical_speed": (np.nan, 0.2, "m/s"),
    },
    orient="index",
    columns=["nominal", "uncertainty", "unit"],
)
"""Constants by name: nominal value (NaN: found by the method itself); by how much a consumer's sensor, as mounted, may
be off (assumed: the prior of a calibration, and the error bar of what was not calibrated); unit."""

_ACCELEROMETER = [name for name in PARAMETERS.index if name.startswith("accelerometer")]
_GYRO = [name for name in PARAMETERS.index if name.startswith("gyro")]
_BIASES = [name for name in (*_ACCELEROMETER, *_GYRO) if "_bias_" in name]
_SPEED = ["wheel_scale", "wheel_delay", "gnss_delay"]
_ROAD = [*_ACCELEROMETER, "mounting_pitch", "mounting_yaw", "lever_arm", "weight_transfer", "yaw_rate_bias", *_SPEED]

ACCEPTED = {
    "slope": [*_ACCELEROMETER, "mounting_pitch", "mounting_yaw", "weight_transfer", *_SPEED],
    "shirai": [*_ROAD, "initial_vertical_speed"],
    "fused": [*_ROAD, "initial_vertical_speed"],
    "conventional": [
        *("accelerometer_bias_x", "accelerometer_scale", "accelerometer_scale_x", "gyro_bias_y", "gyro_scale_y"),
        *("mounting_pitch", "mounting_yaw", *_SPEED),
    ],
    "roll": [*_ACCELEROMETER, *_GYRO, "mounting_pitch", "mounting_yaw", *_SPEED],
    "aided": [*_ACCELEROMETER, *_GYRO, "mounting_pitch", "mounting_yaw", *_SPEED],
    "filter": [*(name for name in _BIASES if name != "accelerometer_bias_z"), "mounting_yaw", *_SPEED],
    "epoch": [*_ACCELEROMETER, "gnss_delay"],
    "window": [*_ACCELEROMETER, *_GYRO, "gnss_delay"],
    "batch": [*_BIASES, "gnss_delay"],
    "drive": list(DRIVE_PARAMETERS),
}
"""Which of `PARAMETERS` each method of `calibrate` can find."""


def require_parameters(parameters: str | Iterable[str], method: str) -> list[str]:
    """Names as a list.

    Parameters
    ----------
    parameters : str or several
        Names of constants.
    method : str
        A key of `ACCEPTED`.

    Returns
    -------
    names : list of str
        In the order given.

    Raises
    ------
    ValueError
        If the method is unknown, or the names are none, repeated or not for this method.
    """
    if method not in ACCEPTED:
        raise ValueError(f"method must be one of {', '.join(ACCEPTED)}, got {method!r}")
    names = [parameters] if isinstance(parameters, str) else list(parameters)
    if not names or len(set(names)) < len(names) or not set(names) <= set(ACCEPTED[method]):
        known = ", ".join(ACCEPTED[method])
        raise ValueError(
            f"parameters of method {method!r} must be different names out of {known}; got {', '.join(names) or 'none'}"
        )
    return names
