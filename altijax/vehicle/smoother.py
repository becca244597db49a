"""Most probable motion of a whole record: Gauss-Newton over all instants, and the likelihood of the noise levels.

One pass linearises about a trajectory, filters forward and smooths backward; the passes end at the trajectory of
largest posterior probability. The innovations of a last pass give the likelihood of noise levels (Laplace's
approximation), by which they are chosen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax import _safe
from altijax.inference.layout import Layout
from altijax.inference.state_smoother import adjoint_states, filter_states, likelihood_gradients, smooth_states
from altijax.motion_estimate.intervals import MotionReadings, instants_at, intervals_between
from altijax.rotations import rotvec_to_matrix
from altijax.vehicle.between import Between, between_instants
from altijax.vehicle.inertial import MOVING, Trajectory, moved, stationary
from altijax.vehicle.parts import Instant, Kind, Rows
from altijax.vehicle.sensors import Use, kinds_of, layout_of, parts_of
from altijax.vehicle.transitions import transitions

# A measurement more than so many standard deviations from what all others say is trusted that much less.
_GATE = 4.0
_LONGEST_TURN = 0.7

Doubt = Mapping[str, jax.Array]
jax.tree_util.register_dataclass(Rows, ["value", "std", "stamp"], [])


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Belief:
    """What is believed of the first instant and of the constants.

    Attributes
    ----------
    mean : (states,)
        Of the states; those of attitude and velocity do not count.
    covariance : (states, states)
        Of the states.
    """

    mean: jax.Array
    covariance: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Fit:
    """A trajectory and its errors.

    Attributes
    ----------
    trajectory : Trajectory
        States at each instant.
    covariance : (time, states, states)
        Of the error state.
    log_likelihood : ()
        Of the noise levels, about the trajectory the pass began with.
    by_level : dict of str to ()
        Its derivative by each level.
    doubt : dict of str to (time, rows)
        Factor by which outliers' variances should grow.
    surprise : dict of str to (time, rows)
        Each measurement against what all others say, in standard deviations; zero where there is none.
    step : () rad
        Largest turn of the pass.
    """

    trajectory: Trajectory
    covariance: jax.Array
    log_likelihood: jax.Array
    by_level: dict[str, jax.Array]
    doubt: dict[str, jax.Array]
    surprise: dict[str, jax.Array]
    step: jax.Array


def between(use: Use, readings: MotionReadings, trajectory: Trajectory, delay: jax.Array) -> Between:
    """`between_instants` of a trajectory whose instants were moved for a delay of the receiver (s)."""
    instants = instants_at(readings, delay)
    intervals = intervals_between(readings, instants)
    share, gravity = jnp.asarray(readings.share), jnp.asarray(readings.gravity)
    return between_instants(trajectory, intervals, instants, share, gravity, layout_of(use))


def vehicle_pass(
    use: Use,
    readings: MotionReadings,
    trajectory: Trajectory,
    delay: jax.Array,
    between: Between,
    rows: Mapping[str, Rows],
    belief: Belief,
    doubt: Doubt,
    levels: Mapping[str, jax.Array],
) -> Fit:
    """One step of Gauss-Newton from a trajectory, and the likelihood about it with its gradient.

    Parameters
    ----------
    use : tuple of str
        The set of sensors.
    readings : MotionReadings
        IMU readings and instants.
    trajectory : Trajectory
        Where to linearise.
    delay : () s
        By how much the instants were moved for the delay of the receiver.
    between : Between
        What the readings say, about the same trajectory.
    rows : mapping of str to Rows
        Measurements by kind.
    belief : Belief
        What is believed beforehand.
    doubt : mapping of str to (time, rows)
        Factor on the variance of each measurement, 1 but for outliers.
    levels : mapping of str to ()
        Noise levels.

    Returns
    -------
    fit : Fit
        The next trajectory, covariance and likelihood.
    """
    layout = layout_of(use)
    met = _measurements(use, readings, trajectory, delay, between, rows)
    linear, pull_back = jax.vjp(
        partial(_linearised, use, readings.gravity, trajectory, between, met, rows, belief, doubt), dict(levels)
    )
    kinds = tuple(kinds_of(use))
    there = jnp.concatenate([jnp.isfinite(rows[name].std) for name in kinds], -1)
    duration = between.duration
    lasts = jnp.any(there, 1) & (jnp.append(1.0, duration) > 0) | (jnp.append(0.0, duration) > 0)
    lasts = lasts | (jnp.append(duration, 0.0) > 0)
    # Filling comes last.
    used = jax.lax.cummax(lasts.astype(int), reverse=True) > 0
    moving = layout.at(MOVING[-1]).stop
    filtered = filter_states(**linear, used=used, moving=moving)
    adjoint = adjoint_states(linear["F"], linear["H"], filtered, used, moving)
    x, P = smooth_states(filtered, adjoint)
    gradients = likelihood_gradients(linear["F"], linear["H"], filtered, adjoint)
    (by_level,) = pull_back(gradients | {"H": jnp.zeros_like(linear["H"])})
    doubts = jnp.concatenate([doubt[name] for name in kinds], -1)
    surprise, again = _against_all_others(x, P, linear, doubts, there)
    attitude = layout.at("attitude")
    turn = _safe.norm(x[:, attitude])
    # Far from the truth a step may be longer than the linear model reaches.
    shorten = jnp.minimum(1, _LONGEST_TURN / jnp.maximum(turn, 1e-9))
    return Fit(
        trajectory=moved(trajectory, x.at[:, attitude].multiply(shorten[:, None]), layout),
        covariance=P,
        log_likelihood=jnp.sum(filtered.log_likelihood),
        by_level=by_level,
        doubt=_by_kind(again, kinds, rows),
        surprise=_by_kind(surprise, kinds, rows),
        step=jnp.max(turn),
    )


def _measurements(
    use: Use,
    readings: MotionReadings,
    trajectory: Trajectory,
    delay: jax.Array,
    between: Between,
    rows: Mapping[str, Rows],
) -> dict[str, tuple[jax.Array, jax.Array, jax.Array]]:
    """Of each kind what should be measured (time, rows), its derivative by the states, and what its floor adds."""
    layout = layout_of(use)
    at = Instant(
        rate=between.rate, acceleration=between.acceleration, delay=jnp.broadcast_to(delay, between.instants.shape)
    )
    stamped = jnp.asarray(readings.instant) + delay * (1 - jnp.asarray(readings.delayed))
    stamps = {name: jnp.asarray(row.stamp) for name, row in rows.items()}
    return {
        name: _of_kind(kind, layout, trajectory, at, stamps[name] - (stamped if kind.by_receiver else between.instants))
        for name, kind in kinds_of(use).items()
    }


def _of_kind(
    kind: Kind, layout: Layout, trajectory: Trajectory, at: Instant, lead: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    attitude = layout.at("attitude")

    def state(error: jax.Array, C: jax.Array, x: jax.Array) -> dict[str, jax.Array]:
        return layout.split(x + error) | {"C_nb": rotvec_to_matrix(error[attitude]) @ C}

    def one(C: jax.Array, x: jax.Array, at: Instant, lead: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        def expected(error: jax.Array) -> tuple[jax.Array, jax.Array]:
            found = kind.expected(state(error, C, x), at, lead)
            return found, found

        zero = jnp.zeros_like(x)
        H, found = jax.jacfwd(expected, has_aux=True)(zero)
        added = jnp.zeros_like(found) if kind.floor is None else kind.floor(state(zero, C, x), at)
        return found, H, added

    return jax.vmap(one)(trajectory.C_nb, trajectory.x, at, lead)


def _linearised(
    use: Use,
    gravity: jax.Array,
    trajectory: Trajectory,
    between: Between,
    met: Mapping[str, tuple[jax.Array, jax.Array, jax.Array]],
    rows: Mapping[str, Rows],
    belief: Belief,
    doubt: Doubt,
    levels: Mapping[str, jax.Array],
) -> dict[str, jax.Array]:
    layout, parts = layout_of(use), parts_of(use)
    F, c, Q = transitions(trajectory, between, levels, parts, gravity, layout)
    z, H, R = [], [], []
    for name, kind in kinds_of(use).items():
        expected, slope, added = met[name]
        std, value = rows[name].std, rows[name].value
        there = jnp.isfinite(std)
        factor = jnp.stack([levels[level] for level in kind.factor]) if kind.factor else 1.0
        variance = (factor * jnp.where(there, std, 1)) ** 2 + added
        z.append(jnp.where(there, value - expected, 0))
        H.append(jnp.where(there[..., None], slope, 0))
        R.append(jnp.where(there, variance * doubt[name], 1))
    # Attitude and velocity can be anything about the trajectory; all else is believed beforehand.
    first = belief.mean - trajectory.x[0]
    x0 = first.at[layout.at("attitude")].set(0).at[layout.at("velocity")].set(0)
    fading = {name: stationary(part, levels) for name, part in parts.items() if part.time}
    P0 = belief.covariance + jnp.diag(layout.joined(fading, (), x0.dtype))
    joined = {"z": jnp.concatenate(z, -1), "H": jnp.concatenate(H, -2), "R": jnp.concatenate(R, -1)}
    return {"F": F, "c": c, "Q": Q, **joined, "x0": x0, "P0": P0}


def _against_all_others(
    x: jax.Array, P: jax.Array, linear: Mapping[str, jax.Array], doubt: jax.Array, there: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Each measurement against the estimate without it, by its nominal variance, and the doubt that follows."""
    R, H = linear["R"], linear["H"]
    predicted = jnp.einsum("tri,tij,trj->tr", H, P, H)
    residual = linear["z"] - jnp.einsum("tri,ti->tr", H, x)
    # Taking one measurement out of an estimate is a division by the share of its variance that it left.
    left = jnp.maximum(R - predicted, 1e-6 * R)
    alone, variance = residual * R / left, predicted * R / left
    surprise = jnp.where(there, alone / jnp.sqrt(variance + R / doubt), 0)
    needed = (alone / _GATE) ** 2 - variance
    return surprise, jnp.where(there & (jnp.abs(surprise) > _GATE), jnp.maximum(needed / (R / doubt), 1), 1)


def _by_kind(joined: jax.Array, kinds: tuple[str, ...], rows: Mapping[str, Rows]) -> dict[str, jax.Array]:
    ends = np.cumsum([rows[name].std.shape[-1] for name in kinds])
    return dict(zip(kinds, jnp.split(joined, ends[:-1], -1), strict=True))
