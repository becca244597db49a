"""Drives over made-up hills, by a car that squats, with a consumer's sensors whose constants nobody knows.

What tests and benchmarks judge the error bars of an elevation by: the truth is exact, and the estimator sees none of
the constants that are drawn.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.parameters import triads
from altijax.constants import STANDARD_GRAVITY
from altijax.elevation_estimate.estimates import estimate_elevation
from altijax.elevation_estimate.model import NOMINAL, UNCERTAINTY
from altijax.elevation_estimate.smoother import ElevationNoise
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.recordings import Recording
from altijax.roads import SpeedProfile, winding_road
from altijax.rotations import euler_to_matrix

DURATION, RATE = 100.0, 20.0
SPREAD = {
    name: UNCERTAINTY[name]
    for name in (
        *("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z"),
        *("accelerometer_scale", "accelerometer_scale_x", "mounting_pitch", "mounting_yaw"),
        *("lever_arm", "weight_transfer", "yaw_rate_bias", "wheel_scale"),
    )
}


@jax.jit
def _motion(slopes: jax.Array, lengths: jax.Array, phases: jax.Array, bend: jax.Array, speeds: jax.Array) -> Readings:
    road = winding_road(bend[:1], bend[1:2], bend[2:], slopes, lengths, phases, jnp.array(0.0))
    profile = SpeedProfile(
        start=jnp.array([3.0, 45.0]),
        stop=jnp.array([34.0, 88.0]),
        ramp=jnp.array([7.0, 8.0]),
        speed=speeds,
        modulation=jnp.zeros(0),
        wavenumber=jnp.zeros(0),
        phase=jnp.zeros(0),
    )
    t = jnp.arange(0, DURATION, 1 / RATE)
    return ideal_readings(partial(road_pose, road, profile), t, STANDARD_GRAVITY)


_matrix = jax.jit(euler_to_matrix)


def hilly_drive(seed: int, car: str = "presumed") -> Recording:
    """One drive of 100 s with a stop in it; IMU and wheels 20 Hz, heights 5 Hz.

    Parameters
    ----------
    seed : int
        Source of the road, of the way of driving and of all errors.
    car : {"presumed", "strange"}, optional
        Whether the car's errors are drawn from what the estimator presumes, or are of kinds that it does not know.

    Returns
    -------
    recording : Recording
        IMU, wheels, and the true heights as reference.
    """
    rng = np.random.default_rng(seed)
    hills = 4
    with jax.enable_x64(True):
        truth = _motion(
            rng.normal(0, 0.05 * np.sqrt(2 / hills), hills),
            rng.uniform(200, 1500, hills),
            rng.uniform(0, 2 * np.pi, hills),
            np.array([rng.uniform(0.1, 0.6), rng.uniform(150, 500), rng.uniform(0, 2 * np.pi)]),
            rng.uniform(8, 18, 2),
        )
        constants = {name: NOMINAL[name] + std * rng.normal() for name, std in SPREAD.items()}
        known = triads(constants, np)
        mounting = np.asarray(_matrix(known.mounting))
    truth = jax.tree.map(np.asarray, truth)
    f, speed, yaw_rate = truth.f_b.copy(), truth.speed, truth.w_b[:, 2]
    f[:, 0] *= 1 + constants["weight_transfer"]
    noise = ElevationNoise()
    add_error = {"presumed": _presumed_error, "strange": _strange_error}[car]
    f[:, 0] += add_error(rng, f[:, 0], speed, truth.position)
    f[:, 2] += noise.rectified * lasting(rng, f.shape[0], RATE * float(noise.rectified_time))
    f[:, 0] -= constants["lever_arm"] * yaw_rate**2
    f = f @ mounting
    f = (f + known.accelerometer_bias) * known.accelerometer_scale
    f += 0.03 * rng.normal(size=f.shape)
    index = pd.Index(truth.t, name="t")
    imu = pd.DataFrame(f, index=index, columns=["ax", "ay", "az"])
    imu[["gx", "gy"]] = 0.0
    imu["gz"] = yaw_rate + constants["yaw_rate_bias"] + 0.002 * rng.normal(size=yaw_rate.size)
    turning = speed / constants["wheel_scale"]
    wheel = pd.DataFrame({"speed": turning + 0.02 * (turning > 0.1) * rng.normal(size=speed.size)}, index=index)
    reference = pd.DataFrame({"alt": 100 + truth.position[:, 2]}, index=index)
    return Recording(name=f"simulated {seed}", imu=imu, wheel=wheel, reference=reference[::4])


def errors_and_bars(recording: Recording, known: str = "none") -> tuple[np.ndarray, np.ndarray]:
    """What the fused elevation of a drive is off by wherever no height is known, after the start of the drive.

    Parameters
    ----------
    recording : Recording
        A hilly drive.
    known : {"none", "ends", "first third"}, optional
        The heights that the estimate is given.

    Returns
    -------
    error : (samples,) m
        Estimated less true elevation.
    std : (samples,) m
        Its standard deviation as stated.
    """
    if recording.reference is None:
        raise ValueError(f"recording {recording.name!r} has no reference")
    heights = recording.reference.reset_index().to_numpy()
    third = DURATION / 3
    given = {"none": None, "ends": heights[[0, -1]], "first third": heights[heights[:, 0] <= third]}[known]
    estimate = estimate_elevation(recording, method="fused", known_heights=given)
    truth = np.interp(estimate.index, heights[:, 0], heights[:, 1]) - heights[0, 1]
    moved = estimate["way"] > 5.0
    moved &= estimate.index > (third if known == "first third" else 0)
    moved &= estimate["way"] < estimate["way"].iloc[-1] - 5.0
    return (estimate["elevation"] - truth)[moved].to_numpy(), estimate["elevation_std"][moved].to_numpy()


def lasting(rng: np.random.Generator, count: int, samples: float) -> np.ndarray:
    """Stationary Gauss-Markov series of unit variance.

    Parameters
    ----------
    rng : numpy Generator
        Source of the shocks.
    count : int
        Length of the series.
    samples : float
        How many samples it lasts.

    Returns
    -------
    series : (count,)
        The series.
    """
    keep = np.exp(-1 / samples)
    series = np.empty(count)
    series[0] = rng.normal()
    for i, shock in enumerate(np.sqrt(1 - keep**2) * rng.normal(size=count - 1)):
        series[i + 1] = keep * series[i] + shock
    return series


def _presumed_error(rng: np.random.Generator, f_x: np.ndarray, speed: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Trim and rough road as `ElevationNoise` has them, at a level of the car's own."""
    noise, level = ElevationNoise(), np.exp(0.5 * rng.normal())
    way = np.maximum(speed / RATE, 0.05)
    rough = noise.slope * STANDARD_GRAVITY * rng.normal(size=way.size) / np.sqrt(way)
    return level * (noise.trim * lasting(rng, way.size, RATE * float(noise.trim_time)) + rough)


def _strange_error(rng: np.random.Generator, f_x: np.ndarray, speed: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Trim in steps, springs that stick, and a slope of the sensor's that the road's cross-wave repeats.

    The car settles anew about every 20 s (0.2 degrees); its springs follow the load only once it has changed by
    0.4 m/s^2, then by 5 % of it; and over patches of about 80 m of road it tilts by 0.15 degrees.
    """
    steps = np.cumsum(rng.random(f_x.size) < 1 / (20 * RATE))
    trim = 0.035 * rng.normal(size=steps[-1] + 1)[steps]
    stuck = np.empty_like(f_x)
    held = f_x[0]
    for i, load in enumerate(f_x):
        held = min(max(held, load - 0.4), load + 0.4)
        stuck[i] = held - load
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    patches = 0.025 * rng.normal(size=int(way[-1] / 80) + 2)
    return trim + 0.05 * stuck + np.interp(way / 80, np.arange(patches.size), patches)
