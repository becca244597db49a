"""From an exact motion and records of instruments to a recording with its reference."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jax.typing import ArrayLike

from altijax.constants import STANDARD_GRAVITY
from altijax.doppler import DopplerReceiver, doppler_velocity
from altijax.formats.tidy_folder import wheel_from_pulses
from altijax.motions import Pose, Readings, Windsurfer, ideal_readings, road_pose, windsurfer_pose
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.roads import Road, SpeedProfile
from altijax.rotations import matrix_to_euler, yaw_to_heading
from altijax.sensors import Accelerometer, Gyro, accelerometer_output, gyro_output
from altijax.wheels import WheelSensor, wheel_pulses

Motion = tuple[Road, SpeedProfile] | Windsurfer | Pose | Readings
Temperature = float | Callable[[np.ndarray], np.ndarray]

RATES = {"imu": 100.0, "wheel": 50.0, "reference": 10.0}
"""Rows a second of each stream that has no rate of its own; a receiver has one."""

# The smallest sizes that samples, epochs and pulses are filled up to, so that simulations of like length share what was
# compiled.
_SAMPLES, _EPOCHS, _PULSES = 4096, 64, 512
_VELOCITY = ["v_e", "v_n", "v_u"]
# Wheel speeds are read from pulses so often, Hz.
_WHEEL_ROWS = 50.0


def simulate_recording(
    motion: Motion | tuple[Motion, float],
    *,
    accelerometer: Accelerometer | None = None,
    gyro: Gyro | None = None,
    wheel: WheelSensor | None = None,
    receiver: DopplerReceiver | None = None,
    rates: Mapping[str, float] | None = None,
    temperature: Temperature | None = None,
    key: jax.Array | None = None,
    name: str = "simulated",
) -> Recording:
    """What instruments record of an exact motion, with the truth as reference.

    Parameters
    ----------
    motion : (Road, SpeedProfile), Windsurfer, callable or Readings
        A vehicle on a road, a windsurfer, a pose as in `altijax.motions`, such as ``partial(flight_pose, road, profile,
        wind, gravity)``, or exact readings at uniform times, to which shaking may have been added. A pair (motion,
        seconds) says how long to record; otherwise it is until the last leg of the motion's `SpeedProfile` has ended.
        Gravity is 9.80665 m/s^2.
    accelerometer : Accelerometer, optional
        Such as `MEMS_ACCELEROMETER`; an ideal one by default.
    gyro : Gyro, optional
        No gyro is recorded without.
    wheel : WheelSensor, optional
        Pulse generators of an axle, left and right, whose pulses are read as those of a pulses.csv are; no wheel speeds
        without.
    receiver : DopplerReceiver, optional
        No GNSS velocities without.
    rates : mapping of str to float, optional
        Rows a second of "imu", "wheel" and "reference" where they are not `RATES`. That of the IMU is a whole multiple
        of the reference's, 50 one of the wheels'. Readings have their own rate of the IMU.
    temperature : float or callable, optional
        Of the IMU, degC, a number or a function of times (s) in NumPy; it is recorded then.
    key : key, optional
        Source of all noise: equal keys make equal recordings, and a longer recording begins as a shorter one does.
        ``jax.random.key(0)`` by default.
    name : str, optional
        Of the recording.

    Returns
    -------
    recording : Recording
        The reference has roll, pitch, heading, v_e, v_n, v_u and alt, the height above the motion's origin.

    Raises
    ------
    ValueError
        If it is not known how long the motion lasts, a rate is unknown or does not divide, or readings are not uniform.
    """
    rates = _rates(rates, motion)
    with jax.enable_x64(True):
        truth, count = _truth(motion, rates["imu"])
        t = np.asarray(truth.t)
        warm = None if temperature is None else _temperature(temperature, t)
        instruments: dict[str, Any] = {"accelerometer": accelerometer or Accelerometer()}
        instruments |= {kind: it for kind, it in (("gyro", gyro), ("receiver", receiver)) if it is not None}
        epochs = 0 if receiver is None else bucket(round((t[count - 1] - t[0]) * _number(receiver.rate)) + 1, _EPOCHS)
        key = jax.random.key(0) if key is None else key
        sensed = {kind: np.asarray(x) for kind, x in _sensed(truth, instruments, warm, key, epochs).items()}
        pulses = None if wheel is None else _pulses(wheel, truth, count)
    index = pd.Index(t[:count], name="t")
    imu = pd.DataFrame(sensed["f"][:count], index, ["ax", "ay", "az"])
    if gyro is not None:
        imu[["gx", "gy", "gz"]] = sensed["w"][:count]
    if warm is not None:
        imu["temperature"] = warm[:count]
    notes: list[str] = []
    return Recording(
        name=name,
        description="simulated; the reference is exact",
        imu=imu,
        wheel=None if wheel is None or pulses is None else _wheel(wheel, pulses, imu, rates["wheel"], notes),
        gnss=None if receiver is None else _gnss(sensed, _number(receiver.latency), t[count - 1]),
        reference=_reference(truth, sensed["attitude"], index)[:: _every(rates, "imu", "reference")],
        pulses_per_turn=None if wheel is None else float(wheel.pulses_per_turn),
        wheel_radius=None if wheel is None else _number(wheel.radius),
        track_width=None if wheel is None else _number(wheel.track_width),
        notes=tuple(notes),
    )


def _rates(rates: Mapping[str, float] | None, motion: Motion | tuple[Motion, float]) -> dict[str, float]:
    given = dict(rates or {})
    unknown = set(given) - set(RATES)
    if unknown:
        raise ValueError(
            f"rates must be of {', '.join(RATES)}; got {', '.join(sorted(unknown))} (a receiver has a rate)"
        )
    if isinstance(motion, Readings):
        steps = np.diff(np.asarray(motion.t, float))
        step = float(steps.mean())
        if not np.allclose(steps, step, rtol=1e-3):
            raise ValueError("the times of readings must be uniform: give a motion instead, or make readings anew")
        if "imu" in given:
            raise ValueError(f'readings have {1 / step:g} samples a second, so that rates["imu"] must not be given')
        given["imu"] = round(1 / step, 6)
    rates = RATES | given
    _every(rates, "imu", "reference")
    _every({"wheel": rates["wheel"], "pulses": _WHEEL_ROWS}, "pulses", "wheel")
    return rates


def _every(rates: Mapping[str, float], fast: str, slow: str) -> int:
    ratio = rates[fast] / rates[slow]
    if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-6:
        raise ValueError(
            f"the rate of {fast}, {rates[fast]:g} Hz, is no whole multiple of {slow}'s, {rates[slow]:g} Hz"
        )
    return round(ratio)


def _truth(motion: Motion | tuple[Motion, float], rate: float) -> tuple[Readings, int]:
    """Exact readings, filled up at the end, and how many of them count."""
    if isinstance(motion, Readings):
        t = np.asarray(motion.t, float)
        size = bucket(t.size, _SAMPLES)
        whole = jax.tree.map(lambda x: padded(np.asarray(x, float), size), motion)
        later = t[-1] + np.arange(1, size - t.size + 1) / rate
        # Beyond the end the wheels stand.
        speed = np.where(np.arange(size) < t.size, whole.speed, 0.0)
        return replace(whole, t=np.append(t, later), speed=speed), t.size
    pose, seconds = _pose(motion)
    count = int(np.floor(seconds * rate + 1e-6)) + 1
    return _ideal(pose, np.arange(bucket(count, _SAMPLES)) / rate), count


def _pose(motion: Any) -> tuple[jax.tree_util.Partial, float]:
    """A pose whose parameters are arrays, and how long it lasts, s."""
    seconds = None
    if isinstance(motion, tuple) and isinstance(motion[1], int | float):
        motion, seconds = motion
    if isinstance(motion, tuple):
        motion = partial(road_pose, *motion)
    elif isinstance(motion, Windsurfer):
        motion = partial(windsurfer_pose, motion)
    if isinstance(motion, partial):
        pose = jax.tree_util.Partial(motion.func, *motion.args, **motion.keywords)
    else:
        pose = jax.tree_util.Partial(motion)
    if seconds is None:
        parts = jax.tree.leaves(pose, is_leaf=lambda part: isinstance(part, SpeedProfile))
        profiles = [part for part in parts if isinstance(part, SpeedProfile)]
        legs = [np.transpose([part.start, part.stop, part.ramp]) for part in profiles]
        # Legs that go nowhere do not count.
        ends = [stop + ramp for leg in legs for start, stop, ramp in leg if stop > start]
        if not ends:
            raise ValueError("the motion has no SpeedProfile that ends: give (motion, seconds)")
        seconds = float(max(ends))
    return pose, float(seconds)


@jax.jit
def _ideal(pose: Pose, t: jax.Array) -> Readings:
    return ideal_readings(pose, t, STANDARD_GRAVITY)


@partial(jax.jit, static_argnames="epochs")
def _sensed(
    truth: Readings, instruments: dict[str, Any], temperature: jax.Array | None, key: jax.Array, epochs: int
) -> dict[str, jax.Array]:
    """What the accelerometer, the gyro and the receiver read, and the true roll, pitch and heading."""
    keys = jax.random.split(key, 3)
    dt = truth.t[1] - truth.t[0]
    euler = matrix_to_euler(truth.C_nb)
    found = {
        "attitude": jnp.stack([euler[:, 0], euler[:, 1], yaw_to_heading(euler[:, 2])], -1),
        "f": accelerometer_output(instruments["accelerometer"], truth.f_b, dt, temperature, key=keys[0]),
    }
    if "gyro" in instruments:
        found["w"] = gyro_output(instruments["gyro"], truth.w_b, truth.f_b, dt, temperature, key=keys[1])
    if "receiver" in instruments:
        reported = doppler_velocity(instruments["receiver"], truth.t, truth.velocity, epochs=epochs, key=keys[2])
        found |= dict(zip(("t_gnss", "v_gnss", "valid"), reported, strict=True))
    return found


def _number(value: ArrayLike) -> float:
    """A number of a record, of all its elements their mean."""
    return float(np.mean(np.asarray(value)))


def _temperature(temperature: Temperature, t: np.ndarray) -> np.ndarray:
    found = temperature(t) if callable(temperature) else temperature
    return np.broadcast_to(np.asarray(found, float), t.shape)


_wheel_pulses = jax.jit(wheel_pulses, static_argnames="max_pulses")


def _pulses(wheel: WheelSensor, truth: Readings, count: int) -> np.ndarray:
    """Times of the pulses by wheel, infinite after the last one."""
    t, speed, yaw_rate = np.asarray(truth.t), np.asarray(truth.speed), np.asarray(truth.w_b)[:, 2]
    room = _PULSES
    while True:
        times, there = (np.asarray(x) for x in _wheel_pulses(wheel, t, speed, yaw_rate, max_pulses=room))
        if there.max() <= room:
            return np.where(times <= t[count - 1], times, np.inf)
        room = bucket(int(there.max()), _PULSES)


def _wheel(
    wheel: WheelSensor, pulses: np.ndarray, imu: pd.DataFrame, rate: float, notes: list[str]
) -> pd.DataFrame | None:
    """Wheel speeds as they are read from pulses."""
    parts = [
        pd.DataFrame({"t": x[np.isfinite(x)], "wheel": side}) for x, side in zip(pulses, ("left", "right"), strict=True)
    ]
    table = pd.concat(parts, ignore_index=True).rename_axis("row")
    table.attrs["file"] = "simulated pulses"
    sensor = {"radius": _number(wheel.radius), "pulses_per_turn": wheel.pulses_per_turn}
    found = wheel_from_pulses(table, sensor, imu, notes)
    if found is None:
        return None
    sides = found.set_index("t")
    every = round(_WHEEL_ROWS / rate)
    return pd.concat([sides.mean(axis=1).rename("speed"), sides], axis=1)[::every]


def _gnss(sensed: dict[str, np.ndarray], latency: float, end: float) -> pd.DataFrame:
    t = sensed["t_gnss"]
    there = sensed["valid"] & (t <= end) & (t - latency <= end)
    return pd.DataFrame(sensed["v_gnss"][there], pd.Index(t[there], name="t"), _VELOCITY)


def _reference(truth: Readings, attitude: np.ndarray, index: pd.Index) -> pd.DataFrame:
    columns = np.column_stack([attitude, truth.velocity, np.asarray(truth.position)[:, 2]])
    return pd.DataFrame(columns[: len(index)], index, ["roll", "pitch", "heading", *_VELOCITY, "alt"])
