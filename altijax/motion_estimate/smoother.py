"""Most probable motion of a whole record: Gauss-Newton over all instants, and the likelihood of the noise levels.

One pass linearises about a trajectory, filters forward and smooths backward; the passes end at the trajectory of
largest posterior probability. The innovations of a last pass give the likelihood of noise levels and delay (Laplace's
approximation), by which they are chosen.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from altijax import _safe
from altijax.inference.state_smoother import adjoint_states, filter_states, likelihood_gradients, smooth_states
from altijax.motion_estimate.intervals import MotionReadings, instants_at, intervals_between
from altijax.motion_estimate.model import (
    STATES,
    Gains,
    Intervals,
    MotionNoise,
    Trajectory,
    interval_gains,
    motion_measurements,
    motion_transitions,
    moved,
    preintegrated_intervals,
)

# A velocity more than so many standard deviations from what all others say is trusted that much less.
_GATE = 4.0
_LONGEST_TURN = 0.7
# What sideslip and attack leave of the angle between body x and the direction of travel, rad.
_SLIP_LEFT = 0.01
# Over how long the acceleration counts that late vertical velocities miss, s.
_JUST_BEFORE = 0.15


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class MotionPrior:
    """What is believed of the first instant and of the constants, and the trust in each measurement.

    Attributes
    ----------
    covariance : (22, 22)
        Of the states; zero for those that do not exist.
    doubt : (time, 3)
        Factor on the variance of each velocity, 1 but for outliers.
    course : ()
        1 where body x points in the direction of travel but for the mount and the slips, 0 where it may point anywhere.
    """

    covariance: jax.Array
    doubt: jax.Array
    course: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class MotionFit:
    """A trajectory and its errors.

    Attributes
    ----------
    trajectory : Trajectory
        States at each instant.
    covariance : (time, 22, 22)
        Of the error state.
    log_likelihood : ()
        Of the noise levels and the delay, about the trajectory the pass began with.
    by_noise : MotionNoise
        Its derivative by each level.
    by_delay : () 1/s
        Its derivative by the delay.
    doubt : (time, 3)
        Factor by which outliers' variances should grow.
    surprise : (time, 3)
        Each velocity against what all others say, in standard deviations; zero where there is none.
    step : () rad
        Largest turn of the pass.
    """

    trajectory: Trajectory
    covariance: jax.Array
    log_likelihood: jax.Array
    by_noise: MotionNoise
    by_delay: jax.Array
    doubt: jax.Array
    surprise: jax.Array
    step: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class MotionBetween:
    """What the readings say between the instants of a trajectory, at one delay of the receiver's stamps.

    Attributes
    ----------
    instants : (time,) s
        The instants on the IMU's clock.
    t : (intervals, steps) s
        Time of the end of each step.
    C_nb : (intervals, steps, 3, 3)
        Attitude.
    v_n : (intervals, steps, 3) m/s
        Velocity.
    gains : Gains
        What each interval as a whole adds to the states.
    climbing : (time,) m/s^2
        Vertical acceleration just before each instant.
    """

    instants: jax.Array
    t: jax.Array
    C_nb: jax.Array
    v_n: jax.Array
    gains: Gains
    climbing: jax.Array


def motion_between(readings: MotionReadings, trajectory: Trajectory, delay: jax.Array) -> MotionBetween:
    """Attitude and velocity at the steps between the instants of a trajectory, and what the readings add up to there.

    Readings lead from each instant; by how much they miss the next is spread evenly over the interval, which is the
    mean of a random walk between two known ends.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings.
    trajectory : Trajectory
        States at the instants.
    delay : () s
        How late the receiver's stamps are.

    Returns
    -------
    between : MotionBetween
        All that depends on the delay.
    """
    instants = instants_at(readings, delay)
    intervals = intervals_between(readings, instants)
    preintegrated, miss = preintegrated_intervals(trajectory, intervals)
    share = jnp.asarray(readings.share)[1:]
    later = share * intervals.duration[:, None]
    C = trajectory.C_nb[:-1]
    gained = jnp.einsum("kij,ktj->kti", C, preintegrated.velocity)
    v = trajectory.v_n[:-1, None] + gained - later[..., None] * readings.gravity * jnp.array([0.0, 0.0, 1.0])
    missed = trajectory.v_n[1:] - v[:, -1]
    return MotionBetween(
        instants=instants,
        t=instants[:-1, None] + later,
        C_nb=C[:, None] @ preintegrated.C,
        v_n=v + share[:, None] * missed[:, None],
        gains=interval_gains(C, preintegrated, miss, intervals),
        climbing=_climbing(readings, trajectory, intervals),
    )


def motion_between_by_delay(
    readings: MotionReadings, trajectory: Trajectory, delay: jax.Array
) -> tuple[MotionBetween, tuple[Gains, jax.Array]]:
    """`motion_between`, and the derivative by the delay of what a pass needs of it.

    The delay moves every interval at once: one derivative forward through the readings, where one backward would keep
    all their steps.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings.
    trajectory : Trajectory
        States at the instants.
    delay : () s
        How late the receiver's stamps are.

    Returns
    -------
    between : MotionBetween
        All that depends on the delay.
    by_delay : Gains, and (time,) m/s^3
        The derivatives of its gains and of `climbing`, 1/s of each.
    """

    def timed(delay: jax.Array) -> tuple[tuple[Gains, jax.Array], MotionBetween]:
        between = motion_between(readings, trajectory, delay)
        return (between.gains, between.climbing), between

    delay = jnp.asarray(delay)
    _, by_delay, between = jax.jvp(timed, (delay,), (jnp.ones_like(delay),), has_aux=True)
    return between, by_delay


def motion_pass(
    readings: MotionReadings,
    trajectory: Trajectory,
    prior: MotionPrior,
    noise: MotionNoise,
    between: MotionBetween,
    by_delay: tuple[Gains, jax.Array],
) -> MotionFit:
    """One step of Gauss-Newton from a trajectory, and the likelihood about it with its gradient.

    Parameters
    ----------
    readings : MotionReadings
        IMU readings and GNSS velocities.
    trajectory : Trajectory
        Where to linearise.
    prior : MotionPrior
        What is believed beforehand.
    noise : MotionNoise
        Noise levels.
    between : MotionBetween
        What the readings say, about the same trajectory.
    by_delay : Gains, and (time,) m/s^3
        Derivatives by the delay, as of `motion_between_by_delay`.

    Returns
    -------
    fit : MotionFit
        The next trajectory, covariance and likelihood.
    """
    there = jnp.isfinite(readings.std)
    timed, duration = (between.gains, between.climbing), between.gains.duration
    linear, pull_back = jax.vjp(partial(_linearised, readings, trajectory, prior), noise, timed)
    lasts = jnp.any(there, 1) | (jnp.append(0.0, duration) > 0) | (jnp.append(duration, 0.0) > 0)
    # Filling comes last: a first instant that the delay has moved onto the next one is none.
    used = jax.lax.cummax(lasts.astype(int), reverse=True) > 0
    filtered = filter_states(**linear, used=used, moving=None)
    adjoint = adjoint_states(linear["F"], linear["H"], filtered, used)
    x, P = smooth_states(filtered, adjoint)
    gradients = likelihood_gradients(linear["F"], linear["H"], filtered, adjoint)
    by_noise, by_timed = pull_back(gradients | {"H": jnp.zeros_like(linear["H"])})
    changes = jax.tree.map(jnp.vdot, by_timed, by_delay)
    surprise, doubt = _against_all_others(x, P, linear["z"], linear["R"], prior.doubt, there)
    turn = _safe.norm(x[:, :3])
    # Far from the truth a step may be longer than the linear model reaches.
    shorten = jnp.minimum(1, _LONGEST_TURN / jnp.maximum(turn, 1e-9))
    return MotionFit(
        trajectory=moved(trajectory, x.at[:, :3].multiply(shorten[:, None])),
        covariance=P,
        log_likelihood=jnp.sum(filtered.log_likelihood),
        by_noise=by_noise,
        by_delay=jnp.sum(jnp.stack(jax.tree.leaves(changes))),
        doubt=doubt,
        surprise=surprise,
        step=jnp.max(turn),
    )


def _linearised(
    readings: MotionReadings,
    trajectory: Trajectory,
    prior: MotionPrior,
    noise: MotionNoise,
    timed: tuple[Gains, jax.Array],
) -> dict[str, jax.Array]:
    gains, climbing = timed
    F, c, Q = motion_transitions(trajectory, gains, noise, readings.gravity)
    factor = jnp.stack([jnp.asarray(x, F.dtype) for x in (noise.horizontal, noise.horizontal, noise.vertical)])
    there = jnp.isfinite(readings.std)
    variance = jnp.where(there, (factor * jnp.where(there, readings.std, 1)) ** 2 * prior.doubt, jnp.inf)
    used = there[:, 0] & (prior.course > 0)
    slip_variance = jnp.where(used, _SLIP_LEFT**2, jnp.inf)
    z, H, R = motion_measurements(trajectory, readings.v_gnss, variance, slip_variance, climbing)
    # Constants and biases are believed to be zero before the first measurement; attitude and velocity can be anything.
    first = jnp.concatenate(
        [trajectory.accelerometer_bias[0], trajectory.gyro_bias[0], trajectory.constants, trajectory.slip[0]]
    )
    x0 = jnp.concatenate([jnp.zeros(6, F.dtype), -first])
    # Slips that no prior covariance tells of have the one that they keep.
    slips = jnp.stack([jnp.asarray(noise.sideslip), jnp.asarray(noise.attack)])
    P0 = jnp.asarray(prior.covariance) + jnp.diag(jnp.concatenate([jnp.zeros(STATES - 2, F.dtype), slips**2]))
    return {"F": F, "c": c, "Q": Q, "z": z, "H": H, "R": R, "x0": x0, "P0": P0}


def _climbing(readings: MotionReadings, trajectory: Trajectory, intervals: Intervals) -> jax.Array:
    """Vertical acceleration just before each instant."""
    begin, end = readings.share[:-1], readings.share[1:]
    before_end = (1 - 0.5 * (begin + end)) * intervals.duration[:, None]
    weight = ((before_end < _JUST_BEFORE) | (end >= 1)) * (end > begin)
    f_b = jnp.einsum("kt,kti->ki", weight / jnp.sum(weight, 1, keepdims=True), intervals.f_b)
    at_end = jnp.einsum("ki,ki->k", trajectory.C_nb[1:, 2], f_b) - readings.gravity
    return jnp.append(at_end[:1], at_end)


def _against_all_others(
    x: jax.Array, P: jax.Array, z: jax.Array, R: jax.Array, doubt: jax.Array, there: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Each velocity against the estimate without it, by its nominal variance, and the doubt that follows."""
    R = R[:, :3]
    predicted = jnp.diagonal(P, axis1=-2, axis2=-1)[:, 3:6]
    residual = z[:, :3] - x[:, 3:6]
    # Taking one measurement out of an estimate is a division by the share of its variance that it left.
    left = jnp.maximum(R - predicted, 1e-6 * R)
    alone, variance = residual * R / left, predicted * R / left
    surprise = jnp.where(there, alone / jnp.sqrt(variance + R / doubt), 0)
    needed = (alone / _GATE) ** 2 - variance
    return surprise, jnp.where(there & (jnp.abs(surprise) > _GATE), jnp.maximum(needed / (R / doubt), 1), 1)
