"""A vehicle at rest: no velocity, no turning, found from an IMU that does not move."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.drives import imu_of, start_of
from altijax.recordings import Recording
from altijax.series import means_between
from altijax.vehicle.parts import Instant, Kind, Rows, State, rate_of

# What is left of a standing car's velocity and rate while its engine idles: m/s and rad/s.
_VELOCITY, _RATE = 0.01, 0.003
# A car stands where means of 0.2 s spread less than this over two seconds, m/s^2 and rad/s, and no stream has it move
# faster than this, m/s.
_STEP, _WINDOW = 0.2, 11
_FORCE, _TURN, _MOVING = 0.05, 0.004, 0.5


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Velocity (m/s) and rate (rad/s) of the IMU (6,)."""
    return jnp.concatenate([state["velocity"], rate_of(state, at)])


def still(recording: Recording, t: np.ndarray) -> np.ndarray:
    """Instants of which the IMU is quieter than a car's usually is, and far quieter than it ever was in motion."""
    imu, start = imu_of(recording), start_of(recording)
    samples = imu.index.to_numpy(float) - start
    edges = np.arange(0.0, samples[-1], _STEP)
    if "gx" not in imu or edges.size < 2 * _WINDOW:
        return np.zeros(t.size, bool)
    series = imu[["ax", "ay", "az", "gx", "gy", "gz"]].to_numpy(float)
    spread = pd.DataFrame(means_between(edges, samples, series)).rolling(_WINDOW, center=True).std().to_numpy()
    quietness = np.stack([spread[:, :3].max(1), spread[:, 3:].max(1)], -1)
    ends = edges[1:]
    speed = np.zeros(ends.size)
    for stamp, value in _speeds(recording):
        speed = np.maximum(speed, np.interp(ends, stamp - start, value))
    moving = np.isfinite(quietness[:, 0]) & (speed > _MOVING)
    quietest = quietness[moving].min(0) if moving.any() else np.full(2, np.inf)
    quiet = np.all(quietness < np.minimum([_FORCE, _TURN], 0.5 * quietest), axis=1) & (speed < _MOVING)
    return quiet[np.clip(np.searchsorted(ends, t), 0, ends.size - 1)]


def _speeds(recording: Recording) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Times and speeds of the streams that have any."""
    if recording.wheel is not None:
        wheel = recording.wheel["speed"].dropna()
        yield wheel.index.to_numpy(float), wheel.to_numpy(float)
    if recording.gnss is not None:
        gnss = recording.gnss[["v_e", "v_n"]].dropna()
        if len(gnss):
            yield gnss.index.to_numpy(float), np.hypot(*gnss.to_numpy(float).T)


def measured(recording: Recording, t: np.ndarray) -> Rows:
    """Zeros at the instants of standstills."""
    quiet = still(recording, t)
    std = np.where(quiet[:, None], [_VELOCITY] * 3 + [_RATE] * 3, np.inf)
    return Rows(value=np.zeros((t.size, 6)), std=std, stamp=t)


KIND = Kind(rows=("rest_e", "rest_n", "rest_u", "rest_gx", "rest_gy", "rest_gz"), expected=expected, measured=measured)
