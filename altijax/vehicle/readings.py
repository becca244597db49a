"""From a recording to the arrays of the vehicle's smoother: summed IMU readings, and the instants of its states."""

from typing import Any

import numpy as np

from altijax.drives import gnss_velocities, gravity_at, imu_of, start_of, usual_step, without_bursts
from altijax.motion_estimate.intervals import MotionReadings
from altijax.motion_estimate.readings import INSTANTS, even_shares, summed_readings
from altijax.padding import bucket, padded
from altijax.recordings import Recording


def readings_of(
    recording: Recording, *, use_gyro: bool, delay: float, shortest: float, longest: float
) -> MotionReadings:
    """IMU readings and instants: at the epochs of the receiver, and between and beyond them on the IMU's clock."""
    imu, start = imu_of(recording), start_of(recording)
    t = without_bursts(imu.index.to_numpy(float) - start)
    usual = usual_step(t)
    gyro = imu[["gx", "gy", "gz"]].to_numpy(float) if use_gyro else np.zeros((t.size, 3))
    readings = np.concatenate([imu[["ax", "ay", "az"]].to_numpy(float), gyro], -1)
    epochs = _epochs(recording, t[-1], delay, shortest)
    instant, delayed = _instants(epochs, t[-1], delay, longest)
    widest = float(np.max(np.diff(np.where(delayed > 0, instant - delay, instant))))
    size = bucket(instant.size, INSTANTS)
    arrays: dict[str, Any] = summed_readings(t, usual, readings) | dict(
        instant=padded(instant, size, t[-1]),
        delayed=padded(delayed, size, 0.0),
        v_gnss=np.zeros((size, 3)),
        std=np.full((size, 3), np.inf),
        spacing=np.float64(np.median(np.diff(epochs)) if epochs.size > 1 else longest),
        share=even_shares(widest, usual),
        gravity=np.float64(gravity_at(recording)),
    )
    return MotionReadings(**arrays)


def instants_of(readings: MotionReadings, delay: float) -> np.ndarray:
    """The instants (time,), s, on the IMU's clock, within its span, at a delay of the receiver (s)."""
    t_imu = np.asarray(readings.t)
    t = np.clip(readings.instant - delay * np.asarray(readings.delayed), t_imu[0], t_imu[-1])
    return np.maximum.accumulate(t)


def _epochs(recording: Recording, end: float, delay: float, shortest: float) -> np.ndarray:
    """Times of the epochs within the IMU's span, on the receiver's clock, none too close to the one before."""
    found = gnss_velocities(recording)
    if found is None:
        return np.empty(0)
    epochs = found[0]
    epochs = epochs[(epochs - delay >= 0) & (epochs - delay <= end)]
    if epochs.size < 2:
        return epochs
    every = max(1, round(shortest / float(np.median(np.diff(epochs)))))
    return epochs[::every]


def _instants(epochs: np.ndarray, end: float, delay: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """The epochs and instants between them and beyond, and whether each is on the receiver's clock."""
    known = np.concatenate([[delay], epochs, [end + delay]])
    known = known[np.append(True, np.diff(known) > 1e-6)]
    steps = np.diff(known)
    parts = np.maximum(1, np.ceil(steps / longest - 0.5)).astype(int)
    # All intervals are filled up to the longest one: what is left over at the ends must not be longer than the others.
    widest = float(np.max((steps / parts)[1:-1], initial=0.0))
    for end in (0, -1):
        if steps[end] < 2 * longest and widest > 0:
            parts[end] = np.ceil(steps[end] / widest - 1e-9)
    between = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(known[:-1], known[1:], parts, strict=True)]
    instant = np.concatenate([known[:1], *between])
    inside = (instant >= epochs[0]) & (instant <= epochs[-1]) if epochs.size else np.zeros(instant.size, bool)
    return np.where(inside, instant, instant - delay), inside.astype(float)
