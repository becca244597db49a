"""Speed along a recording, by the patent's methods and by filters.

All methods start from the same filter, run over everything up to the end of the aid: its speed, attitude and constants
are theirs, so that only what happens afterwards differs. An estimate never looks at the recording's reference, nor at
an aid that comes after `aid_until`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from scipy.optimize import minimize

from altijax.calibration.records import Calibration
from altijax.drives import imu_of, start_of
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.series import after_gap, interpolated
from altijax.speed_estimate.dead_reckoning import Start, reckon
from altijax.speed_estimate.filter import MARGIN, SpeedState, filter_speed, first_state
from altijax.speed_estimate.model import SENSORS, SpeedNoise, state_names
from altijax.speed_estimate.steps import STEP, SpeedDrive, drive_in_steps, initial_state, steps_until
from altijax.stages import stages

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
# Steps that are filtered at a time, a multiple of `MARGIN`: long against a margin and short against an outage.
_PART = 100
# Of a `SpeedTrack`, what is kept of a run.
_TRACKED = ("speed", "speed_std", "pitch", "roll", "states", "states_std")
# Samples that dead reckoning is filled up to: some minutes.
_SAMPLES = 16384
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
        aided speed held inside the roll angle; "filter" is `filter_speed`. Up to `aid_until` all are the filter, but
        where there is no aid and both initial values are given: then the others begin exactly there.
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
    with jax.enable_x64(True), stages(f"speed of {recording.name}") as stage:
        until = 1.0 if aid_until is None else aid_until - start_of(recording)
        stage("readings in steps")
        drive = drive_in_steps(recording, calibration, until)
        sensors = AUTO_SENSORS if sensors == "auto" else sensors
        initial = initial_state(drive, until, initial_speed, initial_pitch)
        aided = bool(np.any((drive.t_aid >= 0) & (drive.stamp_aid <= until)))
        if method == "filter" or aided or initial_speed is None or initial_pitch is None:
            stage("noise levels")
            noise = fit_noise(drive, until, sensors, initial, NOMINAL_NOISE)
            stage("filter")
            run = run_filter(drive, until, sensors, initial, noise)
            estimate = on_imu(drive, run)
            known = known_at(drive, run, until) if method != "filter" else None
        else:
            # There is nothing to filter: dead reckoning begins exactly where it was told to.
            estimate = pd.DataFrame(0.0, index=drive.t, columns=["speed", "speed_std", "pitch", "roll"])
            estimate["valid"] = True
            known = known_beforehand(drive, initial, sensors)
        if known is not None:
            stage("dead reckoning")
            dead_reckon(estimate, drive, known, method)
        estimate["valid"] &= ~after_gap(drive.t, drive.usual)
        estimate.index = imu_of(recording).index
    return estimate


def require_options(method: str, sensors: str) -> None:
    if method not in SPEED_METHODS:
        raise ValueError(f"method must be one of {', '.join(SPEED_METHODS)}, got {method!r}")
    if sensors not in ("auto", *SENSORS):
        raise ValueError(f"sensors must be one of auto, {', '.join(SENSORS)}, got {sensors!r}")


@dataclass(frozen=True, kw_only=True)
class FilterRun:
    """The filter over a drive, as far as it was asked for, in parts that a later run may share."""

    sensors: str
    initial: tuple[float, float]
    noise: dict[str, float]
    inputs: dict[str, np.ndarray]
    starts: tuple[SpeedState, ...]
    """What a bank of filters knew before each part, and after the last one."""
    parts: tuple[dict[str, np.ndarray], ...]
    """What the first of them found in each part: fields of `SpeedTrack`."""

    def track(self, step: int = 0) -> tuple[int, dict[str, np.ndarray]]:
        """First step of the part in which a step lies, and what was found from there on."""
        parts = self.parts[step // _PART :]
        return step // _PART * _PART, {name: np.concatenate([part[name] for part in parts]) for name in _TRACKED}

    @property
    def last(self) -> SpeedState:
        """What was known at the end."""
        return jax.tree.map(lambda x: np.asarray(x)[0], self.starts[-1])


def fit_noise(
    drive: SpeedDrive, until: float, sensors: str, initial: tuple[float, float], start: dict[str, float]
) -> dict[str, float]:
    """Noise levels of largest posterior probability over the aided part; the nominal ones where it is short."""
    if until < _FIT_FROM:
        return start
    names = _FITTED[sensors] + _ALSO_FITTED
    nominal = np.log([NOMINAL_NOISE[name] for name in names])
    inputs = steps_until(drive, until)
    parts = list(_parts(inputs, int(np.sum(drive.ends <= until))))
    first = _before_the_first(drive, initial, sensors)
    # By differences, all at once: the filter's derivatives take five times as long.
    shifts = np.concatenate([np.zeros((1, len(names))), _DIFFERENCE * np.eye(len(names))])

    def objective(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
        noise = _bank(sensors, NOMINAL_NOISE | dict(zip(names, np.exp(logarithms + shifts).T, strict=True)))
        state, misfits = first, np.zeros(len(shifts))
        for inputs, counted in parts:
            state, log_likelihoods, _ = _go_on(state, inputs, counted, np.float64(drive.gravity), noise, sensors)
            misfits -= np.asarray(log_likelihoods)
        from_nominal = (logarithms - nominal) / _NOISE_SPREAD
        return (
            float(misfits[0]) + 0.5 * float(from_nominal @ from_nominal),
            (misfits[1:] - misfits[0]) / _DIFFERENCE + from_nominal / _NOISE_SPREAD,
        )

    found = minimize(
        objective,
        np.log([start[name] for name in names]),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 30, "ftol": 1e-5},
    )
    return NOMINAL_NOISE | dict(zip(names, np.exp(found.x).tolist(), strict=True))


def run_filter(
    drive: SpeedDrive,
    until: float,
    sensors: str,
    initial: tuple[float, float],
    noise: dict[str, float],
    end: float = np.inf,
    before: FilterRun | None = None,
) -> FilterRun:
    """The filter with the aid up to `until`, on to `end` or further; what a run before shares is not run again."""
    inputs = steps_until(drive, until)
    count = drive.ends.size
    if before is not None and (before.sensors, before.initial, before.noise) == (sensors, initial, noise):
        starts, parts = list(before.starts), list(before.parts)
        same = min((_same_steps(before.inputs[name], values) for name, values in inputs.items()), default=count)
        shared = len(parts) if same == count else max(same - MARGIN, 0) // _PART
        del starts[shared + 1 :], parts[shared:]
    else:
        starts, parts = [_before_the_first(drive, initial, sensors)], []
    levels = _bank(sensors, noise)
    wanted = min(int(np.searchsorted(drive.ends, end)) + 1, count)
    for part, counted in _parts(inputs, count, len(parts), wanted):
        state, _, track = _go_on(starts[-1], part, counted, np.float64(drive.gravity), levels, sensors)
        starts.append(state)
        parts.append({name: np.asarray(values)[counted] for name, values in track.items()})
    return FilterRun(
        sensors=sensors, initial=initial, noise=noise, inputs=inputs, starts=tuple(starts), parts=tuple(parts)
    )


def _same_steps(a: np.ndarray, b: np.ndarray) -> int:
    """How many steps from the first one on are the same in both."""
    if a is b:
        return len(a)
    differs = a != b
    return int(np.argmax(differs)) if differs.any() else len(a)


def _parts(
    inputs: dict[str, np.ndarray], count: int, first: int = 0, wanted: int | None = None
) -> Iterator[tuple[dict[str, np.ndarray], np.ndarray]]:
    """Parts of the first `count` steps with their margins, from the first wanted on, and which steps count in each."""
    for begin in range(first * _PART, count if wanted is None else wanted, _PART):
        steps = np.arange(begin - MARGIN, begin + _PART + MARGIN)
        counted = (steps >= begin) & (steps < min(begin + _PART, count))
        steps = np.clip(steps, 0, len(inputs["f_b"]) - 1)
        yield {name: values[steps] for name, values in inputs.items()}, counted


def _bank_size(sensors: str) -> int:
    """As many filters as a fit of the noise levels runs at once: all runs share one program."""
    return 1 + len(_FITTED[sensors] + _ALSO_FITTED)


def _bank(sensors: str, noise: Mapping[str, float | np.ndarray]) -> SpeedNoise:
    return SpeedNoise(**{name: np.broadcast_to(level, _bank_size(sensors)) for name, level in noise.items()})


def _before_the_first(drive: SpeedDrive, initial: tuple[float, float], sensors: str) -> SpeedState:
    """The same for all filters of a bank."""
    first = first_state(
        *(drive.f_steps[0], drive.w_steps[0], *map(np.float64, (*initial, drive.gravity))),
        sensors=sensors,
        states_covariance=drive.states_covariance,
    )
    return jax.tree.map(lambda x: np.stack([np.asarray(x)] * _bank_size(sensors)), first)


@partial(jax.jit, static_argnames="sensors")
def _go_on(
    start: SpeedState,
    inputs: dict[str, jax.Array],
    counted: jax.Array,
    gravity: jax.Array,
    noise: SpeedNoise,
    sensors: str,
) -> tuple[SpeedState, jax.Array, dict[str, jax.Array]]:
    """A part of the drive through a bank of filters: their last states, log-likelihoods, and the first one's track."""

    def one(start: SpeedState, noise: SpeedNoise) -> tuple[tuple[SpeedState, jax.Array], dict[str, jax.Array]]:
        track = filter_speed(
            **inputs,
            speed0=0.0,
            pitch0=0.0,
            gravity=gravity,
            dt=STEP,
            noise=noise,
            sensors=sensors,
            counted=counted,
            start=start,
        )
        end = SpeedState(states=track.states[-1], covariance=track.last_covariance)
        return (end, jnp.sum(track.log_likelihood)), {name: getattr(track, name) for name in _TRACKED}

    # the bank after the time: as the scan has it
    (end, log_likelihoods), track = jax.vmap(one, out_axes=(0, 1))(start, noise)
    return end, log_likelihoods, {name: values[:, 0] for name, values in track.items()}


def samples_between(drive: SpeedDrive, begin: float, end: float) -> slice:
    """Samples of the IMU from the last one up to a time on to the first one from another on."""
    first, last = np.searchsorted(drive.t, begin, side="right") - 1, np.searchsorted(drive.t, end)
    return slice(max(int(first), 0), min(int(last) + 1, drive.t.size))


def on_imu(drive: SpeedDrive, run: FilterRun, rows: slice = slice(None)) -> pd.DataFrame:
    """An estimate at samples of the IMU, indexed by their times from the first one."""
    t = drive.t[rows]
    begin, track = run.track(max(int(t[0] / STEP) - 1, 0))
    ends = drive.ends[begin : begin + len(track["speed"])]
    columns = {name: np.interp(t, ends, track[name]) for name in ("speed", "speed_std", "pitch", "roll")}
    return pd.DataFrame(columns, index=t).assign(valid=True)


@dataclass(frozen=True, kw_only=True)
class Known:
    """What dead reckoning begins with: when, in s from the first sample, and the filter's states there."""

    begin: float
    sensors: str
    noise: dict[str, float]
    start: Start


def known_at(drive: SpeedDrive, run: FilterRun, until: float) -> Known:
    """What the filter knew at the last step up to a time."""
    last = int(np.clip(np.searchsorted(drive.ends, until, side="right") - 1, 0, drive.ends.size - 1))
    part = last // _PART
    inputs, counted = next(_parts(run.inputs, last + 1, part))
    levels = _bank(run.sensors, run.noise)
    bank, _, track = _go_on(run.starts[part], inputs, counted, np.float64(drive.gravity), levels, run.sensors)
    state = jax.tree.map(lambda x: np.asarray(x)[0], bank)
    speed, roll = (np.asarray(track[name])[counted][-1] for name in ("speed", "roll"))
    start = Start(speed=speed, roll=roll, states=state.states, covariance=state.covariance)
    return Known(begin=float(drive.ends[last]), sensors=run.sensors, noise=run.noise, start=start)


def known_beforehand(drive: SpeedDrive, initial: tuple[float, float], sensors: str) -> Known:
    """What the filter is told of the first sample."""
    first = jax.tree.map(lambda x: x[0], _before_the_first(drive, initial, sensors))
    roll = first.states[state_names(sensors).index("roll")]
    start = Start(speed=np.float64(initial[0]), roll=roll, states=first.states, covariance=first.covariance)
    return Known(begin=0.0, sensors=sensors, noise=NOMINAL_NOISE, start=start)


def dead_reckon(estimate: pd.DataFrame, drive: SpeedDrive, known: Known, method: str) -> None:
    """Write over the rows after the aid what a method without a filter makes of the same constants."""
    begin, end = known.begin, drive.t[-1]
    intervals = round((end - begin) / drive.usual)
    if intervals < 1:
        return
    dt = (end - begin) / intervals
    # no further than there are rows
    count = min(intervals, int(np.ceil((estimate.index[-1] - begin) / dt))) + 1
    t = begin + dt * np.arange(count)
    size = bucket(count, _SAMPLES)
    f_b, w_b = (padded(interpolated(t, drive.t, series), size) for series in (drive.f_b, drive.w_b))
    vibration = padded(np.interp(t, drive.ends, drive.vibration), size)
    noise = SpeedNoise(**{name: np.float64(level) for name, level in known.noise.items()})
    names = state_names(known.sensors)
    found = reckon(method, names, known.start, f_b, w_b, vibration, np.float64(drive.gravity), dt, noise, STEP)
    series = {name: np.asarray(getattr(found, name))[:count] for name in ("speed", "std", "pitch", "roll", "valid")}
    later = estimate.index >= begin
    times = estimate.index[later].to_numpy()
    columns = {"speed": np.maximum(series["speed"], 0), "speed_std": series["std"]}
    columns |= {"pitch": series["pitch"], "roll": series["roll"]}
    for name, values in columns.items():
        estimate.loc[later, name] = np.interp(times, t, values)
    estimate.loc[later, "valid"] = series["valid"][np.clip(np.rint((times - begin) / dt), 0, count - 1).astype(int)]
