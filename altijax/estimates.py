"""The verbs: a recording in, a DataFrame out, one row an IMU sample; and the calibration of their constants.

Everything is computed in double precision, whatever jax's flag says, on times counted from the first IMU sample. An
estimate never looks at the recording's reference: `calibrate` may, up to `until`, and the scores do.
"""

from altijax.elevation_estimate.calibration import calibrate
from altijax.elevation_estimate.estimates import estimate_elevation, score_elevation
from altijax.elevation_estimate.model import PARAMETERS
from altijax.motion_estimate.estimates import estimate_motion
from altijax.motion_estimate.scores import score_motion, withheld_gnss_errors
from altijax.speed_estimate.estimates import estimate_speed
from altijax.speed_estimate.outages import outage_errors, outage_table

__all__ = [
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
