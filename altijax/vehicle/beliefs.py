"""What is believed of a vehicle's states before its record: of any vehicle's, or as a calibration has found them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from altijax.calibration.records import Calibration
from altijax.vehicle.parts import Part
from altijax.vehicle.sensors import Use, layout_of, parts_of
from altijax.vehicle.smoother import Belief

_AXES = "xyz"
_EAST = 1e-3
# The state that a named constant is, its entry, and whether it is the inverse of a scale, less one.
_STATES: dict[str, tuple[str, int, bool]] = {
    **{f"accelerometer_bias_{axis}": ("accelerometer_bias", i, False) for i, axis in enumerate(_AXES)},
    **{f"accelerometer_scale_{axis}": ("accelerometer_scale", i, True) for i, axis in enumerate(_AXES)},
    **{f"gyro_bias_{axis}": ("gyro_bias", i, False) for i, axis in enumerate(_AXES)},
    **{f"gyro_scale_{axis}": ("gyro_scale", i, True) for i, axis in enumerate(_AXES)},
    "gnss_delay": ("gnss_delay", 0, False),
    "wheel_delay": ("wheel_delay", 0, False),
    "wheel_scale": ("wheel_scale", 0, True),
}


def belief_of(use: Use, calibration: Calibration | None = None) -> Belief:
    """What is believed of the states of a set of sensors.

    Parameters
    ----------
    use : tuple of str
        The set.
    calibration : Calibration, optional
        Constants known beforehand, with their errors and correlations; those that are no states here have no say.

    Returns
    -------
    belief : Belief
        Mean and covariance.
    """
    parts, layout = parts_of(use), layout_of(use)
    mean: Any = _spread(parts, "mean")
    std = _spread(parts, "std")
    if not {"velocity", "position"} & set(use):
        # Nothing tells where East is: it is where the drive starts to.
        std[layout.at("attitude").start + 2] = _EAST
    covariance: Any = np.diag(np.square(std))
    if calibration is None:
        return Belief(mean=mean, covariance=covariance)
    found = {
        name: layout.at(state).start + entry
        for name, (state, entry, _) in _STATES.items()
        if name in calibration.values and state in layout
    }
    if not found:
        return Belief(mean=mean, covariance=covariance)
    names, places = list(found), np.array(list(found.values()))
    inverse = np.array([_STATES[name][2] for name in names])
    value = calibration.values[names].to_numpy(float)
    slope = np.where(inverse, -1 / np.where(inverse, value, 1.0) ** 2, 1.0)
    known = calibration.std_with_absorbed[names].to_numpy(float) * slope
    mean[places] = np.where(inverse, 1 / np.where(inverse, value, 1.0) - 1, value)
    correlation = calibration.correlation.loc[names, names].to_numpy(float)
    covariance[places[:, None], places] = correlation * np.outer(known, known)
    return Belief(mean=mean, covariance=covariance)


def _spread(parts: Mapping[str, Part], field: str) -> np.ndarray:
    values = [np.broadcast_to(np.asarray(getattr(part, field), float), part.size) for part in parts.values()]
    return np.concatenate(values)
