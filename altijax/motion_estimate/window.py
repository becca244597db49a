"""Attitudes of epochs that share one as the gyro turns, and the velocities between the epochs that follow from them."""

from typing import Any

import jax
import numpy as np
import pandas as pd

from altijax.inference.layout import Layout
from altijax.motion_estimate.intervals import MotionReadings
from altijax.motion_estimate.readings import motion_readings
from altijax.motion_estimate.start import Attitudes, delay_by_windows, epochs_within, window_attitudes
from altijax.recordings import Recording
from altijax.stages import Stages
from altijax.vehicle.at_samples import MOTION_COLUMNS, as_table, at_samples
from altijax.vehicle.estimates import supported
from altijax.vehicle.inertial import Trajectory
from altijax.vehicle.measurements.doppler_velocity import USUAL_DELAY
from altijax.vehicle.search import between_readings
from altijax.vehicle.sensors import Use, layout_of, levels_of

# How long epochs share an attitude, s: with a gyro, and without.
_WINDOW, _WINDOW_WITHOUT_GYRO = 15.0, 5.0
# Standard deviation of the attitude believed beforehand, rad: with a gyro nothing is believed, without one the course.
_FREE, _COURSE_STD = 2.0, 0.3
# Random walk of the velocity between epochs, m/s^1.5, and how much less is known of it with each second away from one.
_SHAKEN, _AWAY = 0.3, 0.3
_UNKNOWN = 100.0  # m/s


def window_estimate(recording: Recording, *, use_gyro: bool, delay: float | None, stage: Stages) -> pd.DataFrame:
    """What `altijax.estimate_motion` says by "window", of a corrected IMU; its arguments are described there."""
    search = delay is None and use_gyro
    first = float(USUAL_DELAY if search else delay or 0.0)
    readings = motion_readings(recording, use_gyro=use_gyro, delay=first)
    if search:
        stage("delay of the GNSS velocities")
        delay = delay_by_windows(readings)
        readings = motion_readings(recording, use_gyro=use_gyro, delay=delay)
    delay = float(delay or 0.0)
    stage("attitudes by windows of epochs")
    length = _WINDOW if use_gyro else _WINDOW_WITHOUT_GYRO
    window = epochs_within(length / float(readings.spacing))
    shared, covariance, _ = window_attitudes(readings, delay, _FREE if use_gyro else _COURSE_STD, window, gyro=use_gyro)
    stage("between the instants")
    return led(recording, readings, shared, covariance, delay, use_gyro=use_gyro)


def led(
    recording: Recording,
    readings: MotionReadings,
    shared: Attitudes,
    covariance: np.ndarray,
    delay: float,
    *,
    use_gyro: bool,
) -> pd.DataFrame:
    """The motion at the samples, led from instant to instant by the readings.

    Parameters
    ----------
    recording : Recording
        With an IMU, corrected.
    readings : MotionReadings
        The same as arrays.
    shared : Attitudes
        At the instants.
    covariance : (time, 3, 3) rad^2
        Of the attitudes, rotation vectors in navigation axes.
    delay : float
        How late the receiver's stamps are, s.
    use_gyro : bool
        Whether the readings hold rates.

    Returns
    -------
    estimate : DataFrame
        As of `altijax.estimate_motion`.
    """
    use: Use = (*(("gyro",) if use_gyro else ()), "velocity")
    layout = layout_of(use)
    x = np.zeros((len(shared.v_n), layout.size))
    x[:, layout.at("velocity")] = shared.v_n
    states: dict[str, Any] = {"C_nb": shared.C_nb, "x": x}
    trajectory = Trajectory(**states)
    between = jax.device_get(between_readings(use, jax.device_put(readings), trajectory, np.float64(delay)))
    P = _covariance(layout, np.asarray(between.instants), np.asarray(readings.std), covariance)
    levels = {name: level.usual for name, level in levels_of(use).items()} | {"acceleration": _SHAKEN}
    samples = at_samples(recording, layout, trajectory, P, between, levels)
    estimate = as_table(recording, samples)[list(MOTION_COLUMNS)].assign(valid=supported(recording, use))
    estimate.attrs = {"delay": delay}
    return estimate


def _covariance(layout: Layout, instants: np.ndarray, std: np.ndarray, attitude: np.ndarray) -> np.ndarray:
    covariance = np.zeros((len(attitude), layout.size, layout.size))
    covariance[:, layout.at("attitude"), layout.at("attitude")] = attitude
    for axis, errors in enumerate(std.T):
        known = np.isfinite(errors)
        velocity = np.full(errors.shape, _UNKNOWN)
        if known.any():
            away = np.abs(instants[:, None] - instants[known]).min(1)
            velocity = np.interp(instants, instants[known], errors[known]) + _AWAY * away
        place = layout.at("velocity").start + axis
        covariance[:, place, place] = velocity**2
    return covariance
