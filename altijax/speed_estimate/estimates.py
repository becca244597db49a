"""Speed along a recording, by the patent's methods and by filters.

All methods start from the same filter, run over everything up to the end of the aid: its speed, attitude and constants
are theirs, so that only what happens afterwards differs. An estimate never looks at the recording's reference, nor at
an aid that comes after `aid_until`.
"""

from dataclasses import fields, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from scipy.optimize import minimize

from altijax.calibration.records import Calibration
from altijax.drives import imu_of, start_of
from altijax.recordings import Recording
from altijax.speed import speed_error_growth, speed_with_aided_roll, speed_with_roll, speed_without_roll
from altijax.speed_estimate.filter import SpeedTrack, filter_speed
from altijax.speed_estimate.model import SENSORS, SpeedNoise, state_names
from altijax.speed_estimate.steps import STEP, SpeedDrive, drive_in_steps, initial_state, steps_until

SPEED_METHODS = ("conventional", "roll", "aided", "filter")

AUTO_SENSORS = "2+3"
"""Accelerometers + gyros of sensors="auto": the patent's four and the roll gyro."""

# Noise levels are worth fitting from here on.
_FIT_FROM = 20.0
_FITTED = {
    "2+2": ("acceleration", "rotation", "road_roll", "road_roll_time", "lateral"),
    "2+3": ("acceleration", "rotation", "lateral"),
    "6": ("acceleration", "rotation", "lateral_speed", "vertical_speed"),
}
_ALSO_FITTED = ("vibration", "roughness", "roughness_scatter", "aid", "accelerometer_walk", "gyro_walk")
# Step of the differences in a logarithm: half the digits.
_DIFFERENCE = 1e-5
# By what factor, as a logarithm, a car's noise levels differ from the nominal ones.
_NOISE_SPREAD = 1.0
NOMINAL_NOISE: dict[str, float] = {field.name: float(getattr(SpeedNoise(), field.name)) for field in fields(SpeedNoise)}
"""Levels of `SpeedNoise` before anything is known of a drive."""


def estimate_speed(
    recording: Recording,
    *,
    method: str = "filter",
    aid_until: float | None = None,
    calibration: Calibration | None = None,
    initial_speed: float | None = None,
    initial_pitch: float | None = None,
    sensors: str = "auto",
) -> pd.DataFrame:
    """Speed along the path by dead reckoning, from where the aid ends.

    Parameters
    ----------
    recording : Recording
        With accelerometer and gyro, and wheel speeds or else GNSS velocities as aid.
    method : {"filter", "conventional", "roll", "aided"}
        "conventional" neglects the roll, "roll" is the loop of [us20060293826]_, "aided" the same with the last
        aided speed held inside the roll angle; "filter" is `filter_speed`. Up to `aid_until` all are the filter.
    aid_until : float, optional
        Last time, on the recording's time axis, whose aid may be used; by default the first second of the IMU, which
        gives the initial speed and pitch and next to nothing of the constants.
    calibration : Calibration, optional
        Constants known beforehand, as far as a speed depends on them; what remains of them is learned, the filter
        beginning with their standard deviations. A delay is that of the aid.
    initial_speed : float, optional
        In m/s; by default the aid's of the first second.
    initial_pitch : float, optional
        Of the IMU, in rad; by default from the forward specific force and the aid of the first second.
    sensors : {"auto", "2+2", "2+3", "6"}
        Accelerometers + gyros that the filter uses; "auto" is the patent's four and the roll gyro, "2+3".

    Returns
    -------
    estimate : DataFrame
        Indexed as ``recording.imu``: speed (m/s), speed_std (m/s), pitch and roll (rad, of the IMU), and valid, False
        in gaps of the IMU and where no roll explains the readings.

    Raises
    ------
    ValueError
        If an option is unknown or the recording lacks what it needs.
    """
    require_options(method, sensors)
    with jax.enable_x64(True):
        until = 1.0 if aid_until is None else aid_until - start_of(recording)
        drive = drive_in_steps(recording, calibration, until)
        sensors = AUTO_SENSORS if sensors == "auto" else sensors
        initial = initial_state(drive, until, initial_speed, initial_pitch)
        noise = fit_noise(drive, until, sensors, initial, NOMINAL_NOISE)
        track = run_filter(drive, until, sensors, initial, noise)
        estimate = on_imu(drive, track, sensors)
        if method != "filter":
            dead_reckon(estimate, drive, track, until, sensors, method, noise)
        usual = float(np.median(np.diff(drive.t)))
        gap = np.diff(drive.t, prepend=drive.t[0]) > max(5 * usual, 0.1)
        estimate["valid"] &= ~gap
        estimate.index = imu_of(recording).index
    return estimate


def require_options(method: str, sensors: str) -> None:
    if method not in SPEED_METHODS:
        raise ValueError(f"method must be one of {', '.join(SPEED_METHODS)}, got {method!r}")
    if sensors not in ("auto", *SENSORS):
        raise ValueError(f"sensors must be one of auto, {', '.join(SENSORS)}, got {sensors!r}")


def fit_noise(
    drive: SpeedDrive, until: float, sensors: str, initial: tuple[float, float], start: dict[str, float]
) -> dict[str, float]:
    """Noise levels of largest posterior probability over the aided part; the nominal ones where it is short."""
    if until < _FIT_FROM:
        return start
    names = _FITTED[sensors] + _ALSO_FITTED
    nominal = np.log([NOMINAL_NOISE[name] for name in names])
    inputs = steps_until(drive, until)
    counted = (drive.ends <= until).astype(float)

    def objective(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = _misfit(logarithms, inputs, counted, initial, drive.gravity, sensors, names)
        from_nominal = (logarithms - nominal) / _NOISE_SPREAD
        return (
            float(value) + 0.5 * float(from_nominal @ from_nominal),
            np.asarray(slope) + from_nominal / _NOISE_SPREAD,
        )

    found = minimize(
        objective,
        np.log([start[name] for name in names]),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 30, "ftol": 1e-5},
    )
    return NOMINAL_NOISE | dict(zip(names, np.exp(found.x).tolist(), strict=True))


@partial(jax.jit, static_argnames=("sensors", "names"))
def _misfit(
    logarithms: jax.Array,
    inputs: dict[str, jax.Array],
    counted: jax.Array,
    initial: tuple[float, float],
    gravity: float,
    sensors: str,
    names: tuple[str, ...],
) -> tuple[jax.Array, jax.Array]:
    """Minus the log-likelihood and its gradient, by differences: the filter's derivatives take five times as long."""

    def misfit(logarithms: jax.Array) -> jax.Array:
        noise = replace(SpeedNoise(), **dict(zip(names, jnp.exp(logarithms), strict=True)))
        return -jnp.sum(counted * _run(inputs, initial, gravity, noise, sensors).log_likelihood)

    shifts = jnp.concatenate([jnp.zeros((1, len(names))), _DIFFERENCE * jnp.eye(len(names))])
    misfits = jax.vmap(misfit)(logarithms + shifts)
    return misfits[0], (misfits[1:] - misfits[0]) / _DIFFERENCE


def run_filter(
    drive: SpeedDrive, until: float, sensors: str, initial: tuple[float, float], noise: dict[str, float]
) -> SpeedTrack:
    return _run(steps_until(drive, until), initial, drive.gravity, SpeedNoise(**noise), sensors)


@partial(jax.jit, static_argnames="sensors")
def _run(
    inputs: dict[str, jax.Array], initial: tuple[float, float], gravity: float, noise: SpeedNoise, sensors: str
) -> SpeedTrack:
    speed0, pitch0 = initial
    return filter_speed(**inputs, speed0=speed0, pitch0=pitch0, gravity=gravity, dt=STEP, noise=noise, sensors=sensors)


def on_imu(drive: SpeedDrive, track: SpeedTrack, sensors: str) -> pd.DataFrame:
    columns = {name: np.asarray(getattr(track, name)) for name in ("speed", "speed_std", "pitch", "roll")}
    estimate = pd.DataFrame({name: np.interp(drive.t, drive.ends, x) for name, x in columns.items()})
    return estimate.assign(valid=True)


def dead_reckon(
    estimate: pd.DataFrame,
    drive: SpeedDrive,
    track: SpeedTrack,
    until: float,
    sensors: str,
    method: str,
    noise: dict[str, float],
) -> None:
    """Write over the rows after the aid what a method without a filter makes of the same constants."""
    last = int(np.clip(np.searchsorted(drive.ends, until, side="right") - 1, 0, drive.ends.size - 1))
    names = state_names(sensors)
    state = dict(zip(names, np.asarray(track.states[last]), strict=True))
    std = dict(zip(names, np.asarray(track.states_std[last]), strict=True))
    begin, end = drive.ends[last], drive.t[-1]
    count = round((end - begin) / float(np.median(np.diff(drive.t)))) + 1
    if count < 2:
        return
    t = np.linspace(begin, end, count)
    dt = t[1] - t[0]
    f, w = (np.stack([np.interp(t, drive.t, x) for x in series.T], -1) for series in (drive.f_b, drive.w_b))
    f_x, f_y = f[:, 0] - state["accelerometer_bias_x"], f[:, 1] - state["accelerometer_bias_y"]
    w_y = w[:, 1] - state["gyro_bias_y"] - state["rectification_y"] * np.interp(t, drive.ends, drive.vibration)
    w_z = w[:, 2] - state["gyro_bias_z"]
    # along and across the direction of travel
    along, across = np.cos(state["travel_yaw"]), np.sin(state["travel_yaw"])
    f_x, f_y = along * f_x + across * f_y, along * f_y - across * f_x
    pitch, roll = float(track.pitch[last]), float(track.roll[last])
    pitch0 = float(np.arcsin(np.clip(along * np.sin(pitch) + across * np.cos(pitch) * np.sin(roll), -1, 1)))
    speed0 = float(track.speed[last])
    valid = np.ones(count, bool)
    rolls = np.zeros(count)
    if method == "conventional":
        speed, pitches = speed_without_roll(f_x, w_y, speed0, pitch0, drive.gravity, dt)
        growth, response = np.ones(count), t - begin
    elif method == "roll":
        speed, pitches, rolls, valid = speed_with_roll(f_x, f_y, w_y, w_z, speed0, pitch0, drive.gravity, dt)
        growth, response = (np.asarray(x) for x in speed_error_growth(w_z, dt))
    else:
        held = np.full(count, speed0)
        speed, pitches, rolls, valid = speed_with_aided_roll(
            f_x, f_y, w_y, w_z, held, np.ones(count), speed0, pitch0, drive.gravity, dt
        )
        growth, response = np.ones(count), t - begin
    g, span = drive.gravity, t - begin
    acceleration = g * std["pitch"]
    turned = np.cumsum(np.abs(w_z)) * dt
    roll_error = noise["road_roll"]
    variance = (
        (growth * std["speed"]) ** 2
        + (response * acceleration) ** 2
        + (g * std["gyro_bias_y"] * response * span / 2) ** 2
        + noise["acceleration"] ** 2 * span
        + (g * noise["rotation"]) ** 2 * response**2 * span / 3
        + (g * roll_error * turned * response / 2) ** 2
    )
    rows = drive.t > begin
    columns = {"speed": np.maximum(np.asarray(speed), 0), "speed_std": np.sqrt(variance)}
    columns |= {"pitch": np.asarray(pitches), "roll": np.asarray(rolls)}
    for name, values in columns.items():
        estimate.loc[rows, name] = np.interp(drive.t[rows], t, values)
    estimate.loc[rows, "valid"] = np.asarray(valid)[
        np.clip(np.rint((drive.t[rows] - begin) / dt), 0, count - 1).astype(int)
    ]
