"""How the error of a vehicle's state goes on from instant to instant, linear about a trajectory.

The trajectory need not obey its own dynamics: what is missing at each step is part of the model, so that repeating
linearisation and smoothing is the Gauss-Newton method on the whole record and ends at its most probable trajectory.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp

from altijax import _safe
from altijax.inference.layout import Layout
from altijax.rotations import skew
from altijax.vehicle.between import Between
from altijax.vehicle.inertial import ROTATION, Trajectory, stationary
from altijax.vehicle.parts import Part

Levels = Mapping[str, jax.Array]

# How fast attitude and velocity may change unseen in a gap of the IMU: rad/s and m/s^2.
_UNSEEN_TURN, _UNSEEN_ACCELERATION = 0.5, 3.0


def transitions(
    trajectory: Trajectory,
    between: Between,
    levels: Levels,
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
    kept = {name: jnp.exp(-between.duration / levels[part.time]) for name, part in parts.items() if part.time}
    mean = 0.5 * (x["velocity"][:-1] + x["velocity"][1:])
    along = (mean / jnp.maximum(_safe.norm(mean), 1e-6)[:, None])[:, None]
    F = _transition(between, along, kept, parts, layout)
    c = _missing(x, between, along, kept, parts, gravity, layout)
    walked = jnp.stack([levels[name] for name in ROTATION if name in levels])
    C = trajectory.C_nb[:-1]
    turning = C * walked**2 @ jnp.swapaxes(C, -1, -2)
    return F, c, _noise(between, along, turning, kept, levels, parts, layout)


def _transition(
    between: Between, along: jax.Array, kept: Levels, parts: Mapping[str, Part], layout: Layout
) -> jax.Array:
    dt = between.duration[:, None, None]
    _, gained, moved = jnp.split(between.gained, 3, -1)
    by = {name: block for name, block in between.by.items() if name != "turn"}
    # Of the position: what grows evenly in the velocity, or with its square, as turns do.
    to_position = {"attitude": -skew(moved), "velocity": dt * jnp.eye(3, dtype=dt.dtype)}
    to_position |= {name: (dt / 3 if name.startswith("gyro") else dt / 2) * block for name, block in by.items()}
    blocks = {("attitude", name): block for name, block in between.turn_by.items()}
    blocks |= {("velocity", "attitude"): -skew(gained)} | {("velocity", name): block for name, block in by.items()}
    blocks |= {("position", name): block for name, block in to_position.items()}
    blocks |= {("way", name): along @ block for name, block in to_position.items()}
    for name, keep in kept.items():
        blocks[name, name] = (keep - 1)[:, None, None] * jnp.eye(parts[name].size, dtype=dt.dtype)
    return jnp.eye(layout.size, dtype=dt.dtype) + layout.matrix(blocks, between.duration.shape, dt.dtype)


def _missing(
    x: Levels,
    between: Between,
    along: jax.Array,
    kept: Levels,
    parts: Mapping[str, Part],
    gravity: jax.Array,
    layout: Layout,
) -> jax.Array:
    dt = between.duration[:, None]
    before, after = slice(None, -1), slice(1, None)
    v, p = x["velocity"], x["position"]
    miss, gained, moved = jnp.split(between.gained, 3, -1)
    down = gravity * jnp.array([0.0, 0.0, -1.0], dt.dtype)
    turned = jnp.einsum("kij,kj->ki", between.by["turn"], miss)
    missing = {name: x[name][before] - x[name][after] for name, part in parts.items() if part.walk}
    for name, keep in kept.items():
        share = keep if parts[name].size == 1 else keep[:, None]
        missing[name] = share * x[name][before] - x[name][after]
    missing["attitude"] = -miss
    missing["velocity"] = v[before] + down * dt + gained - v[after] - turned
    missing["position"] = p[before] + dt * v[before] + moved + 0.5 * dt**2 * down - p[after] - dt / 3 * turned
    missing["way"] = between.led - x["way"][after] - jnp.einsum("kij,kj->ki", along, dt / 3 * turned)[:, 0]
    return layout.joined(missing, between.duration.shape, dt.dtype)


def _noise(
    between: Between,
    along: jax.Array,
    turning: jax.Array,
    kept: Levels,
    levels: Levels,
    parts: Mapping[str, Part],
    layout: Layout,
) -> jax.Array:
    dt, gap = between.duration[:, None, None], between.gap[:, None, None]
    identity = jnp.broadcast_to(jnp.eye(3, dtype=dt.dtype), (*between.duration.shape, 3, 3))
    none, by_turn = jnp.zeros_like(identity), between.by["turn"]
    lever = skew(between.gained[:, 3:6])
    turned = turning * dt + (_UNSEEN_TURN * gap) ** 2 * identity
    shaken = levels["acceleration"] ** 2 * dt + (_UNSEEN_ACCELERATION * gap) ** 2
    # An even turn is what the ends of a random walk leave on average; about it the walk still wanders.
    wander = lever @ turned @ jnp.swapaxes(lever, -1, -2) / 12
    # Of attitude, velocity and position by each source, and its covariance.
    sources = (
        ((identity, by_turn, dt / 3 * by_turn), turned),
        ((none, identity, dt / 2 * identity), shaken * identity + wander),
        ((none, none, identity), shaken * dt**2 / 12 * identity),
    )
    moving = jnp.zeros(())
    for response, covariance in sources:
        to = jnp.concatenate([*response, along @ response[-1]], -2)
        moving = moving + to @ covariance @ jnp.swapaxes(to, -1, -2)
    alone = {
        name: jnp.repeat(levels[part.walk] ** 2 * between.duration[:, None], part.size, -1)
        for name, part in parts.items()
        if part.walk
    }
    for name, keep in kept.items():
        alone[name] = stationary(parts[name], levels) * (1 - keep * keep)[:, None]
    diagonal = layout.joined(alone, between.duration.shape, dt.dtype)
    rest = layout.size - moving.shape[-1]
    return jnp.pad(moving, [(0, 0), (0, rest), (0, rest)]) + diagonal[:, None] * jnp.eye(layout.size, dtype=dt.dtype)
