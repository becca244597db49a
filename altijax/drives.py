"""From a recording to arrays: the IMU on a uniform grid, the speed, gravity, and the reference to judge by."""

import math
import warnings
from dataclasses import dataclass

import jax
import numpy as np
import pandas as pd

from altijax.constants import STANDARD_GRAVITY
from altijax.earth import gravity_of
from altijax.recordings import Recording
from altijax.series import interpolated, longest_step, supported

# A row that comes later than this after the one before, in s, comes after a gap, not after a pause between bursts.
_PAUSE = 1.0
# Rows come in bursts where they stand this many times closer than they come on average.
_BURSTING = 3.0
# Samples on the grid: 11 hours at 100 Hz.
_MOST_SAMPLES = 2**22

# Standard deviation of a velocity whose receiver states none, before it is estimated, m/s.
_UNSTATED = 0.1

Array = jax.Array | np.ndarray


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A recording's readings for elevation as arrays, times counted from the first IMU sample.

    Attributes
    ----------
    t : (time,) s
        Uniform grid at the IMU's usual rate.
    f : (time, 3) m/s^2
        Accelerometer readings in body axes.
    yaw_rate : (time,) rad/s
        Rate of turn.
    gravity : () m/s^2
        Magnitude of gravity.
    supported : (time,)
        False where the IMU or the speed has a gap, had not begun or had ended.
    t_speed : (samples,) s
        Times of the speed sensor.
    speed : (samples,) m/s
        Its readings.
    from_wheel : ()
        True where they are wheel speeds, False for GNSS ground speeds.
    """

    t: Array
    f: Array
    yaw_rate: Array
    gravity: Array
    supported: Array
    t_speed: Array
    speed: Array
    from_wheel: Array


def drive_arrays(recording: Recording, *, turns: bool) -> tuple[Drive, np.ndarray]:
    """Readings of a recording as arrays of NumPy, in double precision.

    Parameters
    ----------
    recording : Recording
        With an IMU and wheel speeds or GNSS velocities.
    turns : bool
        Whether the rate of turn is wanted; it is zero otherwise.

    Returns
    -------
    drive : Drive
        The arrays.
    t : ndarray
        The grid's times on the recording's own axis.

    Raises
    ------
    ValueError
        If a stream is missing, or the IMU's times make a grid too long to work on.
    """
    imu, start = imu_of(recording), start_of(recording)
    t_imu = imu.index.to_numpy(float) - start
    step = usual_step(t_imu)
    count = round(t_imu[-1] / step) + 1
    if count > _MOST_SAMPLES:
        raise ValueError(
            f"recording {recording.name!r} is {t_imu[-1]:.6g} s long with {1 / step:.6g} IMU samples a second, which "
            f"makes {count} of them; more than {_MOST_SAMPLES} cannot be worked on at once: cut it into parts, or mend "
            "its times"
        )
    t = np.linspace(0, t_imu[-1], count)
    t_imu = without_bursts(t_imu)
    t_speed, speed = speed_readings(recording)
    t_speed = t_speed - start
    drive = Drive(
        t=t,
        f=interpolated(t, t_imu, imu[["ax", "ay", "az"]].to_numpy(float)),
        yaw_rate=_yaw_rate(recording, t) if turns else np.zeros(count),
        gravity=np.asarray(gravity_at(recording)),
        supported=supported(t, t_imu, longest_step(step)) & supported(t, t_speed, max(5 * usual_step(t_speed), 0.5)),
        t_speed=t_speed,
        speed=speed,
        from_wheel=np.asarray(recording.wheel is not None),
    )
    return drive, t + start


def usual_step(t: np.ndarray) -> float:
    """Time from one sample of a sensor to the next.

    Parameters
    ----------
    t : (samples,) s
        Times of the rows, not decreasing.

    Returns
    -------
    step : float
        The median interval; where rows come in bursts, the mean one, gaps of more than 1 s left out.
    """
    steps = np.diff(t)
    median = float(np.median(steps))
    return _mean_step(steps) if _in_bursts(steps) else median


def without_bursts(t: np.ndarray) -> np.ndarray:
    """Times at which rows were sampled that carry the time when they arrived, many at once.

    Parameters
    ----------
    t : (samples,) s
        Times of the rows, not decreasing.

    Returns
    -------
    t : (samples,) s
        The rows of each burst spread evenly over the time since the burst before, its last row where it was; after a
        gap, and at first, they stand at the usual step. The times themselves where they do not come in bursts.
    """
    steps = np.diff(t)
    if not _in_bursts(steps):
        return t
    mean = _mean_step(steps)

    def spread(t: np.ndarray) -> np.ndarray:
        last = np.flatnonzero(np.append(np.diff(t) > mean, True))
        before = t[last[0]] - mean * (last[0] + 1)
        return np.interp(np.arange(t.size), [-1, *last], [before, *t[last]])

    parts = np.split(t, np.flatnonzero(steps > _PAUSE) + 1)
    return np.maximum.accumulate(np.concatenate([spread(part) for part in parts]))


def _in_bursts(steps: np.ndarray) -> bool:
    return _mean_step(steps) > _BURSTING * float(np.median(steps))


def _mean_step(steps: np.ndarray) -> float:
    """Mean interval, gaps left out."""
    near = steps <= _PAUSE
    return float(np.mean(steps[near] if near.any() else steps))


def speed_readings(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Times, on the recording's axis, and readings in m/s of its wheels, else of the GNSS ground speed.

    Raises
    ------
    ValueError
        If there is neither.
    """
    if recording.wheel is not None:
        return recording.wheel.index.to_numpy(float), recording.wheel["speed"].to_numpy(float)
    if recording.gnss is not None:
        velocity = recording.gnss[["v_e", "v_n"]].dropna()
        return velocity.index.to_numpy(float), np.hypot(velocity["v_e"].to_numpy(), velocity["v_n"].to_numpy())
    raise ValueError(
        f"recording {recording.name!r} has neither wheel speeds nor GNSS velocities, and a speed is needed: "
        "add a wheel.csv, pulses.csv or gnss.csv"
    )


def gnss_velocities(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Velocities of the epochs that have a horizontal one.

    Parameters
    ----------
    recording : Recording
        With an IMU.

    Returns
    -------
    t : ndarray
        (epochs,) Times from the first IMU sample, s.
    velocity : ndarray
        (epochs, 3) East, North and up, m/s; zero where there is none.
    std : ndarray
        (epochs, 3) Standard deviations as far as known beforehand, m/s; infinite where there is no velocity. Nothing at
        all, None, where the recording has no GNSS.
    """
    if recording.gnss is None:
        return None
    gnss = recording.gnss.dropna(subset=["v_e", "v_n"])
    velocity = gnss[["v_e", "v_n", "v_u"]].to_numpy(float)
    std = np.full(velocity.shape, _UNSTATED)
    for axis, name in enumerate(("sd_e", "sd_n", "sd_u")):
        if name in gnss:
            stated = gnss[name].to_numpy(float)
            usable = np.isfinite(stated) & (stated > 0)
            if usable.any():
                std[:, axis] = np.where(usable, stated, np.median(stated[usable]))
    std = np.where(np.isfinite(velocity), std, np.inf)
    return gnss.index.to_numpy(float) - start_of(recording), np.nan_to_num(velocity), std


def wheel_pair(recording: Recording) -> tuple[str, str] | None:
    """Columns of the left and right wheel of one axle, of the rear one if there are two; None without such."""
    pairs = (("left", "right"), ("rear_left", "rear_right"), ("front_left", "front_right"))
    return next((pair for pair in pairs if recording.wheel is not None and set(pair) <= set(recording.wheel)), None)


def imu_of(recording: Recording) -> pd.DataFrame:
    """The IMU stream, which every method needs.

    Raises
    ------
    ValueError
        If it is missing or has fewer than 3 samples.
    """
    if recording.imu is None or len(recording.imu) < 3:
        raise ValueError(f"recording {recording.name!r} has no IMU stream of at least 3 samples")
    return recording.imu


def start_of(recording: Recording) -> float:
    """Time of the first IMU sample on the recording's axis, in s."""
    return float(imu_of(recording).index[0])


def reference_heights(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Times from the first IMU sample, and heights, of the reference within the IMU's span."""
    if recording.reference is None or "alt" not in recording.reference:
        raise ValueError(f"recording {recording.name!r} has no reference heights: a reference.csv with a column alt")
    heights = recording.reference["alt"].dropna()
    t = heights.index.to_numpy(float) - start_of(recording)
    inside = (t >= 0) & (t <= imu_of(recording).index[-1] - start_of(recording))
    return t[inside], heights.to_numpy(float)[inside]


def gravity_at(recording: Recording) -> float:
    """Gravity for a recording.

    Parameters
    ----------
    recording : Recording
        Any recording.

    Returns
    -------
    gravity : float
        Normal gravity in m/s^2 at the mean latitude and height of its GNSS stream, else of its site; a latitude
        without a height is taken at height zero (1 km is 3 mm/s^2). 9.80665 where no latitude is known. The reference
        is never asked.
    """
    gnss = recording.gnss
    latitude, height = recording.site_latitude, recording.site_height
    if gnss is not None and "lat" in gnss and gnss["lat"].notna().any():
        latitude = float(np.radians(gnss["lat"].mean()))
    if gnss is not None and "alt" in gnss and gnss["alt"].notna().any():
        height = float(gnss["alt"].mean())
    if latitude is None:
        return STANDARD_GRAVITY
    return gravity_of(math.sin(latitude) ** 2, 0.0 if height is None else height)


def _yaw_rate(recording: Recording, t: np.ndarray) -> np.ndarray:
    """Rate of turn on the grid: from the wheels as the paper has it, else from the gyro."""
    start, wheel, pair = start_of(recording), recording.wheel, wheel_pair(recording)
    if wheel is not None and pair is not None and recording.track_width is not None:
        left, right = (wheel[name].to_numpy(float) for name in pair)
        rate = (right - left) / recording.track_width  # as `yaw_rate_from_wheels` has it
        return interpolated(t, wheel.index.to_numpy(float) - start, rate)
    imu = imu_of(recording)
    if "gz" in imu:
        return interpolated(t, without_bursts(imu.index.to_numpy(float) - start), imu["gz"].to_numpy(float))
    warnings.warn(
        f"recording {recording.name!r} has no rate of turn (left and right wheel speeds with a track width, or a "
        "gyro): it is taken as zero, so that turns read as upward accelerations of v^2 w^2 / 2g",
        stacklevel=4,
    )
    return np.zeros(t.size)
