"""Attitudes from windows of epochs, where nothing moves and where a device is mounted anyhow."""

import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.motion_readings import motion_readings
from altijax.motion_start import window_attitudes
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix


def test_what_no_epoch_tells_stays_with_the_course() -> None:
    """At constant velocity the force tells roll and pitch; yaw and its variance are the prior's."""
    t, epochs = np.arange(0, 20, 0.04), np.arange(0.5, 19, 1.0)
    C = np.asarray(euler_to_matrix(jnp.array([0.1, -0.05, 2.0])))
    f = np.tile(C.T @ [0, 0, 9.80665], (t.size, 1))
    imu = pd.DataFrame(f, columns=["ax", "ay", "az"], index=t)
    v = np.tile([10 * np.cos(2.0), 10 * np.sin(2.0), 0.0], (epochs.size, 1))
    gnss = pd.DataFrame(v, columns=["v_e", "v_n", "v_u"], index=epochs)
    readings, steps = motion_readings(Recording(imu=imu, gnss=gnss), use_gyro=False, delay=0.0)
    trajectory, covariance, misfit = window_attitudes(readings, jnp.zeros(()), jnp.full((), 0.3), steps, 1, gyro=False)
    np.testing.assert_allclose(trajectory.C_nb[5], C, atol=1e-2)
    assert abs(float(covariance[5, 2, 2]) - 0.09) < 0.003
    assert float(covariance[5, 0, 0]) < 0.002 and float(misfit) < 1e-6
