"""What is known of the constants of an elevation before a drive: a calibration's, else those of any instrument."""

from dataclasses import replace

import numpy as np
import pandas as pd

from altijax.calibration.parameters import ACCEPTED
from altijax.calibration.records import Calibration, correct_imu
from altijax.drives import Drive, imu_of, wheel_pair
from altijax.elevation_estimate.model import NOMINAL, uncertain_constants, vertical_speed_at_start
from altijax.elevation_estimate.posterior import Constants
from altijax.recordings import Recording

_OWN = set(ACCEPTED["fused"])


def prior_constants(
    drive: Drive, method: str, calibration: Calibration | None = None, fixed: dict[str, float] | None = None
) -> Constants:
    """What is known of a method's constants before a drive.

    Parameters
    ----------
    drive : Drive
        The drive.
    method : {"shirai", "slope", "fused"}
        The method.
    calibration : Calibration, optional
        Of any method, of which the constants that an elevation depends on count; others are those of an instrument that
        nobody has calibrated.
    fixed : dict of str to float, optional
        Constants known exactly, which are left out.

    Returns
    -------
    constants : Constants
        A calibrated constant has taken up what the others, left at nominal, did where it was fitted: it is off by its
        own error and, against each of them, by what it absorbed.
    """
    fixed = {} if fixed is None else fixed
    values = (
        {} if calibration is None else {str(name): float(x) for name, x in calibration.values.items() if name in _OWN}
    )
    names = [name for name in values if name not in fixed]
    others = {name: std for name, std in uncertain_constants(drive, method).items() if name not in values | fixed}
    covariance = np.diag(np.square([*np.zeros(len(names)), *others.values()]))
    if calibration is not None:
        std = calibration.std[names].to_numpy()
        own = calibration.correlation.loc[names, names].to_numpy() * np.outer(std, std)
        absorbed = calibration.absorbed if calibration.method == method else pd.DataFrame()
        gain = absorbed.reindex(index=names, columns=list(others)).fillna(0.0).to_numpy()
        through = np.vstack([gain, np.eye(len(others))])
        covariance = through @ np.diag(np.square(list(others.values()))) @ through.T
        covariance[: len(names), : len(names)] += own
    mean, order = NOMINAL | values, (*names, *others)
    if "initial_vertical_speed" in others:
        mean["initial_vertical_speed"] = vertical_speed_at_start({**values, **fixed}, drive, order, "shirai")
    return Constants(names=order, mean=np.array([mean[name] for name in order]), covariance=covariance)


def with_corrected_turns(recording: Recording, calibration: Calibration | None) -> Recording:
    """The recording with its rates of turn corrected: what is left is `yaw_rate_bias`, a constant of the elevation.

    Parameters
    ----------
    recording : Recording
        The recording.
    calibration : Calibration, optional
        Of which the bias and the scale of the gyro about z count, and for single wheels their scale, their difference
        and the track width.

    Returns
    -------
    recording : Recording
        The same without a calibration.
    """
    if calibration is None:
        return recording
    known = calibration.values
    imu, wheel, pair = imu_of(recording), recording.wheel, wheel_pair(recording)
    if "gz" in imu:
        imu = imu.assign(gz=correct_imu(imu, calibration)["gz"])
    if wheel is not None and pair is not None:
        half = known.get("wheel_difference", 0.0) / 2
        scale = known.get("wheel_scale", 1.0)
        left, right = pair
        wheel = wheel.assign(**{left: wheel[left] * scale * (1 - half), right: wheel[right] * scale * (1 + half)})
    track_width = known.get("track_width", recording.track_width)
    return replace(recording, imu=imu, wheel=wheel, track_width=track_width)
