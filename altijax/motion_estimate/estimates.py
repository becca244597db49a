"""Attitude and velocity at every IMU sample of a recording, from accelerometer, gyro and GNSS Doppler velocities."""

from dataclasses import replace

import jax
import numpy as np
import pandas as pd

from altijax.calibration.priors import prior_of
from altijax.calibration.records import Calibration, correct_imu
from altijax.drives import imu_of
from altijax.motion_estimate.batch import batch_estimate
from altijax.motion_estimate.epoch_attitudes import epoch_estimate
from altijax.motion_estimate.window import window_estimate
from altijax.recordings import Recording
from altijax.stages import stages
from altijax.vehicle.estimates import warn_of

MOTION_METHODS = ("epoch", "window", "batch")


def estimate_motion(
    recording: Recording,
    *,
    method: str = "batch",
    calibration: Calibration | None = None,
    use_gyro: bool = True,
    wind: bool | str = "auto",
    delay: float | None = None,
) -> pd.DataFrame:
    """Attitude and velocity at the rate of the IMU, from velocities of 1 to 10 Hz, after [chalko2010]_.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities; a gyro helps a lot.
    method : {"batch", "window", "epoch"}
        "epoch" is the paper's: `fit_attitudes` finds an attitude for each epoch by itself, from Fourier means, level
        and along the course as far as the epoch does not tell, and the previous one where it tells too little. It never
        uses the gyro, and its bars presume a device that points about where it goes. "window" lets epochs around share
        an attitude that turns as the gyro says. "batch" is the most probable motion of the whole record, with biases,
        noise levels and delay from the record itself, and the only one whose error bars include all of these.
    calibration : Calibration, optional
        Constants known beforehand: biases and scales of accelerometers and gyros, `gnss_delay`. In "batch" they and
        their errors are the priors of what it estimates itself; a bias found from heights also holds the mounting, and
        is trusted accordingly less. Constants of wheels and mounting have no say in the attitude of the IMU.
    use_gyro : bool
        Whether the gyro is used where there is one.
    wind : bool or "auto"
        Whether body x may point off the course by a constant wind (an aircraft). True and False hold it near the
        direction of travel, through the air or over ground. By itself: with a gyro it is free; without one it is held,
        and the wind is in it where the courses flown show one. Only "batch" knows wind.
    delay : float, optional
        How late the stamps of the GNSS velocities are, in s; estimated by default, in "batch" with how much later still
        the vertical ones are. Where the record does not tell it, "epoch" takes what is presumed of receivers.

    Returns
    -------
    estimate : DataFrame
        Indexed as ``recording.imu``: roll, pitch, heading (rad), v_e, v_n, v_u (m/s), the standard deviation of each
        (``roll_std`` ...), and valid, False where no GNSS velocity is near or the IMU has a gap. ``attrs["delay"]`` is
        the delay in s. That of "batch" has also ``climb_delay``, how much later the vertical velocities are than the
        horizontal ones (s), ``wind`` (m/s to East and North, or None), and all that `estimate_drive` says of itself.

    Raises
    ------
    ValueError
        If an option is unknown or a stream that is needed is missing.
    """
    if method not in MOTION_METHODS:
        raise ValueError(f"method must be one of {', '.join(MOTION_METHODS)}, got {method!r}")
    if wind not in (True, False, "auto"):
        raise ValueError(f'wind must be True, False or "auto", got {wind!r}')
    use_gyro = use_gyro and "gx" in imu_of(recording)
    with jax.enable_x64(True), stages(f"motion of {recording.name} by {method}") as stage:
        if method == "batch":
            estimate = batch_estimate(
                recording, use_gyro=use_gyro, wind=wind, delay=delay, calibration=calibration, stage=stage
            )
            warn_of(recording, estimate)
            return estimate
        corrected = replace(recording, imu=correct_imu(imu_of(recording), calibration))
        calibrated = calibration is not None and "gnss_delay" in calibration.values
        known, variance = prior_of(["gnss_delay"], calibration)
        believed = float(known[0]), float(np.sqrt(variance[0, 0]))
        if method == "epoch":
            stage("delay of the GNSS velocities, attitudes of epochs")
            given = (float(delay), 0.0) if delay is not None else believed if calibrated else None
            return epoch_estimate(corrected, given, believed)
        if delay is None and calibrated:
            delay = believed[0]
        return window_estimate(corrected, use_gyro=use_gyro, delay=delay, stage=stage)
