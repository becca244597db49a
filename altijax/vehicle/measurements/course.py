"""The direction of travel: along body x but for the mounting, slips, and the wind of a craft."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from altijax import _safe
from altijax.recordings import Recording
from altijax.vehicle.parts import Instant, Kind, Level, Part, Rows, State, turning_of

# What the slips leave of the angles, rad, and the speed below which body x says little of the direction of travel, m/s.
_LEFT, _SLOW = 0.01, 0.5


AXLE = Part(size=3, std=(1.5, 0.3, 0.5))
"""Where the point is, seen from the IMU, that does not slip sideways, m: the middle of a car's rear axle."""


MOUNTING = Part(size=2, entries=("yaw", "pitch"), std=0.1)
"""How far body x is turned from the direction of travel, rad."""


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Yaw and pitch (2,), rad, of the direction of travel in body axes, with what mounting and slips make up for."""
    forward, left, up = _through_air(state, at)
    angles = jnp.stack([_safe.arctan2(left, forward), _safe.arctan2(up, _safe.norm(jnp.stack([forward, left])))])
    return angles + state["slip"] + state["mounting"] + state["yielding"] * _forces(state, at)


def _through_air(state: State, at: Instant) -> jax.Array:
    wind = jnp.append(state["wind"], 0.0) if "wind" in state else 0.0
    v_b = state["C_nb"].T @ (state["velocity"] - wind)
    return v_b + turning_of(state, at, "axle")


def _forces(state: State, at: Instant) -> jax.Array:
    """Acceleration to the left and forward, by which a vehicle slips and pitches, m/s^2."""
    forward, left, _ = state["C_nb"].T @ at.acceleration
    return jnp.stack([left, forward])


def floor(state: State, at: Instant) -> jax.Array:
    """Variance that grows as the vehicle slows down (2,), rad^2."""
    speed = jnp.sum(_through_air(state, at) ** 2)
    return jnp.broadcast_to(_SLOW**2 / jnp.maximum(speed, 1e-6), (2,))


def measured(recording: Recording, t: np.ndarray) -> Rows:
    """Zeros at every instant: nothing is read, but this is what holds."""
    return Rows(value=np.zeros((t.size, 2)), std=np.full((t.size, 2), _LEFT), stamp=t)


KIND = Kind(
    rows=("sideways", "upwards"),
    expected=expected,
    measured=measured,
    parts={
        "axle": AXLE,
        "mounting": MOUNTING,
        "slip": Part(size=2, level=("sideslip", "attack"), time="slip_time"),
        "yielding": Part(size=2, entries=("yaw", "pitch"), std=0.005),
    },
    levels={"sideslip": Level(usual=0.1), "attack": Level(usual=0.1), "slip_time": Level(usual=3.0)},
    floor=floor,
)
# The mount of a craft's IMU is in its sideslip, which is as large as a crooked mount and which nothing in flight tells
# from it.
CRAFT = {"mounting": replace(MOUNTING, std=(0.0, 0.1))}
WIND = {"wind": Part(size=2, entries=("e", "n"), std=10.0)}


def untold_levels(craft: bool) -> dict[str, Level]:
    """Slips where no gyro tells of the attitude: it would follow the course as closely as it is told to, and no
    likelihood can say how closely that is. Assumed, of a car and of a small aircraft."""
    usual = 0.1 if craft else 0.05
    return {
        "sideslip": Level(usual=usual, spread=0.0),
        "attack": Level(usual=usual, spread=0.0),
        "slip_time": Level(usual=3.0, spread=0.0),
    }
