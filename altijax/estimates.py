"""The verbs: a recording in, a DataFrame out, one row an IMU sample; and the calibration of their constants.

Everything is computed in double precision, whatever jax's flag says, on times counted from the first IMU sample. An
estimate never looks at the recording's reference: `calibrate` may, up to `until`, and the scores do.
"""

import warnings
from collections.abc import Iterable

from altijax.calibration.drives import calibrate_driving
from altijax.calibration.parameters import ACCEPTED, require_parameters
from altijax.calibration.priors import PARAMETERS
from altijax.calibration.records import Calibration, worse_where_held_out
from altijax.elevation_estimate.calibration import calibrate_elevation
from altijax.elevation_estimate.estimates import estimate_elevation, score_elevation
from altijax.elevation_estimate.model import ELEVATION_METHODS
from altijax.motion_estimate.calibration import calibrate_motion
from altijax.motion_estimate.estimates import MOTION_METHODS, estimate_motion
from altijax.motion_estimate.scores import score_motion, withheld_gnss_errors
from altijax.recordings import Recording
from altijax.speed_estimate.calibration import calibrate_speed
from altijax.speed_estimate.estimates import SPEED_METHODS, estimate_speed
from altijax.speed_estimate.outages import outage_errors, outage_table

__all__ = [
    "ACCEPTED",
    "PARAMETERS",
    "calibrate",
    "estimate_elevation",
    "estimate_motion",
    "estimate_speed",
    "outage_errors",
    "outage_table",
    "score_elevation",
    "score_motion",
    "withheld_gnss_errors",
]

_FITS = {
    ELEVATION_METHODS: calibrate_elevation,
    SPEED_METHODS: calibrate_speed,
    MOTION_METHODS: calibrate_motion,
    ("drive",): calibrate_driving,
}


def calibrate(
    recordings: Recording | Iterable[Recording],
    parameters: str | Iterable[str],
    *,
    method: str,
    until: float | None = None,
) -> Calibration:
    """Constants of sensors, mounting and car that suit a method best, with their errors.

    The most probable values, by damped Gauss-Newton steps, under normal priors (`PARAMETERS`) and noise as large as the
    misfit itself shows. Of the methods of an estimate the misfit is that to the reference quantity that it estimates,
    with what the method finds for itself (an offset of the height, the speed and pitch a stretch begins with, the
    states of a filter) averaged over. "drive" needs no reference: there the sensors are made to agree. The constants
    make up for errors of the method, too, so those of one method need not suit another; those of "drive" and "batch"
    are the ones nearest to the sensors.

    Parameters
    ----------
    recordings : Recording or several
        With a reference of the quantity estimated: ``alt`` for an elevation, ``v_e, v_n, v_u`` for a speed, any of
        ``roll, pitch, heading`` for a motion. The constants are common to them.
    parameters : str or several
        Names out of ``ACCEPTED[method]``; the others keep their nominal values.
    method : str
        A method of `estimate_elevation`, `estimate_speed` or `estimate_motion`, or "drive".
    until : float, optional
        Last time, on the recordings' time axis, whose reference may be used; all of it by default. Afterwards the
        reference only measures what the calibration is worth there (``held_out``).

    Returns
    -------
    calibration : Calibration
        For the argument ``calibration`` of any estimate. Where the method estimates a constant itself ("fused",
        "filter", "batch"), value and standard deviation become its prior.

    Raises
    ------
    ValueError
        If the method is unknown, a name is none of its constants or changes nothing on these recordings, or the
        reference is missing or too short.

    Warns
    -----
    UserWarning
        If the data do not determine some of the constants, or these make the estimate worse by more than 1 % where
        they were not fitted. `Calibration` says the same when it is shown.
    """
    recordings = [recordings] if isinstance(recordings, Recording) else list(recordings)
    names = require_parameters(parameters, method)
    if not recordings:
        raise ValueError("calibrate needs one recording or more, got none")
    fit = next(fit for methods, fit in _FITS.items() if method in methods)
    found = fit(recordings, names, method=method, until=until)
    for sentence in (*found.undetermined, worse_where_held_out(found)):
        if sentence:
            warnings.warn(sentence, stacklevel=2)
    return found
