"""How a vehicle's speed, attitude and constants move, and what its sensors should read: the model of `filter_speed`.

With four or five sensors the speed is the vehicle's and integrates the forward equation, with six the velocity is the
IMU's along its own axes. The direction of travel seen from the IMU, and its place in the vehicle, are states.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax.calibration.parameters import CONSTANTS, presumed

States = dict[str, jax.Array]

SENSORS = ("2+2", "2+3", "6")
"""Accelerometers + gyros of `filter_speed`: f_x f_y w_y w_z, the same with w_x, or all six."""

_HOLDS_MORE = "assumed 6 deg: the direction of travel holds what the tyres slip sideways and how the body sits, too"
_TRIMMED = "assumed 0.6 deg/s; what benchmarks.speed_accuracy shows was reached with it"
SPREADS = {
    "gyro_bias_x": (0.01, _TRIMMED),
    "gyro_bias_y": (0.01, _TRIMMED),
    "gyro_bias_z": (0.01, _TRIMMED),
    "gyro_scale_z": (0.02, "assumed: most units are better than their tolerance"),
    "mounting_yaw": (0.1, _HOLDS_MORE),
    "mounting_pitch": (0.1, _HOLDS_MORE),
}
"""Spreads that are not those of `CONSTANTS`, and why."""

OF_CONSTANTS = {
    **{f"accelerometer_bias_{axis}": (f"accelerometer_bias_{axis}", 1.0) for axis in "xyz"},
    **{f"gyro_bias_{axis}": (f"gyro_bias_{axis}", 1.0) for axis in "xyz"},
    "gyro_scale_z": ("gyro_scale_z", -1.0),
    "travel_yaw": ("mounting_yaw", -1.0),
    "travel_pitch": ("mounting_pitch", -1.0),
    "imu_delay": ("gnss_delay", -1.0),
}
"""States that are constants of a calibration, their names there, and their sign: the filter sees some from the other
side. They are zero where readings and aid were corrected. `imu_delay` is that of whatever aids. `lever_x` is none of
them: the filter begins without a lever whatever was calibrated."""

_SPREAD = {state: presumed([name], SPREADS)[name].spread for state, (name, _) in OF_CONSTANTS.items()}

STATES = {
    "speed": 1.0,
    "pitch": 0.1,
    "roll": 0.1,
    "resting_roll": 0.05,
    "lateral_speed": 0.3,
    "vertical_speed": 1.0,
    "accelerometer_bias_x": _SPREAD["accelerometer_bias_x"],
    "accelerometer_bias_y": _SPREAD["accelerometer_bias_y"],
    "accelerometer_bias_z": _SPREAD["accelerometer_bias_z"],
    "gyro_bias_x": _SPREAD["gyro_bias_x"],
    "gyro_bias_y": _SPREAD["gyro_bias_y"],
    "gyro_bias_z": _SPREAD["gyro_bias_z"],
    "gyro_scale_z": _SPREAD["gyro_scale_z"],
    "rectification_y": 0.05,
    "travel_yaw": _SPREAD["travel_yaw"],
    "travel_pitch": _SPREAD["travel_pitch"],
    "lever_x": CONSTANTS["lever_arm"].spread,
    "lever_y": 0.3,
    "lever_z": 1.0,
    "suspension_roll": 0.03,
    "imu_delay": _SPREAD["imu_delay"],
    "side_slip": 0.003,
    "vibration_level": 3.0,
    "vibration_gain": 1.5,
    "roughness": 0.5,
}
"""States of the filters and their standard deviations before the first sample, those of a consumer's instrument fixed
to a car by hand (assumed). SI and radians. With six sensors the speeds are the IMU's along its own axes, else `speed`
is the vehicle's. `travel_yaw` and `travel_pitch` are the direction of travel seen from the IMU (left and up), the
levers the IMU's place seen from the point of the vehicle that does not slip sideways. `rectification_y` is the bias of
w_y for each unit of vibration, `suspension_roll` the roll for each m/s^2 to the left, that of the usual cant included,
`imu_delay` by how much the stamps of the IMU are later than those of the aid, `side_slip` the lateral speed at the
point for each v^2 w_z. The logarithm of the vibration is `vibration_level` at standstill, grows by `vibration_gain` for
each e-fold of the speed, and has `roughness` from the road."""

_STEEPEST = 1.4
# A pitch vibration to compare with, the speed below which it is the engine's and no longer the road's, and for how
# long, in s, a road stays as rough as it is (assumed: some hundred metres).
_USUAL_VIBRATION, _LEAST_VIBRATION, _IDLE_SPEED, _ROUGHNESS_TIME = 0.004, 1e-8, 3.0, 25.0
_STILL_SPEED, _STILL_RATE = 0.02, 0.003


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SpeedNoise:
    """Noise levels of `filter_speed`.

    Attributes
    ----------
    acceleration : () m/s^2/sqrt(Hz)
        What the forward equation leaves unexplained.
    rotation : () rad/s/sqrt(Hz)
        Noise of the gyros, which goes wherever they go.
    vibration : () 1/sqrt(Hz)
        The same of the gyros for each rad/s of vibration.
    road_roll : () rad
        Standard deviation of the roll about its mean, where there is no roll gyro.
    road_roll_time : () s
        Its correlation time.
    lateral : () m/s^2
        Error of the lateral equation in one step.
    lateral_speed : () m/s
        Error of "no lateral speed" in one step, with six sensors.
    vertical_speed : () m/s
        Error of "no vertical speed" in one step, with six sensors.
    roughness : ()
        Standard deviation of the logarithm of the vibration that the road makes, about its mean for a speed.
    roughness_scatter : ()
        The same in one mean of five steps, without memory.
    aid : () m/s
        Error of the aid.
    accelerometer_walk : () m/s^2/sqrt(s)
        Random walk of the accelerometers' biases.
    gyro_walk : () rad/s/sqrt(s)
        Random walk of the gyros' biases.
    delay_walk : () s/sqrt(s)
        Random walk of the IMU's delay: two clocks drift apart.
    """

    acceleration: ArrayLike = 0.03
    rotation: ArrayLike = 0.002
    vibration: ArrayLike = 0.01
    road_roll: ArrayLike = 0.03
    road_roll_time: ArrayLike = 10.0
    lateral: ArrayLike = 0.15
    lateral_speed: ArrayLike = 0.05
    vertical_speed: ArrayLike = 0.1
    roughness: ArrayLike = 0.5
    roughness_scatter: ArrayLike = 1.0
    aid: ArrayLike = 0.1
    accelerometer_walk: ArrayLike = 0.003
    gyro_walk: ArrayLike = 0.0001
    delay_walk: ArrayLike = 0.003


class Step(NamedTuple):
    """Readings of one step, those of `filter_speed`; w_end at its end, w_slow their running mean, w_dot their rate.

    `shaking` is the mean vibration of some steps; the middle one of them has `shaking_told`, and `shaking_aided` if any
    of them has an aid.
    """

    f_b: jax.Array
    w_b: jax.Array
    w_end: jax.Array
    w_slow: jax.Array
    w_dot: jax.Array
    vibration: jax.Array
    shaking: jax.Array
    shaking_told: jax.Array
    shaking_aided: jax.Array
    still: jax.Array
    aid_speed: jax.Array
    aid_acceleration: jax.Array
    aid_lead: jax.Array
    aided: jax.Array


def state_names(sensors: str) -> tuple[str, ...]:
    """Names of the states of `filter_speed`, in their order.

    Parameters
    ----------
    sensors : {"2+2", "2+3", "6"}
        Accelerometers + gyros used.

    Returns
    -------
    names : tuple
        Keys of `STATES`.

    Raises
    ------
    ValueError
        If `sensors` is none of these.
    """
    if sensors not in SENSORS:
        raise ValueError(f"sensors must be one of {', '.join(SENSORS)}, got {sensors!r}")
    without = {
        "2+2": {
            "lateral_speed",
            "vertical_speed",
            "accelerometer_bias_z",
            "gyro_bias_x",
            "lever_y",
            "lever_z",
            "side_slip",
        },
        "2+3": {
            "lateral_speed",
            "vertical_speed",
            "accelerometer_bias_z",
            "lever_y",
            "side_slip",
            "resting_roll",
            "suspension_roll",
        },
        "6": {"resting_roll", "suspension_roll", "gyro_scale_z"},
    }[sensors]
    return tuple(name for name in STATES if name not in without)


class Model(NamedTuple):
    """Rates of the states by name; what `measurements` should be; the vehicle's speed."""

    rates: Callable[[States, Step, jax.Array, SpeedNoise], States]
    expected: Callable[[States, States, States, Step, jax.Array], list[jax.Array]]
    travel_speed: Callable[[States, Step], jax.Array]


def model_of(sensors: str) -> Model:
    """The model for these accelerometers + gyros."""
    if sensors == "6":
        return Model(_rates_of_six, _expected_of_six, _travel_speed_of_six)
    return Model(_rates, _expected, lambda x, step: x["speed"])


def _corrected(x: States, step: Step) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Rates of turn without what the gyros add."""
    w_x = step.w_b[0] - x.get("gyro_bias_x", 0.0)
    w_y = step.w_b[1] - x["gyro_bias_y"] - x["rectification_y"] * step.vibration
    w_z = (step.w_b[2] - x["gyro_bias_z"]) * (1 + x.get("gyro_scale_z", 0.0))
    return w_x, w_y, w_z


def _roll_kept(pitch: jax.Array, roll: jax.Array, w_y: jax.Array, w_z: jax.Array) -> jax.Array:
    """The w_x that keeps the roll. The pitch is bounded: no car is steeper, and at the poles the roll has no rate."""
    return jnp.tan(jnp.clip(pitch, -_STEEPEST, _STEEPEST)) * (w_y * jnp.sin(roll) + w_z * jnp.cos(roll))


def _travel(x: States) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Direction of travel in the axes of the IMU."""
    forward = jnp.cos(x["travel_pitch"])
    yaw = x["travel_yaw"]
    return forward * jnp.cos(yaw), forward * jnp.sin(yaw), jnp.sin(x["travel_pitch"])


def total_roll(x: States, step: Step) -> jax.Array:
    """Roll of the IMU, with that of the body in its suspension."""
    if "suspension_roll" not in x:
        return x["roll"]
    return x["roll"] + x["suspension_roll"] * x["speed"] * _corrected(x, step)[2]


def _rates(x: States, step: Step, gravity: jax.Array, noise: SpeedNoise) -> States:
    """Rates of speed, pitch and roll with two accelerometers."""
    w_x, w_y, w_z = _corrected(x, step)
    u_x, u_y, u_z = _travel(x)
    roll, pitch = total_roll(x, step), x["pitch"]
    # f = v' u + w x v u + gravity + the lever's centripetal force, solved for v'
    force = step.f_b[0] - x["accelerometer_bias_x"] - gravity * jnp.sin(pitch)
    acceleration = (force - x["speed"] * (w_y * u_z - w_z * u_y) + (w_y * w_y + w_z * w_z) * x["lever_x"]) / u_x
    if "resting_roll" in x:
        roll_rate = (x["resting_roll"] - x["roll"]) / noise.road_roll_time
    else:
        roll_rate = w_x - _roll_kept(pitch, roll, w_y, w_z)
    return {
        "speed": acceleration,
        "pitch": -w_y * jnp.cos(roll) + w_z * jnp.sin(roll),
        "roll": roll_rate,
        "roughness": -x["roughness"] / _ROUGHNESS_TIME,
    }


def _expected(x: States, middle: States, rate: States, step: Step, gravity: jax.Array) -> list[jax.Array]:
    """What `measurements` should be with two accelerometers."""
    w_x, w_y, w_z = _corrected(middle, step)
    u_x, u_y, u_z = _travel(x)
    roll = total_roll(middle, step)
    if "gyro_bias_x" not in x:
        w_x = _roll_kept(middle["pitch"], roll, w_y, w_z)
    f_y = rate["speed"] * u_y + middle["speed"] * (w_z * u_x - w_x * u_z) + x["accelerometer_bias_y"]
    f_y += gravity * jnp.cos(middle["pitch"]) * jnp.sin(roll) + step.w_dot[2] * x["lever_x"]
    if "lever_z" in x:
        f_y -= step.w_dot[0] * x["lever_z"]
    return [f_y, _at_aid(x, x["speed"], step), x["speed"], _shaking(x, x["speed"]), *_rates_at_rest(x, step)]


def _rates_of_six(x: States, step: Step, gravity: jax.Array, noise: SpeedNoise) -> States:
    """Rates of the IMU's velocity along its own axes, of pitch and roll."""
    w = jnp.stack(_corrected(x, step))
    roll, pitch = x["roll"], x["pitch"]
    bias = jnp.stack([x["accelerometer_bias_x"], x["accelerometer_bias_y"], x["accelerometer_bias_z"]])
    up = jnp.stack([jnp.sin(pitch), jnp.cos(pitch) * jnp.sin(roll), jnp.cos(pitch) * jnp.cos(roll)])
    velocity = jnp.stack([x["speed"], x["lateral_speed"], x["vertical_speed"]])
    a = step.f_b - bias - gravity * up - jnp.cross(w, velocity)
    return {
        "speed": a[0],
        "lateral_speed": a[1],
        "vertical_speed": a[2],
        "pitch": -w[1] * jnp.cos(roll) + w[2] * jnp.sin(roll),
        "roll": w[0] - _roll_kept(pitch, roll, w[1], w[2]),
        "roughness": -x["roughness"] / _ROUGHNESS_TIME,
    }


def _expected_of_six(x: States, middle: States, rate: States, step: Step, gravity: jax.Array) -> list[jax.Array]:
    """What `measurements` should be with six sensors."""
    forward, left, up = _velocity_of_point(x, step)
    slip = left + x["side_slip"] * forward * forward * (step.w_end[2] - x["gyro_bias_z"])
    return [slip, up, _at_aid(x, forward, step), forward, _shaking(x, forward), *_rates_at_rest(x, step)]


def _travel_speed_of_six(x: States, step: Step) -> jax.Array:
    return _velocity_of_point(x, step)[0]


def _velocity_of_point(x: States, step: Step) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Velocity, along the vehicle's axes, of its point that does not slip sideways."""
    lever = jnp.stack([x["lever_x"], x["lever_y"], x["lever_z"]])
    w = step.w_end - jnp.stack([x["gyro_bias_x"], x["gyro_bias_y"], x["gyro_bias_z"]])
    v = jnp.stack([x["speed"], x["lateral_speed"], x["vertical_speed"]]) - jnp.cross(w, lever)
    forward = jnp.stack(_travel(x))
    left = jnp.stack([-jnp.sin(x["travel_yaw"]), jnp.cos(x["travel_yaw"]), jnp.zeros_like(x["speed"])])
    return v @ forward, v @ left, v @ jnp.cross(forward, left)


def _at_aid(x: States, speed: jax.Array, step: Step) -> jax.Array:
    """Speed at the time of the aid, by the aid's own acceleration: the filter's is wrong while the pitch is."""
    return speed + (x["imu_delay"] + step.aid_lead) * step.aid_acceleration


def _shaking(x: States, speed: jax.Array) -> jax.Array:
    """Logarithm of the vibration: a power of the speed, times what the road under it makes of that."""
    moving = 0.5 * jnp.log(1 + (speed / _IDLE_SPEED) ** 2)
    return x["vibration_level"] + x["vibration_gain"] * moving + x["roughness"]


def _rates_at_rest(x: States, step: Step) -> list[jax.Array]:
    w_y = x["gyro_bias_y"] + x["rectification_y"] * step.vibration
    return [w_y, x["gyro_bias_z"]] + ([x["gyro_bias_x"]] if "gyro_bias_x" in x else [])


def measurements(
    step: Step, noise: SpeedNoise, sensors: str, shaken: jax.Array
) -> list[tuple[jax.Array, ArrayLike, jax.Array]]:
    """Measured value, standard deviation, and whether there is one; `shaken` says if the vibration tells the speed."""
    zero, moving = jnp.zeros_like(step.aid_speed), ~step.still
    constraints: list[tuple[jax.Array, ArrayLike, jax.Array]] = (
        [(zero, level, moving) for level in (noise.lateral_speed, noise.vertical_speed)]
        if sensors == "6"
        else [(step.f_b[1], noise.lateral, moving)]
    )
    at_rest: list[tuple[jax.Array, ArrayLike, jax.Array]] = [
        (step.w_b[axis], jnp.full_like(zero, _STILL_RATE), step.still)
        for axis in ((1, 2) if sensors == "2+2" else (1, 2, 0))
    ]
    shaking = jnp.log(jnp.maximum(step.shaking, _LEAST_VIBRATION) / _USUAL_VIBRATION)
    return [
        *constraints,
        (step.aid_speed, noise.aid, step.aided),
        (zero, jnp.full_like(zero, _STILL_SPEED), step.still),
        (shaking, noise.roughness_scatter, step.shaking_told & moving & (step.shaking_aided | shaken)),
        *at_rest,
    ]


def walks(x: States, step: Step, noise: SpeedNoise, sensors: str) -> jax.Array:
    """Growth of the states' variances, each second."""
    names = tuple(x)
    growth = dict.fromkeys(("speed", "lateral_speed", "vertical_speed"), noise.acceleration**2)
    growth |= {name: noise.accelerometer_walk**2 for name in names if name.startswith("accelerometer_bias")}
    growth |= {name: noise.gyro_walk**2 for name in names if name.startswith("gyro_bias")}
    growth["imu_delay"] = noise.delay_walk**2
    growth["roughness"] = 2 * noise.roughness**2 / _ROUGHNESS_TIME
    if sensors == "2+2":
        growth["roll"] = 2 * noise.road_roll**2 / noise.road_roll_time
    return jnp.stack([growth.get(name, jnp.zeros_like(noise.aid)) for name in names])
