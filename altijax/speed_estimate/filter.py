"""Speed through curves without aid: a Kalman filter that takes the lateral equation as a measurement.

Where [us20060293826] solves the lateral equation f_y = w_z v + g cos(pitch) sin(roll) for the roll and lets errors feed
on themselves, here it is a noisy measurement of a speed and a roll that both have their own uncertainty: turning then
tells the speed. The constants of the sensors and of their mounting are states, learned for as long as a speed is given.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax.speed_estimate.model import (
    STATES,
    SpeedNoise,
    Step,
    measurements,
    model_of,
    state_names,
    total_roll,
    walks,
)

_GATE, _SIGNIFICANT = 3.0, 3.0
# What no vehicle on wheels does keeps a filter that lost its way within numbers.
_LARGEST = {"speed": 300.0, "lateral_speed": 300.0, "vertical_speed": 300.0, "pitch": 1.4, "roll": 1.5}
_LARGEST |= {"travel_yaw": 1.0, "travel_pitch": 1.0}
_UNLIKELY = 30.0
# Steps over which the rates are taken to be steady where their noise must not count.
_SLOW = 11
# Steps that a bump shakes a car for: the mean over as many is one measurement, else one bump counts as several. Seen on
# two cars and a motorbike: the logarithm's correlation is 0.4 to 0.7 after one step, at most 0.23 after five.
_BUMP = 5
MARGIN = -(-(_SLOW // 2) // _BUMP) * _BUMP
"""Steps before and after it that a part of a drive needs, uncounted, to be filtered like the whole; it may begin at a
multiple of as many."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SpeedTrack:
    """What `filter_speed` found, at the end of each step.

    Attributes
    ----------
    speed : (time,) m/s
        Speed of the vehicle, never negative.
    speed_std : (time,) m/s
        Its standard deviation.
    pitch : (time,) rad
        Pitch of the IMU.
    roll : (time,) rad
        Roll of the IMU.
    states : (time, states)
        All states, named by `state_names`.
    states_std : (time, states)
        Their standard deviations.
    log_likelihood : (time,)
        Of each step's measurements, given all before.
    last_covariance : (states, states)
        Covariance of the states after the last step.
    """

    speed: jax.Array
    speed_std: jax.Array
    pitch: jax.Array
    roll: jax.Array
    states: jax.Array
    states_std: jax.Array
    log_likelihood: jax.Array
    last_covariance: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SpeedState:
    """What is known between two steps.

    Attributes
    ----------
    states : (states,)
        All states, named by `state_names`.
    covariance : (states, states)
        Their covariance.
    """

    states: jax.Array
    covariance: jax.Array


@partial(jax.jit, static_argnames="sensors")
def first_state(
    f_b: ArrayLike,
    w_b: ArrayLike,
    speed0: ArrayLike,
    pitch0: ArrayLike,
    gravity: ArrayLike,
    sensors: str = "2+2",
    states_covariance: ArrayLike | None = None,
) -> SpeedState:
    """What `filter_speed` knows before the first step.

    Parameters
    ----------
    f_b : (3,) m/s^2
        Mean specific force in the first step.
    w_b : (3,) rad/s
        Mean angular rate in it.
    speed0 : () m/s
        Speed at the start.
    pitch0 : () rad
        Pitch at the start.
    gravity : () m/s^2
        Magnitude of gravity.
    sensors : {"2+2", "2+3", "6"}, optional
        Accelerometers + gyros to use.
    states_covariance : array, optional
        Covariance of `STATES`; by default their own values are standard deviations.

    Returns
    -------
    state : SpeedState
        The roll from the lateral force, and all constants zero.

    Raises
    ------
    ValueError
        If the shapes do not fit or `sensors` is unknown.
    """
    names = state_names(sensors)
    f_b = require_shape("f_b", f_b, (3,))
    w_b = require_shape("w_b", w_b, (3,))
    scalars = {"speed0": speed0, "pitch0": pitch0, "gravity": gravity}
    speed0, pitch0, gravity = (require_shape(name, value, ()).astype(f_b.dtype) for name, value in scalars.items())
    roll0 = jnp.clip((f_b[1] - speed0 * w_b[2]) / gravity, -0.5, 0.5)
    known = {"speed": speed0, "pitch": pitch0, "roll": roll0, "resting_roll": roll0}
    if states_covariance is None:
        states_covariance = jnp.diag(jnp.asarray(list(STATES.values()), f_b.dtype) ** 2)
    covariance = require_shape("states_covariance", states_covariance, (len(STATES), len(STATES))).astype(f_b.dtype)
    rows = jnp.asarray([list(STATES).index(name) for name in names])
    return SpeedState(
        states=jnp.stack([known.get(name, jnp.zeros_like(speed0)) for name in names]),
        covariance=covariance[rows[:, None], rows],
    )


@partial(jax.jit, static_argnames="sensors")
def filter_speed(
    f_b: ArrayLike,
    w_b: ArrayLike,
    vibration: ArrayLike,
    still: ArrayLike,
    aid_speed: ArrayLike,
    aid_acceleration: ArrayLike,
    aid_lead: ArrayLike,
    aided: ArrayLike,
    speed0: ArrayLike,
    pitch0: ArrayLike,
    gravity: ArrayLike,
    dt: ArrayLike,
    noise: SpeedNoise | None = None,
    sensors: str = "2+2",
    states_covariance: ArrayLike | None = None,
    counted: ArrayLike | None = None,
    start: SpeedState | None = None,
) -> SpeedTrack:
    """Speed by an extended Kalman filter over the constants of the sensors and their mounting.

    The readings are means over steps that are short against the car's manoeuvres and long against its vibration: 0.2 s
    serves. With four or five sensors ``pitch' = -w_y cos(roll) + w_z sin(roll)`` and ``v' = f_x - g sin(pitch)``, as in
    [us20060293826]_; ``f_y = w_z v + g cos(pitch) sin(roll)`` is measured with noise. Without a roll gyro the roll is
    taken to wander about a mean, that of the road's cant, also where a road turns on a slope. With six sensors the
    IMU's velocity is carried along its own axes, and the point that does not slip has neither lateral nor vertical
    speed. Of the aid only the speed is used. A measurement beyond 3 standard deviations counts as one of a larger
    error. Where the vehicle stands, its speed and rates are zero. Where the aid has shown that the vehicle shakes the
    more the faster it is, the vibration, in means of five steps, is a measurement of the speed.

    Parameters
    ----------
    f_b : (time, 3) m/s^2
        Mean specific force in each step; the third is used with six sensors.
    w_b : (time, 3) rad/s
        Mean angular rate; the first is used with a roll gyro.
    vibration : (time,) rad^2/s^2
        Mean square of what is fast in w_y: it rectifies into a bias of it.
    still : (time,)
        Not zero where the vehicle certainly stands.
    aid_speed : (time,) m/s
        Speed from a wheel or a satellite receiver.
    aid_acceleration : (time,) m/s^2
        Its rate of change, which serves to shift it in time.
    aid_lead : (time,) s
        Its time less that of the end of the step.
    aided : (time,)
        Not zero where there is one; elsewhere its values do not matter.
    speed0 : () m/s
        Speed at the start, known to 1 m/s.
    pitch0 : () rad
        Pitch at the start, known to 0.1 rad.
    gravity : () m/s^2
        Magnitude of gravity.
    dt : () s
        Duration of a step.
    noise : SpeedNoise, optional
        Noise levels; `fit_speed_noise` finds those of a drive.
    sensors : {"2+2", "2+3", "6"}, optional
        Accelerometers + gyros to use.
    states_covariance : array, optional
        Covariance of `STATES` before the first sample, in their order, used or not: that of a calibration, say. By
        default their own values are standard deviations.
    counted : (time,), optional
        Not zero where a step counts, by default everywhere; elsewhere the states are held and the speed is zero. So
        arrays may be filled up with copies of their first and last steps.
    start : SpeedState, optional
        What is known before the first step that counts: the last states and covariance of an earlier part of the drive.
        By default `first_state`, which alone asks for `speed0`, `pitch0` and `states_covariance`.

    Returns
    -------
    track : SpeedTrack
        Speed, attitude and all states with their standard deviations at the end of each step.

    Raises
    ------
    ValueError
        If the shapes do not fit or `sensors` is unknown.
    """
    f_b = require_shape("f_b", f_b, (None, 3))
    time, dtype = f_b.shape[0], f_b.dtype
    names = state_names(sensors)
    w_b = require_shape("w_b", w_b, (time, 3))
    series = {
        "vibration": vibration,
        "still": still,
        "aid_speed": aid_speed,
        "aid_acceleration": aid_acceleration,
        "aid_lead": aid_lead,
        "aided": aided,
    }
    given = {name: require_shape(name, value, (time,)).astype(dtype) for name, value in series.items()}
    has_aid = given["aided"] != 0
    scalars = {"speed0": speed0, "pitch0": pitch0, "gravity": gravity, "dt": dt}
    speed0, pitch0, gravity, dt = (require_shape(name, value, ()).astype(dtype) for name, value in scalars.items())
    noise = jax.tree.map(lambda level: jnp.asarray(level, dtype), SpeedNoise() if noise is None else noise)
    before, after = jnp.concatenate([w_b[:1], w_b[:-1]]), jnp.concatenate([w_b[1:], w_b[-1:]])
    steps = Step(
        f_b=f_b,
        w_b=w_b,
        w_end=0.5 * (w_b + after),
        w_slow=_moving_mean(w_b, _SLOW),
        w_dot=(after - before) / (2 * dt),
        vibration=given["vibration"],
        shaking=_moving_mean(given["vibration"][:, None], _BUMP)[:, 0],
        shaking_told=jnp.arange(time) % _BUMP == _BUMP // 2,
        shaking_aided=_moving_mean(has_aid.astype(dtype)[:, None], _BUMP)[:, 0] > 0,
        still=given["still"] != 0,
        aid_speed=jnp.where(has_aid, given["aid_speed"], 0),
        aid_acceleration=jnp.where(has_aid, given["aid_acceleration"], 0),
        aid_lead=jnp.where(has_aid, given["aid_lead"], 0),
        aided=has_aid,
    )
    index = {name: number for number, name in enumerate(names)}
    gain = index["vibration_gain"]
    moved = jnp.asarray([index[name] for name in ("speed", "lateral_speed", "vertical_speed") if name in index])
    largest = jnp.asarray([_LARGEST.get(name, _UNLIKELY * STATES[name]) for name in names], dtype)
    identity = jnp.eye(len(names), dtype=dtype)
    rates, observe, travel_speed = model_of(sensors)

    def named(x: jax.Array) -> dict[str, jax.Array]:
        return dict(zip(names, x, strict=True))

    def stage(x: jax.Array, step: Step, at: jax.Array, one: tuple[jax.Array, jax.Array]) -> tuple:
        """Rates at a place and their derivatives, and the next place."""
        further, w_b = one

        def slope(at: jax.Array, w_b: jax.Array) -> jax.Array:
            found = rates(named(at), step._replace(w_b=w_b), gravity, noise)
            return jnp.stack([found.get(name, jnp.zeros((), dtype)) for name in names])

        rate, derivatives = _linearised(slope, at, w_b)
        return x + further * rate, (at, rate, *derivatives)

    def proceed(x: jax.Array, P: jax.Array, step: Step) -> tuple:
        # The midpoint rule, and the rates at the place that it leads to. A loop, for compiling the model takes longest.
        stages = [(0.5, step.w_b), (1.0, step.w_b), (0.0, step.w_b)]
        if sensors == "6":
            # The noise of the gyros times the speed drives the velocities: gains that knew it would pull the speed
            # down. So the derivatives are those at steady rates, and the place goes back to x between.
            stages = [(0.5, step.w_slow), (0.0, step.w_slow), *stages]
        further, readings = (jnp.stack(column) for column in zip(*stages, strict=True))
        found: tuple[jax.Array, ...] = jax.lax.scan(partial(stage, x, step), x, (dt * further, readings))[1]
        at, rate, by_x, by_w = found
        F = identity + dt * by_x[1] @ (identity + dt / 2 * by_x[0])
        G = by_w[-3]
        walk = walks(named(x), step, noise, sensors)
        gyros = noise.rotation**2 + noise.vibration**2 * step.vibration
        x, P = at[-1], F @ P @ F.T + dt * (jnp.diag(walk) + gyros * G @ G.T)
        # learned while aided, and of use only where that has shown that the car shakes the more the faster it is
        shaken = x[gain] > _SIGNIFICANT * _safe.sqrt(P[gain, gain])
        predicted = x

        def expected(x: jax.Array, middle: jax.Array, rate: jax.Array) -> jax.Array:
            return jnp.stack(observe(named(x), named(middle), named(rate), step, gravity))

        y0, along = jax.linearize(expected, x, x - dt / 2 * rate[-1], rate[-1])
        H = jax.vmap(along, in_axes=-1, out_axes=-1)(identity, identity - dt / 2 * by_x[-1], by_x[-1])
        value, std, valid = _columns(measurements(step, noise, sensors, shaken))
        # The same for all noise levels, and so a branch for a batch of them: most steps have one or two measurements.
        possible = _columns(measurements(step, noise, sensors, jnp.asarray(True)))[2]

        def measure(carry: tuple[jax.Array, jax.Array], one: tuple[jax.Array, ...]) -> tuple:
            possible, h, y0, value, std, valid = one

            def update(x: jax.Array, P: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
                return _update(x, P, h, value - y0 - h @ (x - predicted), std, valid)

            x, P, log_likelihood = jax.lax.cond(possible, update, lambda x, P: (x, P, jnp.zeros((), dtype)), *carry)
            return (x, P), log_likelihood

        log_likelihood: jax.Array
        (x, P), log_likelihood = jax.lax.scan(measure, (x, P), (possible, H, y0, value, std, valid))
        x, P = jnp.clip(x, -largest, largest), _bounded(P, largest)
        speed, (direction,) = _linearised(lambda x: travel_speed(named(x), step), x)
        x = x.at[moved].add(-jnp.minimum(speed, 0) * direction[moved])
        speed = jnp.maximum(travel_speed(named(x), step), 0)
        return x, P, speed, _safe.sqrt(direction @ P @ direction), jnp.sum(log_likelihood)

    def hold(x: jax.Array, P: jax.Array, step: Step) -> tuple:
        return x, P, *3 * [jnp.zeros((), dtype)]

    def body(carry: tuple[jax.Array, jax.Array], one: tuple[Step, jax.Array | None]) -> tuple:
        step, counts = one
        x, P, speed, speed_std, log_likelihood = (
            proceed(*carry, step) if counts is None else jax.lax.cond(counts, proceed, hold, *carry, step)
        )
        seen = speed, speed_std, x[index["pitch"]], total_roll(named(x), step), x, _safe.sqrt(jnp.diagonal(P))
        return (x, P), (*seen, log_likelihood)

    if start is None:
        start = first_state(f_b[0], w_b[0], speed0, pitch0, gravity, sensors, states_covariance)
    x0 = require_shape("start.states", start.states, (len(names),)).astype(dtype)
    P0 = require_shape("start.covariance", start.covariance, (len(names), len(names))).astype(dtype)
    if counted is not None:
        counted = require_shape("counted", counted, (time,)) != 0
    found: tuple[jax.Array, ...]
    (_, P), found = jax.lax.scan(body, (x0, P0), (steps, counted))
    return SpeedTrack(
        speed=found[0],
        speed_std=found[1],
        pitch=found[2],
        roll=found[3],
        states=found[4],
        states_std=found[5],
        log_likelihood=found[6],
        last_covariance=P,
    )


def _linearised(function: Callable[..., jax.Array], *at: jax.Array) -> tuple[jax.Array, tuple[jax.Array, ...]]:
    """A function at a place, and its derivatives by each argument, the argument along the last axis."""
    y, along = jax.linearize(function, *at)
    ends = [0]
    for x in at:
        ends.append(ends[-1] + x.size)
    basis = jnp.eye(ends[-1], dtype=y.dtype)
    columns = [basis[:, first:last] for first, last in pairwise(ends)]
    derivatives = jax.vmap(along, out_axes=-1)(*columns)
    return y, tuple(derivatives[..., first:last] for first, last in pairwise(ends))


def _columns(rows: list[tuple[jax.Array, ArrayLike, jax.Array]]) -> list[jax.Array]:
    return [jnp.stack(column) for column in zip(*rows, strict=True)]


def _bounded(P: jax.Array, largest: jax.Array) -> jax.Array:
    """Covariance whose standard deviations are at most `largest`, and no correlation beyond 1 for rounding."""
    std = _safe.sqrt(jnp.diagonal(P))
    shrink = jnp.where(std > largest, largest / jnp.where(std > largest, std, 1), 1)
    bound = jnp.outer(shrink * std, shrink * std)
    return jnp.clip(shrink[:, None] * P * shrink, -bound, bound)


def _moving_mean(series: jax.Array, width: int) -> jax.Array:
    """Mean of `width` (an odd number) neighbours in time, the ends held."""
    held = jnp.pad(series, ((width // 2, width // 2), (0, 0)), mode="edge")
    return jnp.mean(jnp.stack([held[k : k + series.shape[0]] for k in range(width)]), axis=0)


def _update(
    x: jax.Array, P: jax.Array, h: jax.Array, innovation: jax.Array, std: jax.Array, valid: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """One measurement, its error inflated beyond the gate; and its log-likelihood, Huber's."""
    Ph = P @ h
    # rounding may take the first term below zero
    expected_variance = jnp.maximum(h @ Ph, 0) + std * std
    ratio = jnp.abs(innovation) / jnp.sqrt(expected_variance)
    variance = expected_variance * jnp.maximum(ratio / _GATE, 1)
    gain = jnp.where(valid, Ph / variance, 0)
    # Joseph's form multiplied out for one measurement: right to first order for a rounded gain, and symmetric
    cross = jnp.outer(gain, Ph)
    P = P - cross - cross.T + variance * jnp.outer(gain, gain)
    loss = jnp.where(ratio < _GATE, 0.5 * ratio * ratio, _GATE * ratio - 0.5 * _GATE * _GATE)
    return x + gain * innovation, P, jnp.where(valid, -0.5 * jnp.log(expected_variance) - loss, 0)
