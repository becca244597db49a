"""Attitudes of a record from windows of its epochs: what a whole-record fit starts from, and an estimate of its own."""

from dataclasses import dataclass
from functools import partial

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from altijax.motion_estimate.intervals import Intervals, MotionReadings, instants_at, intervals_between
from altijax.motion_estimate.preintegration import relative_attitudes
from altijax.series import interpolated
from altijax.wahba import fit_windows

# Error of a mean acceleration over one second, m/s^2: Doppler noise and vibration.
_ACCELERATION_STD = 0.3
# Below this speed the direction of travel says nothing, m/s.
_SLOWEST = 1.0

# Delays of receivers, s, and how long epochs share an attitude to tell which fits, s; the attitude itself is free, rad.
_DELAYS = np.arange(-0.2, 1.05, 0.1)
_DELAY_WINDOW, _FREE = 15.0, 2.0

# XLA's newer way to compile loops for CPUs takes half as long again, for programs that run no faster.
quick_jit = partial(jax.jit, compiler_options={"xla_cpu_use_fusion_emitters": False})

_fit_windows = quick_jit(fit_windows)


@dataclass(frozen=True, kw_only=True)
class Attitudes:
    """Attitudes and velocities at the instants of a record.

    Attributes
    ----------
    C_nb : (time, 3, 3)
        Attitude.
    v_n : (time, 3) m/s
        Velocity, East, North and up.
    """

    C_nb: np.ndarray
    v_n: np.ndarray


@quick_jit
def _turned_intervals(readings: MotionReadings, delay: jax.Array) -> tuple[jax.Array, Intervals, jax.Array]:
    """The instants, the readings between them, and how the gyro turns from the beginning of each interval."""
    t = instants_at(readings, delay)
    intervals = intervals_between(readings, t)
    return t, intervals, relative_attitudes(intervals.w_b, intervals.dt)


def window_attitudes(
    readings: MotionReadings, delay: float, prior_std: float, window: int, *, gyro: bool
) -> tuple[Attitudes, np.ndarray, float]:
    """Attitude at each instant from the epochs around it, level and along the direction of travel beforehand.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings and GNSS velocities.
    delay : float
        How late the receiver's stamps are, s.
    prior_std : float
        Standard deviation of the attitude believed beforehand, rad.
    window : int
        Epochs that share an attitude, an odd number; 1 for each epoch by itself.
    gyro : bool
        Whether the attitude turns as the gyro says; without one the readings of it are zero.

    Returns
    -------
    attitudes : Attitudes
        Attitudes, and the measured velocities joined by straight lines, led on by the readings.
    covariance : (time, 3, 3) rad^2
        Of the attitude, a rotation vector in navigation axes.
    misfit : float
        Mean square of what the attitudes leave, in units of its variance: least at the right delay.
    """
    t, intervals, C = jax.device_get(_turned_intervals(readings, np.float64(delay)))
    delayed, std = np.asarray(readings.delayed) > 0, np.asarray(readings.std)
    share, upward = np.asarray(readings.share), np.array([0.0, 0.0, float(readings.gravity)])
    v = np.zeros_like(std)
    for axis, known in enumerate(np.isfinite(std).T):
        if known.any():
            v[:, axis] = interpolated(t, t[known], np.asarray(readings.v_gnss)[known, axis])
    # Before the first and after the last measured velocity nothing is known of the acceleration.
    between = delayed[1:] & delayed[:-1]
    whole = between & (intervals.duration > 0.3 * float(readings.spacing))
    dt = np.where(whole, intervals.duration, 1.0)
    f_n = np.diff(v, axis=0) / dt[:, None] + upward
    std_n = np.where(whole & (intervals.gap == 0), _ACCELERATION_STD / np.sqrt(dt), np.inf)

    half, end = C[:, np.argmin(np.abs(share[1:] - 0.5))], C[:, -1]
    middles = C @ _matrices(-0.5 * intervals.dt[..., None] * intervals.w_b)
    mean = np.einsum("ktij,ktj,t->ki", middles, intervals.f_b, np.diff(share), optimize=True)
    f_b = np.einsum("kji,kj->ki", half, mean)
    begins = np.empty_like(end)
    begins[0] = np.eye(3)
    for k in range(1, len(end)):
        begins[k] = begins[k - 1] @ end[k - 1]

    C0 = _matrices(np.outer(_course(0.5 * (v[1:] + v[:-1])), [0.0, 0.0, 1.0]))
    # Without a gyro these are attitudes that do not turn.
    turned, prior = begins @ half, np.full_like(dt, prior_std)
    shared = jax.device_get(_fit_windows(f_b, f_n, C0, prior, std_n, np.int64(window), turned))
    # Beyond the measured velocities the readings lead on.
    gained = (np.einsum("kij,kj->ki", shared.C_nb, f_b) - upward) * intervals.duration[:, None]
    beyond = np.concatenate([np.zeros((1, 3)), np.cumsum(np.where(between[:, None], 0, gained), 0)])
    C_nb = _at_instants(shared.C_nb, half, end, intervals.duration, gyro=gyro)
    # Instants that only fill up stay as the last one is: a pass spends no time on them.
    last = np.flatnonzero(intervals.duration > 0)[-1] + 1
    C_nb[last:] = C_nb[last]
    v_n = v + beyond - beyond[np.argmax(np.isfinite(std[:, 0]))]
    covariance = np.concatenate([shared.covariance[:1], shared.covariance])
    misfit = np.sum(whole * shared.misfit**2) / max(np.sum(whole), 1)
    return Attitudes(C_nb=C_nb, v_n=v_n), covariance, float(misfit)


def _at_instants(
    C_middle: np.ndarray, half: np.ndarray, whole: np.ndarray, duration: np.ndarray, *, gyro: bool
) -> np.ndarray:
    """Attitudes at the instants from those amid the intervals: carried by the gyro from both sides and averaged.

    Without one the attitude turns evenly from the middle of an interval to that of the next.
    """
    begin = C_middle @ np.swapaxes(half, -1, -2)
    end = begin @ whole
    ahead, behind = np.concatenate([begin, end[-1:]]), np.concatenate([begin[:1], end])
    before, after = np.append(duration[:1], duration), np.append(duration, duration[-1:])
    part = np.full(before.size, 0.5)
    if not gyro:
        # Where both intervals have no length either share is right.
        np.divide(after, before + after, out=part, where=before + after > 0)
    turn = Rotation.from_matrix(np.swapaxes(ahead, -1, -2) @ behind).as_rotvec()
    return ahead @ _matrices(part[:, None] * turn)


def _matrices(rotvec: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(rotvec.reshape(-1, 3)).as_matrix().reshape(*rotvec.shape, 3)


def _course(v: np.ndarray) -> np.ndarray:
    """Direction of travel, counter-clockwise from East, held where it is too slow to tell."""
    k = course_rows(v)
    return np.arctan2(v[k, 1], v[k, 0])


def course_rows(v: np.ndarray) -> np.ndarray:
    """Of each velocity (time, 3), m/s, the row whose course it has: its own, or the last one fast enough to tell."""
    fast = np.hypot(v[:, 0], v[:, 1]) > _SLOWEST
    last = np.maximum.accumulate(np.where(fast, np.arange(len(v)), -1))
    return np.where(last < 0, np.argmax(fast), last)


def epochs_within(count: float) -> int:
    """The odd number nearest to a number of epochs, 3 or more."""
    return 2 * round(max(count - 1, 2) / 2) + 1


def delay_by_windows(readings: MotionReadings) -> float:
    """How late the receiver's stamps are, by the windows of epochs that fit best.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings, the gyro's among them, and GNSS velocities.

    Returns
    -------
    delay : float
        The least of a parabola through the best of a grid and its neighbours, s.
    """
    window = epochs_within(_DELAY_WINDOW / float(readings.spacing))
    misfits = np.array([window_attitudes(readings, delay, _FREE, window, gyro=True)[2] for delay in _DELAYS])
    k = int(np.clip(np.argmin(misfits), 1, len(_DELAYS) - 2))
    before, least, after = misfits[k - 1 : k + 2]
    bend = before - 2 * least + after
    offset = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(_DELAYS[k] + np.clip(offset, -1, 1) * (_DELAYS[1] - _DELAYS[0]))
