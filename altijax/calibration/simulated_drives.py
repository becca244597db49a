"""Drives to try a calibration on: a town with turns, hills and stops, and what uncalibrated sensors record of it."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import require_shape
from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.parameters import triads
from altijax.constants import STANDARD_GRAVITY
from altijax.doppler import DopplerReceiver, doppler_velocity
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.roads import SpeedProfile, winding_road
from altijax.rotations import euler_to_matrix
from altijax.sensors import Accelerometer, Gyro, accelerometer_output, gyro_output
from altijax.signals import resample


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Manoeuvres:
    """How a simulated drive is driven: legs of one minute from standstill to standstill on a winding, hilly road.

    Attributes
    ----------
    speed : () m/s
        Speed of the legs, before the variation.
    ramp : () s
        Time to reach it and to lose it: braking is at most about 2 speed / ramp.
    standstill : () s
        Time at rest before each leg.
    variation : ()
        Largest relative change of the speed under way.
    turning : () rad
        Largest angle between the road and its general direction.
    slope : ()
        Steepest rise per length.
    """

    speed: ArrayLike = 12.0
    ramp: ArrayLike = 8.0
    standstill: ArrayLike = 6.0
    variation: ArrayLike = 0.15
    turning: ArrayLike = 0.9
    slope: ArrayLike = 0.05


def town_drive(manoeuvres: Manoeuvres, t: ArrayLike, gravity: ArrayLike, *, legs: int = 5) -> Readings:
    """Exact motion of a drive, and what ideal sensors aligned with the vehicle read.

    Parameters
    ----------
    manoeuvres : Manoeuvres
        How it is driven.
    t : (time,) s
        Times; a leg lasts a minute.
    gravity : () m/s^2
        Magnitude of gravity.
    legs : int, optional
        Number of legs.

    Returns
    -------
    readings : Readings
        Motion and readings.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    speed, ramp, rest, variation, turning, slope = (
        jnp.asarray(getattr(manoeuvres, name), t.dtype)
        for name in ("speed", "ramp", "standstill", "variation", "turning", "slope")
    )
    start = 60.0 * jnp.arange(legs, dtype=t.dtype) + rest
    wave = 2 * jnp.pi / jnp.asarray([170.0], t.dtype)
    profile = SpeedProfile(
        start=start,
        stop=start + 60.0 - rest - ramp,
        ramp=jnp.full(legs, ramp),
        speed=jnp.full(legs, speed),
        modulation=variation / wave,
        wavenumber=wave,
        phase=jnp.zeros(1, t.dtype),
    )
    road = winding_road(
        turning * jnp.asarray([0.7, 0.3], t.dtype),
        jnp.asarray([330.0, 190.0], t.dtype),
        jnp.asarray([0.0, 1.0], t.dtype),
        slope * jnp.asarray([0.6, 0.4], t.dtype),
        jnp.asarray([700.0, 260.0], t.dtype),
        jnp.asarray([0.0, 2.0], t.dtype),
        0.3,
    )
    return ideal_readings(partial(road_pose, road, profile), t, gravity)


def recorded_drive(
    readings: Readings,
    parameters: ArrayLike,
    *,
    accelerometer: Accelerometer,
    gyro: Gyro,
    receiver: DopplerReceiver,
    wheel_noise: ArrayLike,
    epochs: int,
    key: jax.Array,
) -> dict[str, jax.Array]:
    """What sensors with given parameters record of an exact motion.

    Parameters
    ----------
    readings : Readings
        The motion, at uniform times.
    parameters : (19,)
        True values in the order of `DRIVE_PARAMETERS`; the sensors are otherwise as the records say. The motion is that
        of the middle of the rear axle.
    accelerometer, gyro, receiver
        Records of the sensors, for their noise and rate.
    wheel_noise : () m/s
        Standard deviation of the mean of the axle's two wheels; of their difference it is twice that.
    epochs : int
        Number of epochs of the receiver.
    key : key
        Source of the noise.

    Returns
    -------
    recorded : dict
        t, f, w; t_gnss, v_gnss (NaN where an epoch is missing); t_wheel, wheel (mean of the axle) and apart (right
        less left), at half the rate of the IMU.
    """
    t = readings.t
    p = dict(zip(DRIVE_PARAMETERS, jnp.asarray(parameters, t.dtype), strict=True))
    keys = jax.random.split(key, 4)
    dt = t[1] - t[0]
    imu = triads(p)
    mounting = euler_to_matrix(imu.mounting)
    acceleration = jnp.gradient(readings.speed, dt)
    squat = p["weight_transfer"] / STANDARD_GRAVITY * acceleration
    body = euler_to_matrix(jnp.stack([0 * squat, squat, 0 * squat], -1))
    pitching = jnp.stack([0 * squat, -jnp.asarray(jnp.gradient(squat, dt)), 0 * squat], -1)
    f, w = (jnp.einsum("tji,tj->ti", body, x) for x in (readings.f_b, readings.w_b))
    w = w + pitching
    ahead = jnp.asarray([1.0, 0.0, 0.0], t.dtype)
    per_metre = jnp.cross(w, ahead)
    f = f + p["lever_arm"] * (jnp.cross(jnp.asarray(jnp.gradient(w, dt, axis=0)), ahead) + jnp.cross(w, per_metre))
    at_antenna = (p["lever_arm"] + p["antenna_lever_arm"]) * per_metre
    velocity = readings.velocity + jnp.einsum("tij,tjk,tk->ti", readings.C_nb, body, at_antenna)
    turning = w[:, 2]
    f, w = f @ mounting, w @ mounting
    accelerometer = replace(accelerometer, bias=imu.accelerometer_bias, scale=imu.accelerometer_scale)
    t_gnss, v_gnss, valid = doppler_velocity(
        replace(receiver, latency=p["gnss_delay"]), t, velocity, epochs=epochs, key=keys[2]
    )
    t_wheel = t[2:-2:2]
    slipping = readings.speed * (1 + p["wheel_slip"] * acceleration)
    apart = p["track_width"] * turning - p["wheel_difference"] * slipping
    shown, _ = resample(
        t_wheel - p["wheel_delay"], t, jnp.stack([slipping, apart], -1) / p["wheel_scale"], jnp.inf, axis=-2
    )
    # Two wheels' noises: their mean has half the variance of one, their difference twice.
    noise = wheel_noise * jax.random.normal(keys[3], shown.shape, t.dtype)
    return {
        "t": t,
        "f": accelerometer_output(accelerometer, f, dt, key=keys[0]),
        "w": gyro_output(replace(gyro, bias=imu.gyro_bias, scale=imu.gyro_scale), w, f, dt, key=keys[1]),
        "t_gnss": t_gnss,
        "v_gnss": jnp.where(valid[:, None], v_gnss, jnp.nan),
        "t_wheel": t_wheel,
        "wheel": shown[:, 0] + noise[:, 0],
        "apart": shown[:, 1] + 2 * noise[:, 1],
    }
