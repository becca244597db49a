"""Mean specific forces between GNSS velocities, in body and in navigation axes, after [chalko2010].

An epoch lasts from one velocity to another. The velocities tell its mean specific force in East, North and up, the
Fourier reconstruction of the accelerometers the same in body axes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import jax
import numpy as np

from altijax.drives import gravity_at, imu_of, start_of, usual_step, without_bursts
from altijax.motion_estimate.readings import velocities_within
from altijax.motion_estimate.start import course_rows
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.series import after_gap, interpolated
from altijax.signals import fourier_interval_means, periodic_extension

# Samples are reconstructed in blocks of so many seconds or epochs, a quarter at each side to keep the ends away; the
# smallest sizes that blocks and epochs are filled up to.
_BLOCK_TIME, _BLOCK_EPOCHS = 40.0, 8
_BLOCK = 4096
EPOCHS = 64
# Doppler noise of 0.05 m/s is 4 degrees in an epoch of 0.1 s: epochs may be joined up to so many seconds.
_LONGEST = 1.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Epochs:
    """Mean specific forces between velocities.

    Attributes
    ----------
    knots : (epochs + 1,) s
        Times of the velocities on the IMU's clock, from its first sample.
    v_n, std : (epochs + 1, 3) m/s
        Velocities, East, North and up, and their standard deviations, infinite where there was none.
    f_b, f_n : (epochs, 3) m/s^2
        Mean specific force in body and in navigation axes.
    whole : (epochs,)
        False where the IMU or a velocity was missing.
    """

    knots: np.ndarray
    v_n: np.ndarray
    std: np.ndarray
    f_b: np.ndarray
    f_n: np.ndarray
    whole: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Times (epochs,) s that the attitudes belong to."""
        return 0.5 * (self.knots[1:] + self.knots[:-1])

    @property
    def course_of(self) -> np.ndarray:
        """Number (epochs,) of the epoch whose course each has: its own, or the last one fast enough to tell."""
        return course_rows(0.5 * (self.v_n[1:] + self.v_n[:-1]))

    @property
    def length_misfit(self) -> np.ndarray:
        """By how much the forces of whole epochs differ in length, m/s^2."""
        f_b, f_n = (np.linalg.norm(force[self.whole], axis=1) for force in (self.f_b, self.f_n))
        return np.asarray(f_b - f_n)


def joined_epochs(recording: Recording, delay: float) -> Epochs:
    """Epochs at a delay: those of single velocities, or as many of them together as agree best, up to a second.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities.
    delay : float
        How late the stamps of the velocities are, s.

    Returns
    -------
    epochs : Epochs
        Those whose forces differ least in length: short ones are noisy, in long ones the body turns.

    Raises
    ------
    ValueError
        If there are fewer than 3 velocities within the time of the IMU.
    """
    t, f_b = uniform_forces(recording)
    stamps, v_n, std = velocities_within(recording, delay)
    knots = stamps - delay
    for axis, known in enumerate(np.isfinite(std).T):
        if known.any():
            v_n[:, axis] = np.interp(knots, knots[known], v_n[known, axis])
    dt = np.diff(knots)
    usual = float(np.median(dt))
    t_imu = imu_of(recording).index.to_numpy(float) - start_of(recording)
    missing = np.where(after_gap(t_imu, usual_step(t_imu)), np.diff(t_imu, prepend=t_imu[0]), 0.0)
    lost = np.diff(np.interp(knots, t_imu, np.cumsum(missing)))
    whole = (lost == 0) & (dt < 2 * usual)
    single = np.concatenate(list(_fourier_means(t, f_b, knots)))
    up = np.array([0.0, 0.0, gravity_at(recording)])

    def joined(count: int) -> Epochs:
        first = np.arange(0, dt.size - count + 1, count)
        ends = np.append(first, first[-1] + count)
        width = np.diff(knots[ends])[:, None]
        sums = np.add.reduceat((single * dt[:, None])[: ends[-1]], first)
        f_n = np.diff(v_n[ends], axis=0) / width + up
        all_whole = np.logical_and.reduceat(whole[: ends[-1]], first)
        return Epochs(knots=knots[ends], v_n=v_n[ends], std=std[ends], f_b=sums / width, f_n=f_n, whole=all_whole)

    counts = [2**k for k in range(8) if 2**k == 1 or (2**k * usual <= _LONGEST and dt.size >= 2 * 2**k)]
    trials = [joined(count) for count in counts]
    return min(trials, key=lambda epochs: float(np.std(epochs.length_misfit)) if epochs.whole.sum() > 2 else np.inf)


def uniform_forces(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Accelerometer readings on a uniform grid at the IMU's usual rate.

    Parameters
    ----------
    recording : Recording
        With an accelerometer.

    Returns
    -------
    t : (samples,) s
        Times from the first sample.
    f_b : (samples, 3) m/s^2
        Specific force.
    """
    imu = imu_of(recording)
    t_imu = imu.index.to_numpy(float) - start_of(recording)
    t = np.linspace(0, t_imu[-1], round(t_imu[-1] / usual_step(t_imu)) + 1)
    return t, interpolated(t, without_bursts(t_imu), imu[["ax", "ay", "az"]].to_numpy(float))


def _fourier_means(t: np.ndarray, f_b: np.ndarray, knots: np.ndarray) -> Iterator[np.ndarray]:
    """Means between the knots, block by block: one reconstruction of all takes as long as the square of the time."""
    step, widest = t[1], float(np.max(np.diff(knots)))
    size = bucket(int(max(_BLOCK_TIME, _BLOCK_EPOCHS * min(widest, _BLOCK_TIME)) / step), _BLOCK)
    blocks = (0.5 * (knots[1:] + knots[:-1]) / step).astype(int) // (size // 2)
    edges = bucket(int(np.max(np.bincount(blocks))) + 1, EPOCHS)
    for block in np.unique(blocks):
        first = max(min(block * (size // 2) - size // 4, t.size - size), 0)
        samples = padded(f_b[first : first + size], size, axis=0)
        inside = np.flatnonzero(blocks == block)
        ends = padded(knots[inside[0] : inside[-1] + 2] - t[first], edges)
        yield np.asarray(_block_means(step * np.arange(size), samples, ends))[: inside.size]


@jax.jit
def _block_means(t: jax.Array, values: jax.Array, edges: jax.Array) -> jax.Array:
    t_continued, continued, line = periodic_extension(t, values.T)
    middle = 0.5 * (edges[1:] + edges[:-1])
    slope = (line[:, -1] - line[:, 0]) / (t[-1] - t[0])
    return fourier_interval_means(t_continued, continued, edges).T + line[:, 0] + middle[:, None] * slope
