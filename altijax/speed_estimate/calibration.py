"""Constants of the speed methods, fitted to a reference speed.

The methods without a filter run from stretch to stretch of 20 s; the speed and the pitch that each stretch begins with
are its own and marginalised (`fit_shared`), and inside the roll of "aided" stands the reference speed. "filter" finds
its constants by itself from any aid: here the reference is the aid. What belongs to the aid of the verb, the wheels'
scale and the delays, is found from the aid against the reference, the same for all methods.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.parameters import ACCEPTED, triads
from altijax.calibration.priors import PARAMETERS
from altijax.calibration.records import Calibration, held_out_row, held_out_table
from altijax.calibration.reference_fit import Found, calibration_from, fit_to_reference, weighted_fit
from altijax.calibration.shared_parameters import fit_shared
from altijax.drives import gravity_at, imu_of, start_of
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix
from altijax.series import interpolated, means_between
from altijax.speed import speed_with_aided_roll, speed_with_roll, speed_without_roll
from altijax.speed_estimate.estimates import (
    AUTO_SENSORS,
    NOMINAL_NOISE,
    dead_reckon,
    fit_noise,
    known_at,
    on_imu,
    run_filter,
    samples_between,
)
from altijax.speed_estimate.model import OF_CONSTANTS, STATES, state_names
from altijax.speed_estimate.steps import aid_of, drive_in_steps, initial_state, speed_of
from altijax.stages import stages, tracked

STRETCH = 20.0
"""Length of a stretch, s: long enough for a gyro's bias, short against the growth of errors in turns."""

OUTAGE = 10.0
"""Length of the outages in which a calibration is judged, s."""

_OF_THE_AID = ("wheel_scale", "wheel_delay", "gnss_delay")
_OF_THE_IMU = tuple(name for name in ACCEPTED["roll"] if name not in _OF_THE_AID)
_STEP, _EVERY = 0.05, 10
# A reference that far away says nothing of the speed, s.
_NEAR = 1.0
# What a stretch begins with: standard deviations of speed (m/s) and pitch (rad) about the first guess.
_OWN_STD = (1.0, 0.1)
# The smallest numbers of stretches, and of speeds of an aid, that arrays are filled up to.
_FEW, _SPEEDS = 4, 1024
_STATE_OF = {constant: (state, sign) for state, (constant, sign) in OF_CONSTANTS.items()}

Array = jax.Array | np.ndarray


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class _Stretches:
    f: Array
    w: Array
    gravity: Array
    inside: Array  # reference speed at every node, for the roll of "aided"
    speed: Array  # the same at every tenth
    weight: Array  # 1 or 0 over the standard deviation


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class _Aids:
    """Speeds of the aid and the reference by recording, filled up; what is weighted with zero does not count."""

    by_wheel: Array
    t: Array
    speed: Array
    weight: Array
    t_aid: Array
    aid: Array


def calibrate_speed(
    recordings: Sequence[Recording], names: Sequence[str], *, method: str, until: float | None = None
) -> Calibration:
    """Constants that bring a method's speed closest to a reference speed.

    Parameters
    ----------
    recordings : sequence of Recording
        With ``v_e`` and ``v_n`` (and ``v_u``) in their reference; the constants are common to them.
    names : sequence of str
        Constants to find; the others keep their nominal values, but that "filter" always finds its own.
    method : {"conventional", "roll", "aided", "filter"}
        Method of `estimate_speed`.
    until : float, optional
        Last time whose reference may be used.

    Returns
    -------
    calibration : Calibration
        ``held_out`` has the errors of `estimate_speed` in outages of 10 s with the aid's speeds up to their start, and
        those of the aid where one of its constants was asked for.

    Raises
    ------
    ValueError
        If a constant changes nothing, or the reference is missing or too short.
    """
    of_aid = [name for name in names if name in _OF_THE_AID]
    of_imu = [name for name in names if name not in _OF_THE_AID]
    with jax.enable_x64(True), stages(f"{method} calibrated") as stage:
        references = [_reference(recording) for recording in recordings]
        ends = [np.inf if until is None else until - start_of(recording) for recording in recordings]
        parts, rows = [], []
        if of_imu:
            stage("constants of the IMU")
            fit = _from_filter if method == "filter" else _from_stretches
            parts.append(fit(recordings, references, ends, of_imu, method))
        if of_aid:
            stage("constants of the aid")
            found, judged = _from_aid(recordings, references, ends, of_aid, method)
            parts.append(found)
            rows += judged
        calibration = _joined(parts, list(names))
        for recording, reference, end in zip(recordings, references, ends, strict=True):
            rows += _outages(recording, reference, end, method, calibration)
    return replace(calibration, held_out=held_out_table(rows))


def _reference(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Times from the first IMU sample, and speeds, of the reference within the IMU's span."""
    reference = recording.reference
    if reference is None or not {"v_e", "v_n"} <= set(reference) or not reference["v_e"].notna().any():
        raise ValueError(
            f"recording {recording.name!r} has no reference speeds: a reference.csv with columns v_e, v_n, v_u"
        )
    t, speed = speed_of(reference)
    t = t - start_of(recording)
    inside = (t >= 0) & (t <= imu_of(recording).index[-1] - start_of(recording))
    return t[inside], speed[inside]


def _at(reference: tuple[np.ndarray, np.ndarray], times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reference speed at times, and whether one is near on both sides."""
    t, speed = reference
    k = np.clip(np.searchsorted(t, times), 1, t.size - 1)
    near = (times >= t[0]) & (times <= t[-1]) & (t[k] - t[k - 1] <= _NEAR)
    return np.interp(times, t, speed), near


def _from_stretches(
    recordings: Sequence[Recording],
    references: Sequence[tuple[np.ndarray, np.ndarray]],
    ends: Sequence[float],
    names: list[str],
    method: str,
) -> Calibration:
    pieces = [
        piece
        for recording, reference, end in zip(recordings, references, ends, strict=True)
        for piece in _stretches(recording, reference, end)
    ]
    if not pieces:
        raise ValueError(f"method {method!r} needs a reference speed for {STRETCH:g} s before the end of the fit")
    # more stretches that say nothing, as programs are compiled for a number of them
    size = bucket(len(pieces), _FEW)
    stretches = jax.tree.map(lambda *leaves: padded(np.stack(leaves), size), *(data for data, _ in pieces))
    known = padded(np.ones(len(pieces)), size, 0.0)
    stretches = replace(stretches, weight=known[:, None] * stretches.weight)
    own0 = padded(np.stack([guess for _, guess in pieces]), size)
    mean, unit = _priors(_OF_THE_IMU, names)

    def solve(x: np.ndarray, noise: np.ndarray, unit: np.ndarray = unit) -> Found:
        return _solve(x, noise, stretches, own0, mean, unit, method=method)

    first = solve(0 * mean, np.ones(1), 0 * unit)[2]
    fit = fit_to_reference(_of_some(_OF_THE_IMU, names, solve), len(names), first)
    return calibration_from(method, names, fit.x, fit.covariance, pd.DataFrame())


def _priors(names: Sequence[str], wanted: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Prior means, and standard deviations that are zero for what is not wanted and so stays known."""
    known = PARAMETERS.loc[list(names)]
    unit = known["uncertainty"].where(known.index.isin(wanted), 0.0)
    return known["nominal"].to_numpy(float), unit.to_numpy(float)


def _of_some(
    names: Sequence[str], wanted: Sequence[str], solve: Callable[[np.ndarray, np.ndarray], Found]
) -> Callable[[Array, Array], Found]:
    """A fit of the constants that are wanted, from one of all."""
    rows = [names.index(name) for name in wanted]

    def of_wanted(x: Array, noise: Array) -> Found:
        x0 = np.zeros(len(names))
        x0[rows] = x
        found, covariance, residuals = solve(x0, np.asarray(noise))
        return np.asarray(found)[rows], np.asarray(covariance)[np.ix_(rows, rows)], residuals

    return of_wanted


def _stretches(
    recording: Recording, reference: tuple[np.ndarray, np.ndarray], end: float
) -> list[tuple[_Stretches, np.ndarray]]:
    """Stretches end to end up to the end of the fit, and a first guess of the speed and pitch each begins with."""
    imu = imu_of(recording)
    t = imu.index.to_numpy(float) - start_of(recording)
    if not {"gx", "gy", "gz"} <= set(imu):
        raise ValueError(f"recording {recording.name!r} has no gyro (gx, gy, gz in the IMU), which a speed needs")
    nodes = _STEP * np.arange(round(STRETCH / _STEP) + 1)
    gravity = gravity_at(recording)
    values = imu[["ax", "ay", "az", "gx", "gy", "gz"]].to_numpy(float)
    found = []
    for start in np.arange(t[0], min(end, t[-1], reference[0][-1]) - STRETCH + 1e-9, STRETCH):
        inside = t[(t >= start) & (t <= start + STRETCH)]
        speed, near = _at(reference, start + nodes[::_EVERY])
        if np.max(np.diff(inside), initial=0.0) > 5 * _STEP or near.mean() < 0.5:
            continue
        edges = start + np.append(nodes - _STEP / 2, nodes[-1] + _STEP / 2)
        # the edges among the samples make the means exact
        times = np.union1d(edges, t[(t > edges[0]) & (t < edges[-1])])
        readings = means_between(edges, times, interpolated(times, t, values))
        gained = (speed[4] - speed[0]) / (4 * _EVERY * _STEP)
        force = readings[: 4 * _EVERY, 0].mean() - gained
        data = _Stretches(
            f=readings[:, :3],
            w=readings[:, 3:],
            gravity=np.asarray(gravity),
            inside=np.interp(start + nodes, *reference),
            speed=np.where(near, speed, 0.0),
            weight=near.astype(float),
        )
        found.append((data, np.array([speed[0], np.arcsin(np.clip(force / gravity, -0.5, 0.5))])))
    return found


@partial(jax.jit, static_argnames="method")
def _solve(
    x0: jax.Array,
    noise: jax.Array,
    stretches: _Stretches,
    own0: jax.Array,
    mean: jax.Array,
    unit: jax.Array,
    method: str,
) -> Found:
    """The constants in units of their priors, each stretch's own speed and pitch averaged over."""
    weighted = replace(stretches, weight=stretches.weight / noise[0])

    def residual(x: jax.Array, own: jax.Array, stretch: _Stretches) -> jax.Array:
        values = dict(zip(_OF_THE_IMU, mean + unit * x, strict=True))
        return jnp.asarray(stretch.weight) * (_dead_reckoned(values, own, stretch, method) - stretch.speed)

    ones = jnp.ones_like(mean)
    fit = fit_shared(residual, weighted, 0 * ones, ones, own0, jnp.asarray(_OWN_STD), start=(x0, own0))
    return fit.shared, fit.covariance, (fit.residuals * noise[0],)


def _dead_reckoned(values: dict[str, jax.Array], own: jax.Array, stretch: _Stretches, method: str) -> jax.Array:
    imu = triads(values)
    f = stretch.f / imu.accelerometer_scale - imu.accelerometer_bias
    w = stretch.w / imu.gyro_scale - imu.gyro_bias
    mounting = euler_to_matrix(imu.mounting)
    (f_x, f_y, _), (_, w_y, w_z) = (f @ mounting.T).T, (w @ mounting.T).T
    start = own[0], own[1], stretch.gravity, _STEP
    if method == "conventional":
        speed = speed_without_roll(f_x, w_y, *start)[0]
    elif method == "roll":
        speed = speed_with_roll(f_x, f_y, w_y, w_z, *start)[0]
    else:
        speed = speed_with_aided_roll(f_x, f_y, w_y, w_z, stretch.inside, jnp.ones_like(f_x), *start)[0]
    return speed[::_EVERY]


def _from_filter(
    recordings: Sequence[Recording],
    references: Sequence[tuple[np.ndarray, np.ndarray]],
    ends: Sequence[float],
    names: list[str],
    method: str,
) -> Calibration:
    """One drive after the other, each beginning with what the ones before have left; the reference as the aid."""
    states, signs = zip(*(_STATE_OF[name] for name in names), strict=True)
    rows = [state_names(AUTO_SENSORS).index(state) for state in states]
    prior = PARAMETERS.copy()
    prior.loc[names, "uncertainty"] = [STATES[state] for state in states]
    unit = prior.loc[names, "uncertainty"].to_numpy(float)
    calibration, value = None, np.zeros(len(names))
    for recording, (t, speed), end in zip(recordings, references, ends, strict=True):
        used = t <= end
        if used.sum() < 3 or t[used][-1] - t[used][0] < STRETCH:
            raise ValueError(f"method 'filter' needs a reference speed for {STRETCH:g} s before the end of the fit")
        start, last = start_of(recording), float(t[used][-1])
        aid = pd.DataFrame({"v_e": speed[used], "v_n": 0.0}, index=t[used] + start)
        place = gravity_at(recording)
        drive = drive_in_steps(
            replace(recording, imu=imu_of(recording).loc[: start + last], wheel=None, gnss=aid), calibration, last
        )
        drive = replace(drive, gravity=place)
        initial = initial_state(drive, last, None, None)
        noise = fit_noise(drive, last, AUTO_SENSORS, initial, NOMINAL_NOISE)
        found = run_filter(drive, last, AUTO_SENSORS, initial, noise).last
        value = value + signs * found.states[rows]
        covariance = np.asarray(found.covariance)[np.ix_(rows, rows)] * np.outer(signs, signs)
        calibration = calibration_from(
            method, names, value / unit, covariance / np.outer(unit, unit), pd.DataFrame(), prior=prior
        )
    assert calibration is not None  # there is at least one drive
    return calibration


def _from_aid(
    recordings: Sequence[Recording],
    references: Sequence[tuple[np.ndarray, np.ndarray]],
    ends: Sequence[float],
    names: list[str],
    method: str,
) -> tuple[Calibration, list[dict[str, str | float | bool]]]:
    """The wheels' or the receiver's speed, corrected, against the reference."""
    data = []
    for recording, (t, speed) in zip(recordings, references, strict=True):
        t_aid, aid = aid_of(recording)
        t_aid = t_aid - start_of(recording)
        known = (t > t_aid[0] + _NEAR) & (t < t_aid[-1] - _NEAR)
        gap = np.diff(t_aid)[np.clip(np.searchsorted(t_aid, t) - 1, 0, t_aid.size - 2)]
        known &= gap <= _NEAR
        data.append((t[known], speed[known], t_aid, aid))
    fitted = [int(np.sum(t <= end)) for (t, *_), end in zip(data, ends, strict=True)]
    if min(fitted) < 3:
        raise ValueError(
            f"{', '.join(names)}: fewer than 3 speeds of aid and reference together before the end of the fit"
        )
    size, size_aid = (bucket(max(part[k].size for part in data), _SPEEDS) for k in (0, 2))
    t, speed = (np.stack([padded(part[k], size) for part in data]) for k in (0, 1))
    t_aid, aid = (np.stack([padded(part[k], size_aid) for part in data]) for k in (2, 3))
    by_wheel = np.array([recording.wheel is not None for recording in recordings])
    counts, counts_fitted = (
        (np.arange(size) < np.array(numbers)[:, None]).astype(float)
        for numbers in ([part[0].size for part in data], fitted)
    )
    aids = _Aids(by_wheel=by_wheel, t=t, speed=speed, weight=counts, t_aid=t_aid, aid=aid)
    before = replace(aids, weight=counts_fitted)
    mean, unit = _priors(_OF_THE_AID, names)

    def solve(x: np.ndarray, noise: np.ndarray) -> Found:
        return _solve_aid(x, noise, before, mean, unit)

    first = list(np.asarray(_aid_errors(mean, before))[:, None])
    fit = fit_to_reference(_of_some(_OF_THE_AID, names, solve), len(names), first)
    calibration = calibration_from(method, names, fit.x, fit.covariance, pd.DataFrame())
    values = np.array([calibration.values.get(name, nominal) for name, nominal in zip(_OF_THE_AID, mean, strict=True)])
    rows = []
    for recording, (t, *_), n, nominal, best in zip(
        recordings, data, fitted, *(np.asarray(_aid_errors(x, aids)) for x in (mean, values)), strict=True
    ):
        interval = np.array([t[0], t[n - 1], t[-1]]) + start_of(recording)
        halves = [[_rms(error[cut]) for error in (nominal, best)] for cut in (slice(0, n), slice(n, t.size))]
        rows.append(held_out_row(recording.name, "speed of the aid", "m/s", interval.tolist(), *halves))
    return calibration, rows


@jax.jit
def _aid_errors(values: jax.Array, aids: _Aids) -> jax.Array:
    """Speed of the aid, corrected by the values of `_OF_THE_AID`, less that of the reference, by recording."""
    scale, wheel_delay, gnss_delay = values
    at = aids.t + jnp.where(aids.by_wheel, wheel_delay, gnss_delay)[:, None]
    speed = jnp.where(aids.by_wheel, scale, 1.0)[:, None] * jax.vmap(jnp.interp)(at, aids.t_aid, aids.aid)
    return jnp.asarray(aids.weight) * (speed - aids.speed)


@jax.jit
def _solve_aid(x0: jax.Array, noise: jax.Array, aids: _Aids, mean: jax.Array, unit: jax.Array) -> Found:
    """The constants in units of their priors."""
    return weighted_fit(lambda x: tuple(_aid_errors(mean + unit * x, aids)[:, None]), x0, noise)


def _outages(
    recording: Recording, reference: tuple[np.ndarray, np.ndarray], end: float, method: str, calibration: Calibration
) -> list[dict[str, str | float | bool]]:
    """Errors of the verb in outages end to end, those that lie before the end of the fit and those after it."""
    errors = {}
    last = min(imu_of(recording).index[-1] - start_of(recording), reference[0][-1]) - OUTAGE
    first = OUTAGE + (end % OUTAGE if np.isfinite(end) else 0.0)
    starts = np.arange(first, last + 1e-9, OUTAGE)
    for kind, known in (("nominal", None), ("fitted", calibration)):
        drive = drive_in_steps(recording, known, np.inf)
        if not starts.size or not np.any(drive.t_aid <= 1.0):
            return []  # without an aid at the start the verb wants an initial speed
        run = None
        for start in tracked(starts.tolist(), f"outages of {recording.name}, {kind} constants"):
            initial = initial_state(drive, start, None, None)
            samples = np.searchsorted(drive.t, start + OUTAGE, side="right")
            outage = replace(drive, t=drive.t[:samples], f_b=drive.f_b[:samples], w_b=drive.w_b[:samples])
            run = run_filter(drive, start, AUTO_SENSORS, initial, NOMINAL_NOISE, start + OUTAGE, run)
            estimate = on_imu(outage, run, samples_between(outage, start, start + OUTAGE))
            if method != "filter":
                dead_reckon(estimate, outage, known_at(outage, run, start), method)
            times = start + np.arange(0.5, OUTAGE + 0.1, 0.5)
            truth, near = _at(reference, times)
            errors[kind, start] = (np.interp(times, estimate.index, estimate["speed"]) - truth)[near]
    halves = [
        [_rms(np.concatenate([errors[kind, start] for start in chosen] or [[]])) for kind in ("nominal", "fitted")]
        for chosen in (starts[starts + OUTAGE <= end], starts[starts >= end])
    ]
    interval = np.array([0.0, min(end, starts[-1] + OUTAGE), starts[-1] + OUTAGE]) + start_of(recording)
    return [held_out_row(recording.name, f"speed in outages of {OUTAGE:g} s", "m/s", interval.tolist(), *halves)]


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error)))) if np.size(error) else np.nan


def _joined(parts: list[Calibration], names: list[str]) -> Calibration:
    """Two calibrations of different constants, independent of each other, as one."""
    if len(parts) == 1:
        return parts[0]
    first, second = parts
    correlation = pd.concat([first.correlation, second.correlation]).fillna(0.0)
    return replace(
        first,
        table=pd.concat([first.table, second.table]).loc[names],
        correlation=correlation.loc[names, names],
        absorbed=pd.concat([first.absorbed, second.absorbed]).loc[names],
        undetermined=first.undetermined + second.undetermined,
    )
