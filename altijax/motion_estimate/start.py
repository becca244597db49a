"""Attitudes of a record from windows of its epochs: what a whole-record fit starts from, and an estimate of its own."""

import jax
import jax.numpy as jnp

from altijax.motion_estimate.intervals import MotionReadings, instants_at, intervals_between
from altijax.motion_estimate.model import Trajectory
from altijax.motion_estimate.preintegration import relative_attitudes
from altijax.rotations import euler_to_matrix, matrix_to_rotvec, rotvec_to_matrix
from altijax.wahba import fit_windows

# Error of a mean acceleration over one second, m/s^2: Doppler noise and vibration.
_ACCELERATION_STD = 0.3
# Below this speed the direction of travel says nothing, m/s.
_SLOWEST = 1.0


@jax.jit
def window_attitudes(
    readings: MotionReadings, delay: jax.Array, prior_std: jax.Array, window: jax.Array, gyro: jax.Array
) -> tuple[Trajectory, jax.Array, jax.Array]:
    """Attitude at each instant from the epochs around it, level and along the direction of travel beforehand.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings and GNSS velocities.
    delay : () s
        How late the receiver's stamps are.
    prior_std : () rad
        Standard deviation of the attitude believed beforehand.
    window : ()
        Epochs that share an attitude, an odd number; 1 for each epoch by itself.
    gyro : ()
        True where the attitude turns as the gyro says; False where there is none and the readings of it are zero.

    Returns
    -------
    trajectory : Trajectory
        Attitudes, and the measured velocities joined by straight lines, led on by the readings; biases are zero.
    covariance : (time, 3, 3) rad^2
        Of the attitude, a rotation vector in navigation axes.
    misfit : ()
        Mean square of what the attitudes leave, in units of its variance: least at the right delay.
    """
    t = instants_at(readings, delay)
    intervals = intervals_between(readings, t)
    v = jax.vmap(_joined, in_axes=(None, 1, 1), out_axes=1)(t, readings.v_gnss, readings.std)
    v_middle = 0.5 * (v[1:] + v[:-1])
    # Before the first and after the last measured velocity nothing is known of the acceleration.
    between = (readings.delayed[1:] > 0) & (readings.delayed[:-1] > 0)
    whole = between & (intervals.duration > 0.3 * readings.spacing)
    dt = jnp.where(whole, intervals.duration, 1)
    f_n = jnp.diff(v, axis=0) / dt[:, None] + jnp.array([0.0, 0.0, 1.0]) * readings.gravity
    std = jnp.where(whole & (intervals.gap == 0), _ACCELERATION_STD / jnp.sqrt(dt), jnp.inf)

    C = relative_attitudes(intervals.w_b, intervals.dt)
    half = C[:, jnp.argmin(jnp.abs(readings.share[1:] - 0.5))]
    middles = C @ rotvec_to_matrix(-0.5 * intervals.dt[..., None] * intervals.w_b)
    mean = jnp.einsum("ktij,ktj,t->ki", middles, intervals.f_b, jnp.diff(readings.share))
    f_b = jnp.einsum("kji,kj->ki", half, mean)
    begins = jax.lax.scan(lambda C, by: (C @ by, C), jnp.eye(3, dtype=C.dtype), C[:, -1])[1]

    level = jnp.zeros_like(dt)
    C0 = euler_to_matrix(jnp.stack([level, level, _course(v_middle)], -1))
    # Without a gyro these are attitudes that do not turn.
    shared = fit_windows(f_b, f_n, C0, jnp.full_like(dt, prior_std), std, window, begins @ half)
    zero = jnp.zeros_like(v)
    C_nb = _at_instants(shared.C_nb, half, C[:, -1], intervals.duration, gyro)
    # Beyond the measured velocities the readings lead on.
    gained = jnp.einsum("kij,kj->ki", shared.C_nb, f_b) - jnp.array([0.0, 0.0, 1.0]) * readings.gravity
    beyond = jnp.cumsum(jnp.where(between[:, None], 0, gained * intervals.duration[:, None]), 0)
    beyond = jnp.concatenate([zero[:1], beyond])
    v = v + beyond - beyond[jnp.argmax(jnp.isfinite(readings.std[:, 0]))]
    trajectory = Trajectory(
        C_nb=C_nb,
        v_n=v,
        accelerometer_bias=zero,
        gyro_bias=zero,
        slip=zero[:, :2],
        constants=jnp.zeros(8, v.dtype),
    )
    covariance = jnp.concatenate([shared.covariance[:1], shared.covariance])
    misfit = jnp.sum(whole * shared.misfit**2) / jnp.maximum(jnp.sum(whole), 1)
    return trajectory, covariance, misfit


def _at_instants(
    C_middle: jax.Array, half: jax.Array, whole: jax.Array, duration: jax.Array, gyro: jax.Array
) -> jax.Array:
    """Attitudes at the instants from those amid the intervals: carried by the gyro from both sides and averaged.

    Without one the attitude turns evenly from the middle of an interval to that of the next.
    """
    begin = C_middle @ jnp.swapaxes(half, -1, -2)
    end = begin @ whole
    ahead, behind = jnp.concatenate([begin, end[-1:]]), jnp.concatenate([begin[:1], end])
    before, after = jnp.append(duration[:1], duration), jnp.append(duration, duration[-1:])
    even = jnp.where(before + after > 0, after / jnp.where(before + after > 0, before + after, 1), 0.5)
    part = jnp.where(gyro, 0.5, even)
    turn = matrix_to_rotvec(jnp.swapaxes(ahead, -1, -2) @ behind)
    return ahead @ rotvec_to_matrix(part[:, None] * turn)


def _joined(t: jax.Array, v: jax.Array, std: jax.Array) -> jax.Array:
    """One component of the measured velocities, joined by straight lines; zero where there is none at all."""
    there, k, n = jnp.isfinite(std), jnp.arange(t.size), t.size
    before = jax.lax.cummax(jnp.where(there, k, -1))
    after = jax.lax.cummin(jnp.where(there, k, n), reverse=True)
    a = jnp.clip(jnp.where(before < 0, after, before), 0, n - 1)
    b = jnp.clip(jnp.where(after >= n, before, after), 0, n - 1)
    span = t[b] - t[a]
    part = jnp.where(span > 0, (t - t[a]) / jnp.where(span > 0, span, 1), 0)
    return jnp.where(jnp.any(there), v[a] + part * (v[b] - v[a]), 0)


def _course(v: jax.Array) -> jax.Array:
    """Direction of travel, counter-clockwise from East, held where it is too slow to tell."""
    fast = jnp.hypot(v[:, 0], v[:, 1]) > _SLOWEST
    last = jax.lax.cummax(jnp.where(fast, jnp.arange(len(v)), -1))
    k = jnp.where(last < 0, jnp.argmax(fast), last)
    return jnp.arctan2(v[k, 1], v[k, 0])
