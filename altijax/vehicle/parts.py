"""What a state, a noise level and a kind of measurement are: the pieces that a set of sensors is put together from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np

from altijax.recordings import Recording

State = Mapping[str, jax.Array]
"""Parts of one state by name, those of one entry without an axis; ``C_nb`` (3, 3) is its attitude."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the state.

    Attributes
    ----------
    size : int
        Its number of entries.
    entries : tuple of str
        What they are called, where there are several.
    mean, std : float or tuple of float
        What is believed before the record; of a part that fades the levels tell.
    walk : str
        Name of the level by which it walks at random, in its unit/sqrt(s); empty for a part that stays.
    level : tuple of str
        Of a part that fades (Gauss-Markov of the first order), the level of its standard deviation, one for all its
        entries or one for each.
    time : str
        Of such a part, the level of its correlation time, s.
    """

    size: int = 1
    entries: tuple[str, ...] = ("x", "y", "z")
    mean: float | tuple[float, ...] = 0.0
    std: float | tuple[float, ...] = 0.0
    walk: str = ""
    level: tuple[str, ...] = ()
    time: str = ""


@dataclass(frozen=True, kw_only=True)
class Level:
    """A noise level: what it usually is, and by what factor, as a logarithm, it may differ (one standard deviation).

    One that may not differ at all is not fitted.
    """

    usual: float
    spread: float = 1.5


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Instant:
    """What the IMU says about an instant, about the trajectory: given to `Kind.expected`.

    Attributes
    ----------
    rate : (3,) rad/s
        Angular rate as read, in body axes.
    acceleration : (3,) m/s^2
        Acceleration, East, North and up.
    delay : () s
        By how much the instant was moved for the delay of the receiver.
    """

    rate: jax.Array
    acceleration: jax.Array
    delay: jax.Array


def rate_of(state: State, at: Instant) -> jax.Array:
    """Angular rate of the body (3,), rad/s; without a gyro the part of it that lasts."""
    return at.rate * (1 + (state["gyro_scale"] if "gyro_scale" in state else 0.0)) - state["gyro_bias"]


def turning_of(state: State, at: Instant, lever: str) -> jax.Array:
    """Velocity (3,), m/s, in body axes, of a point beside that of the IMU; none where the lever is no state."""
    return jnp.cross(rate_of(state, at), state[lever]) if lever in state else jnp.zeros(3)


@dataclass(frozen=True)
class Rows:
    """Measurements of one kind at each instant, of NumPy.

    Attributes
    ----------
    value : (time, rows)
        What was measured; any value where there is nothing.
    std : (time, rows)
        Standard deviation as far as known beforehand; infinite where there is nothing.
    stamp : (time,) s
        When it was measured, on the clock of its stream; close to the instant.
    """

    value: np.ndarray
    std: np.ndarray
    stamp: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of measurement.

    Attributes
    ----------
    rows : tuple of str
        What its rows are called.
    expected : callable
        From a `State`, an `Instant` and how much later than it the measurement is (s) to what should be measured,
        (rows,).
    measured : callable
        From a recording and instants (time,), counted from the IMU's first sample, to `Rows`, or None where the
        recording has nothing of this kind.
    by_receiver : bool
        Whether the instants for `measured` are on the receiver's clock, not the IMU's.
    parts : mapping of str to Part
        States that it brings along, by name.
    levels : mapping of str to Level
        Noise levels that it brings along, by name.
    factor : tuple of str
        Level by which the standard deviation of each row is multiplied; empty where it is as given.
    floor : callable, optional
        From a `State` and an `Instant` to a variance to be added to each row's, (rows,).
    """

    rows: tuple[str, ...]
    expected: Callable[[State, Instant, jax.Array], jax.Array]
    measured: Callable[[Recording, np.ndarray], Rows | None]
    by_receiver: bool = False
    parts: Mapping[str, Part] = field(default_factory=dict)
    levels: Mapping[str, Level] = field(default_factory=dict)
    factor: tuple[str, ...] = ()
    floor: Callable[[State, Instant], jax.Array] | None = None
