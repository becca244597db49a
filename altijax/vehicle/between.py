"""What an IMU says between the instants of a trajectory: where its readings lead, and derivatives by its constants."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from altijax import _safe
from altijax.inference.layout import Layout
from altijax.motion_estimate.intervals import Intervals
from altijax.motion_estimate.preintegration import Preintegrated, preintegrate, relative_attitudes
from altijax.rotations import matrix_to_rotvec
from altijax.vehicle.inertial import Trajectory

State = Mapping[str, jax.Array]

# Over how long before and after an instant readings are averaged to tell its rate and acceleration, s.
_ABOUT = 0.1


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Between:
    """What the readings say between the instants of a trajectory.

    Attributes
    ----------
    instants : (time,) s
        The instants on the IMU's clock.
    duration, gap : (intervals,) s
        Length of each interval, and how much of it no reading supports.
    t : (intervals, steps) s
        Time of the end of each step.
    C_nb : (intervals, steps, 3, 3)
        Attitude there.
    v_n, p_n : (intervals, steps, 3) m/s, m
        Velocity and position there.
    way : (intervals, steps) m
        Way there.
    led : (intervals,) m
        Way that the readings alone lead to at the end.
    gained : (intervals, 9)
        Missed turn as a rotation vector in navigation axes, integral of the specific force, and its integral.
    by : dict of str to (intervals, 3, size)
        Derivative of the final velocity by parts of the state, "turn" a rotation vector that grows evenly.
    turn_by : dict of str to (intervals, 3, size)
        The same of the final attitude.
    rate : (time, 3) rad/s
        Angular rate as read about each instant.
    acceleration : (time, 3) m/s^2
        Acceleration there.
    """

    instants: jax.Array
    duration: jax.Array
    gap: jax.Array
    t: jax.Array
    C_nb: jax.Array
    v_n: jax.Array
    p_n: jax.Array
    way: jax.Array
    led: jax.Array
    gained: jax.Array
    by: dict[str, jax.Array]
    turn_by: dict[str, jax.Array]
    rate: jax.Array
    acceleration: jax.Array


def _places(*places: tuple[int, int]) -> np.ndarray:
    """Matrices (entries, 3, 3) of a one in each place."""
    matrices = np.zeros((len(places), 3, 3))
    for entry, (row, column) in enumerate(places):
        matrices[entry, row, column] = 1
    return matrices


_SCALES = _places((0, 0), (1, 1), (2, 2))
_BELOW = _places((1, 0), (2, 0), (2, 1))
_ACROSS = _places((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))


def _matrix(x: State, *parts: tuple[str, np.ndarray]) -> jax.Array:
    """What scales and crossed axes add to a reading, a matrix (..., 3, 3)."""
    return jnp.einsum(
        "...p,pij->...ij",
        jnp.concatenate([x[name] for name, _ in parts], -1),
        np.concatenate([places for _, places in parts]),
    )


def between_instants(
    trajectory: Trajectory,
    intervals: Intervals,
    instants: jax.Array,
    share: jax.Array,
    gravity: jax.Array,
    layout: Layout,
) -> Between:
    """What the readings say between the instants of a trajectory.

    Readings lead from each instant; by how much they miss the next is spread evenly over the interval, which is the
    mean of a random walk between two known ends.

    Parameters
    ----------
    trajectory : Trajectory
        States at the instants.
    intervals : Intervals
        Readings between them.
    instants : (time,) s
        The instants on the IMU's clock.
    share : (steps + 1,)
        Where the steps of an interval begin and end, from 0 to 1.
    gravity : () m/s^2
        Magnitude of gravity.
    layout : Layout
        Of the states.

    Returns
    -------
    between : Between
        All that a pass needs of the readings.
    """
    x = layout.split(trajectory.x)
    f_b, w_b = _corrected(x, intervals)
    C = trajectory.C_nb[:-1]
    by_gyro = relative_attitudes(w_b, intervals.dt)
    reached = jnp.swapaxes(C, -1, -2) @ trajectory.C_nb[1:]
    turn = matrix_to_rotvec(reached @ jnp.swapaxes(by_gyro[:, -1], -1, -2))
    summed = preintegrate(f_b, w_b, by_gyro, turn, intervals.dt)
    by, turn_by = _derivatives(x, C, summed)
    down = gravity * jnp.array([0.0, 0.0, -1.0])
    C_nb = C[:, None] @ summed.C
    gained = jnp.einsum("kij,ktj->kti", C, summed.velocity)
    v_n, p_n, way, led, moved = _led(x, gained, intervals, share, down)
    return Between(
        instants=instants,
        duration=intervals.duration,
        gap=intervals.gap,
        t=instants[:-1, None] + share[1:] * intervals.duration[:, None],
        C_nb=C_nb,
        v_n=v_n,
        p_n=p_n,
        way=way,
        led=led,
        gained=jnp.concatenate([jnp.einsum("kij,kj->ki", C, turn), gained[:, -1], moved], -1),
        by=by,
        turn_by=turn_by,
        rate=_about_instants(intervals.w_b, intervals, share),
        acceleration=_about_instants(jnp.einsum("ktij,ktj->kti", C_nb, f_b), intervals, share) + down,
    )


def _corrected(x: State, intervals: Intervals) -> tuple[jax.Array, jax.Array]:
    """Specific forces and rates of the steps without what the sensors' constants add."""
    w_b = intervals.w_b - x["gyro_bias"][:-1, None]
    if "gyro_scale" in x:
        more = _matrix(x, ("gyro_scale", _SCALES), ("gyro_axes", _ACROSS))[:-1]
        w_b = w_b + jnp.einsum("kij,ktj->kti", more, intervals.w_b)
    gains = jnp.eye(3) + _matrix(x, ("accelerometer_scale", _SCALES), ("accelerometer_axes", _BELOW))[:-1]
    f_b = jnp.einsum("kij,ktj->kti", gains, intervals.f_b) - _added(x)[:, None]
    return f_b, w_b


def _added(x: State) -> jax.Array:
    return x["accelerometer_bias"][:-1] + x["force_error"][:-1]


def _led(x: State, gained: jax.Array, intervals: Intervals, share: jax.Array, down: jax.Array) -> tuple[jax.Array, ...]:
    """Velocities, positions and ways at the steps, the way that the readings lead to, and the second integral."""
    v, p, dt = x["velocity"], x["position"], intervals.dt
    later = share[1:] * intervals.duration[:, None]
    before = jnp.concatenate([jnp.zeros_like(gained[:, :1]), gained[:, :-1]], 1)
    moved = jnp.cumsum(0.5 * (gained + before) * dt[..., None], 1)
    v_n = v[:-1, None] + gained + later[..., None] * down
    p_n = p[:-1, None] + later[..., None] * v[:-1, None] + moved + 0.5 * later[..., None] ** 2 * down
    speed = _safe.norm(jnp.concatenate([v[:-1, None], v_n], 1))
    way = x["way"][:-1, None] + jnp.cumsum(0.5 * (speed[:, 1:] + speed[:, :-1]) * dt, 1)
    led, part = way[:, -1], share[1:, None]
    way = way + share[1:] * (x["way"][1:] - led)[:, None]
    v_n = v_n + part * (v[1:] - v_n[:, -1])[:, None]
    p_n = p_n + part * (p[1:] - p_n[:, -1])[:, None]
    return v_n, p_n, way, led, moved[:, -1]


def _derivatives(x: State, C: jax.Array, summed: Preintegrated) -> tuple[dict[str, jax.Array], dict[str, jax.Array]]:
    """Of the final velocity and attitude by parts of the state: gains multiply a reading before its bias is off."""
    raw = summed.velocity_by_matrix - jnp.einsum("kai,kj->kaij", summed.velocity_by_bias, _added(x))
    by = {
        "turn": C @ summed.velocity_by_turn @ jnp.swapaxes(C, -1, -2),
        "accelerometer_bias": C @ summed.velocity_by_bias,
        "force_error": C @ summed.velocity_by_bias,
        "accelerometer_scale": C @ jnp.einsum("kaij,pij->kap", raw, _SCALES),
        "accelerometer_axes": C @ jnp.einsum("kaij,pij->kap", raw, _BELOW),
        "gyro_bias": C @ summed.velocity_by_gyro[..., :3],
    }
    turn_by = {"gyro_bias": C @ summed.turn_by_gyro[..., :3]}
    if "gyro_scale" in x:
        for found, columns in ((by, summed.velocity_by_gyro), (turn_by, summed.turn_by_gyro)):
            off = jnp.einsum("kai,kj->kaij", columns[..., :3], x["gyro_bias"][:-1])
            raw = columns[..., 3:].reshape(-1, 3, 3, 3) - off
            found["gyro_scale"] = C @ jnp.einsum("kaij,pij->kap", raw, _SCALES)
            found["gyro_axes"] = C @ jnp.einsum("kaij,pij->kap", raw, _ACROSS)
    return by, turn_by


def _about_instants(series: jax.Array, intervals: Intervals, share: jax.Array) -> jax.Array:
    """Mean of a series (intervals, steps, ...) about the instants, from both sides."""
    middle = 0.5 * (share[1:] + share[:-1]) * intervals.duration[:, None]
    there = (jnp.diff(share) > 0) & (intervals.duration > 0)[:, None]

    def mean(weight: jax.Array) -> tuple[jax.Array, jax.Array]:
        total = jnp.sum(weight, 1)
        return jnp.einsum("kt,kti->ki", weight / jnp.where(total > 0, total, 1)[:, None], series), total > 0

    first = jnp.arange(share.size - 1) == 0
    last = share[1:] >= 1
    after, has_after = mean(1.0 * there * ((middle < _ABOUT) | first))
    before, has_before = mean(
        1.0 * there * ((intervals.duration[:, None] - middle < _ABOUT) | (last & (share[:-1] < 1)))
    )
    after = jnp.concatenate([after, before[-1:]])
    before = jnp.concatenate([after[:1], before])
    has_after = jnp.append(has_after, False)[:, None]
    has_before = jnp.insert(has_before, 0, False)[:, None]
    return jnp.where(has_after & has_before, 0.5 * (after + before), jnp.where(has_after, after, before))
