"""A recording in the steps of the speed filter: mean readings, vibration, standstills, and the aid up to its end."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from altijax.calibration.priors import prior_of
from altijax.calibration.records import Calibration, correct_imu
from altijax.drives import gravity_at, imu_of, start_of
from altijax.recordings import Recording
from altijax.series import means_between
from altijax.speed_estimate.model import OF_CONSTANTS, SPREADS, STATES

STEP = 0.2
"""Duration of a step in s: long against a car's vibration and rocking, short against its manoeuvres."""

_SHORTEST = 2.0
# What is faster than this is vibration.
_VIBRATION_WINDOW = 0.5
# A car stands where the steps' means spread less than this over two seconds, and less than half of what was ever seen
# while the aid said that it moved.
_STILL_WINDOW, _STILL_FORCE, _STILL_RATE, _MOVING_SPEED = 2.0, 0.05, 0.004, 0.5


@dataclass(frozen=True, kw_only=True)
class SpeedDrive:
    """Readings of a recording, in steps and at the IMU's own rate, times from the first IMU sample."""

    t: np.ndarray
    usual: float  # time between samples
    f_b: np.ndarray
    w_b: np.ndarray
    ends: np.ndarray
    f_steps: np.ndarray
    w_steps: np.ndarray
    vibration: np.ndarray
    spread: np.ndarray
    stamp_aid: np.ndarray
    t_aid: np.ndarray
    aid: np.ndarray
    gravity: float
    states_covariance: np.ndarray


def drive_in_steps(recording: Recording, calibration: Calibration | None, until: float) -> SpeedDrive:
    """Readings of a recording, corrected by what was calibrated; `t_aid` are the aid's stamps less its delay.

    Constants that no speed depends on, such as a vertical speed at the start, are left out. The aid is kept whole, for
    `steps_until` to cut, but gravity is that of the places up to `until`.
    """
    imu, start = imu_of(recording), start_of(recording)
    t = imu.index.to_numpy(float) - start
    if "gx" not in imu or t[-1] < _SHORTEST:
        raise ValueError(
            f"recording {recording.name!r} has no gyro, or less than {_SHORTEST} s of it: speed needs both"
        )
    values = {} if calibration is None else calibration.known()
    imu = correct_imu(imu, calibration)
    f_b, w_b = (imu[[f"{sensor}{axis}" for axis in "xyz"]].to_numpy(float) for sensor in "ag")
    mounting = Rotation.from_euler("ZY", [values.get("mounting_yaw", 0.0), -values.get("mounting_pitch", 0.0)])
    f_b, w_b = (readings @ mounting.as_matrix().T for readings in (f_b, w_b))
    edges = STEP * np.arange(int(t[-1] / STEP) + 1)
    usual = float(np.median(np.diff(t)))
    window = max(round(_VIBRATION_WINDOW / usual), 2)
    fast = w_b[:, 1] - uniform_filter1d(w_b[:, 1], window)
    f_steps, w_steps, vibration = (means_between(edges, t, x) for x in (f_b, w_b, (fast * fast)[:, None]))
    rolling = pd.DataFrame(np.hstack([f_steps, w_steps])).rolling(
        round(_STILL_WINDOW / STEP) + 1, center=True, min_periods=round(1 / STEP)
    )
    deviation = rolling.std().fillna(np.inf).to_numpy()
    t_aid, aid = aid_of(recording)
    delay = "gnss_delay" if recording.wheel is None else "wheel_delay"
    gnss = recording.gnss
    return SpeedDrive(
        t=t,
        usual=usual,
        f_b=f_b,
        w_b=w_b,
        ends=edges[1:],
        f_steps=f_steps,
        w_steps=w_steps,
        vibration=vibration[:, 0],
        spread=np.stack([deviation[:, :3].max(1), deviation[:, 3:].max(1)], -1),
        stamp_aid=t_aid - start,
        t_aid=t_aid - start - values.get(delay, 0.0),
        aid=aid * (values.get("wheel_scale", 1.0) if recording.wheel is not None else 1.0),
        gravity=gravity_at(replace(recording, gnss=None if gnss is None else gnss[: start + until])),
        states_covariance=_states_covariance(calibration, delay),
    )


def _states_covariance(calibration: Calibration | None, delay: str) -> np.ndarray:
    """Covariance of the filter's states before the first sample, all of them zero but for how the drive begins."""
    names, signs = zip(*(OF_CONSTANTS | {"imu_delay": (delay, -1.0)}).values(), strict=True)
    rows = [list(STATES).index(state) for state in OF_CONSTANTS]
    _, known = prior_of(names, calibration, {name: spread for name, (spread, _) in SPREADS.items()})
    covariance = np.diag(np.square(list(STATES.values())))
    covariance[np.ix_(rows, rows)] = known * np.outer(signs, signs)
    return covariance


def from_first_aid(recording: Recording) -> Recording:
    """The recording from when its speed is known: where the first aid comes later than a second, from there on.

    Parameters
    ----------
    recording : Recording
        With an IMU.

    Returns
    -------
    recording : Recording
        The same but for its IMU.

    Raises
    ------
    ValueError
        If no aid lies within the time of the IMU.
    """
    imu, (t_aid, _) = imu_of(recording), aid_of(recording)
    t_aid = t_aid[(t_aid >= imu.index[0]) & (t_aid <= imu.index[-1])]
    if not t_aid.size:
        raise ValueError(
            f"recording {recording.name!r} has no wheel or GNSS speed within the time of its IMU; are the streams on "
            "one clock?"
        )
    return recording if t_aid[0] <= imu.index[0] + 1.0 else replace(recording, imu=imu[t_aid[0] :])


def aid_of(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    if recording.wheel is not None:
        speed = recording.wheel["speed"].dropna()
        return speed.index.to_numpy(float), speed.to_numpy(float)
    if recording.gnss is not None:
        return speed_of(recording.gnss)
    return np.zeros(0), np.zeros(0)


def speed_of(frame: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Speed along the path; a vertical speed that was not recorded counts as zero."""
    velocity = frame[["v_e", "v_n", "v_u"]] if "v_u" in frame else frame[["v_e", "v_n"]]
    velocity = velocity.dropna(subset=["v_e", "v_n"]).fillna(0.0)
    return velocity.index.to_numpy(float), np.linalg.norm(velocity.to_numpy(float), axis=1)


def initial_state(drive: SpeedDrive, until: float, speed: float | None, pitch: float | None) -> tuple[float, float]:
    """Speed and pitch at the start, from the aid of the first second."""
    early = (np.abs(drive.t_aid) <= 1.0) & (drive.stamp_aid <= until)
    if speed is None:
        if not early.any():
            raise ValueError("there is no wheel or GNSS speed in the first second: give initial_speed")
        speed = float(drive.aid[early].mean())
    if pitch is None:
        gained = np.polyfit(drive.t_aid[early], drive.aid[early], 1)[0] if early.sum() > 3 else 0.0
        force = drive.f_steps[: round(1 / STEP), 0].mean() - gained
        pitch = float(np.arcsin(np.clip(force / drive.gravity, -0.5, 0.5)))
    return speed, pitch


def steps_until(drive: SpeedDrive, until: float) -> dict[str, np.ndarray]:
    """Series that `filter_speed` takes, the aid after `until` left out."""
    known = (drive.t_aid >= 0) & (drive.stamp_aid <= until) & (drive.t_aid <= drive.ends[-1])
    t_aid, aid = drive.t_aid[known], drive.aid[known]
    step = np.clip(np.ceil(t_aid / STEP).astype(int) - 1, 0, drive.ends.size - 1)
    count = np.bincount(step, minlength=drive.ends.size)
    aided = count > 0
    mean_speed = np.bincount(step, aid, drive.ends.size) / np.maximum(count, 1)
    mean_time = np.bincount(step, t_aid, drive.ends.size) / np.maximum(count, 1)
    past = drive.ends <= until
    speed = np.interp(drive.ends, t_aid, aid) if t_aid.size else np.zeros(drive.ends.size)
    moving = past & (speed > _MOVING_SPEED)
    # over a second: long against the noise of the aid
    sides = [np.interp(drive.ends + shift, t_aid, aid) if t_aid.size else 0 * speed for shift in (-0.5, 0.5)]
    acceleration = sides[1] - sides[0]
    quietest = drive.spread[moving].min(0) if moving.any() else np.full(2, np.inf)
    still: np.ndarray = np.all(drive.spread < np.minimum([_STILL_FORCE, _STILL_RATE], 0.5 * quietest), axis=1)
    return {
        "f_b": drive.f_steps,
        "w_b": drive.w_steps,
        "vibration": drive.vibration,
        "still": still,
        "aid_speed": mean_speed,
        "aid_acceleration": acceleration,
        "aid_lead": np.where(aided, mean_time - drive.ends, 0.0),
        "aided": aided,
    }
