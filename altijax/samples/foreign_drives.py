"""Simulated drives that share no formula with the estimators: NumPy alone, to judge their error bars by.

Heading, slope, speed and cant are sums of sines; the specific force comes from differences of the exact velocity on a
grid eight times finer than the IMU's, so that neither the motions nor the sensors are those of the rest of the package.
"""

from typing import Any

import numpy as np
import pandas as pd

from altijax.recordings import Recording

GRAVITY = 9.80665
MISMATCHES: dict[str, dict[str, Any]] = {
    "nominal": {},
    "vibration": dict(vibration=1.5, gyro_vibration=0.05),
    "scale": dict(accelerometer_scale=1.03, gyro_scale=1.03),
    "delay": dict(delay=0.5),
    "mounting 5": dict(mounting=tuple(np.radians([5, 5, 5]))),
    "mounting 15": dict(mounting=tuple(np.radians([10, 15, 15]))),
    "mounting 30": dict(mounting=tuple(np.radians([20, 30, 30]))),
    "lever": dict(lever=(1.0, 0.3, 1.0)),
    "cant": dict(cant=0.06, mean_cant=0.05),
    "slip": dict(sideslip=0.05, wheel_slip=0.02),
    "lasting receiver error": dict(receiver_memory=20.0),
}


class _Sines:
    """A smooth random function and its derivatives."""

    def __init__(
        self,
        rng: np.random.Generator,
        rms: float,
        shortest: float,
        longest: float,
        mean: float = 0.0,
        trend: float = 0.0,
        count: int = 5,
    ) -> None:
        self.rate = 2 * np.pi / np.exp(rng.uniform(np.log(shortest), np.log(longest), count))
        self.phase = rng.uniform(0, 2 * np.pi, count)
        size = rng.normal(size=count)
        self.size = rms * np.sqrt(2) * size / np.sqrt((size**2).sum())
        self.mean, self.trend = mean, trend

    def __call__(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        waves = np.sin(np.multiply.outer(t, self.rate) + self.phase + derivative * np.pi / 2)
        line = {0: self.mean + self.trend * t, 1: self.trend}.get(derivative, 0.0)
        return (self.size * self.rate**derivative * waves).sum(-1) + line


def _attitude(roll: Any, pitch: Any, yaw: Any) -> np.ndarray:
    """C_nb for right side down, nose up, counter-clockwise from East."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    rows = (
        (cp * cy, -cr * sy - sp * cy * sr, sr * sy - cr * sp * cy),
        (cp * sy, cr * cy - sp * sr * sy, -cy * sr - cr * sp * sy),
        (sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(np.broadcast_arrays(*row), -1) for row in rows], -2)


def _band(rng: np.random.Generator, count: int, dt: float, low: float, high: float, rms: float) -> np.ndarray:
    """Noise between two frequencies."""
    spectrum = np.fft.rfft(rng.normal(size=(count, 3)), axis=0)
    f = np.fft.rfftfreq(count, dt)
    spectrum[(f < low) | (f > high)] = 0
    series = np.fft.irfft(spectrum, count, axis=0)
    return series * rms / np.maximum(series.std(0), 1e-12)


def _constants(seed: int) -> dict[str, Any]:
    """Of an instrument and its mounting, drawn anew for each drive."""
    r = np.random.default_rng(1000 + seed)
    return dict(
        accelerometer_bias=r.normal(size=3) * 0.15,
        gyro_bias=r.normal(size=3) * 0.005,
        mounting=(0.03 * r.normal(), 0.05 * r.normal(), 0.05 * r.normal()),
        vibration=0.3,
        gyro_vibration=0.01,
        gyro_noise=0.002,
        cant=0.03,
        delay=0.1,
    )


def foreign_drive(seed: int, mismatch: str = "nominal", **changed: Any) -> Recording:
    """A drive of a car, with a reference of its motion.

    Parameters
    ----------
    seed : int
        Of the road, the sensors and their noise.
    mismatch : str
        A key of `MISMATCHES`: what is unlike what estimators presume.
    **changed : float or tuple
        Keyword arguments of the simulation, such as duration (s), rate (Hz) or gnss_std (m/s).

    Returns
    -------
    recording : Recording
        IMU, wheel speeds, Doppler velocities and the reference, of the middle of the rear axle but for the attitude.

    Raises
    ------
    KeyError
        If there is no such mismatch.
    """
    return _drive(seed, **(_constants(seed) | MISMATCHES[mismatch] | changed))


def drive_errors(estimate: pd.DataFrame, recording: Recording) -> pd.DataFrame:
    """By how much an estimate of such a drive is off: estimate less truth.

    Parameters
    ----------
    estimate : DataFrame
        Of `estimate_drive`.
    recording : Recording
        The drive.

    Returns
    -------
    errors : DataFrame
        Of roll, pitch, heading (rad), v_e, v_n, v_u, speed (m/s) and height (m).
    """
    reference = recording.reference
    assert reference is not None
    velocity, angles = ["v_e", "v_n", "v_u"], ["roll", "pitch", "heading"]
    truth = reference[angles + velocity].assign(
        speed=np.sqrt((reference[velocity] ** 2).sum(axis=1)), height=reference["alt"] - reference["alt"].iloc[0]
    )
    error = estimate[list(truth)] - truth
    error[angles] = np.mod(error[angles] + np.pi, 2 * np.pi) - np.pi
    return error


def _drive(
    seed,
    duration=90.0,
    rate=50.0,
    mean_speed=12.0,
    turning=0.35,
    cant=0.02,
    mean_cant=0.0,
    suspension=-0.006,
    mounting=(0, 0, 0),
    lever=(0, 0, 0),
    accelerometer_bias=(0, 0, 0),
    gyro_bias=(0, 0, 0),
    accelerometer_scale=1.0,
    gyro_scale=1.0,
    accelerometer_noise=0.02,
    gyro_noise=0.001,
    vibration=0.0,
    gyro_vibration=0.0,
    squat=0.0,
    trim=0.0,
    trim_time=5.0,
    wheel=True,
    wheel_scale=1.0,
    wheel_slip=0.0,
    sideslip=0.0,
    gnss_rate=1.0,
    gnss_std=0.05,
    delay=0.0,
    receiver_memory=0.0,
) -> Recording:
    """The drive, all of its constants given."""
    rng = np.random.default_rng(seed)
    fine = 8
    n = int(duration * rate) * fine + 1
    t = np.arange(n) / (rate * fine)
    slope = _Sines(rng, 0.045, 12, 60)
    course = _Sines(rng, turning, 10, 45, trend=rng.normal() * 0.01)
    wanted = _Sines(rng, 0.2 * mean_speed, 10, 50, mean=mean_speed)
    canted = _Sines(rng, cant, 10, 40, mean=mean_cant)
    speed = np.maximum(wanted(t), 2.0)
    along = np.where(wanted(t) > 2, wanted(t, 1), 0.0)
    lateral = speed * course(t, 1) * np.cos(slope(t))
    roll = canted(t) + suspension * lateral
    slip = sideslip * lateral / 5.0
    pitch, yaw = slope(t), course(t) + slip
    roll_rate, pitch_rate, yaw_rate = np.gradient(roll, t), slope(t, 1), course(t, 1) + np.gradient(slip, t)
    direction = np.stack([np.cos(pitch) * np.cos(course(t)), np.cos(pitch) * np.sin(course(t)), np.sin(pitch)], -1)
    velocity = speed[:, None] * direction
    acceleration = np.gradient(velocity, t, axis=0, edge_order=2)
    C = _attitude(roll, pitch, yaw)
    w = np.stack(
        [
            roll_rate + np.sin(pitch) * yaw_rate,
            -pitch_rate * np.cos(roll) + np.cos(pitch) * np.sin(roll) * yaw_rate,
            pitch_rate * np.sin(roll) + np.cos(pitch) * np.cos(roll) * yaw_rate,
        ],
        -1,
    )
    f = np.einsum("tji,tj->ti", C, acceleration + np.array([0, 0, GRAVITY]))
    arm = np.broadcast_to(np.asarray(lever, float), w.shape)
    f = f + np.cross(np.gradient(w, t, axis=0), arm) + np.cross(w, np.cross(w, arm))
    steps = np.diff(t)[:, None]
    position = np.concatenate([np.zeros((1, 3)), np.cumsum((velocity[1:] + velocity[:-1]) / 2 * steps, 0)])
    f[:, 0] *= 1 + squat
    if trim:
        keep = np.exp(-(t[1] - t[0]) / trim_time)
        push, state = rng.normal(size=n) * trim * np.sqrt(1 - keep * keep), rng.normal() * trim
        for i in range(n):
            f[i, 0] += state
            state = keep * state + push[i]
    M = _attitude(*map(np.float64, mounting))  # sensor axes in the body
    each = slice(None, None, fine)
    dt, samples = 1 / rate, t[each].size

    def readings(x: np.ndarray, bias: Any, scale: float, noise: float, shaking: float) -> np.ndarray:
        y = x[each] @ M + np.asarray(bias) + noise * rng.normal(size=(samples, 3))
        if shaking:
            y = y + _band(rng, samples, dt, 4, min(15, 0.45 * rate), shaking) * (speed[each] / mean_speed)[:, None]
        return y * scale

    f_read = readings(f, accelerometer_bias, accelerometer_scale, accelerometer_noise, vibration)
    w_read = readings(w, gyro_bias, gyro_scale, gyro_noise, gyro_vibration)
    index = pd.Index(t[each], name="t")
    imu = pd.DataFrame(np.hstack([f_read, w_read]), index=index, columns=["ax", "ay", "az", "gx", "gy", "gz"])
    t_gnss = np.arange(0, duration + 1e-9, 1 / gnss_rate)
    t_gnss = t_gnss[t_gnss >= delay]
    error = rng.normal(size=(t_gnss.size, 3))
    if receiver_memory:
        keep = np.exp(-1 / (gnss_rate * receiver_memory))
        for i in range(1, t_gnss.size):
            error[i] = keep * error[i - 1] + np.sqrt(1 - keep * keep) * error[i]
    v_gnss = np.stack([np.interp(t_gnss - delay, t, v) for v in velocity.T], -1) + error * gnss_std * np.array(
        [1, 1, 2]
    )
    gnss = pd.DataFrame(v_gnss, index=pd.Index(t_gnss, name="t"), columns=["v_e", "v_n", "v_u"])
    wheels = None
    if wheel:
        t_wheel = t[each][:: max(int(rate // 20), 1)]
        turned = np.interp(t_wheel, t, speed * (1 + wheel_slip * along)) / wheel_scale
        turned = turned + 0.01 * rng.normal(size=t_wheel.size)
        wheels = pd.DataFrame({"speed": turned}, index=pd.Index(t_wheel, name="t"))
    C_nb = C[each] @ M
    reference = pd.DataFrame(
        {
            "roll": np.arctan2(C_nb[:, 2, 1], C_nb[:, 2, 2]),
            "pitch": np.arcsin(C_nb[:, 2, 0]),
            "heading": np.mod(np.pi / 2 - np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0]), 2 * np.pi),
            "v_e": velocity[each][:, 0],
            "v_n": velocity[each][:, 1],
            "v_u": velocity[each][:, 2],
            "alt": position[each][:, 2] + 100.0,
        },
        index=index,
    )
    # The gravity of the simulation is the standard one.
    place = {"lat": 45.0, "lon": 10.0, "alt": 0.0}
    gnss = gnss.assign(**place)
    return Recording(name=f"foreign drive {seed}", imu=imu, wheel=wheels, gnss=gnss, reference=reference)
