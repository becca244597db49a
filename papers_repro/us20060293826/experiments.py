"""Figures 6 and 7 as experiments: drives with many curves, consumer sensors after static calibration, and both methods.

A run is a sensor unit of its own, drawn from the tolerances of its data sheet. Before the drive it lies still and level
for `STATIC` seconds, whose mean readings less gravity are taken off as its biases; that is the static calibration. Then
it stands for `STANDING` seconds at the start, which gives the initial pitch; the initial speed is zero. What remains:
noise, wandering biases, scales, axes out of square, and the gyros' sensitivity to acceleration. As in the patent, the
speed of a GPS receiver stands for the actual speed.
"""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp

from altijax.doppler import doppler_velocity
from altijax.instruments import DOPPLER_1_HZ, MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.roads import Road, SpeedProfile, rest_to_rest, winding_road
from altijax.sensors import Accelerometer, Gyro, accelerometer_output, gyro_output
from altijax.speed import speed_with_aided_roll, speed_with_roll, speed_without_roll

G = 9.80665
DT = 0.01
STATIC = 20.0
STANDING = 5.0
DURATION = 65.0
METHODS = ("without roll", "with roll", "aided roll")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Drive:
    """A road with its way of driving, from rest to rest after standing at the start."""

    road: Road
    profile: SpeedProfile


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Runs:
    """Errors of many runs against the GPS speed: (runs, epochs) by method; and the first run in full for a picture."""

    turning: jax.Array
    t_gps: jax.Array
    gps: jax.Array
    errors: dict[str, jax.Array]
    speeds: dict[str, jax.Array]


def winding_drive(
    heading_swing: tuple[float, float],
    distance: float,
    bend_length: tuple[float, float] = (190.0, 117.0),
) -> Drive:
    """Curves left and right with cant inward, hills, and a body that rolls outward."""
    bends = jnp.array(heading_swing), jnp.array(bend_length), jnp.array([0.0, 1.0])
    hills = jnp.array([0.05, 0.03]), jnp.array([400.0, 170.0]), jnp.array([0.5, 2.0])
    road = winding_road(*bends, *hills, 6.0)
    # A body rolls by some 0.05 rad at 5 m/s^2.
    road = replace(road, roll_gain=jnp.asarray(0.01))
    profile = rest_to_rest(distance, DURATION - STANDING, 8.0)
    return Drive(road=road, profile=replace(profile, start=profile.start + STANDING, stop=profile.stop + STANDING))


def figure_drives() -> dict[str, Drive]:
    """A winding country road and a hillier one with sharper bends."""
    return {
        "figure 6": winding_drive((0.16, 0.10), 700.0),
        "figure 7": winding_drive((0.24, 0.14), 560.0, (150.0, 90.0)),
    }


def readings_of(drive: Drive) -> Readings:
    t = DT * jnp.arange(round(DURATION / DT) + 1)
    return ideal_readings(partial(road_pose, drive.road, drive.profile), t, G)


def turning_of(readings: Readings) -> jax.Array:
    """Accumulated change of heading."""
    return DT * jnp.cumsum(jnp.abs(readings.w_b[:, 2]))


def drawn_unit(gyro_quality: jax.Array, key: jax.Array) -> tuple[Accelerometer, Gyro]:
    """One unit; a data sheet's tolerance is taken as three standard deviations, all of the gyro's errors are scaled.

    The sensitivity to acceleration is of the size given, of random sign for each pair of axes.
    """
    key, sign_key = jax.random.split(key)
    drawn = jnp.split(jax.random.normal(key, (24,)), [3, 6, 12, 15, 18])
    sign = jax.random.rademacher(sign_key, (3, 3), float)
    accelerometer = replace(
        MEMS_ACCELEROMETER,
        bias=0.05 * G / 3 * drawn[0],
        scale=1 + 0.01 * drawn[1],
        misalignment=0.02 / 3 * drawn[2],
    )
    gyro = replace(
        MEMS_GYRO,
        bias=jnp.radians(20 / 3) * drawn[3],
        scale=1 + gyro_quality * 0.01 * drawn[4],
        misalignment=gyro_quality * 0.02 / 3 * drawn[5],
        noise_density=gyro_quality * MEMS_GYRO.noise_density,
        bias_random_walk=gyro_quality * MEMS_GYRO.bias_random_walk,
        g_sensitivity=gyro_quality * MEMS_GYRO.g_sensitivity * sign,
        resolution=gyro_quality * MEMS_GYRO.resolution,
    )
    return accelerometer, gyro


def calibrated_readings(readings: Readings, gyro_quality: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Specific force and angular rate (time, 3) of one unit on a drive, less what it read at rest."""
    unit_key, accelerometer_key, gyro_key = jax.random.split(key, 3)
    accelerometer, gyro = drawn_unit(gyro_quality, unit_key)
    rest = round(STATIC / DT)
    up = jnp.array([0.0, 0.0, G])
    f_b = jnp.concatenate([jnp.broadcast_to(up, (rest, 3)), readings.f_b])
    w_b = jnp.concatenate([jnp.zeros((rest, 3)), readings.w_b])
    f_read = accelerometer_output(accelerometer, f_b, DT, key=accelerometer_key)
    w_read = gyro_output(gyro, w_b, f_b, DT, key=gyro_key)
    return f_read[rest:] - (f_read[:rest].mean(0) - up), w_read[rest:] - w_read[:rest].mean(0)


def speeds_of(f_b: jax.Array, w_b: jax.Array, aid_speed: jax.Array) -> dict[str, jax.Array]:
    """Each method's speed (time,)."""
    (f_x, f_y), (w_y, w_z) = f_b[:, :2].T, w_b[:, 1:].T
    pitch0 = jnp.arcsin(f_x[: round(STANDING / DT)].mean() / G)
    start = 0.0, pitch0, G, DT
    return {
        "without roll": speed_without_roll(f_x, w_y, *start)[0],
        "with roll": speed_with_roll(f_x, f_y, w_y, w_z, *start)[0],
        "aided roll": speed_with_aided_roll(f_x, f_y, w_y, w_z, aid_speed, jnp.ones(aid_speed.size, bool), *start)[0],
    }


@partial(jax.jit, static_argnames="runs")
def simulate(drive: Drive, gyro_quality: jax.Array, key: jax.Array, *, runs: int) -> Runs:
    """Many runs of one drive, each with a unit and a receiver of its own."""
    readings = readings_of(drive)
    epochs = round(DURATION) + 1

    def run(key: jax.Array) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
        sensor_key, receiver_key = jax.random.split(key)
        f_b, w_b = calibrated_readings(readings, gyro_quality, sensor_key)
        receiver = replace(DOPPLER_1_HZ, latency=0.0)
        t_gps, v_gps, _ = doppler_velocity(receiver, readings.t, readings.velocity, epochs=epochs, key=receiver_key)
        gps = jnp.linalg.norm(v_gps[:, :2], axis=-1)
        held = jnp.interp(readings.t, t_gps, gps)
        return t_gps, gps, speeds_of(f_b, w_b, held)

    t_gps, gps, speeds = jax.vmap(run)(jax.random.split(key, runs))
    at_epochs = slice(None, None, round(1 / DT))
    return Runs(
        turning=turning_of(readings)[at_epochs],
        t_gps=t_gps[0],
        gps=gps,
        errors={name: speed[:, at_epochs] - gps for name, speed in speeds.items()},
        speeds=jax.tree.map(lambda speed: speed[:8], speeds),
    )


@jax.jit
def rms_errors(runs: Runs) -> dict[str, jax.Array]:
    """RMS difference from the GPS speed of each run (runs,), by method."""
    return {name: jnp.sqrt(jnp.mean(error**2, -1)) for name, error in runs.errors.items()}
