"""How attitude, velocity, position and way follow from an IMU's readings, linear in small errors about a trajectory.

The error of the attitude is a rotation vector in navigation axes, C_nb true = exp(error) C_nb; all else adds. The
trajectory need not obey its own dynamics: what is missing at each step is part of the model, so that repeating
linearisation and smoothing is the Gauss-Newton method on the whole record and ends at its most probable trajectory.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from altijax import _safe
from altijax.inference.layout import Layout
from altijax.motion_estimate.model import Intervals
from altijax.motion_estimate.preintegration import preintegrate, relative_attitudes
from altijax.rotations import matrix_to_rotvec, rotvec_to_matrix, skew
from altijax.vehicle.parts import Level, Part

# How fast attitude and velocity may change unseen in a gap of the IMU: rad/s and m/s^2.
_UNSEEN_TURN, _UNSEEN_ACCELERATION = 0.5, 3.0

# Attitude and velocity can be anything; positions and the way count from the first instant.
PARTS = {
    "attitude": Part(size=3, std=2.0),
    "velocity": Part(size=3, std=10.0),
    "position": Part(size=3),
    "way": Part(),
    "accelerometer_bias": Part(size=3, std=0.3, walk="accelerometer_walk"),
    # Vibration rectified, and a body that leans on its springs for a while.
    "force_error": Part(size=3, level=("force_error",), time="force_error_time"),
    "accelerometer_scale": Part(size=3, std=0.015),
    # The share of forward force in the left reading, of forward and of left force in the upward one.
    "accelerometer_axes": Part(size=3, entries=("yx", "zx", "zy"), std=0.005),
}
LEVELS = {
    "rotation": Level(usual=0.005),
    "acceleration": Level(usual=0.05),
    "accelerometer_walk": Level(usual=1e-3, spread=1.0),
    "force_error": Level(usual=0.02),
    "force_error_time": Level(usual=5.0, spread=0.7),
    "gyro_walk": Level(usual=1e-4, spread=1.0),
}
GYRO_PARTS = {
    "gyro_bias": Part(size=3, std=0.07, walk="gyro_walk"),
    "gyro_scale": Part(size=3, std=0.03),
    # The shares of the other axes' rates in a reading: of y and z in x, of x and z in y, of x and y in z.
    "gyro_axes": Part(size=6, entries=("xy", "xz", "yx", "yz", "zx", "zy"), std=0.005),
}
# Without a gyro the attitude walks as the vehicle turns, and what lasts of its rate walks as well.
TURNING_PARTS = {"gyro_bias": Part(size=3, std=0.3, walk="gyro_walk")}
TURNING_LEVELS = {"rotation": Level(usual=0.1), "gyro_walk": Level(usual=0.1, spread=1.0)}

MOVING = ("attitude", "velocity", "position", "way")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """States at a series of instants.

    Attributes
    ----------
    C_nb : (time, 3, 3)
        Attitude.
    x : (time, states)
        All else, in its layout; zero in the place of the attitude.
    """

    C_nb: jax.Array
    x: jax.Array


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


def gyro_matrix(x: Mapping[str, jax.Array]) -> jax.Array:
    """What scales and crossed axes add to a rate as read, a matrix (..., 3, 3)."""
    return _matrix(x, ("gyro_scale", _SCALES), ("gyro_axes", _ACROSS))


def _matrix(x: Mapping[str, jax.Array], *parts: tuple[str, np.ndarray]) -> jax.Array:
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
    w_b = intervals.w_b - x["gyro_bias"][:-1, None]
    if "gyro_scale" in layout:
        w_b = w_b + jnp.einsum("kij,ktj->kti", gyro_matrix(x)[:-1], intervals.w_b)
    M = jnp.eye(3) + _matrix(x, ("accelerometer_scale", _SCALES), ("accelerometer_axes", _BELOW))[:-1]
    added = x["accelerometer_bias"][:-1] + x["force_error"][:-1]
    f_b = jnp.einsum("kij,ktj->kti", M, intervals.f_b) - added[:, None]

    C, C_next = trajectory.C_nb[:-1], trajectory.C_nb[1:]
    by_gyro = relative_attitudes(w_b, intervals.dt)
    turn = matrix_to_rotvec(jnp.swapaxes(C, -1, -2) @ C_next @ jnp.swapaxes(by_gyro[:, -1], -1, -2))
    summed = preintegrate(f_b, w_b, by_gyro, turn, intervals.dt)

    down = gravity * jnp.array([0.0, 0.0, -1.0])
    v, p = x["velocity"], x["position"]
    later = share[1:] * intervals.duration[:, None]
    gained = jnp.einsum("kij,ktj->kti", C, summed.velocity)
    before = jnp.concatenate([jnp.zeros_like(gained[:, :1]), gained[:, :-1]], 1)
    moved = jnp.cumsum(0.5 * (gained + before) * intervals.dt[..., None], 1)
    v_n = v[:-1, None] + gained + later[..., None] * down
    p_n = p[:-1, None] + later[..., None] * v[:-1, None] + moved + 0.5 * later[..., None] ** 2 * down
    speed = _safe.norm(jnp.concatenate([v[:-1, None], v_n], 1))
    way = x["way"][:-1, None] + jnp.cumsum(0.5 * (speed[:, 1:] + speed[:, :-1]) * intervals.dt, 1)
    led = way[:, -1]
    way = way + share[1:] * (x["way"][1:] - led)[:, None]
    part = share[1:, None]
    v_n = v_n + part * (v[1:] - v_n[:, -1])[:, None]
    p_n = p_n + part * (p[1:] - p_n[:, -1])[:, None]

    # Gains multiply the reading, before the bias is taken off.
    by_matrix = summed.velocity_by_matrix - jnp.einsum("kai,kj->kaij", summed.velocity_by_bias, added)
    by = {
        "turn": C @ summed.velocity_by_turn @ jnp.swapaxes(C, -1, -2),
        "accelerometer_bias": C @ summed.velocity_by_bias,
        "force_error": C @ summed.velocity_by_bias,
        "accelerometer_scale": C @ jnp.einsum("kaij,pij->kap", by_matrix, _SCALES),
        "accelerometer_axes": C @ jnp.einsum("kaij,pij->kap", by_matrix, _BELOW),
        "gyro_bias": C @ summed.velocity_by_gyro[..., :3],
    }
    turn_by = {"gyro_bias": C @ summed.turn_by_gyro[..., :3]}
    if "gyro_scale" in layout:
        for found, columns in ((by, summed.velocity_by_gyro), (turn_by, summed.turn_by_gyro)):
            raw = columns[..., 3:].reshape(-1, 3, 3, 3) - jnp.einsum(
                "kai,kj->kaij", columns[..., :3], x["gyro_bias"][:-1]
            )
            found["gyro_scale"] = C @ jnp.einsum("kaij,pij->kap", raw, _SCALES)
            found["gyro_axes"] = C @ jnp.einsum("kaij,pij->kap", raw, _ACROSS)
    return Between(
        instants=instants,
        duration=intervals.duration,
        gap=intervals.gap,
        t=instants[:-1, None] + later,
        C_nb=C[:, None] @ summed.C,
        v_n=v_n,
        p_n=p_n,
        way=way,
        led=led,
        gained=jnp.concatenate([jnp.einsum("kij,kj->ki", C, turn), gained[:, -1], moved[:, -1]], -1),
        by=by,
        turn_by=turn_by,
        rate=_about_instants(intervals.w_b, intervals, share),
        acceleration=_about_instants(jnp.einsum("ktij,ktj->kti", C[:, None] @ summed.C, f_b), intervals, share) + down,
    )


# Over how long before and after an instant readings are averaged to tell its rate and acceleration, s.
_ABOUT = 0.1


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


def transitions(
    trajectory: Trajectory,
    between: Between,
    levels: Mapping[str, jax.Array],
    parts: Mapping[str, Part],
    gravity: jax.Array,
    layout: Layout,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Transition of the error state over each interval.

    Parameters
    ----------
    trajectory : Trajectory
        Where to linearise.
    between : Between
        What the readings say, about the same trajectory.
    levels : mapping of str to ()
        Noise levels by name.
    parts : mapping of str to Part
        The parts of the state, by name.
    gravity : () m/s^2
        Magnitude of gravity.
    layout : Layout
        Of the states.

    Returns
    -------
    F : (intervals, states, states)
        Derivative of the state by the one before.
    c : (intervals, states)
        What is missing for the trajectory to obey its own dynamics.
    Q : (intervals, states, states)
        Covariance of the noise.
    """
    x = layout.split(trajectory.x)
    dt, gap = between.duration, between.gap
    shape, dtype = dt.shape, dt.dtype
    miss, gained, moved = jnp.split(between.gained, 3, -1)
    down = gravity * jnp.array([0.0, 0.0, -1.0], dtype)
    before, after = slice(None, -1), slice(1, None)
    v, p = x["velocity"], x["position"]
    mean = 0.5 * (v[before] + v[after])
    along = (mean / jnp.maximum(_safe.norm(mean), 1e-6)[:, None])[:, None]  # (intervals, 1, 3)
    # About the same of the position: what grows evenly in the velocity, or with its square.
    half, third = 0.5 * dt[:, None, None], dt[:, None, None] / 3

    lever = skew(gained)
    to_position = {"attitude": -skew(moved), "velocity": dt[:, None, None] * jnp.eye(3, dtype=dtype)}
    to_position |= {
        name: (third if name.startswith("gyro") else half) * by for name, by in between.by.items() if name != "turn"
    }
    blocks = {("attitude", name): by for name, by in between.turn_by.items()}
    blocks |= {("velocity", "attitude"): -lever}
    blocks |= {("velocity", name): by for name, by in between.by.items() if name != "turn"}
    blocks |= {("position", name): block for name, block in to_position.items()}
    blocks |= {("way", name): along @ block for name, block in to_position.items()}
    kept = {name: jnp.exp(-dt / levels[part.time]) for name, part in parts.items() if part.time}
    blocks |= {
        (name, name): (keep - 1)[:, None, None] * jnp.eye(parts[name].size, dtype=dtype) for name, keep in kept.items()
    }
    F = jnp.eye(layout.size, dtype=dtype) + layout.matrix(blocks, shape, dtype)

    by_turn = between.by["turn"]
    turned_by = jnp.einsum("kij,kj->ki", by_turn, miss)
    missing = {name: x[name][before] - x[name][after] for name, part in parts.items() if part.walk}
    missing |= {
        name: (keep if parts[name].size == 1 else keep[:, None]) * x[name][before] - x[name][after]
        for name, keep in kept.items()
    }
    missing["attitude"] = -miss
    missing["velocity"] = v[before] + down * dt[:, None] + gained - v[after] - turned_by
    missing["position"] = p[before] - p[after] + dt[:, None] * v[before] + moved + 0.5 * dt[:, None] ** 2 * down
    missing["position"] = missing["position"] - dt[:, None] / 3 * turned_by
    third_of_turn = jnp.einsum("kij,kj->ki", along, dt[:, None] / 3 * turned_by)[:, 0]
    missing["way"] = between.led - third_of_turn - x["way"][after]
    c = layout.joined(missing, shape, dtype)

    turned = (levels["rotation"] ** 2 * dt + (_UNSEEN_TURN * gap) ** 2)[:, None, None]
    shaken = (levels["acceleration"] ** 2 * dt + (_UNSEEN_ACCELERATION * gap) ** 2)[:, None, None]
    identity = jnp.broadcast_to(jnp.eye(3, dtype=dtype), (*shape, 3, 3))
    to_way = along @ (third * by_turn)
    response = jnp.concatenate([identity, by_turn, third * by_turn, to_way], -2)
    moving = turned * response @ jnp.swapaxes(response, -1, -2)
    # An even turn is what the ends of a random walk leave on average; about it the walk still wanders.
    wander = turned * (lever @ jnp.swapaxes(lever, -1, -2) / 12)
    none = jnp.zeros_like(identity)
    for response, size in (
        (jnp.concatenate([none, identity, half * identity, along @ (half * identity)], -2), shaken * identity + wander),
        (
            jnp.concatenate([none, none, identity, along], -2),
            shaken * dt[:, None, None] ** 2 / 12 * identity,
        ),
    ):
        moving = moving + response @ size @ jnp.swapaxes(response, -1, -2)
    alone = {
        name: jnp.repeat((levels[part.walk] ** 2 * dt)[:, None], part.size, -1)
        for name, part in parts.items()
        if part.walk
    }
    for name, keep in kept.items():
        alone[name] = stationary(parts[name], levels) * (1 - keep * keep)[:, None]
    diagonal = layout.joined(alone, shape, dtype)
    rest = layout.size - moving.shape[-1]
    Q = jnp.pad(moving, [(0, 0), (0, rest), (0, rest)]) + diagonal[:, None] * jnp.eye(layout.size, dtype=dtype)
    return F, c, Q


def stationary(part: Part, levels: Mapping[str, jax.Array]) -> jax.Array:
    """Variances (size,) of a part that fades, as its levels have them."""
    return jnp.broadcast_to(jnp.stack([jnp.asarray(levels[name]) ** 2 for name in part.level]), (part.size,))


def moved(trajectory: Trajectory, x: jax.Array, layout: Layout) -> Trajectory:
    """The trajectory with an error state (time, states) added at each instant."""
    attitude = layout.at("attitude")
    return Trajectory(
        C_nb=rotvec_to_matrix(x[:, attitude]) @ trajectory.C_nb,
        x=trajectory.x + jnp.asarray(x).at[:, attitude].set(0),
    )
