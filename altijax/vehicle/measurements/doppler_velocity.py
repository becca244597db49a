"""Velocities of a GNSS receiver by Doppler: of its antenna, late, with errors that last."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.drives import gnss_velocities
from altijax.recordings import Recording
from altijax.vehicle.parts import Instant, Kind, Level, Part, Rows, State, turning_of

ANTENNA = Part(size=3, std=(1.0, 0.5, 1.0))
"""Where the antenna is, seen from the IMU, m."""
USUAL_DELAY = 0.1
GNSS_DELAY = Part(mean=USUAL_DELAY, std=0.3)
"""How late the receiver's stamps are, s."""

# Velocities this many usual intervals away from an instant are not of it.
_HALF = 0.5


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Velocity of the antenna as the receiver gives it (3,), m/s."""
    later = lead - (state["gnss_delay"] - at.delay)
    antenna = state["C_nb"] @ turning_of(state, at, "antenna")
    climb = at.acceleration[2] * state["climb_delay"]
    velocity = state["velocity"] + antenna + state["velocity_error"] + at.acceleration * later
    return velocity - climb * jnp.array([0.0, 0.0, 1.0])


def measured(recording: Recording, t: np.ndarray) -> Rows | None:
    """Means of the velocities that lie closer to an instant, on the receiver's clock, than to any other."""
    found = gnss_velocities(recording)
    if found is None:
        return None
    stamp, value, std = found
    return means_at(t, stamp, value, std, _HALF * np.median(np.diff(t)))


def means_at(t: np.ndarray, stamp: np.ndarray, value: np.ndarray, std: np.ndarray, reach: float) -> Rows:
    """Means of samples about the nearest instants, none farther than `reach` (s); errors are taken to be common."""
    order = np.argsort(t, kind="stable")
    middle = 0.5 * (t[order][1:] + t[order][:-1])
    nearest = order[np.searchsorted(middle, stamp)]
    used = np.abs(stamp - t[nearest]) <= reach + 1e-9
    nearest, stamp, value, std = nearest[used], stamp[used], value[used], std[used]
    there = np.isfinite(std)
    count = np.zeros((t.size, value.shape[1]))
    sums, spread = np.zeros_like(count), np.zeros_like(count)
    np.add.at(count, nearest, there)
    np.add.at(sums, nearest, np.where(there, value, 0.0))
    np.add.at(spread, nearest, np.where(there, std, 0.0))
    rows, time = np.zeros(t.size), np.zeros(t.size)
    np.add.at(rows, nearest, 1.0)
    np.add.at(time, nearest, stamp)
    full = np.maximum(count, 1)
    return Rows(
        value=sums / full,
        std=np.where(count > 0, spread / full, np.inf),
        stamp=np.where(rows > 0, time / np.maximum(rows, 1), t),
    )


KIND = Kind(
    rows=("v_e", "v_n", "v_u"),
    expected=expected,
    measured=measured,
    by_receiver=True,
    parts={
        "antenna": ANTENNA,
        "gnss_delay": GNSS_DELAY,
        # Receivers smooth the climb more than the rest.
        "climb_delay": Part(std=0.1),
        "velocity_error": Part(
            size=3, level=("lasting_horizontal", "lasting_horizontal", "lasting_vertical"), time="receiver_time"
        ),
    },
    levels={
        "horizontal": Level(usual=1.0, spread=0.5),
        "vertical": Level(usual=1.0, spread=0.5),
        "lasting_horizontal": Level(usual=0.02),
        "lasting_vertical": Level(usual=0.03),
        "receiver_time": Level(usual=10.0, spread=1.0),
    },
    factor=("horizontal", "horizontal", "vertical"),
)
