"""What is known of the constants of an elevation before a drive: a calibration's, else those of any instrument."""

from dataclasses import replace

from altijax.calibration.priors import prior_of
from altijax.calibration.records import Calibration, correct_imu
from altijax.drives import Drive, imu_of, wheel_pair
from altijax.elevation_estimate.model import NAMES, uncertain_constants, vertical_speed_at_start
from altijax.elevation_estimate.posterior import Constants
from altijax.recordings import Recording


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
        Those calibrated first; see `prior_of`.
    """
    fixed = {} if fixed is None else fixed
    known = {} if calibration is None else calibration.known()
    values = {name: value for name, value in known.items() if name in NAMES and name not in fixed}
    others = {name: std for name, std in uncertain_constants(drive, method).items() if name not in values | fixed}
    names = (*values, *others)
    mean, covariance = prior_of(names, calibration, others)
    if "initial_vertical_speed" in others:
        at = {**values, **fixed}
        mean[names.index("initial_vertical_speed")] = vertical_speed_at_start(at, drive, names, "shirai")
    return Constants(names=names, mean=mean, covariance=covariance)


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
