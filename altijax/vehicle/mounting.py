"""How the IMU is turned in its vehicle, from gravity and from forward force against change of speed."""

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from altijax.drives import imu_of
from altijax.recordings import Recording
from altijax.series import low_pass

# Slower than a car's rocking, faster than its manoeuvres, Hz.
_CUTOFF = 0.5
# Up to here the smoother finds the mounting by itself, rad; beyond, the angles between two directions are no longer
# about linear.
_SMALL = 0.15
# The direction must be known this much better than what it is turned by.
_SURE = 4.0


def mounting_of(recording: Recording, speed: pd.Series) -> Rotation:
    """Rotation from the IMU's axes to the vehicle's: up is where gravity points on average, forward where forces are
    that change the speed.

    Parameters
    ----------
    recording : Recording
        With an accelerometer.
    speed : Series
        Speed over ground (m/s) by time, on the recording's time axis.

    Returns
    -------
    mounting : Rotation
        None at all, the identity, where it is small, or too little is sped up and braked to tell.
    """
    imu = imu_of(recording)
    t = imu.index.to_numpy(float)
    force = imu[["ax", "ay", "az"]].to_numpy(float)
    up = force.mean(0)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    size = np.linalg.norm(axis)
    level = Rotation.from_rotvec(axis / max(size, 1e-12) * np.arctan2(size, up[2]))
    t_speed = speed.index.to_numpy(float)
    inside = (t >= t_speed[0]) & (t <= t_speed[-1])
    t, force = t[inside] - t[0], level.apply(force[inside])
    if t.size < 10:
        return Rotation.identity()
    series = np.vstack([np.interp(t, t_speed - imu.index[0], speed.to_numpy(float)), force.T[:2]])
    smooth = low_pass(t, series, _CUTOFF)
    change = np.gradient(smooth[0], t)
    change, forces = change - change.mean(), smooth[1:] - smooth[1:].mean(1, keepdims=True)
    power = change @ change
    slope = forces @ change / max(power, 1e-12)
    rest = forces - slope[:, None] * change
    # Of samples that belong together for as long as the low pass lasts.
    apart = max(t.size * np.median(np.diff(t)) * 2 * _CUTOFF, 2.0)
    error = np.sqrt((rest * rest).mean() * t.size / max(power, 1e-12) / apart)
    yaw = np.arctan2(slope[1], slope[0]) if np.hypot(*slope) > _SURE * error else 0.0
    found = Rotation.from_rotvec([0.0, 0.0, -yaw]) * level
    return found if found.magnitude() > _SMALL else Rotation.identity()
