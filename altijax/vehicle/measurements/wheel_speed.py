"""Speed by the turning of wheels: without a sign, with a scale, late, and slipping a little."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.drives import start_of
from altijax.recordings import Recording
from altijax.vehicle.measurements.course import AXLE, MOUNTING
from altijax.vehicle.measurements.doppler_velocity import means_at
from altijax.vehicle.parts import Instant, Kind, Level, Part, Rows, State, turning_of

# Of the mean of some wheels over an instant's half second, m/s: toothed wheels and rounding.
_STD = 0.03


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Speed of the wheels as read (1,), m/s: sensors count teeth, forward and in reverse."""
    C_bn = state["C_nb"].T
    yaw, pitch = -state["mounting"]
    ahead = jnp.stack([jnp.cos(pitch) * jnp.cos(yaw), jnp.cos(pitch) * jnp.sin(yaw), jnp.sin(pitch)])
    forward = ahead @ (C_bn @ state["velocity"] + turning_of(state, at, "axle"))
    later = lead - state["wheel_delay"]
    speed = forward + (ahead @ (C_bn @ at.acceleration)) * later
    sign = jnp.where(jax.lax.stop_gradient(forward) < 0, -1.0, 1.0)
    return jnp.stack([sign * speed * (1 + state["wheel_scale"] + state["wheel_slip"])])


def measured(recording: Recording, t: np.ndarray) -> Rows | None:
    """Mean speeds about the instants."""
    if recording.wheel is None:
        return None
    speed = recording.wheel["speed"].dropna()
    stamp = speed.index.to_numpy(float) - start_of(recording)
    value = speed.to_numpy(float)[:, None]
    return means_at(t, stamp, value, np.full_like(value, _STD), 0.5 * float(np.median(np.diff(t))))


KIND = Kind(
    rows=("speed",),
    expected=expected,
    measured=measured,
    parts={
        "axle": AXLE,
        "mounting": MOUNTING,
        "wheel_scale": Part(std=0.02),
        "wheel_delay": Part(std=0.1),
        "wheel_slip": Part(level=("wheel_slip",), time="wheel_slip_time"),
    },
    levels={
        "wheel": Level(usual=1.0),
        "wheel_slip": Level(usual=0.003),
        "wheel_slip_time": Level(usual=10.0, spread=1.0),
    },
    factor=("wheel",),
)
