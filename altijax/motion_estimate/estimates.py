"""Attitude and velocity at every IMU sample of a recording, from accelerometer, gyro and GNSS Doppler velocities."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import jax
import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation, Slerp

from altijax.calibration.records import Calibration, correct_imu
from altijax.drives import imu_of, start_of
from altijax.motion_estimate.intervals import MotionReadings
from altijax.motion_estimate.model import MotionNoise, Trajectory
from altijax.motion_estimate.readings import motion_readings
from altijax.motion_estimate.smoother import (
    MotionBetween,
    MotionFit,
    MotionPrior,
    motion_between,
    motion_between_by_delay,
    motion_pass,
)
from altijax.motion_estimate.start import delay_by_windows, epochs_within, quick_jit, window_attitudes
from altijax.recordings import Recording
from altijax.series import flanked
from altijax.stages import Stages, stages
from altijax.vehicle.at_samples import angle_columns

MOTION_METHODS = ("epoch", "window", "batch")

_LEVELS = tuple(field.name for field in fields(MotionNoise))
_SLIP_LEVELS = ("sideslip", "attack", "slip_time")
_WALKS = ("gyro_walk", "accelerometer_walk")
_WITH_GYRO = MotionNoise()
# Without a gyro the attitude walks as the vehicle turns, and what lasts of its rate walks as well.
_WITHOUT_GYRO = MotionNoise(rotation=0.1, gyro_walk=0.1)
# By what factor, as a logarithm, levels may differ from these; records say least of the walks of biases.
_SPREAD, _WALK_SPREAD = 1.5, 1.0
# Delays of receivers, s.
_DELAY, _DELAY_STD = 0.1, 0.3
_DELAYS_WITHOUT_GYRO = (0.05, 0.35, 0.65)
# Standard deviations before anything is known: attitude and velocity can be anything.
_ATTITUDE_STD, _VELOCITY_STD = 2.0, 100.0
_ACCELEROMETER_BIAS_STD, _GYRO_BIAS_STD, _GYRO_SCALE_STD = 0.05, 0.07, 0.03
# The accelerometer's scale acts mostly as a bias along gravity.
_ACCELEROMETER_SCALE_STD = 0.015
# What no record tells: the IMU's axes are at right angles, and those of both sensors the body's, to so many radians.
_AXES_STD = 0.01
_RATE_STD = 0.3  # of the vehicle's own turning, without a gyro, rad/s
# Without a gyro turning passes for even between instants, but small aircraft roll there and back within a second.
_LONGEST_EVEN_TURN = 0.5  # s
_MOUNT_STD, _WIND_STD = 0.1, 10.0
# Heights are the weakest direction of GNSS, and receivers smooth the climb more than the rest: how much later it is, s.
_CLIMB_DELAY_STD = 0.1
# The course is trusted to so many radians where the epoch alone must do.
_COURSE_STD = 0.3
_WINDOW = 15.0  # s
_WINDOW_WITHOUT_GYRO = 5.0


_motion_between, _motion_between_by_delay = quick_jit(motion_between), quick_jit(motion_between_by_delay)
_motion_pass = quick_jit(motion_pass)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Beliefs:
    """Standard deviations of constants, by axis, and mean and standard deviation of the delay if it was calibrated."""

    accelerometer_bias: np.ndarray
    accelerometer_scale: np.ndarray
    gyro_bias: np.ndarray
    gyro_scale: np.ndarray
    delay: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Batch:
    """What a search has found so far."""

    fit: MotionFit
    prior: MotionPrior
    noise: MotionNoise
    delay: float
    delay_prior: tuple[float, float]
    objective: float


def estimate_motion(
    recording: Recording,
    *,
    method: str = "batch",
    calibration: Calibration | None = None,
    use_gyro: bool = True,
    wind: bool | str = "auto",
    delay: float | None = None,
) -> pd.DataFrame:
    """Attitude and velocity at the rate of the IMU, from velocities of 1 to 10 Hz, after [chalko2010]_.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities; a gyro helps a lot.
    method : {"batch", "window", "epoch"}
        "epoch" finds an attitude for each epoch by itself, level and along the course as far as the epoch does not
        tell; it never uses the gyro. "window" lets epochs around share an attitude that turns as the gyro says.
        "batch" is the most probable motion of the whole record, with biases, noise levels and delay from the record
        itself, and the only one whose error bars include all of these.
    calibration : Calibration, optional
        Constants known beforehand: biases and scales of accelerometers and gyros, `gnss_delay`. In "batch" they and
        their errors are the priors of what it estimates itself; a bias found from heights also holds the mounting, and
        is trusted accordingly less. Constants of wheels and mounting have no say in the attitude of the IMU.
    use_gyro : bool
        Whether the gyro is used where there is one.
    wind : bool or "auto"
        Whether body x may point off the course by a constant wind (an aircraft). True and False hold it near the
        direction of travel, through the air or over ground. By itself: with a gyro it is free; without one it is held,
        and the wind is in it where the courses flown show one. Only "batch" knows wind.
    delay : float, optional
        How late the stamps of the GNSS velocities are, in s; estimated by default ("epoch" cannot, and takes 0), in
        "batch" with how much later still the vertical ones are.

    Returns
    -------
    estimate : DataFrame
        Indexed as ``recording.imu``: roll, pitch, heading (rad), v_e, v_n, v_u (m/s), the standard deviation of each
        (``roll_std`` ...), and valid, False where no GNSS velocity is near or the IMU has a gap. ``attrs`` has the
        delay, noise levels, constants, wind and the normalised innovations squared (1 where the error bars are right);
        ``attrs["climb_delay"]`` is how much later the vertical velocities are than the horizontal ones, in s.

    Raises
    ------
    ValueError
        If an option is unknown or a stream that is needed is missing.
    """
    if method not in MOTION_METHODS:
        raise ValueError(f"method must be one of {', '.join(MOTION_METHODS)}, got {method!r}")
    if wind not in (True, False, "auto"):
        raise ValueError(f'wind must be True, False or "auto", got {wind!r}')
    beliefs = _beliefs(calibration)
    recording = replace(recording, imu=correct_imu(imu_of(recording), calibration))
    use_gyro = use_gyro and method != "epoch" and "gx" in imu_of(recording)
    with jax.enable_x64(True), stages(f"motion of {recording.name} by {method}") as stage:
        if method == "batch":
            return _batch_estimate(recording, *_found_batch(recording, use_gyro, wind, delay, beliefs, stage))
        if delay is None and beliefs.delay is not None:
            delay = beliefs.delay[0]
        return _window_estimate(recording, method, use_gyro, delay, stage)


def _beliefs(calibration: Calibration | None) -> _Beliefs:
    """What the calibration knows, else what is presumed of a consumer's instrument."""
    known: dict[str, float] = {}
    if calibration is not None:
        known = {str(name): float(std) for name, std in calibration.std_with_absorbed.items()}

    def of(kind: str, presumed: float) -> np.ndarray:
        return np.array([known.get(f"{kind}_{axis}", presumed) for axis in "xyz"])

    # A bias calibrated on a drive has taken up what the scale does to gravity.
    alone = np.array([f"accelerometer_bias_{axis}" not in known for axis in "xyz"])
    delay = None
    if calibration is not None and "gnss_delay" in known:
        delay = float(calibration.values["gnss_delay"]), known["gnss_delay"]
    return _Beliefs(
        accelerometer_bias=of("accelerometer_bias", _ACCELEROMETER_BIAS_STD),
        accelerometer_scale=alone
        * of("accelerometer_scale", known.get("accelerometer_scale", _ACCELEROMETER_SCALE_STD)),
        gyro_bias=of("gyro_bias", _GYRO_BIAS_STD),
        gyro_scale=of("gyro_scale", _GYRO_SCALE_STD),
        delay=delay,
    )


def _window_estimate(
    recording: Recording, method: str, use_gyro: bool, delay: float | None, stage: Stages
) -> pd.DataFrame:
    search = delay is None and use_gyro
    first = float(_DELAY if search else delay or 0.0)
    readings = motion_readings(recording, use_gyro=use_gyro, delay=first)
    if search:
        stage("delay of the GNSS velocities")
        delay = delay_by_windows(readings)
        readings = motion_readings(recording, use_gyro=use_gyro, delay=delay)
    delay = float(delay or 0.0)
    stage("attitudes by windows of epochs")
    length = {False: _WINDOW_WITHOUT_GYRO, True: _WINDOW}[use_gyro]
    window = 1 if method == "epoch" else epochs_within(length / float(readings.spacing))
    trajectory, attitude, _ = _windows(readings, delay, window, use_gyro)
    stage("between the instants")
    between = jax.device_get(_motion_between(readings, trajectory, np.float64(delay)))
    instants = between.instants
    covariance = np.zeros((len(attitude), 6, 6))
    covariance[:, :3, :3] = attitude
    noise = replace(_WITH_GYRO if use_gyro else _WITHOUT_GYRO, acceleration=0.3)
    for axis, std in enumerate(readings.std.T):
        known = np.isfinite(std)
        velocity = np.full(std.shape, _VELOCITY_STD)
        if known.any():
            away = np.abs(instants[:, None] - instants[known]).min(1)
            velocity = np.interp(instants, instants[known], std[known]) + 0.3 * away
        covariance[:, 3 + axis, 3 + axis] = velocity**2
    estimate = _at_samples(recording, readings, trajectory, between, covariance, noise, delay)
    estimate.attrs = {"delay": delay}
    return estimate


def _found_batch(
    recording: Recording,
    use_gyro: bool,
    wind: bool | str,
    delay: float | None,
    beliefs: _Beliefs,
    stage: Stages,
) -> tuple[_Batch, MotionReadings]:
    first = delay if delay is not None else _DELAY if beliefs.delay is None else beliefs.delay[0]
    if delay is None and use_gyro and beliefs.delay is None:
        stage("delay of the GNSS velocities")
        first = delay_by_windows(motion_readings(recording, use_gyro=use_gyro, delay=first))
    stage("first trajectory")
    batch, readings = _first_batch(recording, use_gyro, wind, delay, first, beliefs)
    batch = _most_probable(readings, batch, stage, estimate_delay=delay is None)
    if wind == "auto" and not use_gyro and _turns_around(readings, np.zeros(2)):
        with_wind = batch.prior.covariance.copy()
        with_wind[[17, 18], [17, 18]] = _WIND_STD**2
        windy = replace(batch, prior=replace(batch.prior, covariance=with_wind))
        windy = _most_probable(readings, windy, stage, estimate_delay=delay is None)
        vector = np.asarray(windy.fit.trajectory.constants)[5:7]
        error = np.sqrt(np.diag(windy.fit.covariance[-1])[17:19])
        # Ten in the logarithm pays for two more constants many times over; below 1 m/s a wind is a crooked mount, and
        # one in which all courses are the same would let body x point anywhere.
        shown = batch.objective - windy.objective > 10 and np.hypot(*vector) > max(1.0, 4 * float(np.max(error)))
        if shown and _turns_around(readings, vector):
            batch = windy
    stage("between the instants")
    return batch, readings


def _batch_estimate(recording: Recording, batch: _Batch, readings: MotionReadings) -> pd.DataFrame:
    trajectory, covariance = batch.fit.trajectory, np.asarray(batch.fit.covariance)[:, :6, :6]
    # With the derivative, as the passes have it: without it would be another program.
    between, _ = jax.device_get(_motion_between_by_delay(readings, trajectory, np.float64(batch.delay)))
    estimate = _at_samples(recording, readings, trajectory, between, covariance, batch.noise, batch.delay)
    # Filled up instants count no more than once.
    distinct = np.append(True, np.diff(between.instants) > 0)
    estimate.attrs.update(_summary(readings, batch, distinct))
    return estimate


def batch_with_constants(recording: Recording) -> Callable[[Calibration], pd.DataFrame]:
    """The most probable motion as a function of constants, all else as it was found without them.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities.

    Returns
    -------
    motion : callable
        From a `Calibration` to an estimate as that of `estimate_motion`; noise levels, outliers, and the delay where it
        is none of the constants, stay. Call it in double precision.
    """
    use_gyro = "gx" in imu_of(recording)
    with stages(f"motion of {recording.name} by batch") as stage:
        found, readings = _found_batch(recording, use_gyro, "auto", None, _beliefs(None), stage)

    def motion(calibration: Calibration) -> pd.DataFrame:
        beliefs = _beliefs(calibration)
        corrected = replace(recording, imu=correct_imu(imu_of(recording), calibration))
        again = _corrected_readings(readings, calibration, use_gyro)
        known = _prior_covariance(corrected, use_gyro, float(found.prior.course) > 0, False, False, beliefs)
        covariance = found.prior.covariance.copy()
        covariance[6:15, 6:15] = known[6:15, 6:15]
        batch = replace(
            found,
            prior=replace(found.prior, covariance=covariance),
            delay=found.delay if beliefs.delay is None else beliefs.delay[0],
        )
        start = found.fit.trajectory
        fit = _passes(again, start, batch.prior, batch.noise, batch.delay, passes=4)
        return _batch_estimate(corrected, replace(batch, fit=fit), again)

    return motion


def _corrected_readings(readings: MotionReadings, calibration: Calibration, use_gyro: bool) -> MotionReadings:
    """The same as the readings of a corrected IMU, at the same instants."""
    columns = [f"{sensor}{axis}" for sensor in "ag" for axis in "xyz"]
    # Corrections are straight lines: two points show them.
    offset, one = correct_imu(pd.DataFrame([np.zeros(6), np.ones(6)], columns=columns), calibration).to_numpy(float)
    gain = np.append(one - offset, 1.0)
    offset = np.append(offset, 0.0) * np.append(np.ones(3), np.full(4, float(use_gyro)))
    return replace(
        readings,
        readings=readings.readings * gain + offset,
        sums=readings.sums * gain + offset * (readings.t - readings.t[0])[:, None],
    )


def _first_batch(
    recording: Recording, use_gyro: bool, wind: bool | str, delay: float | None, first: float, beliefs: _Beliefs
) -> tuple[_Batch, MotionReadings]:
    """The best of several starts: turned about the vertical with a gyro, by several delays without."""
    noise = _WITH_GYRO if use_gyro else _WITHOUT_GYRO
    course = not use_gyro or wind != "auto"
    delay_prior = beliefs.delay or (_DELAY, _DELAY_STD)
    covariance = _prior_covariance(recording, use_gyro, course, wind is True, delay is None, beliefs)
    longest = 1.0 if use_gyro else _LONGEST_EVEN_TURN
    search = delay is None and not use_gyro and beliefs.delay is None
    delays = _DELAYS_WITHOUT_GYRO if search else (first,)
    turns = (0.0, 0.5, 1.0, 1.5) if use_gyro else (0.0,)
    best: tuple[_Batch, MotionReadings] | None = None
    for trial in delays:
        readings = motion_readings(recording, use_gyro=use_gyro, delay=trial, longest=longest)
        believed: dict[str, Any] = dict(
            covariance=covariance, doubt=np.ones_like(readings.std), course=np.float64(course)
        )
        prior = MotionPrior(**believed)
        window = epochs_within(_WINDOW / float(readings.spacing)) if use_gyro else 1
        start, _, _ = _windows(readings, trial, window, use_gyro)
        for turn in turns:
            C = Rotation.from_rotvec([0.0, 0.0, turn * np.pi]).as_matrix() @ start.C_nb
            fit = _passes(readings, replace(start, C_nb=C), prior, noise, trial, passes=5)
            objective = -float(fit.log_likelihood) + 0.5 * ((trial - delay_prior[0]) / delay_prior[1]) ** 2
            if best is None or objective < best[0].objective - 1.0:
                batch = _Batch(
                    fit=fit,
                    prior=prior,
                    noise=noise,
                    delay=float(trial),
                    delay_prior=delay_prior,
                    objective=objective,
                )
                best = batch, readings
    assert best is not None
    return best


def _prior_covariance(
    recording: Recording, use_gyro: bool, course: bool, wind: bool, lag: bool, beliefs: _Beliefs
) -> np.ndarray:
    """Of the states before anything is known of the drive."""
    std = [_ATTITUDE_STD] * 3 + [_VELOCITY_STD] * 3 + [*beliefs.accelerometer_bias]
    std += [*beliefs.gyro_bias, *beliefs.gyro_scale] if use_gyro else [_RATE_STD] * 3 + [0.0] * 3
    std += [_MOUNT_STD if course else 0.0] * 2 + [_WIND_STD if wind else 0.0] * 2
    std += [_CLIMB_DELAY_STD if lag else 0.0] + [0.0] * 2
    covariance = np.diag(np.square(std))
    force = imu_of(recording)[["ax", "ay", "az"]].to_numpy(float).mean(0)
    by_scale = beliefs.accelerometer_scale * force
    covariance[6:9, 6:9] += np.outer(by_scale, by_scale)
    return covariance


def _most_probable(readings: MotionReadings, batch: _Batch, stage: Stages, *, estimate_delay: bool) -> _Batch:
    """Noise levels, delay and trajectory in turns, until the levels stay."""
    prior, noise, delay = batch.prior, batch.noise, batch.delay
    trajectory = batch.fit.trajectory
    names = [name for name in _LEVELS if name not in _SLIP_LEVELS or float(prior.course) > 0]
    start = _WITH_GYRO if float(prior.covariance[12, 12]) > 0 else _WITHOUT_GYRO
    nominal = np.append(np.log([float(getattr(start, name)) for name in names]), batch.delay_prior[0])
    spread = np.append([_WALK_SPREAD if name in _WALKS else _SPREAD for name in names], batch.delay_prior[1])
    objective = np.inf
    for turn in range(6):
        stage(f"noise levels, round {turn + 1}")
        x0 = np.append(np.log([float(getattr(noise, name)) for name in names]), delay)

        reach = np.append(np.full(len(names), 2.0), 0.15 if estimate_delay else 0.0)
        found = minimize(
            _misfit,
            x0,
            args=(names, nominal, spread, jax.device_put(readings), trajectory, prior, noise),
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(x0 - reach, x0 + reach, strict=True)),
            options={"maxiter": 12, "maxfun": 16, "ftol": 1e-5},
        )
        noise = replace(noise, **dict(zip(names, np.exp(found.x[:-1]).tolist(), strict=True)))
        delay = float(found.x[-1])
        fit = _passes(readings, trajectory, prior, noise, delay, passes=8)
        trajectory, prior = fit.trajectory, replace(prior, doubt=fit.doubt)
        settled = turn > 1 and abs(found.fun - objective) < 1.0
        objective = float(found.fun)
        if settled:
            break
    fit = _passes(readings, trajectory, prior, noise, delay, passes=8)
    return replace(batch, fit=fit, prior=prior, noise=noise, delay=delay, objective=objective)


def _misfit(
    x: np.ndarray,
    names: list[str],
    nominal: np.ndarray,
    spread: np.ndarray,
    readings: MotionReadings,
    trajectory: Trajectory,
    prior: MotionPrior,
    noise: MotionNoise,
) -> tuple[float, np.ndarray]:
    """Minus the log-posterior of the logarithms of noise levels and the delay, and its gradient."""
    levels = dict(zip(names, np.exp(x[:-1]).tolist(), strict=True))
    fit = _pass(readings, trajectory, prior, replace(noise, **levels), float(x[-1]))
    slope = [-float(getattr(fit.by_noise, name)) * levels[name] for name in names] + [-float(fit.by_delay)]
    off = (x - nominal) / spread
    return -float(fit.log_likelihood) + 0.5 * float(off @ off), np.array(slope) + off / spread


def _pass(
    readings: MotionReadings, trajectory: Trajectory, prior: MotionPrior, noise: MotionNoise, delay: float
) -> MotionFit:
    """`motion_pass` from NumPy to NumPy: an operation on an array of JAX would compile a program of its own."""
    levels = MotionNoise(**{name: np.float64(getattr(noise, name)) for name in _LEVELS})
    between = _motion_between_by_delay(readings, trajectory, np.float64(delay))
    return jax.device_get(_motion_pass(readings, trajectory, prior, levels, *between))


def _passes(
    readings: MotionReadings,
    trajectory: Trajectory,
    prior: MotionPrior,
    noise: MotionNoise,
    delay: float,
    passes: int,
) -> MotionFit:
    readings = jax.device_put(readings)
    for _ in range(passes):
        fit = _pass(readings, trajectory, prior, noise, delay)
        trajectory = fit.trajectory
        if float(fit.step) < 1e-4:
            break
    return fit


def _windows(
    readings: MotionReadings, delay: float, window: int, use_gyro: bool
) -> tuple[Trajectory, np.ndarray, float]:
    return window_attitudes(readings, delay, 2.0 if use_gyro else _COURSE_STD, window, gyro=use_gyro)


def _turns_around(readings: MotionReadings, wind: np.ndarray) -> bool:
    """Whether the courses through the air spread enough to tell a wind from a crooked mount."""
    v = readings.v_gnss[np.isfinite(readings.std[:, 0]), :2] - wind
    speed = np.hypot(*v.T)
    moving = speed > 3.0
    return bool(moving.sum() > 10 and np.linalg.norm(np.mean(v[moving] / speed[moving, None], 0)) < 0.8)


def _summary(readings: MotionReadings, batch: _Batch, distinct: np.ndarray) -> dict[str, object]:
    there = np.isfinite(readings.std)
    trajectory, constants = batch.fit.trajectory, batch.fit.trajectory.constants
    surprise = batch.fit.surprise[there]
    return {
        "delay": batch.delay,
        "noise": {name: float(getattr(batch.noise, name)) for name in _LEVELS},
        "nis": float(np.mean(surprise**2)),
        "outliers": int(np.sum(batch.prior.doubt[there] > 1)),
        "wind": constants[5:7].tolist() if float(batch.prior.covariance[17, 17]) > 0 else None,
        "climb_delay": float(constants[7]),
        "gyro_scale": (1 / (1 + constants[:3])).tolist(),
        "accelerometer_bias": trajectory.accelerometer_bias[distinct].mean(0).tolist(),
        "gyro_bias": trajectory.gyro_bias[distinct].mean(0).tolist(),
        "objective": batch.objective,
    }


def _at_samples(
    recording: Recording,
    readings: MotionReadings,
    trajectory: Trajectory,
    between: MotionBetween,
    covariance: np.ndarray,
    noise: MotionNoise,
    delay: float,
) -> pd.DataFrame:
    """Attitude, velocity and their errors at each IMU sample."""
    imu = imu_of(recording)
    t = imu.index.to_numpy(float) - start_of(recording)
    instants = between.instants
    knots = np.append(instants[0], between.t.ravel())
    kept = np.append(True, np.diff(np.maximum.accumulate(knots)) > 1e-9)
    knots = knots[kept]
    attitudes = np.concatenate([trajectory.C_nb[:1], between.C_nb.reshape(-1, 3, 3)])[kept]
    velocities = np.concatenate([trajectory.v_n[:1], between.v_n.reshape(-1, 3)])[kept]
    inside = np.clip(t, knots[0], knots[-1])
    C_nb = Slerp(knots, Rotation.from_matrix(attitudes))(inside).as_matrix()

    distinct = np.append(True, np.diff(instants) > 1e-9)
    nodes, P = instants[distinct], covariance[distinct]
    k = np.clip(np.searchsorted(nodes, inside, side="right") - 1, 0, nodes.size - 2)
    dt = nodes[k + 1] - nodes[k]
    s = (inside - nodes[k]) / dt
    P = (1 - s)[:, None, None] * P[k] + s[:, None, None] * P[k + 1]
    # Between two known ends a random walk has the variance s (1 - s) dt.
    bridge = s * (1 - s) * dt
    rotation, acceleration = (float(np.asarray(level)) ** 2 for level in (noise.rotation, noise.acceleration))
    force = np.linalg.norm(between.gains.velocity[np.flatnonzero(distinct)[k]], axis=-1) / dt
    attitude = P[:, :3, :3] + (rotation * bridge + _AXES_STD**2)[:, None, None] * np.eye(3)
    velocity = np.diagonal(P, axis1=1, axis2=2)[:, 3:6] + (acceleration * bridge)[:, None]
    velocity = velocity + (rotation * bridge * (force * dt) ** 2 / 12)[:, None]

    columns, bars = angle_columns(C_nb, attitude)
    columns |= {name: np.interp(inside, knots, velocities[:, i]) for i, name in enumerate(("v_e", "v_n", "v_u"))}
    columns |= bars
    for i, name in enumerate(("v_e", "v_n", "v_u")):
        columns[f"{name}_std"] = np.sqrt(np.maximum(velocity[:, i], 0))
    return pd.DataFrame(columns, index=imu.index).assign(valid=_supported(readings, t, delay))


def _supported(readings: MotionReadings, t: np.ndarray, delay: float) -> np.ndarray:
    """Where GNSS velocities lie close on both sides and the IMU has no gap."""
    epochs = readings.instant[np.isfinite(readings.std[:, 0])] - delay
    usual = float(np.median(np.diff(t)))
    gap = np.diff(t, prepend=t[0]) > max(5 * usual, 0.1)
    return flanked(t, np.asarray(epochs), float(readings.spacing)) & ~gap
