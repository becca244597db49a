"""A recording by ideal sensors, whose truth is exact."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.constants import STANDARD_GRAVITY
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.recordings import Recording
from altijax.roads import SpeedProfile, winding_road
from altijax.rotations import matrix_to_euler, yaw_to_heading

jax.config.update("jax_enable_x64", True)

TRACK_WIDTH = 1.5


@jax.jit
def _truth(t: jax.Array) -> tuple[Readings, jax.Array, jax.Array]:
    """The motion with its readings, roll, pitch and yaw (time, 3), and the heading."""
    road = winding_road(
        jnp.array([0.4]),
        jnp.array([200.0]),
        jnp.array([0.5]),
        jnp.array([0.06]),
        jnp.array([300.0]),
        jnp.array([0.3]),
        -2.0,
    )
    profile = SpeedProfile(
        start=jnp.array([3.0, 34.0]),
        stop=jnp.array([26.0, 52.0]),
        ramp=jnp.array([5.0, 4.0]),
        speed=jnp.array([12.0, 9.0]),
        modulation=jnp.zeros(0),
        wavenumber=jnp.zeros(0),
        phase=jnp.zeros(0),
    )
    truth = ideal_readings(partial(road_pose, road, profile), t, STANDARD_GRAVITY)
    euler = matrix_to_euler(truth.C_nb)
    return truth, euler, yaw_to_heading(euler[:, 2])


def exact_drive(start: float = 0.0) -> Recording:
    """Ideal sensors for 60 s over hills and bends, with a stop; IMU 50 Hz, wheels 20 Hz, GNSS 5 Hz, heights 10 Hz."""
    t = np.linspace(0, 60, 3001)
    truth, euler, heading = jax.tree.map(np.asarray, _truth(t))
    index = pd.Index(t + start, name="t")
    imu = pd.DataFrame(np.hstack([truth.f_b, truth.w_b]), index=index, columns=["ax", "ay", "az", "gx", "gy", "gz"])
    half = 0.5 * TRACK_WIDTH * truth.w_b[:, 2]
    wheel = pd.DataFrame({"speed": truth.speed, "left": truth.speed - half, "right": truth.speed + half}, index=index)
    gnss = pd.DataFrame(truth.velocity, index=index, columns=["v_e", "v_n", "v_u"])
    attitude = {"roll": euler[:, 0], "pitch": euler[:, 1], "heading": heading}
    reference = gnss.assign(alt=500 + truth.position[:, 2], **attitude)
    return Recording(
        name="exact", imu=imu, wheel=wheel[::2], gnss=gnss[::10], reference=reference[::5], track_width=TRACK_WIDTH
    )


EXACT = exact_drive()
