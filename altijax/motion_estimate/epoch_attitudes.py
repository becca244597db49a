"""Attitude from each epoch by itself, after [chalko2010], and what it is worth.

The attitude that turns an epoch's force in body axes into that in navigation axes belongs to mid-epoch; `fit_attitudes`
finds it, beginning level and along the course. How far attitudes may be from there the record tells by what its epochs
say with a wide prior, and how exactly the forces agree by the lengths of both, which no attitude changes.
"""

from dataclasses import dataclass

import jax
import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation, Slerp

from altijax.attitude import RESCUED, AttitudeFit, course_attitude, fit_attitudes, hold_attitudes
from altijax.delays import estimate_delay
from altijax.drives import gravity_at, imu_of, start_of, usual_step
from altijax.least_squares import CONVERGED
from altijax.motion_estimate.epochs import EPOCHS, Epochs, joined_epochs, uniform_forces
from altijax.motion_estimate.readings import velocities_within
from altijax.motion_estimate.start import quick_jit
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.series import after_gap, flanked
from altijax.vehicle.at_samples import angle_columns

Delay = tuple[float, float]
"""Of the velocities, and its standard deviation, s."""

_VELOCITY = ("v_e", "v_n", "v_u")
# Samples of the delay's search are filled up to so many, or twice, four times ... as many.
_SAMPLES = 16384
# How far attitudes may be from level and along the course, rad: at first, and at least. It settles in a few rounds.
_AWAY, _LEAST, _ROUNDS = 0.3, 0.05, 6
# The least misfit of two forces: the resolution of accelerometers, m/s^2.
_RESOLUTION = 0.01
# Attitudes that tell the delay must not follow single velocities: they are means over so many seconds. They must
# explain so much of the acceleration's variance: those of a body that leans with each turn do not.
_SLOW, _EXPLAINED = 15.0, 0.5
# From how many epochs on a delay is looked for, and how far to both sides, s.
_FEWEST, _LARGEST_DELAY = 8, 1.0
# Standard deviation of a velocity that was never measured, m/s.
_UNKNOWN = 100.0


@dataclass(frozen=True, kw_only=True, eq=False)
class EpochAttitudes:
    """Attitudes at mid-epoch.

    Attributes
    ----------
    C_nb : (epochs, 3, 3)
        Attitudes.
    variance : (epochs, 3) rad^2
        Of roll, pitch and yaw.
    walk : (3,) rad^2/s
        Variance by which each angle changes in a second, beyond what it goes on by evenly.
    """

    C_nb: np.ndarray
    variance: np.ndarray
    walk: np.ndarray


def epoch_estimate(recording: Recording, delay: Delay | None, presumed: Delay) -> pd.DataFrame:
    """What `estimate_motion` returns by "epoch".

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities; a gyro is not looked at.
    delay : Delay, optional
        Of the velocities; estimated by default.
    presumed : Delay
        For where the record does not tell it.

    Returns
    -------
    estimate : DataFrame
        Angles and velocities with their standard deviations, and valid; ``attrs`` has delay and delay_std.

    Raises
    ------
    ValueError
        If there are fewer than 3 velocities within the time of the IMU.
    """
    if delay is None:
        delay = delay_by_epochs(recording, presumed)
    epochs = joined_epochs(recording, delay[0])
    estimate = _at_samples(recording, epochs, epoch_attitudes(epochs, delay[1]), delay)
    estimate.attrs = {"delay": delay[0], "delay_std": delay[1]}
    return estimate


def delay_by_epochs(recording: Recording, presumed: Delay) -> Delay:
    """Delay of the velocities by `estimate_delay`, the accelerations turned by attitudes that change slowly.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities.
    presumed : Delay
        What it is taken to be at first, and where the record does not tell.

    Returns
    -------
    delay : Delay
        The delay, s, and its standard deviation.
    """
    t, f_b = uniform_forces(recording)
    delay = presumed
    # The attitudes depend on it a little.
    for _ in range(2):
        stamps, v_n, std = _with_missing_epochs(*velocities_within(recording, delay[0]))
        told = (stamps >= _LARGEST_DELAY) & (stamps <= t[-1] - _LARGEST_DELAY)
        v_n = np.where(np.isfinite(std) & told[:, None], v_n, np.nan)
        if np.isfinite(v_n[:, 0]).sum() < _FEWEST:
            return presumed
        a_n = np.einsum("tij,tj->it", _slow_attitudes(joined_epochs(recording, delay[0]), t), f_b)
        a_n[2] -= gravity_at(recording)
        size, count = bucket(t.size, _SAMPLES), bucket(stamps.size, EPOCHS)
        further = np.median(np.diff(stamps)) * np.arange(1, count - stamps.size + 1)
        found = jax.device_get(
            estimate_delay(
                t[1] * np.arange(size),
                padded(a_n, size, 0.0, axis=1),
                np.append(stamps, stamps[-1] + further),
                padded(v_n.T, count, np.nan, axis=1),
                max_delay=_LARGEST_DELAY,
            )
        )
        if found.ambiguous or found.correlation**2 < _EXPLAINED:
            return presumed
        delay = float(found.delay), float(found.std)
    return delay


def _with_missing_epochs(
    stamps: np.ndarray, v_n: np.ndarray, std: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same, about uniform: with an epoch without velocity wherever one is missing."""
    usual = float(np.median(np.diff(stamps)))
    number, first = np.unique(np.rint((stamps - stamps[0]) / usual).astype(int), return_index=True)
    t = stamps[0] + usual * np.arange(number[-1] + 1)
    all_v, all_std = np.zeros((t.size, 3)), np.full((t.size, 3), np.inf)
    t[number], all_v[number], all_std[number] = stamps[first], v_n[first], std[first]
    return t, all_v, all_std


def _slow_attitudes(epochs: Epochs, t: np.ndarray) -> np.ndarray:
    """Attitudes at times whose deviation from level and along the course is a mean over many epochs."""
    fit, euler0 = _fitted(epochs, np.full(3, _AWAY))
    course = Rotation.from_rotvec(euler0 * [0.0, 0.0, 1.0])
    count = max(round(_SLOW / float(np.median(np.diff(epochs.knots)))), 1)
    mounting = (course.inv() * Rotation.from_matrix(fit.C_nb)).as_matrix()
    mean = Rotation.from_matrix(uniform_filter1d(mounting, count, axis=0, mode="nearest"))
    return Slerp(epochs.middle, course * mean)(np.clip(t, epochs.middle[0], epochs.middle[-1])).as_matrix()


def epoch_attitudes(epochs: Epochs, delay_std: float) -> EpochAttitudes:
    """Attitude of each epoch, or the previous one's where it does not determine one.

    Parameters
    ----------
    epochs : Epochs
        Mean forces.
    delay_std : float
        Standard deviation of the velocities' delay, s.

    Returns
    -------
    attitudes : EpochAttitudes
        Their variances count what the forces, the start, the delay and the time since the course was seen leave open.
    """
    prior_std = _away_from_start(epochs)
    fit, _ = _fitted(epochs, prior_std)
    # A delay brings each epoch's force to the time of the one before.
    middle = epochs.middle
    later = epochs.f_n + delay_std * np.gradient(epochs.f_n, middle, axis=0)
    by_delay = _wrapped(_fitted(epochs, prior_std, f_n=later)[0].euler - fit.euler)
    angles = np.unwrap(fit.euler, axis=0)
    spacing = float(np.median(np.diff(epochs.knots)))
    determined = epochs.whole & (fit.rank >= 2) & np.isin(fit.status, (CONVERGED, RESCUED))
    bends = np.diff(angles, 2, axis=0)[determined[2:] & determined[1:-1] & determined[:-2]]
    # The second difference of a random walk has twice the variance of a step.
    walk = np.mean(bends**2, axis=0) / 2 / spacing if len(bends) else np.full(3, _AWAY**2)
    covariance = fit.covariance + by_delay[:, :, None] * by_delay[:, None, :]
    size = bucket(len(angles), EPOCHS)
    held = hold_attitudes(
        padded(np.asarray(fit.euler), size),
        padded(covariance, size),
        padded(determined, size),
        drift_std=np.sqrt(np.max(walk) * spacing),
    )
    euler, covariance = (np.asarray(x)[: len(angles)] for x in held)
    variance = np.diagonal(covariance, axis1=1, axis2=2).copy()
    variance[:, 2] += walk[2] * np.abs(middle - middle[epochs.course_of])
    matrices = Rotation.from_euler("ZYX", euler[:, ::-1] * [1, -1, 1]).as_matrix()
    return EpochAttitudes(C_nb=matrices, variance=variance, walk=walk)


def _fitted(epochs: Epochs, prior_std: np.ndarray, f_n: np.ndarray | None = None) -> tuple[AttitudeFit, np.ndarray]:
    """Fits of all epochs, and their starts."""
    v = 0.5 * (epochs.v_n[1:] + epochs.v_n[:-1])[epochs.course_of]
    f_b, f_n = epochs.f_b, epochs.f_n if f_n is None else f_n
    size = bucket(len(f_b), EPOCHS)
    misfit = epochs.length_misfit
    level = np.sqrt(np.mean(misfit**2) + _RESOLUTION**2) if misfit.size else 1.0
    found = jax.device_get(_fit(*(padded(x, size) for x in (f_b, f_n, v)), prior_std, np.float64(level)))
    return jax.tree.map(lambda x: x[: len(f_b)], found)


@quick_jit
def _fit(
    f_b: jax.Array, f_n: jax.Array, v_n: jax.Array, prior_std: jax.Array, measurement_std: jax.Array
) -> tuple[AttitudeFit, jax.Array]:
    euler0 = course_attitude(v_n)
    return fit_attitudes(f_b, f_n, euler0, prior_std=prior_std, measurement_std=measurement_std), euler0


def _away_from_start(epochs: Epochs) -> np.ndarray:
    """How far attitudes are from level and along the course: the most probable prior, by MacKay's fixed point."""
    prior_std = np.full(3, _AWAY)
    known = epochs.whole & (epochs.course_of == np.arange(epochs.whole.size))
    for _ in range(_ROUNDS):
        fit, euler0 = _fitted(epochs, prior_std)
        square = np.sum(_wrapped(fit.euler - euler0)[known] ** 2, axis=0)
        number = np.sum(fit.data_share[known], axis=0)
        # Angles of which the data tell nothing stay as they were presumed.
        told = number > 1
        prior_std = np.where(told, np.maximum(np.sqrt(square / np.where(told, number, 1)), _LEAST), prior_std)
    return prior_std


def _wrapped(angles: np.ndarray | jax.Array) -> np.ndarray:
    return (np.asarray(angles) + np.pi) % (2 * np.pi) - np.pi


def _at_samples(recording: Recording, epochs: Epochs, attitudes: EpochAttitudes, delay: Delay) -> pd.DataFrame:
    """Attitude and velocity at each IMU sample: the attitude turns evenly from epoch to epoch."""
    imu, middle = imu_of(recording), epochs.middle
    t = imu.index.to_numpy(float) - start_of(recording)
    inside = np.clip(t, middle[0], middle[-1])
    C_nb = Slerp(middle, Rotation.from_matrix(attitudes.C_nb))(inside).as_matrix()
    variance = np.stack([np.interp(inside, middle, column) for column in attitudes.variance.T], -1)
    # A random walk between two known places, about its mean over an epoch, and beyond the ends.
    width = np.interp(inside, middle, np.diff(epochs.knots))
    variance += attitudes.walk * (width / 12 + _bridge(t, middle))[:, None]
    angles, _ = angle_columns(C_nb, np.zeros_like(C_nb))
    bars = {f"{name}_std": np.sqrt(np.minimum(variance[:, i], np.pi**2 / 3)) for i, name in enumerate(angles)}
    a_n = np.einsum("tij,tj->ti", C_nb, imu[["ax", "ay", "az"]].to_numpy(float))
    a_n[:, 2] -= gravity_at(recording)
    gained = np.cumsum(0.5 * (a_n[1:] + a_n[:-1]) * np.diff(t)[:, None], 0)
    gained = np.concatenate([np.zeros((1, 3)), gained])
    for axis, name in enumerate(_VELOCITY):
        known = np.isfinite(epochs.std[:, axis])
        knots = epochs.knots[known] if known.any() else epochs.knots
        v, std = (
            (epochs.v_n[known, axis], epochs.std[known, axis]) if known.any() else (0 * knots, _UNKNOWN + 0 * knots)
        )
        off = v - np.interp(knots, t, gained[:, axis])
        angles[name] = gained[:, axis] + np.interp(t, knots, off)
        walk = np.mean(np.diff(off) ** 2 / np.diff(knots))
        by_delay = np.interp(inside, middle, epochs.f_n[:, axis] - (axis == 2) * gravity_at(recording)) * delay[1]
        bars[f"{name}_std"] = np.sqrt(np.interp(t, knots, std**2) + walk * _bridge(t, knots) + by_delay**2)
    stamps = velocities_within(recording, delay[0])[0] - delay[0]
    valid = flanked(t, stamps, float(np.median(np.diff(stamps)))) & ~after_gap(t, usual_step(t))
    return pd.DataFrame(angles | bars, index=imu.index).assign(valid=valid)


def _bridge(t: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Variance of a random walk of one unit a second that is known at some times, s."""
    k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, knots.size - 2)
    before, after = t - knots[k], knots[k + 1] - t
    beyond = (before < 0) | (after < 0)
    between = before * after / (before + after)
    found: np.ndarray = np.where(beyond, np.maximum(-before, -after), between)
    return found
