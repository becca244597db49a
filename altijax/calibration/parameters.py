"""Constants of a car and its sensors: what is known of each beforehand, and by which methods it can be found.

This is the one place for it. A method that needs another spread of a constant has a table `SPREADS` of its own, which
gives the reason, and takes its constants from `presumed`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax.numpy as jnp


@dataclass(frozen=True)
class Constant:
    """What is known of a constant beforehand.

    Attributes
    ----------
    nominal : float
        Value where nothing was calibrated; NaN where the method finds it by itself.
    spread : float
        By how much it may be off, one standard deviation: the prior of a calibration, and the error bar of what was
        not calibrated.
    unit : str
        Unit of both.
    why : str
        Reason or source of the spread.
    methods : tuple of str
        Methods of `calibrate` that can find it.
    """

    nominal: float
    spread: float
    unit: str
    why: str
    methods: tuple[str, ...]


_HEIGHT, _RECKONED, _EPOCHS = ("slope", "shirai", "fused"), ("conventional", "roll", "aided"), ("epoch", "window")
_METHODS = (*_HEIGHT, *_RECKONED, "filter", *_EPOCHS, "batch", "drive")
_ROAD = (*_HEIGHT, *_RECKONED, "filter", "drive")
_WITHOUT_PITCH = tuple(method for method in _METHODS if method != "conventional")
_ROLL = ("roll", "aided", "window")

_ZERO_G = "assumed 30 mg; an MPU-6050's zero may be off by 50 mg on x and y, 80 mg on z"
_FORCE_SCALE = "a third of an MPU-6050's tolerance of 3 %"
_ZERO_RATE = "assumed 1.1 deg/s, of a gyro trimmed now and then; an untrimmed MPU-6050 may be off by 20 deg/s"
_RATE_SCALE = "tolerance of an MPU-6050, 3 %"
_BY_HAND = "assumed 3 deg: fixed by hand, aligned by eye"
_PLACED = "assumed: anywhere between the axles"

CONSTANTS = {
    "wheel_scale": Constant(1.0, 0.01, "1", "assumed: radius of a tyre by pressure, load and wear", _ROAD),
    "wheel_delay": Constant(0.0, 0.1, "s", "assumed: a bus or logger that sends ten times a second", _ROAD),
    "gnss_delay": Constant(0.0, 0.1, "s", "0.11 to 0.22 s were seen in real logs", (*_ROAD, *_EPOCHS, "batch")),
    "accelerometer_bias_x": Constant(0.0, 0.3, "m/s^2", _ZERO_G, _METHODS),
    "accelerometer_bias_y": Constant(0.0, 0.3, "m/s^2", _ZERO_G, _WITHOUT_PITCH),
    "accelerometer_bias_z": Constant(
        0.0, 0.3, "m/s^2", _ZERO_G, tuple(method for method in _WITHOUT_PITCH if method != "filter")
    ),
    "accelerometer_scale": Constant(1.0, 0.01, "1", _FORCE_SCALE, (*_HEIGHT, *_RECKONED, *_EPOCHS, "drive")),
    "accelerometer_scale_x": Constant(1.0, 0.01, "1", _FORCE_SCALE, (*_HEIGHT, *_RECKONED, *_EPOCHS)),
    "accelerometer_scale_y": Constant(1.0, 0.01, "1", _FORCE_SCALE, (*_HEIGHT, *_ROLL, "epoch")),
    "accelerometer_scale_z": Constant(1.0, 0.01, "1", _FORCE_SCALE, (*_HEIGHT, *_ROLL, "epoch")),
    "gyro_bias_x": Constant(0.0, 0.02, "rad/s", _ZERO_RATE, (*_ROLL, "filter", "batch", "drive")),
    "gyro_bias_y": Constant(0.0, 0.02, "rad/s", _ZERO_RATE, ("conventional", *_ROLL, "filter", "batch", "drive")),
    "gyro_bias_z": Constant(0.0, 0.02, "rad/s", _ZERO_RATE, (*_ROLL, "filter", "batch", "drive")),
    "gyro_scale_x": Constant(1.0, 0.03, "1", _RATE_SCALE, _ROLL),
    "gyro_scale_y": Constant(1.0, 0.03, "1", _RATE_SCALE, ("conventional", *_ROLL)),
    "mounting_pitch": Constant(0.0, 0.05, "rad", _BY_HAND, (*_HEIGHT, *_RECKONED, "drive")),
    "mounting_yaw": Constant(0.0, 0.05, "rad", _BY_HAND, _ROAD),
    "gyro_scale_z": Constant(1.0, 0.03, "1", _RATE_SCALE, (*_ROLL, "drive")),
    "weight_transfer": Constant(0.0, 0.05, "1", "assumed: a car pitches by 3 deg for each g", (*_HEIGHT, "drive")),
    "wheel_slip": Constant(0.0, 0.003, "s^2/m", "assumed: a tyre slips by 1 % at a third of g", ("drive",)),
    "lever_arm": Constant(0.0, 1.0, "m", _PLACED, ("shirai", "fused", "drive")),
    "antenna_lever_arm": Constant(0.0, 1.0, "m", _PLACED, ("drive",)),
    "wheel_difference": Constant(0.0, 0.02, "1", "assumed: tyres of an axle that wore unevenly", ("drive",)),
    "track_width": Constant(1.5, 0.1, "m", "assumed: cars from small to large", ("drive",)),
    "yaw_rate_bias": Constant(
        0.0, 0.005, "rad/s", "assumed: of a gyro or two wheels, after a rest", ("shirai", "fused")
    ),
    "initial_vertical_speed": Constant(
        float("nan"), 0.2, "m/s", "assumed, beside what the slope at the start leaves", ("shirai", "fused")
    ),
}
"""Constants by name, in the order in which methods have them, for a consumer's sensor, mounted by hand in a car. The
MPU-6050's figures are those of `altijax.instruments.MEMS_ACCELEROMETER` and `MEMS_GYRO`. One table of spreads stands
beside this one: `altijax.calibration.static.POSITION_UNCERTAINTY`, of a sensor on a table, where its tolerance counts
whole and no mounting is added."""

ACCEPTED = {method: [name for name, constant in CONSTANTS.items() if method in constant.methods] for method in _METHODS}
"""Which of `CONSTANTS` each method of `calibrate` can find."""


def presumed(names: Iterable[str], spreads: Mapping[str, tuple[float, str]]) -> dict[str, Constant]:
    """Constants by name, some of them with a spread of a method's own.

    Parameters
    ----------
    names : several str
        Out of `CONSTANTS`.
    spreads : mapping
        Spread and its reason by name, of those that differ from the table's.

    Returns
    -------
    constants : dict
        In the order given.
    """
    constants = {name: CONSTANTS[name] for name in names}
    own = {
        name: replace(constants[name], spread=spread, why=why)
        for name, (spread, why) in spreads.items()
        if name in constants
    }
    return constants | own


class Triads(NamedTuple):
    """An IMU in a car: ``true = euler_to_matrix(mounting) @ (measured / scale - bias)``, from named constants.

    Attributes
    ----------
    accelerometer_bias : (3,) m/s^2
    accelerometer_scale : (3,)
    gyro_bias : (3,) rad/s
    gyro_scale : (3,)
    mounting : (3,) rad
        Roll, which is zero, pitch and yaw.
    """

    accelerometer_bias: Any
    accelerometer_scale: Any
    gyro_bias: Any
    gyro_scale: Any
    mounting: Any


def triads(values: Mapping[str, Any], arrays: Any = jnp) -> Triads:
    """Named constants as those of two triads and their mounting.

    Parameters
    ----------
    values : mapping
        Numbers by name; a constant that is missing is nominal, names of other constants are passed over.
    arrays : module, optional
        Of which the arrays are: `jax.numpy`, or `numpy` where no program should be compiled.

    Returns
    -------
    triads : Triads
        Differentiable by the values.
    """

    def of(kind: str) -> Any:
        names = [f"{kind}_{axis}" for axis in "xyz"]
        return arrays.stack([values.get(name, CONSTANTS[name].nominal) for name in names])

    return Triads(
        accelerometer_bias=of("accelerometer_bias"),
        accelerometer_scale=values.get("accelerometer_scale", 1.0) * of("accelerometer_scale"),
        gyro_bias=of("gyro_bias"),
        gyro_scale=of("gyro_scale"),
        mounting=arrays.stack([0.0, values.get("mounting_pitch", 0.0), values.get("mounting_yaw", 0.0)]),
    )


def require_parameters(parameters: str | Iterable[str], method: str) -> list[str]:
    """Names as a list.

    Parameters
    ----------
    parameters : str or several
        Names of constants.
    method : str
        A key of `ACCEPTED`.

    Returns
    -------
    names : list of str
        In the order given.

    Raises
    ------
    ValueError
        If the method is unknown, or the names are none, repeated or not for this method.
    """
    if method not in ACCEPTED:
        raise ValueError(f"method must be one of {', '.join(ACCEPTED)}, got {method!r}")
    names = [parameters] if isinstance(parameters, str) else list(parameters)
    if not names or len(set(names)) < len(names) or not set(names) <= set(ACCEPTED[method]):
        known = ", ".join(ACCEPTED[method])
        raise ValueError(
            f"parameters of method {method!r} must be different names out of {known}; got {', '.join(names) or 'none'}"
        )
    return names
