"""Transitions against derivatives of what they linearise."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.vehicle import inertial
from altijax.vehicle.inertial import Trajectory, moved
from altijax.vehicle.sensors import layout_of, parts_of
from altijax.vehicle.smoother import between
from altijax.vehicle.transitions import transitions
from tests.quick import quick_jit
from tests.vehicle.made import USE, short_search

LAYOUT, PARTS = layout_of(USE), parts_of(USE)


@quick_jit
def missing(trajectory: Trajectory, delay: jax.Array) -> tuple[jax.Array, jax.Array]:
    search = short_search()
    levels = {name: jnp.asarray(level) for name, level in search.levels.items()}
    said = between(USE, search.readings, trajectory, delay)
    F, c, _ = transitions(trajectory, said, levels, PARTS, search.readings.gravity, LAYOUT)
    return c, F


def test_transitions_are_the_derivatives_of_what_is_missing() -> None:
    """What is missing after an error e of the trajectory is c + F e before - e after."""
    search, rng = short_search(), np.random.default_rng(1)
    trajectory = jax.tree.map(jnp.asarray, search.trajectory)
    delay = jnp.asarray(search.delay)
    scale = np.concatenate([np.broadcast_to(0.01 if n == "attitude" else 1e-3, part.size) for n, part in PARTS.items()])
    # Constants are the same at all instants.
    e = rng.normal(size=(len(trajectory.x), LAYOUT.size)) * scale
    constant = np.concatenate(
        [np.full(p.size, not (p.walk or p.time or n in inertial.MOVING)) for n, p in PARTS.items()]
    )
    e[:, constant] = e[0, constant]
    step = 1e-4
    (ahead, _), (behind, F) = (missing(moved(trajectory, s * e, LAYOUT), delay) for s in (step, -step))
    _, F = missing(trajectory, delay)
    change = (ahead - behind) / (2 * step)
    expected = jnp.einsum("kij,kj->ki", F, e[:-1]) - e[1:]
    apart = np.abs(change - expected)
    lasts = np.diff(np.asarray(between(USE, search.readings, trajectory, delay).instants)) > 1e-9
    for name in ("attitude", "velocity"):
        assert apart[lasts][:, LAYOUT.at(name)].max() < 2e-4, name
    # Of positions the derivatives by constants are those of an even motion.
    assert apart[lasts][:, LAYOUT.at("position")].max() < 2e-3
    # The way of what hardly moves has no derivative.
    fast = lasts & (np.linalg.norm(search.trajectory.x[1:, LAYOUT.at("velocity")], axis=1) > 3)
    assert apart[fast][:, LAYOUT.at("way")].max() < 2e-3
    others = [n for n, part in PARTS.items() if part.walk or part.time]
    for name in others:
        assert apart[lasts][:, LAYOUT.at(name)].max() < 1e-9, name


def test_noise_is_a_covariance() -> None:
    search = short_search()
    trajectory = jax.tree.map(jnp.asarray, search.trajectory)
    said = between(USE, search.readings, trajectory, jnp.asarray(search.delay))
    levels = {name: jnp.asarray(level) for name, level in search.levels.items()}
    Q = np.asarray(transitions(trajectory, said, levels, PARTS, search.readings.gravity, LAYOUT)[2])
    assert np.abs(Q - np.swapaxes(Q, -1, -2)).max() < 1e-15
    assert np.linalg.eigvalsh(Q).min() > -1e-12
