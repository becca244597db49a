"""A recording as the paper's epochs: mean accelerations between velocities, in double precision.

An epoch lasts from one Doppler velocity to the next. The mean specific force in body axes comes from the Fourier
reconstruction that the paper asks for, that in navigation axes from the difference of the velocities; the attitude
belongs to mid-epoch. With a gyro every sample is also turned into the axes of its mid-epoch before the mean is taken.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.doppler import velocity_to_course
from altijax.drives import gravity_at
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix, heading_to_yaw, interpolate_rotations, matrix_to_euler, wrap_angle
from altijax.signals import cumulative_integral, fourier_interval_means, resample
from altijax.strapdown import integrate_attitude


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Epochs:
    """What a method may use; samples are the accelerometer's, knots the velocities, one more than epochs.

    Attributes
    ----------
    t : (samples,) s
        Uniform times.
    f_b : (samples, 3) m/s^2
        Specific force in body axes.
    turned : (samples, 3, 3)
        Attitude by the gyro, from the identity at the first sample.
    turned_middle : (epochs, 3, 3)
        The same at mid-epoch.
    t_knots : (knots,) s
        Times of the velocities.
    v_knots : (knots, 3) m/s
        Velocities.
    f_b_mean, f_b_carried : (epochs, 3) m/s^2
        Mean specific force in body axes: of the components, and of the samples turned into mid-epoch axes.
    f_n : (epochs, 3) m/s^2
        Mean specific force by the velocities, A + g U.
    euler0 : (epochs, 3) rad
        The paper's initial values (0, 0, pi/2 - COG).
    gravity : () m/s^2
        Magnitude.
    """

    t: jax.Array
    f_b: jax.Array
    turned: jax.Array
    turned_middle: jax.Array
    t_knots: jax.Array
    v_knots: jax.Array
    f_b_mean: jax.Array
    f_b_carried: jax.Array
    f_n: jax.Array
    euler0: jax.Array
    gravity: jax.Array

    @property
    def t_middle(self) -> jax.Array:
        """Middles of the epochs (epochs,) s."""
        return (self.t_knots[1:] + self.t_knots[:-1]) / 2


@jax.jit
def epochs_of_arrays(
    t: jax.Array, f_b: jax.Array, w_b: jax.Array, t_knots: jax.Array, v_knots: jax.Array, gravity: jax.Array
) -> Epochs:
    """The epochs of uniform samples and of velocities within their span."""
    turned = integrate_attitude(w_b, jnp.eye(3), t[1] - t[0])
    middle = (t_knots[1:] + t_knots[:-1]) / 2
    turned_middle = interpolate_rotations(middle, t, turned)
    both = jnp.concatenate([f_b, jnp.einsum("tij,tj->ti", turned, f_b)], -1)
    f_b_mean, in_first = jnp.split(detrended_means(t, both, t_knots), 2, -1)
    a_n = jnp.diff(v_knots, axis=0) / jnp.diff(t_knots)[:, None]
    _, cog, _ = velocity_to_course((v_knots[1:] + v_knots[:-1]) / 2)
    zero = jnp.zeros_like(cog)
    return Epochs(
        t=t,
        f_b=f_b,
        turned=turned,
        turned_middle=turned_middle,
        t_knots=t_knots,
        v_knots=v_knots,
        f_b_mean=f_b_mean,
        f_b_carried=jnp.einsum("kji,kj->ki", turned_middle, in_first),
        f_n=a_n.at[:, 2].add(gravity),
        euler0=jnp.stack([zero, zero, heading_to_yaw(cog)], -1),
        gravity=gravity,
    )


def detrended_means(t: jax.Array, values: jax.Array, edges: jax.Array) -> jax.Array:
    """Fourier interval means of series (time, 3), whose ends are first made to meet by taking a straight line off."""
    slope = (values[-1] - values[0]) / (t[-1] - t[0])
    line = values[0] + (t - t[0])[:, None] * slope
    middles = (edges[1:] + edges[:-1]) / 2
    means = fourier_interval_means(t, (values - line).T, edges).T
    return means + values[0] + (middles - t[0])[:, None] * slope


def epochs_of(recording: Recording, *, rate: float = 50.0) -> Epochs:
    """The epochs of a recording with a gyro, its IMU averaged down to `rate`; call it in double precision."""
    imu, gnss = recording.imu, recording.gnss
    if imu is None or gnss is None:
        raise ValueError(f"recording {recording.name!r} has no IMU or no GNSS")
    start = float(imu.index[0])
    t_imu = imu.index.to_numpy(float) - start
    t = np.arange(int(t_imu[-1] * rate) + 1) / rate
    # Means over one sample interval each, as differences of the integral: what is faster than `rate` must not fold.
    readings = imu[["ax", "ay", "az", "gx", "gy", "gz"]].to_numpy(float)
    if np.median(np.diff(t_imu)) < 0.9 / rate:
        integral = np.vstack([np.zeros(6), np.cumsum(np.diff(t_imu)[:, None] * (readings[1:] + readings[:-1]) / 2, 0)])
        edges = np.clip(np.stack([t - 0.5 / rate, t + 0.5 / rate]), 0, t_imu[-1])
        ends = np.stack([[np.interp(e, t_imu, column) for column in integral.T] for e in edges])
        samples = ((ends[1] - ends[0]) / (edges[1] - edges[0])).T
    else:
        samples = np.asarray(resample(t, t_imu, readings, np.inf, axis=-2)[0])
    velocity = gnss[["v_e", "v_n", "v_u"]].dropna()
    t_knots = velocity.index.to_numpy(float) - start
    inside = (t_knots >= 0) & (t_knots <= t[-1])
    v_knots, gravity = velocity.to_numpy(float)[inside], np.float64(gravity_at(recording))
    return epochs_of_arrays(t, samples[:, :3], samples[:, 3:], t_knots[inside], v_knots, gravity)


@partial(jax.jit, static_argnames="carried")
def full_rate_attitude(epochs: Epochs, C_middle: jax.Array, *, carried: bool) -> jax.Array:
    """Attitude (..., samples, 3, 3) from that at mid-epoch, by constant rates or by the gyro, its drift even."""
    if not carried:
        return interpolate_rotations(epochs.t, epochs.t_middle, C_middle)
    first = C_middle @ jnp.swapaxes(epochs.turned_middle, -1, -2)
    return interpolate_rotations(epochs.t, epochs.t_middle, first) @ epochs.turned


@jax.jit
def full_rate_velocity(epochs: Epochs, C_nb: jax.Array) -> jax.Array:
    """Velocity (..., samples, 3): accelerations integrated, and bent linearly between velocities to meet them."""
    up = jnp.array([0.0, 0.0, 1.0])
    a_n = jnp.einsum("...tij,tj->...ti", C_nb, epochs.f_b) - epochs.gravity * up
    gained = cumulative_integral(epochs.t, a_n, axis=-2)
    at_knots, _ = resample(epochs.t_knots, epochs.t, gained, jnp.inf, axis=-2)
    return gained + interpolated_velocity(epochs, epochs.v_knots - at_knots)


@jax.jit
def interpolated_velocity(epochs: Epochs, knots: jax.Array) -> jax.Array:
    """Straight lines between values at the knots (..., samples, 3)."""
    return resample(epochs.t, epochs.t_knots, knots, jnp.inf, axis=-2)[0]


def reference_attitude(recording: Recording, t: jax.Array) -> jax.Array:
    """C_nb of the reference at times from the first IMU sample."""
    reference, imu = recording.reference, recording.imu
    if reference is None or imu is None:
        raise ValueError(f"recording {recording.name!r} has no reference or no IMU")
    known = reference[["roll", "pitch", "heading"]].dropna()
    return _interpolated_attitude(t, known.index.to_numpy(float) - float(imu.index[0]), known.to_numpy(float))


@jax.jit
def _interpolated_attitude(t: jax.Array, t_known: jax.Array, angles: jax.Array) -> jax.Array:
    roll, pitch, heading = angles.T
    return interpolate_rotations(t, t_known, euler_to_matrix(jnp.stack([roll, pitch, heading_to_yaw(heading)], -1)))


@jax.jit
def attitude_errors(C_nb: jax.Array, true: jax.Array) -> jax.Array:
    """RMS errors of roll, pitch and heading (3,) deg."""
    error = wrap_angle(matrix_to_euler(C_nb) - matrix_to_euler(true))
    return jnp.degrees(jnp.sqrt(jnp.mean(error * error, 0)))
