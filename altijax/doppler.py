"""GNSS Doppler velocity: what a receiver reports of a motion, and speed over ground, course and climb.

The correction of a receiver's stamps is one subtraction: the velocity stamped t was that of ``t - latency``.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, increasing
from altijax.rotations import yaw_to_heading


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class DopplerReceiver:
    """Parameters of a GNSS receiver's Doppler velocity; without arguments one without errors at 1 Hz.

    Attributes
    ----------
    rate : () Hz
        Epochs per second.
    horizontal_noise : () m/s
        Standard deviation of the errors of v_e and of v_n.
    vertical_noise : () m/s
        Standard deviation of the error of v_u.
    correlation_time : () s
        Time after which the correlation of the errors has fallen to 1/e; zero for independent epochs.
    latency : () s
        By how much a stamp is later than the motion it reports.
    dropout_probability : ()
        Probability that an epoch is missing, independently of the others.
    """

    rate: ArrayLike = 1.0
    horizontal_noise: ArrayLike = 0.0
    vertical_noise: ArrayLike = 0.0
    correlation_time: ArrayLike = 0.0
    latency: ArrayLike = 0.0
    dropout_probability: ArrayLike = 0.0


@checked(t=increasing)
@partial(jax.jit, static_argnames="epochs")
def doppler_velocity(
    receiver: DopplerReceiver, t: ArrayLike, v_n: ArrayLike, *, epochs: int, key: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Velocities that a receiver reports.

    Parameters
    ----------
    receiver : DopplerReceiver
        Parameters.
    t : (time,) s
        Times of the motion, increasing and dense: it is taken as linear in between.
    v_n : (..., time, 3) m/s
        True velocity, East, North and up.
    epochs : int
        Room for epochs; the first is stamped with the first time.
    key : key
        Source of noise and dropouts.

    Returns
    -------
    t_epochs : (epochs,) s
        Stamps.
    v_epochs : (..., epochs, 3) m/s
        Reported velocity.
    valid : (..., epochs)
        False where the epoch was dropped, or the motion it would report lies before the first or after the last time.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    t = require_shape("t", t, (None,))
    v_n = require_shape("v_n", v_n, (..., t.size, 3))
    dtype = v_n.dtype
    rate, horizontal, vertical, correlation, latency, dropout = (
        require_shape(name, getattr(receiver, name), ()).astype(dtype)
        for name in (
            "rate",
            "horizontal_noise",
            "vertical_noise",
            "correlation_time",
            "latency",
            "dropout_probability",
        )
    )
    t_epochs = t[0] + jnp.arange(epochs, dtype=dtype) / rate
    moved = t_epochs - latency
    at_epochs = jnp.vectorize(jnp.interp, signature="(epochs),(time),(time)->(epochs)")
    true = jnp.swapaxes(at_epochs(moved, t, jnp.swapaxes(v_n, -1, -2)), -1, -2)
    supported = (moved >= t[0]) & (moved <= t[-1])
    noise_key, dropout_key = jax.random.split(key)
    noise = _correlated(jax.random.normal(noise_key, true.shape, dtype), rate, correlation)
    kept = ~jax.random.bernoulli(dropout_key, dropout, true.shape[:-1])
    return t_epochs, true + noise * jnp.stack([horizontal, horizontal, vertical]), supported & kept


def velocity_to_course(v_n: ArrayLike) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Speed over ground, course over ground and climb rate of a velocity; the inverse of `course_to_velocity`.

    Parameters
    ----------
    v_n : (..., 3) m/s
        Velocity, East, North and up.

    Returns
    -------
    sog : (...) m/s
        Speed over ground.
    cog : (...) rad
        Course over ground, clockwise from North in [0, 2 pi); without horizontal motion it is undefined, and pi / 2.
    climb : (...) m/s
        Climb rate.

    Raises
    ------
    ValueError
        If the trailing axis of `v_n` is not 3.
    """
    v_n = require_shape("v_n", v_n, (..., 3))
    return _safe.norm(v_n[..., :2]), yaw_to_heading(_safe.arctan2(v_n[..., 1], v_n[..., 0])), v_n[..., 2]


def course_to_velocity(sog: ArrayLike, cog: ArrayLike, climb: ArrayLike) -> jax.Array:
    """Velocity of speed over ground, course over ground and climb rate, Eq. (1) of [chalko2010]_.

    Parameters
    ----------
    sog : (...) m/s
        Speed over ground.
    cog : (...) rad
        Course over ground, clockwise from North.
    climb : (...) m/s
        Climb rate.

    Returns
    -------
    v_n : (..., 3) m/s
        Velocity, East, North and up.
    """
    sog = require_shape("sog", sog, (...,))
    cog = require_shape("cog", cog, (...,))
    climb = require_shape("climb", climb, (...,))
    return jnp.stack(jnp.broadcast_arrays(sog * jnp.sin(cog), sog * jnp.cos(cog), climb), -1)  # Eq. (1)


def _correlated(white: jax.Array, rate: jax.Array, correlation_time: jax.Array) -> jax.Array:
    """First-order Gauss-Markov process (..., epochs, 3) of unit variance made from unit white noise."""
    remembers = correlation_time > 0
    x = 1 / (rate * jnp.where(remembers, correlation_time, 1))
    keep = jnp.where(remembers, jnp.exp(-x), 0)
    new = jnp.where(remembers, jnp.sqrt(-jnp.expm1(-2 * x)), 1)

    def step(e: jax.Array, n: jax.Array) -> tuple[jax.Array, jax.Array]:
        e = keep * e + new * n
        return e, e

    first = white[..., 0, :]
    later = jax.lax.scan(step, first, jnp.moveaxis(white[..., 1:, :], -2, 0))[1]
    return jnp.concatenate([first[..., None, :], jnp.moveaxis(later, 0, -2)], -2)
