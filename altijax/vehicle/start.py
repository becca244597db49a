"""A trajectory to begin with: attitudes by windows of epochs, velocities joined by lines, positions summed up."""

from dataclasses import replace
from typing import Any

import numpy as np

from altijax.drives import imu_of, start_of
from altijax.motion_estimate.intervals import MotionReadings
from altijax.motion_estimate.readings import motion_readings
from altijax.motion_estimate.start import delay_by_windows, epochs_within, window_attitudes
from altijax.recordings import Recording
from altijax.vehicle.inertial import Trajectory
from altijax.vehicle.measurements.doppler_velocity import USUAL_DELAY
from altijax.vehicle.parts import Rows
from altijax.vehicle.readings import instants_of
from altijax.vehicle.sensors import Use, layout_of

_WINDOW = 15.0  # s
# Standard deviation of the attitude believed beforehand: level and along the course, rad.
_FREE, _ALONG = 2.0, 0.3
# Of a velocity that a wheel and a gyro tell, m/s.
_BY_WHEEL = 0.5


def first_trajectory(
    recording: Recording, use: Use, readings: MotionReadings, rows: dict[str, Rows], delay: float
) -> Trajectory:
    """The trajectory that a search begins with, at a delay of the receiver (s)."""
    layout, gyro = layout_of(use), "gyro" in use
    t = instants_of(readings, delay)
    by_gnss = "velocity" in rows
    if by_gnss:
        seen: dict[str, Any] = {"v_gnss": rows["velocity"].value, "std": rows["velocity"].std}
    else:
        velocity = _by_wheel(recording, t, gyro=gyro)
        distinct = np.append(True, np.diff(t) > 1e-9)
        std = np.where(distinct[:, None], np.full_like(velocity, _BY_WHEEL), np.inf)
        seen = {"instant": t, "delayed": distinct.astype(float), "v_gnss": velocity, "std": std, "spacing": np.ones(())}
    started = replace(readings, **seen)
    steps = np.diff(t)
    window = epochs_within(_WINDOW / float(np.median(steps[steps > 1e-9]))) if gyro else 1
    prior = _ALONG if "course" in use or not gyro else _FREE
    start, _, _ = window_attitudes(started, delay if by_gnss else 0.0, prior, window, gyro=gyro)
    v, dt = np.asarray(start.v_n), np.diff(t)[:, None]
    speed = np.linalg.norm(v, axis=1)[:, None]
    x = np.zeros((t.size, layout.size))
    x[:, layout.at("velocity")] = v
    for name, rate in (("position", v), ("way", speed)):
        steps = 0.5 * (rate[1:] + rate[:-1]) * dt
        x[:, layout.at(name)] = np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, 0)])
    states: dict[str, Any] = {"C_nb": np.asarray(start.C_nb), "x": x}
    return Trajectory(**states)


def _by_wheel(recording: Recording, t: np.ndarray, *, gyro: bool) -> np.ndarray:
    """Velocities (time, 3) of a vehicle that starts to the East and turns as its gyro says."""
    imu, begin = imu_of(recording), start_of(recording)
    samples = imu.index.to_numpy(float) - begin
    assert recording.wheel is not None
    wheel = recording.wheel["speed"].dropna()
    speed = np.interp(t, wheel.index.to_numpy(float) - begin, wheel.to_numpy(float))
    yaw = np.zeros_like(t)
    if gyro:
        rate = imu["gz"].to_numpy(float)
        turned = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(samples)))
        yaw = np.interp(t, samples, turned)
    return np.stack([speed * np.cos(yaw), speed * np.sin(yaw), np.zeros_like(t)], -1)


def receiver_delay(recording: Recording) -> float:
    """How late the receiver's stamps are, s: where windows of epochs, turned by the gyro, fit best."""
    return delay_by_windows(motion_readings(recording, use_gyro=True, delay=USUAL_DELAY))
