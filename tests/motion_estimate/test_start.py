"""Attitudes from windows of epochs, where nothing moves, and beyond the velocities."""

import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.motion_estimate.readings import motion_readings
from altijax.motion_estimate.start import window_attitudes
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix


def test_what_no_epoch_tells_stays_with_the_course() -> None:
    """At constant velocity the force tells roll and pitch; yaw and its variance are the prior's."""
    t, epochs = np.arange(0, 20, 0.04), np.arange(1.5, 18, 1.0)
    C = np.asarray(euler_to_matrix(jnp.array([0.1, -0.05, 2.0])))
    f = np.tile(C.T @ [0, 0, 9.80665], (t.size, 1))
    # Before the first epoch the vehicle still gains speed: no epoch tells it, and no window may take it for a tilt.
    early = t < 1.4
    f[early] += 2.0 * C[0]
    imu = pd.DataFrame(f, columns=["ax", "ay", "az"], index=t)
    velocity = np.array([10 * np.cos(2.0), 10 * np.sin(2.0), 0.0])
    gnss = pd.DataFrame(np.tile(velocity, (epochs.size, 1)), columns=["v_e", "v_n", "v_u"], index=epochs)
    readings = motion_readings(Recording(imu=imu, gnss=gnss), use_gyro=False, delay=0.0)
    trajectory, covariance, misfit = window_attitudes(readings, 0.0, 0.3, 1, gyro=False)
    np.testing.assert_allclose(trajectory.C_nb[5], C, atol=4e-3)
    assert abs(float(covariance[5, 2, 2]) - 0.09) < 0.003
    # What the level prior leaves of a force of 9.8 m/s^2 at a tilt of 0.11 rad.
    assert float(covariance[5, 0, 0]) < 0.002 and float(misfit) < 1e-3
    first = int(np.argmax(np.isfinite(np.asarray(readings.std)[:, 0])))
    np.testing.assert_allclose(trajectory.v_n[first], velocity, atol=1e-9)
    before = np.asarray(trajectory.v_n[0] - trajectory.v_n[first])
    # No epoch tells the tilt there, which in 1.5 s is worth 1.6 m/s.
    np.testing.assert_allclose(np.linalg.norm(before), 2.0 * 1.4, atol=1.6)
