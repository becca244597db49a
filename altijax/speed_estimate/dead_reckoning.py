"""Speed after the aid by the methods of [us20060293826], and its error, from what a filter knows of the start.

The error is that of the method's own equations made linear: each state known at the start carries its uncertainty along
by the derivative of the speed with respect to it, correlations included, and noise comes in on the way. With
errors v of the speed, p of the pitch and r of a roll that is neglected,

    v' = -g cos(pitch) p + accelerometer noise,   p' = -w_z^2 v / g + |w_z| r + gyro noise

where the second equation's first term is that of "roll" alone and its second that of "conventional" alone; the
lateral equation of the others has an error, too, which turns the pitch by w_z / g of it.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from altijax.speed import speed_with_aided_roll, speed_with_roll, speed_without_roll
from altijax.speed_estimate.model import SpeedNoise


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Start:
    """What is known where dead reckoning begins.

    Attributes
    ----------
    speed : () m/s
        Speed along the path.
    roll : () rad
        Roll of the IMU.
    states : (states,)
        States of the filter.
    covariance : (states, states)
        Their covariance.
    """

    speed: Any
    roll: Any
    states: Any
    covariance: Any


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Reckoned:
    """Speed by dead reckoning.

    Attributes
    ----------
    speed, std : (time,) m/s
        Speed along the path and its standard deviation.
    pitch, roll : (time,) rad
        Attitude of the path.
    valid : (time,)
        False where no roll explains the readings.
    """

    speed: jax.Array
    std: jax.Array
    pitch: jax.Array
    roll: jax.Array
    valid: jax.Array


@partial(jax.jit, static_argnames=("method", "names"))
def reckon(
    method: str,
    names: tuple[str, ...],
    start: Start,
    f_b: jax.Array,
    w_b: jax.Array,
    vibration: jax.Array,
    gravity: jax.Array,
    dt: jax.Array,
    noise: SpeedNoise,
    step: float,
) -> Reckoned:
    """Speed at each sample from the first on.

    Parameters
    ----------
    method : {"conventional", "roll", "aided"}
        As of `estimate_speed`.
    names : tuple of str
        Names of the states.
    start : Start
        What is known at the first sample.
    f_b, w_b : (time, 3) m/s^2, rad/s
        Readings.
    vibration : (time,) rad^2/s^2
        Mean square of what is fast in w_y.
    gravity : () m/s^2
        Magnitude.
    dt : () s
        Time between samples.
    noise : SpeedNoise
        Noise levels.
    step : float
        Duration of a step of the filter, s, for which the error of the lateral equation is stated.

    Returns
    -------
    reckoned : Reckoned
        Speed, error and attitude.
    """

    def solved(change: jax.Array) -> tuple[jax.Array, tuple[jax.Array, ...]]:
        by = dict(zip(names, change, strict=True))
        x = dict(zip(names, start.states + change, strict=True))
        f_x, f_y = f_b[:, 0] - x["accelerometer_bias_x"], f_b[:, 1] - x["accelerometer_bias_y"]
        w_y = w_b[:, 1] - x["gyro_bias_y"] - x["rectification_y"] * vibration
        w_z = w_b[:, 2] - x["gyro_bias_z"]
        # along and across the direction of travel
        along, across = jnp.cos(x["travel_yaw"]), jnp.sin(x["travel_yaw"])
        f_x, f_y = along * f_x + across * f_y, along * f_y - across * f_x
        roll0 = start.roll + by["roll"]
        sine = along * jnp.sin(x["pitch"]) + across * jnp.cos(x["pitch"]) * jnp.sin(roll0)
        begin = start.speed + by["speed"], jnp.arcsin(jnp.clip(sine, -1, 1)), gravity, dt
        if method == "conventional":
            speed, pitch = speed_without_roll(f_x, w_y, *begin)
            return speed, (pitch, jnp.zeros_like(pitch), jnp.ones_like(pitch, bool), w_z)
        if method == "roll":
            speed, pitch, roll, valid = speed_with_roll(f_x, f_y, w_y, w_z, *begin)
        else:
            held = jnp.full_like(f_x, start.speed) + by["speed"]
            speed, pitch, roll, valid = speed_with_aided_roll(
                f_x, f_y, w_y, w_z, held, jnp.ones_like(held, bool), *begin
            )
        return speed, (pitch, roll, valid, w_z)

    unchanged = jnp.zeros_like(start.states)
    speed, by_states, (pitch, roll, valid, w_z) = jax.linearize(solved, unchanged, has_aux=True)
    J = jax.vmap(by_states, out_axes=-1)(jnp.eye(unchanged.size, dtype=unchanged.dtype))
    variance = jnp.einsum("ti,ij,tj->t", J, start.covariance, J)
    variance += _noise_variance(method, pitch, w_z, vibration, gravity, dt, noise, step)
    if method == "aided":
        # The speed inside the roll is that of the last aid: by as much as it has changed it is wrong.
        false_rate = w_z**2 * (speed - speed[0]) / gravity
        variance += (gravity * dt**2 * jnp.cumsum(jnp.cumsum(false_rate))) ** 2
    return Reckoned(speed=speed, std=jnp.sqrt(jnp.maximum(variance, 0)), pitch=pitch, roll=roll, valid=valid)


def _noise_variance(
    method: str,
    pitch: jax.Array,
    w_z: jax.Array,
    vibration: jax.Array,
    gravity: jax.Array,
    dt: jax.Array,
    noise: SpeedNoise,
    step: float,
) -> jax.Array:
    """Variance of the speed by what comes in on the way; states: speed, pitch, both biases, a neglected roll."""
    gyro = jnp.square(noise.rotation) + jnp.square(noise.vibration) * vibration
    if method != "conventional":
        gyro = gyro + jnp.square(w_z / gravity * noise.lateral) * step
    feedback = w_z**2 / gravity if method == "roll" else 0 * w_z
    neglected = jnp.abs(w_z) if method == "conventional" else 0 * w_z
    most = jnp.sqrt(jnp.finfo(pitch.dtype).max) ** 0.5

    def proceed(P: jax.Array, sample: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
        pitch, feedback, neglected, gyro = sample
        F = jnp.eye(5, dtype=P.dtype)
        F = F.at[0, 1].set(-gravity * jnp.cos(pitch) * dt).at[0, 2].set(-dt)
        F = F.at[1, 0].set(-feedback * dt).at[1, 3].set(dt).at[1, 4].set(neglected * dt)
        walks = (noise.acceleration, 0.0, noise.accelerometer_walk, noise.gyro_walk, 0.0)
        Q = jnp.diag(jnp.stack([jnp.square(jnp.asarray(level, P.dtype)) for level in walks]))
        later = F @ P @ F.T + dt * Q.at[1, 1].set(gyro)
        return jnp.clip(later, -most, most), P[0, 0]

    P0 = jnp.zeros((5, 5), pitch.dtype).at[4, 4].set(jnp.square(jnp.asarray(noise.road_roll, pitch.dtype)))
    found: jax.Array = jax.lax.scan(proceed, P0, (pitch, feedback, neglected, gyro))[1]
    return found
