"""Estimates as functions of named constants that JAX can trace: gradients, batches, and tables of sensitivities."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.attitude import course_attitude, fit_attitudes
from altijax.calibration.parameters import ACCEPTED, CONSTANTS, triads
from altijax.drives import drive_arrays, gnss_velocities, gravity_at, imu_of, reference_heights, start_of, usual_step
from altijax.elevation_estimate.model import ElevationReadings, elevation_from, readings_of
from altijax.metrics import rms
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix, wrap_angle, yaw_to_heading
from altijax.series import interpolated
from altijax.signals import cumulative_integral
from altijax.speed import speed_with_aided_roll, speed_with_roll, speed_without_roll
from altijax.speed_estimate.steps import aid_of, drive_in_steps, initial_state, speed_of

DIFFERENTIABLE = ("slope", "shirai", "conventional", "roll", "aided", "epoch")
"""Methods that `differentiable` takes."""

# Of the course, rad, and of a mean acceleration over a second, m/s^2; presumed, where "epoch" asks the record.
_COURSE_STD, _ACCELERATION_STD = 0.3, 0.3
# The smallest sizes that samples, references and epochs are filled up to.
_SAMPLES, _REFERENCES, _EPOCHS = 16384, 1024, 64
_FIRST_SECOND = 1.0

Estimate = dict[str, jax.Array]
# A function of all constants, data and method; the data; nominal constants; and times.
Built = tuple[Callable[..., Estimate], Any, dict[str, float], np.ndarray]


class OfConstants(Protocol):
    """What `differentiable` returns."""

    names: tuple[str, ...]

    def __call__(self, constants: Mapping[str, Any]) -> Estimate: ...


def differentiable(recording: Recording, method: str) -> OfConstants:
    """An estimate as a jitted function of named constants, for `jax.grad`, `jax.hessian` and `jax.vmap`.

        error = aj.differentiable(recording, "slope")
        jax.grad(lambda c: error(c)["score"])({"accelerometer_bias_x": 0.0})

    Parameters
    ----------
    recording : Recording
        What the method needs.
    method : {"slope", "shirai", "conventional", "roll", "aided", "epoch"}
        Of `estimate_elevation`; of the loops of [us20060293826]_, which run from the speed and the pitch of the first
        second to the end, "aided" with the wheels' or the receiver's speed inside the roll throughout; or an attitude
        for each pair of GNSS epochs.

    Returns
    -------
    of_constants : callable
        From a mapping of constants, true by ``true = measured / scale - bias``, to the estimate. It has the attribute
        ``names``: those that may be given, of `CONSTANTS` and, of a loop, initial_speed (m/s) and initial_pitch (rad);
        what is not given is nominal. The estimate is a dict of arrays: t (s, on the recording's time axis) and

        ====================== ==========================================================================
        slope, shirai          elevation (m), vertical_speed, speed (m/s)
        the loops              speed (m/s), pitch (rad); with the roll also roll (rad)
        epoch                  roll, pitch, heading (rad)
        ====================== ==========================================================================

        and, where the recording has a reference of it, score: the root mean square error of the elevation from the
        first reference height on (m), of the speed (m/s), or of the angles together (rad). It computes in double
        precision, whether or not JAX is set to. A delay of the speed acts on an elevation to first order.

    Raises
    ------
    ValueError
        If the method is none of these or the recording lacks what it needs; and by the function, if a name is unknown.
    """
    builds = dict.fromkeys(("slope", "shirai"), _elevation) | dict.fromkeys(("conventional", "roll", "aided"), _speed)
    builds["epoch"] = _epochs
    if method not in builds:
        raise ValueError(f"method must be one of {', '.join(DIFFERENTIABLE)}, got {method!r}")
    with jax.enable_x64(True):
        of_all, data, nominal, t = builds[method](recording, method)

    def of_constants(constants: Mapping[str, Any]) -> Estimate:
        unknown = set(constants) - set(nominal)
        if unknown:
            raise ValueError(f"{', '.join(sorted(unknown))}: constants of {method!r} are {', '.join(nominal)}")
        traced = {name: x for name, x in constants.items() if isinstance(x, jax.core.Tracer)}
        known = {**nominal, **{name: np.float64(x) for name, x in constants.items() if name not in traced}}
        with jax.enable_x64(True):
            # Converted one by one: tracers may come from outside of double precision.
            given = {name: jax.lax.convert_element_type(x, np.float64) for name, x in traced.items()}
            return {"t": jnp.asarray(t), **_forward(of_all, method, t.size, given, {"known": known, "data": data})}

    function: Any = of_constants
    function.names = tuple(nominal)
    return function


@partial(jax.jit, static_argnums=(0, 1, 2))
def _of_given(of_all: Callable[..., Estimate], method: str, count: int, given: Any, rest: Any) -> Estimate:
    found = of_all({**rest["known"], **given}, rest["data"], method)
    return {name: x[:count] if x.ndim else x for name, x in found.items()}


@partial(jax.jit, static_argnums=(0, 1, 2))
def _slopes(of_all: Callable[..., Estimate], method: str, count: int, given: Any, rest: Any) -> dict[str, Any]:
    return jax.jacfwd(partial(_of_given, of_all, method, count))(given, rest)


@partial(jax.custom_jvp, nondiff_argnums=(0, 1, 2))
def _forward(of_all: Callable[..., Estimate], method: str, count: int, given: Any, rest: Any) -> Estimate:
    """An estimate whose derivatives go forward: constants are few, samples many, and loops need not be kept.

    What is left to JAX is linear in the constants' changes and so has no need of double precision to be switched on.
    """
    return _of_given(of_all, method, count, given, rest)


@_forward.defjvp
def _forward_jvp(of_all: Callable[..., Estimate], method: str, count: int, primals: Any, tangents: Any) -> tuple:
    with jax.enable_x64(True):
        slopes = _slopes(of_all, method, count, *primals)
        changes = {name: sum(slope[of] * tangents[0][of] for of in slope) for name, slope in slopes.items()}
        return _of_given(of_all, method, count, *primals), changes


def sensitivity(
    recording: Recording,
    method: str,
    *,
    score: Callable[[Estimate], jax.Array] | None = None,
    constants: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """How much a score changes with each constant that a method depends on.

    Parameters
    ----------
    recording : Recording
        What the method needs; without `score`, with a reference.
    method : str
        One of `DIFFERENTIABLE`.
    score : callable, optional
        A number of an estimate as `differentiable` has it; its score by default.
    constants : mapping of str to float, optional
        Where the derivatives are taken; nominal otherwise.

    Returns
    -------
    table : DataFrame
        A row a constant, the largest effect first: value, spread (one standard deviation of what an uncalibrated
        constant may be off by, `CONSTANTS`), unit, derivative (of the score, per unit) and effect, the change of the
        score to first order for one spread.

    Raises
    ------
    ValueError
        If the method is unknown, or there is neither a score nor a reference.
    """
    estimate = differentiable(recording, method)
    at = {name: CONSTANTS[name].nominal for name in estimate.names if name in CONSTANTS} | dict(constants or {})
    at = {name: float(value) for name, value in at.items() if not np.isnan(value)}

    def of(constants: Mapping[str, Any]) -> jax.Array:
        found = estimate(constants)
        if score is not None:
            return score(found)
        if "score" not in found:
            raise ValueError(
                f"recording {recording.name!r} has no reference of what {method!r} estimates: give a score"
            )
        return found["score"]

    slopes = jax.device_get(jax.grad(of)(at))
    rows = {
        name: {
            "value": value,
            "spread": CONSTANTS[name].spread,
            "unit": CONSTANTS[name].unit,
            "derivative": float(slopes[name]),
            "effect": float(slopes[name]) * CONSTANTS[name].spread,
        }
        for name, value in at.items()
        if name in CONSTANTS
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("constant")
    return table.sort_values("effect", key=np.abs, ascending=False)


def _nominal(method: str) -> dict[str, float]:
    return {name: CONSTANTS[name].nominal for name in ACCEPTED[method]}


def _elevation(recording: Recording, method: str) -> Built:
    drive, t = drive_arrays(recording, turns=method != "slope")
    nominal = _nominal("fused") | _nominal(method)
    readings = readings_of(drive, nominal["wheel_delay" if drive.from_wheel else "gnss_delay"])
    target = None
    if recording.reference is not None and "alt" in recording.reference:
        t_reference, heights = reference_heights(recording)
        target = _target(t_reference, heights - heights[0])
    known = {name: nominal[name] for name in _nominal(method)}
    return _elevation_program, {"others": nominal, "readings": readings, "target": target}, known, t


def _elevation_program(values: dict[str, Any], data: dict[str, Any], method: str) -> Estimate:
    readings: ElevationReadings = data["readings"]
    target = data["target"]
    found = elevation_from({**data["others"], **values}, readings, method)
    estimate = {name: found[name] for name in ("elevation", "vertical_speed", "speed")}
    if target is not None:
        at = jnp.interp(target["t"], readings.t, found["elevation"])
        estimate["score"] = _score(at - at[0] - target["value"][0], target["weight"])
    return estimate


def _target(t: np.ndarray, *series: np.ndarray) -> dict[str, np.ndarray]:
    """A reference, filled up: times, values (series, time), and the weight of each sample."""
    size = bucket(t.size, _REFERENCES)
    return {
        "t": padded(t, size),
        "value": padded(np.stack(series), size, axis=-1),
        "weight": padded(np.sqrt(np.full(t.size, size / max(t.size, 1))), size, 0.0),
    }


def _score(error: jax.Array, weight: jax.Array) -> jax.Array:
    return rms((error * weight).reshape(-1))


def _speed(recording: Recording, method: str) -> Built:
    imu, start = imu_of(recording), start_of(recording)
    drive = drive_in_steps(recording, None, _FIRST_SECOND)
    speed0, _ = initial_state(drive, _FIRST_SECOND, None, None)
    early = np.abs(drive.t_aid) <= _FIRST_SECOND
    gained = np.polyfit(drive.t_aid[early], drive.aid[early], 1)[0] if early.sum() > 3 else 0.0
    step = usual_step(drive.t)
    t = np.linspace(0, drive.t[-1], round(drive.t[-1] / step) + 1)
    size = bucket(t.size, _SAMPLES)
    columns = ["ax", "ay", "az", "gx", "gy", "gz"]
    readings = interpolated(t, drive.t, imu[columns].to_numpy(float))
    t_aid, aid = aid_of(recording)
    data = {
        "readings": padded(readings, size),
        "t": np.arange(size) * t[1],
        "first": padded(t <= _FIRST_SECOND, size, 0.0),
        "t_aid": padded(t_aid - start, bucket(t_aid.size, _REFERENCES)),
        "aid": padded(aid, bucket(t_aid.size, _REFERENCES)),
        "by_wheel": np.asarray(recording.wheel is not None),
        "start": np.array([speed0, gained]),
        "gravity": np.asarray(drive.gravity),
        "target": None,
    }
    reference = recording.reference
    if reference is not None and {"v_e", "v_n"} <= set(reference) and reference["v_e"].notna().any():
        at, speed = speed_of(reference)
        inside = (at >= start) & (at <= start + t[-1])
        data["target"] = _target(at[inside] - start, speed[inside])
    nominal = _nominal(method) | {"initial_speed": np.nan, "initial_pitch": np.nan}
    return _speed_program, data, nominal, t + start


def _speed_program(values: dict[str, Any], data: dict[str, Any], method: str) -> Estimate:
    imu = triads(values)
    mounting = euler_to_matrix(imu.mounting)
    f = (data["readings"][:, :3] / imu.accelerometer_scale - imu.accelerometer_bias) @ mounting.T
    w = (data["readings"][:, 3:] / imu.gyro_scale - imu.gyro_bias) @ mounting.T
    by_wheel, gravity = data["by_wheel"], data["gravity"]
    scale = jnp.where(by_wheel, values["wheel_scale"], 1.0)
    speed0, gained = scale * data["start"]
    # As `initial_state` has the pitch: what the change of speed leaves of the forward force is gravity's.
    force = jnp.sum(f[:, 0] * data["first"]) / jnp.sum(data["first"]) - gained
    pitch0 = jnp.arcsin(jnp.clip(force / gravity, -0.5, 0.5))
    speed0, pitch0 = (
        jnp.where(jnp.isnan(values[name]), found, values[name])
        for name, found in (("initial_speed", speed0), ("initial_pitch", pitch0))
    )
    f_x, f_y, w_y, w_z = f[:, 0], f[:, 1], w[:, 1], w[:, 2]
    start = speed0, pitch0, gravity, data["t"][1]
    if method == "conventional":
        speed, pitch = speed_without_roll(f_x, w_y, *start)
        found = {"speed": speed, "pitch": pitch}
    else:
        delay = jnp.where(by_wheel, values["wheel_delay"], values["gnss_delay"])
        aid = scale * jnp.interp(data["t"] + delay, data["t_aid"], data["aid"])
        aided = () if method == "roll" else (aid, jnp.ones_like(aid))
        loop = speed_with_roll if method == "roll" else speed_with_aided_roll
        speed, pitch, roll, _ = loop(f_x, f_y, w_y, w_z, *aided, *start)
        found = {"speed": speed, "pitch": pitch, "roll": roll}
    if data["target"] is not None:
        at = jnp.interp(data["target"]["t"], data["t"], speed)
        found["score"] = _score(at - data["target"]["value"][0], data["target"]["weight"])
    return found


def _epochs(recording: Recording, method: str) -> Built:
    imu, start = imu_of(recording), start_of(recording)
    t = imu.index.to_numpy(float) - start
    velocities = gnss_velocities(recording)
    if velocities is None:
        raise ValueError(f"recording {recording.name!r} has no GNSS velocities, which {method!r} needs")
    stamps, v, std = velocities
    # A second to either side, over which a delay may move the epochs.
    kept = (stamps >= 1) & (stamps <= t[-1] - 1) & np.isfinite(std[:, 0])
    stamps, v = stamps[kept], v[kept]
    if stamps.size < 3:
        raise ValueError(f"recording {recording.name!r} has {stamps.size} GNSS velocities amid the IMU's; 3 are needed")
    size, count = bucket(t.size, _SAMPLES), bucket(stamps.size, _EPOCHS)
    f = imu[["ax", "ay", "az"]].to_numpy(float)
    reference, target = recording.reference, None
    angles = [name for name in ("roll", "pitch", "heading") if reference is not None and name in reference]
    if reference is not None and angles:
        known = reference[angles].dropna()
        target = {name: np.unwrap(known[name].to_numpy(float)) for name in angles}
        target |= {"t": known.index.to_numpy(float) - start}
        target = {name: padded(x, bucket(x.size, _REFERENCES)) for name, x in target.items()}
    data = {
        "t": np.append(t, t[-1] + np.arange(1, size - t.size + 1) * usual_step(t)),
        "f": padded(f, size),
        "stamps": padded(stamps, count),
        "v": padded(v, count),
        "there": padded(np.ones(stamps.size - 1), count - 1, 0.0),
        "gravity": np.asarray(gravity_at(recording)),
        "std": np.asarray(_ACCELERATION_STD / np.sqrt(np.median(np.diff(stamps)))),
        "target": target,
    }
    middles = (stamps[1:] + stamps[:-1]) / 2 + start
    return _epoch_program, data, _nominal(method), middles


def _epoch_program(values: dict[str, Any], data: dict[str, Any], method: str) -> Estimate:
    del method
    imu = triads(values)
    there = data["there"] > 0
    f = data["f"] / imu.accelerometer_scale - imu.accelerometer_bias
    edges = data["stamps"] - values["gnss_delay"]
    dt = jnp.where(there, jnp.diff(edges), 1.0)
    total = cumulative_integral(data["t"], f, axis=0)
    gained = jnp.diff(jax.vmap(partial(jnp.interp, edges, data["t"]), 1, 1)(total), axis=0)
    up = jnp.array([0.0, 0.0, 1.0]) * data["gravity"]
    f_b = jnp.where(there[:, None], gained / dt[:, None], up)
    v = data["v"]
    f_n = jnp.diff(v, axis=0) / dt[:, None] + up
    course = course_attitude((v[1:] + v[:-1]) / 2)
    euler = fit_attitudes(f_b, f_n, course, prior_std=_COURSE_STD, measurement_std=data["std"]).euler
    found = {"roll": euler[:, 0], "pitch": euler[:, 1], "heading": yaw_to_heading(euler[:, 2])}
    if data["target"] is not None:
        middle = (edges[1:] + edges[:-1]) / 2
        names = [name for name in data["target"] if name != "t"]
        off = [found[name] - jnp.interp(middle, data["target"]["t"], data["target"][name]) for name in names]
        share = jnp.sqrt(there.size / jnp.sum(there))
        found["score"] = _score(jnp.stack([wrap_angle(x) for x in off]), there * share)
    return found
