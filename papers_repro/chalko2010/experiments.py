"""The motions that the paper names, exact, and recordings of them by consumer instruments: the truth is known.

A windsurfer's helmet with chop, gybes, a head that looks around and a fall; a vehicle on a winding road; an aircraft in
figures of eight with a wind, so that its heading is not its course. The accelerometer samples at 50 Hz, the receiver
reports Doppler velocities at 1 Hz; a gyro, which the paper has not, is recorded for the remedies that need one.

Errors are those after the calibration that the paper asks for: zero and scale are known, what remains of them is drawn
anew for each unit (`LEFT_BIAS`, `LEFT_GYRO_BIAS`, assumed: 3 mg and 0.1 deg/s), noise is that of the data sheets, and
the delay is taken off.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.doppler import DopplerReceiver, doppler_velocity
from altijax.instruments import DOPPLER_1_HZ, MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import (
    Pose,
    Readings,
    flight_pose,
    gybing_windsurfer,
    ideal_readings,
    road_pose,
    windsurfer_pose,
)
from altijax.recordings import Recording
from altijax.roads import Road, SpeedProfile, winding_road
from altijax.rotations import matrix_to_euler, yaw_to_heading
from altijax.sensors import Accelerometer, Gyro, accelerometer_output, gyro_output

G = 9.80665
DURATION = 120.0
FINE_RATE = 100.0
ACCELEROMETER_RATE = 50.0
LEFT_BIAS = 0.03
LEFT_GYRO_BIAS = np.radians(0.1)
RECEIVER = replace(DOPPLER_1_HZ, latency=0.0)


def windsurfer_motion() -> Pose:
    """Broad reaches at 8 m/s with gybes in chop, the head looking around; no fall."""
    return partial(windsurfer_pose, gybing_windsurfer(8.0, 0.7, 90.0, DURATION + 20.0, DURATION + 20.0))


def falling_motion() -> Pose:
    """The same with a fall after two thirds of the time."""
    return partial(windsurfer_pose, gybing_windsurfer(8.0, 0.7, 90.0, DURATION + 20.0, 80.0))


def vehicle_motion() -> Pose:
    """A winding, hilly road at 10 to 20 m/s, speeding up and slowing down; the body rolls outward on its springs."""
    road = winding_road(
        jnp.array([0.5, 0.3]),
        jnp.array([420.0, 190.0]),
        jnp.array([0.0, 1.0]),
        jnp.array([0.05, 0.03]),
        jnp.array([400.0, 170.0]),
        jnp.array([0.5, 2.0]),
        6.0,
    )
    return partial(road_pose, replace(road, roll_gain=jnp.asarray(0.01)), _under_way(14.0, [15.0], [0.15]))


def aircraft_motion() -> Pose:
    """Figures of eight at 24 to 42 m/s with banks of 28 degrees, climbing and descending, in a wind of 7 m/s."""
    size = 220.0
    eight = Road(
        direction=jnp.zeros(3),
        amplitude=size * jnp.array([[1.0, 0.0, 0.0], [0.0, 0.5**1.5, 0.0], [0.0, 0.0, 0.1]]),
        wavenumber=jnp.array([1.0, 2.0, 0.7]) / size,
        phase=jnp.array([0.4, 0.8, 0.0]),
        cant=jnp.zeros(3),
        roll_gain=jnp.asarray(0.0),
    )
    return partial(flight_pose, eight, _under_way(34.0, [], []), jnp.array([6.0, -3.5, 0.0]), G)


MOTIONS: dict[str, Callable[[], Pose]] = {
    "windsurfer": windsurfer_motion,
    "windsurfer falling": falling_motion,
    "vehicle": vehicle_motion,
    "aircraft": aircraft_motion,
}


@partial(jax.jit, static_argnames="motion")
def _readings(motion: str, t: jax.Array) -> Readings:
    return ideal_readings(MOTIONS[motion](), t, G)


def exact_readings(motion: str, rate: float = FINE_RATE) -> Readings:
    """What ideal sensors read on a motion, at a rate that divides `FINE_RATE`."""
    t = jnp.arange(round(DURATION * FINE_RATE) + 1) / FINE_RATE
    return jax.tree.map(lambda x: x[:: round(FINE_RATE / rate)], _readings(motion, t))


def drawn_unit(key: jax.Array) -> tuple[Accelerometer, Gyro]:
    """One calibrated unit: its noise, and what calibration left of its biases."""
    accelerometer_key, gyro_key = jax.random.split(key)
    return (
        replace(MEMS_ACCELEROMETER, bias=LEFT_BIAS * jax.random.normal(accelerometer_key, (3,))),
        replace(MEMS_GYRO, bias=LEFT_GYRO_BIAS * jax.random.normal(gyro_key, (3,)), g_sensitivity=0.0),
    )


def simulated_recording(motion: str, *, seed: int, receiver: DopplerReceiver = RECEIVER) -> Recording:
    """A motion as its instruments record it, and its truth as the reference; in double precision."""
    readings = exact_readings(motion, ACCELEROMETER_RATE)
    unit_key, accelerometer_key, gyro_key, receiver_key = jax.random.split(jax.random.key(seed), 4)
    accelerometer, gyro = drawn_unit(unit_key)
    dt = 1 / ACCELEROMETER_RATE
    f_b = accelerometer_output(accelerometer, readings.f_b, dt, key=accelerometer_key)
    w_b = gyro_output(gyro, readings.w_b, readings.f_b, dt, key=gyro_key)
    epochs = int(DURATION * jnp.asarray(receiver.rate).item()) + 1
    # Where MINPACK's headings wander to hangs on the last bits of the velocities; computed step by step these stay.
    with jax.disable_jit():
        gnss = doppler_velocity(receiver, readings.t, readings.velocity, epochs=epochs, key=receiver_key)
    t_gnss, v_gnss, valid = gnss
    t, velocity = np.asarray(readings.t), np.asarray(readings.velocity)
    roll, pitch, yaw = np.asarray(matrix_to_euler(readings.C_nb)).T
    heading = np.asarray(yaw_to_heading(yaw))
    reference = np.column_stack([roll, pitch, heading, velocity])
    return Recording(
        name=motion,
        description=(MOTIONS[motion].__doc__ or "").strip(),
        imu=_stream(t, np.hstack([f_b, w_b]), ["ax", "ay", "az", "gx", "gy", "gz"]),
        gnss=_stream(np.asarray(t_gnss)[valid], np.asarray(v_gnss)[valid], ["v_e", "v_n", "v_u"]),
        reference=_stream(t, reference, ["roll", "pitch", "heading", "v_e", "v_n", "v_u"]),
    )


def _stream(t: np.ndarray, values: np.ndarray, columns: list[str]) -> pd.DataFrame:
    return pd.DataFrame(values, index=pd.Index(t, name="t"), columns=columns)


def _under_way(speed: float, wave_lengths: list[float], waves: list[float]) -> SpeedProfile:
    """Progress that is under way at t = 0, with an uneven speed of waves in s and relative sizes."""
    wavenumber = 2 * jnp.pi / (speed * jnp.array(wave_lengths, float))
    return SpeedProfile(
        start=jnp.array([-20.0]),
        stop=jnp.array([1e4]),
        ramp=jnp.array([10.0]),
        speed=jnp.array([speed]),
        modulation=jnp.array(waves, float) / wavenumber,
        wavenumber=wavenumber,
        phase=jnp.zeros(wavenumber.size),
    )
