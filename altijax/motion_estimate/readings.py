"""From a recording to the arrays of the motion estimators: summed IMU readings, and instants with velocities."""

from typing import Any

import numpy as np

from altijax.drives import gnss_velocities, gravity_at, imu_of, start_of
from altijax.motion_estimate.intervals import MotionReadings
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.series import after_gap

_ACCELEROMETER, _GYRO = ["ax", "ay", "az"], ["gx", "gy", "gz"]
# The smallest sizes that samples, instants and steps are filled up to, so that recordings of like length share what was
# compiled, and what steps are rounded up to.
_SAMPLES, INSTANTS, _STEPS, _EVEN = 16384, 64, 16, 8
# Readings go on for as long as delays may yet move the last instants beyond them, s.
_BEYOND = 1.0


def motion_readings(recording: Recording, *, use_gyro: bool, delay: float, longest: float = 1.0) -> MotionReadings:
    """Arrays of a recording, of NumPy and in double precision.

    Parameters
    ----------
    recording : Recording
        With an IMU and GNSS velocities.
    use_gyro : bool
        Whether the rates are taken; they are zero otherwise.
    delay : float
        About how late the receiver's stamps are, in s; it decides which epochs the IMU covers.
    longest : float, optional
        About how long intervals between instants may be, in s, whatever the time between epochs.

    Returns
    -------
    readings : MotionReadings
        The arrays.

    Raises
    ------
    ValueError
        If a stream is missing or the velocities do not overlap with the IMU.
    """
    imu, start = imu_of(recording), start_of(recording)
    t = imu.index.to_numpy(float) - start
    usual = float(np.median(np.diff(t)))
    gyro = imu[_GYRO].to_numpy(float) if use_gyro else np.zeros((t.size, 3))
    readings = np.concatenate([imu[_ACCELEROMETER].to_numpy(float), gyro], -1)
    epochs, velocity, std = velocities_within(recording, delay)
    spacing = float(np.clip(np.median(np.diff(epochs)), usual, 1.0))
    instant, row = _with_instants_between(epochs, t[-1] + delay, delay, min(spacing, longest))
    delayed = np.ones(instant.size)
    # What lies before the first and after the last epoch stands on the IMU's clock.
    before, after = instant < epochs[0], instant > epochs[-1]
    instant = np.where(before | after, instant - delay, instant)
    delayed[before | after] = 0.0
    there = row >= 0
    v_gnss = np.where(there[:, None], velocity[row], 0.0)
    std = np.where(there[:, None], std[row], np.inf)
    longest = float(np.max(np.diff(np.where(delayed > 0, instant - delay, instant))))
    size = bucket(instant.size, INSTANTS)
    arrays: dict[str, Any] = summed_readings(t, usual, readings) | dict(
        instant=padded(instant, size, t[-1]),
        delayed=padded(delayed, size, 0.0),
        v_gnss=padded(v_gnss, size, 0.0),
        std=padded(std, size, np.inf),
        spacing=np.float64(spacing),
        share=even_shares(longest, usual),
        gravity=np.float64(gravity_at(recording)),
    )
    return MotionReadings(**arrays)


def velocities_within(recording: Recording, delay: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """GNSS velocities that lie within the time of the IMU.

    Parameters
    ----------
    recording : Recording
        With an IMU and GNSS velocities.
    delay : float
        How late the receiver's stamps are, s.

    Returns
    -------
    t, velocity, std : ndarray
        As of `gnss_velocities`; the times as stamped.

    Raises
    ------
    ValueError
        If there are none, or fewer than 3 lie within the time of the IMU.
    """
    last = imu_of(recording).index[-1] - start_of(recording)
    found = gnss_velocities(recording)
    if found is None:
        raise ValueError(
            f"recording {recording.name!r} has no GNSS velocities, which estimate_motion needs (wheel speeds have no "
            "direction): add a gnss.csv with v_e, v_n or speed, course"
        )
    epochs, velocity, std = found
    inside = (epochs - delay >= 0) & (epochs - delay <= last)
    if inside.sum() < 3:
        raise ValueError(
            f"recording {recording.name!r}: {inside.sum()} GNSS velocities lie within the time of the IMU and 3 are "
            "needed; are the streams on one clock?"
        )
    return epochs[inside], velocity[inside], std[inside]


def summed_readings(t: np.ndarray, usual: float, readings: np.ndarray) -> dict[str, np.ndarray]:
    """Readings with their integrals, filled up: what `MotionReadings` calls t, readings and sums.

    Parameters
    ----------
    t : (samples,) s
        Times of the IMU.
    usual : float
        Usual time between them, s.
    readings : (samples, 6)
        Specific force (m/s^2) and angular rate (rad/s).

    Returns
    -------
    arrays : dict of str to ndarray
        By these names.
    """
    gaps = np.append(after_gap(t, usual)[1:], False)
    readings = np.concatenate([readings, np.zeros((t.size, 1))], -1)
    pad = bucket(t.size + int(np.ceil(_BEYOND / usual)), _SAMPLES) - t.size
    t = np.append(t, t[-1] + usual * np.arange(1, pad + 1))
    readings = np.concatenate([readings, np.repeat(readings[-1:], pad, 0)])
    areas = 0.5 * (readings[1:] + readings[:-1]) * np.diff(t)[:, None]
    sums = np.concatenate([np.zeros((1, 7)), np.cumsum(areas, 0)])
    # A gap's indicator is a step, not a straight line: kept as a sum alone.
    lost = np.where(np.append(gaps, np.zeros(pad, bool))[:-1], np.diff(t), 0.0)
    sums[:, 6] = np.append(0.0, np.cumsum(lost))
    return {"t": t, "readings": readings, "sums": sums}


def even_shares(longest: float, usual: float) -> np.ndarray:
    """Where the steps of an interval begin and end, from 0 to 1, filled up: as many as resolve the IMU's samples.

    Parameters
    ----------
    longest : float
        The longest interval, s.
    usual : float
        Usual time between samples, s.

    Returns
    -------
    share : ndarray
        (steps + 1,) Steps that only fill up have no length; the others are an even number.
    """
    steps = int(np.ceil(longest / usual / _EVEN)) * _EVEN
    return np.minimum(np.arange(bucket(steps, _STEPS) + 1) / steps, 1.0)


def _with_instants_between(
    epochs: np.ndarray, end: float, begin: float, longest: float
) -> tuple[np.ndarray, np.ndarray]:
    """The epochs, and instants that leave no interval longer than about `longest`; the row of each, -1 for those."""
    first = [begin] if epochs[0] - begin > 1e-6 else []
    last = [end] if end - epochs[-1] > 1e-6 else []
    known = np.concatenate([first, epochs, last])
    rows = np.concatenate([[-1] * len(first), np.arange(epochs.size), [-1] * len(last)]).astype(int)
    instants, chosen = [known[:1]], [rows[:1]]
    for a, b, row in zip(known[:-1], known[1:], rows[1:], strict=True):
        parts = max(1, int(np.ceil((b - a) / longest - 0.5)))
        instants.append(np.linspace(a, b, parts + 1)[1:])
        chosen.append(np.append(np.full(parts - 1, -1), row))
    return np.concatenate(instants), np.concatenate(chosen)
