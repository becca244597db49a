"""A stretch of a drive as an IMU, a GNSS receiver and the wheels see it: the residuals of a drive's calibration.

The IMU carries attitude and velocity from their values at the start of the stretch; the velocity is compared with the
receiver's, and, seen from the vehicle, with the wheels' and with standing still sideways and upwards. All stamps are
corrected by their delays: the reading stamped t was that of ``t - delay`` on the IMU's clock. Vehicle axes come from
those of the IMU by the mounting, ``v_vehicle = C(mounting) v_imu``: the IMU sits nose up by `mounting_pitch` and turned
to the left by `mounting_yaw`. Its roll changes nothing here. What stands still sideways and upwards is the middle of
the rear axle, `lever_arm` behind the IMU; the antenna is `antenna_lever_arm` ahead of it. An accelerating body pitches
up by `weight_transfer` a / g, and driven tyres turn faster than they roll, by `wheel_slip` a. Where the wheels of an
axle that is not steered are recorded one by one, the right one goes faster than the left one by the rate of turn times
`track_width`; a right wheel that is larger than the left one by the fraction `wheel_difference` shows less of it. Side
slip, the way that steered wheels go further in a bend, and lever arms across and up are left out.

The noise of the IMU within a stretch is part of the model: in each interval its attitude and velocity drift evenly by
as much as white noise makes in that time, the straight line through Brownian motion. What is left of that between the
ends of an interval has a third of the variance that kicks at its ends would leave. So a stretch is as long as one
likes. So is an error of the receiver's velocity that lasts a whole stretch, as satellites' paths through the air and
reflections make it: no residual shows it, and without it a long drive would know the wheels better than the receiver
knows the speed.
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

from altijax.calibration.parameters import ACCEPTED, presumed, triads

_WIDE = "assumed; wide, for a drive tells it and no prior need hold it"
SPREADS = {
    "wheel_scale": (0.03, "assumed: wheels of another size than the car came with"),
    "wheel_delay": (0.15, _WIDE),
    "gnss_delay": (0.3, "receivers that smooth are later than those in `CONSTANTS`"),
    "mounting_pitch": (0.1, _WIDE),
    "mounting_yaw": (0.1, _WIDE),
    "gyro_scale_z": (0.01, "assumed: most units are better than their tolerance"),
    "weight_transfer": (0.1, "assumed: a soft car"),
    "lever_arm": (1.5, "assumed: from the rear axle up to the bonnet"),
}
"""Spreads that are not those of `CONSTANTS`, and why."""

DRIVE_PARAMETERS = presumed(ACCEPTED["drive"], SPREADS)
"""Parameters by name, in the order of the fit."""

GROUPS = ("GNSS horizontal", "GNSS vertical", "wheel", "sideways", "upwards", "right less left wheel")
"""Kinds of residuals, in the order of the fields `gnss_std` and `wheel_std` of `Stretch`."""

STEP = 0.05
"""Length of a step, s: a car's turns are slow enough for it."""

STEPS_OF_INTERVAL = 60
"""Steps of an interval of the IMU's noise, 3 s: with 5 s, what is left of it between the ends shook a wheel's delay by
15 % more than its bar says; with 2 s a fit takes twice as long."""

_LOOK = 3  # steps either way for the acceleration: wide against its noise, short against a driver's foot


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Data of one stretch; times count from its start. Missing observations have an infinite standard deviation.

    Attributes
    ----------
    f : (steps, 3) m/s^2
        Mean reading of the accelerometers in each step.
    w : (steps, 3) rad/s
        Mean reading of the gyros.
    C_nb : (3, 3)
        First guess of the attitude at the start.
    gravity : () m/s^2
        Magnitude of gravity.
    noise : (3,) rad/sqrt(s), m/s/sqrt(s), m/s
        Random walk of attitude and of velocity that the IMU's noise makes, and the size of the receiver's slow error.
    t_gnss : (epochs,) s
        Stamps of the receiver.
    v_gnss : (epochs, 3) m/s
        Its velocities.
    gnss_std : (epochs, 2) m/s
        Standard deviation of their horizontal components and of the vertical one.
    t_wheel : (samples,) s
        Stamps of the wheels.
    wheel : (samples,) m/s
        Their speeds, each the mean over some time.
    apart : (samples,) m/s
        By how much the right wheel of an axle is faster than the left one, means likewise.
    wheel_spread : (samples,) s
        Standard deviation of the times that they are the means of.
    wheel_std : (samples, 4) m/s
        Standard deviation of the wheel speed, of standing still sideways and upwards, and of `apart`.
    """

    # Arrays of JAX, or of NumPy on their way there.
    f: Any
    w: Any
    C_nb: Any
    gravity: Any
    noise: Any
    t_gnss: Any
    v_gnss: Any
    gnss_std: Any
    t_wheel: Any
    wheel: Any
    apart: Any
    wheel_spread: Any
    wheel_std: Any


def own_states(steps: int) -> int:
    """Number of parameters that each stretch has of its own.

    Parameters
    ----------
    steps : int
        Steps of a stretch.

    Returns
    -------
    states : int
        Attitude and velocity at the start, six drifts in each interval, and the receiver's slow error.
    """
    return 9 + 6 * -(-steps // STEPS_OF_INTERVAL)


def drive_residuals(parameters: jax.Array, own: jax.Array, stretch: Stretch) -> jax.Array:
    """Residuals of a stretch in units of their standard deviations, group after group.

    Parameters
    ----------
    parameters : (19,)
        Values in the order of `DRIVE_PARAMETERS`.
    own : (states,)
        Turn of the first guess of the attitude (rad) and velocity at the start (m/s), both in navigation axes; then,
        interval after interval, drifts in units of their standard deviations, for attitude, then velocity;
        last, in the same units, the error of the receiver.
    stretch : Stretch
        Its data.

    Returns
    -------
    residuals : (observations,)
        East, North and up of all epochs, then wheel, sideways, upwards and right less left wheel of all samples.
    """
    p = dict(zip(DRIVE_PARAMETERS, parameters, strict=True))
    axes, v_antenna, rolled, still = _motion(p, own, stretch)
    at_epochs = axes @ _at(stretch.t_gnss - p["gnss_delay"], v_antenna) + stretch.noise[2] * own[-3:, None]
    gnss = (stretch.v_gnss.T - at_epochs) / jnp.stack([stretch.gnss_std[:, i] for i in (0, 0, 1)])
    rolled = _at(stretch.t_wheel - p["wheel_delay"], rolled, stretch.wheel_spread)
    # Standing still sideways and upwards holds at any time, whatever the wheels' stamps.
    still = _at(stretch.t_wheel, still)
    shown = p["wheel_scale"] * jnp.stack([stretch.wheel, stretch.apart])
    wheel = jnp.concatenate([shown[:1] - rolled[:1], -still, shown[1:] - rolled[1:]]) / stretch.wheel_std.T
    return jnp.concatenate([gnss.reshape(-1), wheel.reshape(-1)])


# Nearly all of a first calibration is the compilation of what follows, with its derivatives. A matrix product, or a sum
# of products, compiles in a tenth of the time of an element-wise loop, so vectors are turned and crossed by sums, and
# series are summed, differenced and interpolated by matrices that are mostly zero.


def _motion(
    p: dict[str, jax.Array], own: jax.Array, stretch: Stretch
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """The motion at the ends of the steps, in the axes that the vehicle has at the start of the stretch.

    Returns these axes in navigation axes (3, 3); in them, the velocity of the antenna (3, nodes); in the axes that the
    vehicle has then, what the wheels show, speed and right less left (2, nodes), and the velocity left and up
    (2, nodes). So what a stretch has of its own enters by a few vectors, and the turns depend on the gyros alone.
    """
    imu = triads(p)
    yawed, pitched = jnp.asarray([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], own.dtype)
    yawed, pitched, first_turn = _rotations(
        jnp.stack([yawed * p["mounting_yaw"], pitched * p["mounting_pitch"], own[:3]])
    )
    mounting = yawed @ pitched
    f = mounting @ (stretch.f.T / imu.accelerometer_scale[:, None] - imu.accelerometer_bias[:, None])
    w = mounting @ (stretch.w.T / imu.gyro_scale[:, None] - imu.gyro_bias[:, None])
    axes = first_turn @ stretch.C_nb @ mounting.T
    turn = w * STEP
    turns = _turns(turn)
    steps = f.shape[1]
    node = jnp.arange(steps + 1)
    t = node.astype(f.dtype) * STEP
    # Constant rate and force in the body during a step: to first order the force is turned by half the step.
    force = _onward(turns, turn, f + _cross(w, f) * STEP / 2)
    # Drifts are so small that they add up as vectors, evenly within each interval.
    length = STEP * STEPS_OF_INTERVAL
    drifts = own[6:-3].reshape(-1, 2, 3) * stretch.noise[:2, None] * length**0.5 @ axes
    passed = jnp.clip(t / length - jnp.arange(drifts.shape[0], dtype=f.dtype)[:, None], 0, 1)
    tilt_drift, kicks = drifts[:, 0].T, drifts[:, 1].T @ passed
    force = force + _cross(tilt_drift @ ((passed[:, :-1] + passed[:, 1:]) / 2), force)
    coasting = jnp.stack([own[3:6] @ axes, -stretch.gravity * axes[2]], -1) @ jnp.stack([jnp.ones_like(t), t])
    v = coasting + _sums(force) * STEP + kicks
    forward, left, up = _back(turns, turn, v - _cross(tilt_drift @ passed, v))
    # Rates at the ends of the steps, and by them the velocity of a point one metre ahead of another.
    w = jnp.concatenate([w[:, :1], (w[:, 1:] + w[:, :-1]) / 2, w[:, -1:]], 1)
    per_metre = jnp.asarray([[0, 0, 0], [0, 0, 1], [0, -1, 0]], f.dtype) @ w
    v_antenna = v + p["antenna_lever_arm"] * _onward(turns, turn, per_metre)
    left, up = left - p["lever_arm"] * w[2], up + p["lever_arm"] * w[1]
    before, after = jnp.maximum(node - _LOOK, 0), jnp.minimum(node + _LOOK, steps)
    differences = (node[:, None] == after).astype(f.dtype) - (node[:, None] == before)
    acceleration = forward @ (differences / ((after - before) * STEP))
    squat = p["weight_transfer"] / stretch.gravity * acceleration
    cos, sin = jnp.cos(squat), jnp.sin(squat)
    forward, up = forward * cos - up * sin, forward * sin + up * cos
    shown = forward * (1 + p["wheel_slip"] * acceleration)
    apart = p["track_width"] * w[2] - p["wheel_difference"] * shown
    return axes, v_antenna, jnp.stack([shown, apart]), jnp.stack([left, up])


def _turns(turn: jax.Array) -> jax.Array:
    """Attitudes (3, 3, nodes) seen from the first one after steps that turn by rotation vectors (3, steps).

    Without derivatives: `_onward` and `_back` have them.
    """

    def step(C: jax.Array, change: jax.Array) -> tuple[jax.Array, jax.Array]:
        return jnp.sum(C[:, :, None] * change, 1), C

    first = jnp.eye(3, dtype=turn.dtype)
    last, before = jax.lax.scan(step, first, _rotations(jax.lax.stop_gradient(turn).T))
    return jnp.moveaxis(jnp.concatenate([before, last[None]]), 0, -1)


def _rotations(rotvecs: jax.Array) -> jax.Array:
    """`rotvec_to_matrix` of turns well below a revolution, by power series, whose derivatives compile fast."""
    squared = jnp.sum(rotvecs * rotvecs, -1)[:, None, None]
    # sin a / a and (1 - cos a) / a^2, to rounding up to half a revolution.
    sine, versine = jnp.ones_like(squared), jnp.ones_like(squared)
    for n in range(28, 0, -2):
        sine, versine = 1 - squared * sine / (n * (n + 1)), 1 - squared * versine / ((n + 1) * (n + 2))
    versine = versine / 2
    across = jnp.einsum("ijk,vk->vij", jnp.asarray(_LEVI_CIVITA, rotvecs.dtype), rotvecs)
    outer = rotvecs[:, :, None] * rotvecs[:, None, :]
    return (1 - versine * squared) * jnp.eye(3, dtype=rotvecs.dtype) + sine * across + versine * outer


@jax.custom_jvp
def _onward(turns: jax.Array, turn: jax.Array, vectors: jax.Array) -> jax.Array:
    """Vectors (3, steps or nodes) in the first axes, of components in those of the time; `turns` are ``_turns(turn)``.

    What changes a turn on the way turns all that comes after it by a sum of small vectors: differentiated as a product
    of matrices it would be nine numbers a node and many times the work.
    """
    del turn
    return jnp.sum(turns[:, :, : vectors.shape[1]] * vectors, 1)


@_onward.defjvp
def _onward_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    turns, turn, vectors = primals
    found = _onward(*primals)
    turned = _turned_more(turns, turn, tangents[1])[:, : vectors.shape[1]]
    return found, _onward(turns, turn, tangents[2]) - _cross(found, turned)


@jax.custom_jvp
def _back(turns: jax.Array, turn: jax.Array, vectors: jax.Array) -> jax.Array:
    """Components (3, nodes) in the axes of the time, of vectors in the first ones."""
    del turn
    return jnp.sum(turns * vectors[:, None], 0)


@_back.defjvp
def _back_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    turns, turn, vectors = primals
    turned = _turned_more(turns, turn, tangents[1])
    return _back(*primals), _back(turns, turn, tangents[2] + _cross(vectors, turned))


def _turned_more(turns: jax.Array, turn: jax.Array, change: jax.Array) -> jax.Array:
    """By how much more (3, nodes) the attitudes are turned, in the first axes, where the steps' turns change."""
    squared = jnp.sum(turn * turn, 0)
    # A step turns by a small angle a: (1 - cos a) / a^2 and (a - sin a) / a^3 by their first terms.
    versine = 1 / 2 - squared / 24 * (1 - squared / 30 * (1 - squared / 56))
    excess = 1 / 6 - squared / 120 * (1 - squared / 42 * (1 - squared / 72))
    across = _cross(turn, change)
    return _sums(_onward(turns, turn, change + versine * across + excess * _cross(turn, across)))


def _sums(values: jax.Array) -> jax.Array:
    """Running sums along the last axis, from zero: within each interval, then over the intervals before it."""
    rows, steps = values.shape
    parts = jnp.pad(values, ((0, 0), (0, -steps % STEPS_OF_INTERVAL))).reshape(rows, -1, STEPS_OF_INTERVAL)
    within = parts @ jnp.triu(jnp.ones((STEPS_OF_INTERVAL, STEPS_OF_INTERVAL), values.dtype))
    before = within[:, :, -1] @ jnp.triu(jnp.ones((parts.shape[1], parts.shape[1]), values.dtype), 1)
    sums = (within + before[:, :, None]).reshape(rows, -1)[:, :steps]
    return jnp.pad(sums, ((0, 0), (1, 0)))


@jax.custom_jvp
def _cross(a: jax.Array, b: jax.Array) -> jax.Array:
    return jnp.sum(jnp.einsum("ijk,k...->ij...", jnp.asarray(_LEVI_CIVITA, a.dtype), a) * b, 1)


@_cross.defjvp
def _cross_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    (a, b), (da, db) = primals, tangents
    return _cross(a, b), _cross(a, db) - _cross(b, da)


# times[i][j][k] a[k] b[j], summed over j and k, is component i of a x b.
_LEVI_CIVITA = (
    ((0, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((0, 0, 1), (0, 0, 0), (-1, 0, 0)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 0)),
)


def _at(t: jax.Array, values: jax.Array, spread: jax.Array | None = None) -> jax.Array:
    """A uniform series (rows, nodes) at other times, by Catmull and Rom's cubic.

    Its slope is continuous in the time: else a delay finds a minimum of its own wherever neighbours change. `spread` is
    the standard deviation of the times where it is means about them that are wanted, s.
    """
    place = jnp.clip(t / STEP, 1, values.shape[1] - 2)
    bend = None if spread is None else (spread / STEP) ** 2 / 2
    return _between(place, values, bend)


@jax.custom_jvp
def _between(place: jax.Array, values: jax.Array, bend: jax.Array | None) -> jax.Array:
    return values @ _shares(place, bend, values.shape[1])


@_between.defjvp
def _between_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    (place, values, bend), (moved, change, _) = primals, tangents
    _, slopes = jax.jvp(lambda place: _shares(place, bend, values.shape[1]), (place,), (jnp.ones_like(place),))
    return _between(*primals), _between(place, change, bend) + moved * (values @ slopes)


def _shares(place: jax.Array, bend: jax.Array | None, nodes: int) -> jax.Array:
    """By how much each node counts at each place (nodes, places)."""
    away = place - jnp.arange(nodes, dtype=place.dtype)[:, None]
    shares = _cubic(away)
    if bend is None:
        return shares
    # The mean about a time is the value there and half the variance of the times by the second difference.
    return shares + bend * (_cubic(away - 1) - 2 * shares + _cubic(away + 1))


def _cubic(x: jax.Array) -> jax.Array:
    """What a node counts at a distance of x steps."""
    x = jnp.abs(x)
    near, far = 1 + x * x * (1.5 * x - 2.5), 2 + x * (-4 + x * (2.5 - 0.5 * x))
    return jnp.where(x < 1, near, jnp.where(x < 2, far, 0))
