"""Speed sample by sample, as readings come in: one step of the patent's loop, and one of the filter.

A step takes what is known and a sample, and returns what is known after it with an estimate; many steps are the whole
run of `speed_with_roll`, `speed_with_aided_roll` or `filter_speed`, to rounding. What is known is a record of arrays;
`state_to_dict` makes plain numbers of it, which JSON can keep, and `state_from_dict` the record again.
"""

from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from altijax.speed import roll_angle, speed_with_aided_roll
from altijax.speed_estimate.filter import MARGIN, SpeedState, filter_speed, first_state
from altijax.speed_estimate.model import SpeedNoise

Array = jax.Array | np.ndarray

# A window of the filter begins at a multiple of its margin, and has a margin on both sides of the step that counts.
_WINDOW = 3 * MARGIN


class LoopSample(NamedTuple):
    """Readings of one time: forward and lateral specific force (m/s^2), rates about y and z (rad/s), and an aid.

    `aided` is True where `aid_speed` (m/s) is to be used inside the roll angle, as in `speed_with_aided_roll`.
    """

    f_x: ArrayLike
    f_y: ArrayLike
    w_y: ArrayLike
    w_z: ArrayLike
    aid_speed: ArrayLike = 0.0
    aided: ArrayLike = False


class LoopState(NamedTuple):
    """What the patent's loop knows: speed and the speed inside the roll (m/s), pitch (rad), and the last readings."""

    speed: Array
    inside: Array
    pitch: Array
    readings: Array


class LoopEstimate(NamedTuple):
    """Speed (m/s), pitch and roll (rad), and whether a roll explains the readings."""

    speed: jax.Array
    pitch: jax.Array
    roll: jax.Array
    valid: jax.Array


class FilterSample(NamedTuple):
    """One step of `filter_speed`, named as there: mean readings (3,), vibration, standstill and aid."""

    f_b: ArrayLike
    w_b: ArrayLike
    vibration: ArrayLike
    still: ArrayLike
    aid_speed: ArrayLike
    aid_acceleration: ArrayLike
    aid_lead: ArrayLike
    aided: ArrayLike


class FilterState(NamedTuple):
    """What the filter knows: states and covariance after the last step that counted, and the last of the samples."""

    states: Array
    covariance: Array
    received: Array
    window: FilterSample


class FilterEstimate(NamedTuple):
    """Speed with standard deviation (m/s), pitch and roll (rad) at the end of the step of this number.

    The number is that of the sample before last by `MARGIN`, whose neighbours have come in; below 0 there is none yet.
    """

    speed: jax.Array
    speed_std: jax.Array
    pitch: jax.Array
    roll: jax.Array
    number: jax.Array


State = TypeVar("State", LoopState, FilterState)


@jax.jit
def speed_start(
    sample: LoopSample, speed0: ArrayLike, pitch0: ArrayLike, gravity: ArrayLike
) -> tuple[LoopState, LoopEstimate]:
    """State of the loop of [us20060293826]_ at its first sample.

    Parameters
    ----------
    sample : LoopSample of ()
        The first readings.
    speed0 : () m/s
        Speed there.
    pitch0 : () rad
        Pitch there.
    gravity : () m/s^2
        Magnitude of gravity.

    Returns
    -------
    state : LoopState
        For `speed_step`.
    estimate : LoopEstimate of ()
        Of the first sample.
    """
    dtype = jnp.result_type(float, *sample[:4])
    inside = jnp.where(jnp.asarray(sample.aided) != 0, sample.aid_speed, speed0).astype(dtype)
    speed, pitch = jnp.asarray(speed0, dtype), jnp.asarray(pitch0, dtype)
    readings = jnp.stack(jnp.broadcast_arrays(*sample[:4])).astype(dtype)
    estimate = LoopEstimate(speed, pitch, *roll_angle(readings[1], readings[3], inside, pitch, gravity))
    return LoopState(speed, inside, pitch, readings), estimate


@partial(jax.jit, static_argnames="stepping")
def speed_step(
    state: LoopState, sample: LoopSample, gravity: ArrayLike, dt: ArrayLike, stepping: str = "second_order"
) -> tuple[LoopState, LoopEstimate]:
    """One step of the loop of [us20060293826]_: of `speed_with_roll`, or where aided of `speed_with_aided_roll`.

    Parameters
    ----------
    state : LoopState
        Of `speed_start`, or the step before.
    sample : LoopSample of ()
        New readings.
    gravity : () m/s^2
        Magnitude of gravity.
    dt : () s
        Time since the readings before.
    stepping : {"second_order", "literal"}, optional
        As in `speed_with_roll`.

    Returns
    -------
    state : LoopState
        For the next step.
    estimate : LoopEstimate of ()
        Of the new sample.

    Raises
    ------
    ValueError
        If `stepping` is none of the two.
    """
    before = jnp.asarray(state.readings)
    readings = jnp.stack(jnp.broadcast_arrays(*sample[:4])).astype(before.dtype)
    both = jnp.stack([before, readings], -1)
    inside = jnp.asarray(state.inside)
    aid_speed = jnp.stack([inside, jnp.asarray(sample.aid_speed, inside.dtype)])
    aided = jnp.stack([jnp.asarray(True), jnp.asarray(sample.aided) != 0])
    speeds, pitches, rolls, valid = speed_with_aided_roll(
        *both, aid_speed, aided, inside, state.pitch, gravity, dt, stepping
    )
    gained = speeds[1] - speeds[0]
    speed = state.speed + gained
    new = LoopState(speed, jnp.where(aided[1], aid_speed[1], inside + gained), pitches[1], readings)
    return new, LoopEstimate(speed, pitches[1], rolls[1], valid[1])


def filter_start(
    sample: FilterSample,
    speed0: ArrayLike,
    pitch0: ArrayLike,
    gravity: ArrayLike,
    sensors: str = "2+2",
    states_covariance: ArrayLike | None = None,
) -> FilterState:
    """What `filter_speed` knows before its first step.

    Parameters
    ----------
    sample : FilterSample
        The first step; give it to `filter_step` as well.
    speed0, pitch0, gravity, sensors, states_covariance
        As of `filter_speed`.

    Returns
    -------
    state : FilterState
        For `filter_step`.

    Raises
    ------
    ValueError
        If the shapes do not fit or `sensors` is unknown.
    """
    first = first_state(sample.f_b, sample.w_b, speed0, pitch0, gravity, sensors, states_covariance)
    dtype = first.states.dtype
    window = FilterSample(*(np.repeat(np.asarray(value, dtype)[None], _WINDOW, 0) for value in sample))
    return FilterState(first.states, first.covariance, np.zeros((), int), window)


@partial(jax.jit, static_argnames="sensors")
def filter_step(
    state: FilterState,
    sample: FilterSample,
    gravity: ArrayLike,
    dt: ArrayLike,
    noise: SpeedNoise | None = None,
    sensors: str = "2+2",
) -> tuple[FilterState, FilterEstimate]:
    """One step of `filter_speed`, which looks `MARGIN` steps ahead: the estimate is of as many steps ago.

    At the end of a drive the last sample, given once more for each step of the margin, brings out the rest.

    Parameters
    ----------
    state : FilterState
        Of `filter_start`, or the step before.
    sample : FilterSample
        New mean readings.
    gravity : () m/s^2
        Magnitude of gravity.
    dt : () s
        Duration of a step.
    noise : SpeedNoise, optional
        Noise levels.
    sensors : {"2+2", "2+3", "6"}, optional
        As of `filter_start`.

    Returns
    -------
    state : FilterState
        For the next step.
    estimate : FilterEstimate of ()
        Of the step that now has all its neighbours.

    Raises
    ------
    ValueError
        If `sensors` is unknown.
    """
    received = jnp.asarray(state.received) + 1

    def shifted(old: jax.Array, new: ArrayLike) -> jax.Array:
        return jnp.concatenate([old[1:], jnp.asarray(new, old.dtype)[None]])

    window = jax.tree.map(shifted, state.window, sample)
    number = received - 1 - MARGIN
    begin = jnp.floor_divide(number - MARGIN, MARGIN) * MARGIN
    steps = begin + jnp.arange(_WINDOW)
    rows = jnp.minimum(steps, received - 1) - (received - _WINDOW)
    counted = (steps == number) & (number >= 0)
    track = filter_speed(
        **{name: values[rows] for name, values in window._asdict().items()},
        speed0=0.0,
        pitch0=0.0,
        gravity=gravity,
        dt=dt,
        noise=noise,
        sensors=sensors,
        counted=counted,
        start=SpeedState(states=jnp.asarray(state.states), covariance=jnp.asarray(state.covariance)),
    )
    row = number - begin
    estimate = FilterEstimate(
        speed=track.speed[row],
        speed_std=track.speed_std[row],
        pitch=track.pitch[row],
        roll=track.roll[row],
        number=number,
    )
    return FilterState(track.states[-1], track.last_covariance, received, window), estimate


def state_to_dict(state: LoopState | FilterState) -> dict[str, Any]:
    """A state as numbers, lists and dicts, which JSON can keep to the last digit.

    Parameters
    ----------
    state : LoopState or FilterState
        Between two steps.

    Returns
    -------
    stored : dict
        By the names of its fields.
    """
    return {
        name: state_to_dict(value) if isinstance(value, tuple) else np.asarray(value).tolist()  # type: ignore[arg-type]
        for name, value in state._asdict().items()
    }


def state_from_dict(kind: type[State], stored: dict[str, Any]) -> State:
    """The state that `state_to_dict` made this of.

    Parameters
    ----------
    kind : type
        `LoopState` or `FilterState`.
    stored : dict
        As of `state_to_dict`, also after JSON.

    Returns
    -------
    state : LoopState or FilterState
        Of the kind asked for.

    Raises
    ------
    ValueError
        If the names of the fields are others.
    """
    if set(stored) != set(kind._fields):
        raise ValueError(
            f"stored must have the fields of {kind.__name__}, {', '.join(kind._fields)}, got {', '.join(stored)}"
        )
    fields: dict[str, Any] = {name: np.asarray(value) for name, value in stored.items() if name != "window"}
    if "window" in stored:
        fields["window"] = FilterSample(**{name: np.asarray(value) for name, value in stored["window"].items()})
    return kind(**fields)
