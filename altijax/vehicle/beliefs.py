"""What is believed of a vehicle's states before its record: of any vehicle's, or as a calibration has found them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from altijax.calibration.priors import prior_of
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
_FORCE_SCALES = {f"accelerometer_scale_{axis}" for axis in _AXES}


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
    # What the states are by the constants; all that the calibrated ones absorbed counts, be it a state here or not.
    places = {
        name: layout.at(state).start + entry
        for name, (state, entry, _) in _STATES.items()
        if state in layout and not parts[state].time
    }
    calibrated = [name for name in places if name in calibration.values]
    names = [*places, *(name for name in map(str, calibration.absorbed) if name not in places)]
    common = "accelerometer_scale" in calibration.values
    names += ["accelerometer_scale"] * (common and "accelerometer_scale" not in names)
    spreads = {name: float(std[place]) for name, place in places.items()}
    known, errors = prior_of(names, calibration, spreads)
    value = dict(zip(names, known.tolist(), strict=True))
    J = np.zeros((len(std), len(names)))
    for name, place in places.items():
        scale = _STATES[name][2]
        whole = value[name] * (value["accelerometer_scale"] if common and name in _FORCE_SCALES else 1.0)
        J[place, names.index(name)] = -1 / (whole * value[name]) if scale else 1.0
        if common and name in _FORCE_SCALES:
            J[place, names.index("accelerometer_scale")] = -1 / (whole * value["accelerometer_scale"])
        if name in calibrated or (common and name in _FORCE_SCALES):
            mean[place] = 1 / whole - 1 if scale else value[name]
    at = np.array(list(places.values()))
    covariance[at[:, None], at] = (J @ errors @ J.T)[at[:, None], at]
    return Belief(mean=mean, covariance=covariance)


def _spread(parts: Mapping[str, Part], field: str) -> np.ndarray:
    values = [np.broadcast_to(np.asarray(getattr(part, field), float), part.size) for part in parts.values()]
    return np.concatenate(values)
