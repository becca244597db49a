"""How the IMU is turned in its vehicle, from gravity and from forces against changes of speed and turns."""

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
    """Rotation from the IMU's axes to the vehicle's: up is where gravity points on average, forward where
    forces are that change the speed, and left where those of turns are.

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
    if inside.sum() < 10:
        return Rotation.identity()
    rate = imu[["gx", "gy", "gz"]].to_numpy(float) if "gx" in imu else np.zeros_like(force)
    t, force, turning = t[inside], level.apply(force[inside]), level.apply(rate[inside])[:, 2]
    smooth = low_pass(
        t - t[0], np.vstack([np.interp(t, t_speed, speed.to_numpy(float)), force.T[:2], turning]), _CUTOFF
    )
    # As complex numbers, forward and to the left: forces are the accelerations, turned by the yaw of the mounting.
    expected = np.gradient(smooth[0], t) + 1j * smooth[0] * smooth[3]
    read = smooth[1] + 1j * smooth[2]
    expected, read = expected - expected.mean(), read - read.mean()
    power = max(np.vdot(expected, expected).real, 1e-12)
    slope = np.vdot(expected, read) / power
    rest = read - slope * expected
    # Samples belong together for as long as the low pass lasts.
    apart = max((t[-1] - t[0]) * 2 * _CUTOFF, 2.0)
    error = np.sqrt(np.mean(np.abs(rest) ** 2) / apart * t.size / power)
    yaw = float(np.angle(slope)) if abs(slope) > _SURE * error else 0.0
    found = Rotation.from_rotvec([0.0, 0.0, -yaw]) * level
    return found if found.magnitude() > _SMALL else Rotation.identity()
