"""The paper's experiments as simulations: a cart is pushed along the passage or the slope, and three chains measure it.

The course and the durations are the paper's. What it does not say is decided here. Readings are taken at 20 Hz and not
filtered. The cart first stands for `STANDING` seconds; then it moves from rest to rest, at a pace that varies by a few
per cent, and shakes. The shaking is of high frequency: its double integral stays small, but it adds to the length of
the specific force. The chains:

- Accelerometer and gyro. The readings at rest give roll and pitch, the gyro carries the attitude on, and the readings
  turned level, less the local gravity, are integrated. A bias of x or y thus goes into the first attitude, one of z
  stays. Way and horizontal distance are the lengths of the path in space and in plan.
- Accelerometer and speed sensor. g is the length of the readings at rest, so that a constant bias hardly counts (with
  any other g the elevations of table 2 would differ by more than they do). The way is the number of pulses times the
  distance between two, mean of both wheels; speed and yaw rate follow from the times of the pulses; h by Eq. (1), twice
  integrated, is the elevation, and x by its second line the horizontal distance, from the speed at the first sample.

All chains see the same readings of the accelerometer, as the printed tables share their experiments. In the gyros the
errors act alike that grow with time in between a constant drift and white noise, so the walk of their bias is left out.
"""

from dataclasses import dataclass, replace
from functools import partial
from math import ceil, pi

import jax
import jax.numpy as jnp

from altijax.altitude import horizontal_acceleration, vertical_acceleration
from altijax.instruments import FIBRE_OPTIC_GYRO, JA_5V, ND_PG1, VIBRATION_GYRO
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.roads import rest_to_rest, slope_road
from altijax.rotations import euler_to_matrix
from altijax.sensors import accelerometer_output, gyro_output
from altijax.signals import cumulative_integral, derivative
from altijax.strapdown import integrate_attitude, integrate_position, integrate_velocity
from altijax.wheels import WheelSensor, pulse_distance, speed_from_pulses, wheel_pulses, yaw_rate_from_wheels

# Normal gravity in Narashino.
GRAVITY = 9.798
DT = 0.05
STANDING = 5.0
# From rest to the pace, and back.
RAMP = 3.0
# Relative variation of the pace, root mean square, in waves of a half to a fifth of the way.
UNEVENNESS = 0.03
WAVES = 4
# Room for pulses: turns of a way some per cent longer than any.
TURNS = 90
CHAINS = ("vibration_gyro", "fiber_optic_gyro", "vehicle_speed")
OUTPUTS = ("way", "horizontal", "elevation")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Sensors:
    """What is unknown of the sensors and the cart: standard deviations from run to run but for the wheel's scale.

    Attributes
    ----------
    vibration : () m/s^2
        Root mean square of each axis, typical of the runs.
    vibration_spread : ()
        Standard deviation of its logarithm from run to run.
    accelerometer_bias : () m/s^2
        Zero error of each axis.
    bias_walk : () m/s^2/sqrt(s)
        Wander of that.
    vibration_gyro_drift, fiber_optic_gyro_drift : () rad/s
        Zero error of each axis that remains after its correction.
    vibration_gyro_noise, fiber_optic_gyro_noise : () rad/s/sqrt(Hz)
        White noise, one-sided.
    wheel_scale : ()
        Way by the wheels over true way, less 1.
    wheel_spread : ()
        Its standard deviation from run to run: load, pressure, line taken.
    magnet_error : () rad
        Angle by which a magnet seems to sit too far on.
    """

    vibration: jax.Array
    vibration_spread: jax.Array
    accelerometer_bias: jax.Array
    bias_walk: jax.Array
    vibration_gyro_drift: jax.Array
    vibration_gyro_noise: jax.Array
    fiber_optic_gyro_drift: jax.Array
    fiber_optic_gyro_noise: jax.Array
    wheel_scale: jax.Array
    wheel_spread: jax.Array
    magnet_error: jax.Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Course:
    """Time that a run takes, and the true lengths of its course."""

    duration: jax.Array
    way: jax.Array
    horizontal: jax.Array
    rise: jax.Array


def sample_count(longest: float) -> int:
    """Samples of a run of this duration, standing included."""
    return ceil((longest + STANDING) / DT) + 2


def run(
    sensors: Sensors, course: Course, key: jax.Array, *, samples: int, wheel: WheelSensor = ND_PG1
) -> dict[str, jax.Array]:
    """One run: way, horizontal distance and elevation against time (samples, 3), by chain. After arrival it stands."""
    keys = dict(zip(("pace", "shake", "bias", "accelerometer", *CHAINS), jax.random.split(key, 7), strict=True))
    t = DT * jnp.arange(samples) - STANDING
    true = motion(course, t, keys["pace"])
    f_true = true.f_b + _shaking(sensors, true.speed * course.duration / course.way, keys["shake"])
    accelerometer = replace(
        JA_5V,
        bias=sensors.accelerometer_bias * jax.random.normal(keys["bias"], (3,)),
        bias_random_walk=sensors.bias_walk,
    )
    f_b = accelerometer_output(accelerometer, f_true, DT, key=keys["accelerometer"])
    rest = round(STANDING / DT)
    at_rest = f_b[:rest].mean(0)
    profiles = {}
    for chain, gyro in (("vibration_gyro", VIBRATION_GYRO), ("fiber_optic_gyro", FIBRE_OPTIC_GYRO)):
        drift_key, noise_key = jax.random.split(keys[chain])
        gyro = replace(
            gyro,
            bias=getattr(sensors, f"{chain}_drift") * jax.random.normal(drift_key, (3,)),
            noise_density=getattr(sensors, f"{chain}_noise"),
            bias_random_walk=0.0,
        )
        w_b = gyro_output(gyro, true.w_b, f_true, DT, key=noise_key)
        profiles[chain] = by_gyro(t[rest:], f_b[rest:], w_b[rest:], at_rest)
    scale_key, wheel_key = jax.random.split(keys["vehicle_speed"])
    scale = 1 + sensors.wheel_scale + sensors.wheel_spread * jax.random.normal(scale_key)
    wheel = drawn_wheel(wheel, sensors.magnet_error, wheel_key)
    profiles["vehicle_speed"] = by_speed(
        t[rest:], f_b[rest:], true.speed[rest:], jnp.linalg.norm(at_rest), wheel, scale
    )
    return profiles


def by_gyro(t: jax.Array, f_b: jax.Array, w_b: jax.Array, at_rest: jax.Array) -> jax.Array:
    """Accelerometer and gyro with posture correction: way, horizontal distance and elevation (samples, 3)."""
    f_x, f_y, f_z = at_rest
    pitch = jnp.arctan2(f_x, jnp.hypot(f_y, f_z))
    level = euler_to_matrix(jnp.stack([jnp.arctan2(f_y, f_z), pitch, jnp.zeros_like(pitch)]))
    C_nb = integrate_attitude(w_b, level, DT)
    v = integrate_velocity(f_b, C_nb, jnp.zeros(3), GRAVITY, DT)
    path = jnp.stack([_length(v), _length(v[:, :2]), v[:, 2]], -1)
    return integrate_position(path, jnp.zeros(3), DT)


def by_speed(
    t: jax.Array, f_b: jax.Array, speed: jax.Array, gravity: jax.Array, wheel: WheelSensor, scale: jax.Array
) -> jax.Array:
    """Accelerometer and speed sensor by Eq. (1): way, horizontal distance and elevation (samples, 3).

    `speed` is the true one that turns the wheels, `scale` by how much the distance between pulses is taken too long.
    """
    pulses, _ = wheel_pulses(wheel, t, speed, jnp.zeros_like(speed), max_pulses=TURNS * wheel.pulses_per_turn)
    distance = scale * pulse_distance(wheel)
    wheel_speed, _ = speed_from_pulses(pulses, t, distance)
    v = wheel_speed.mean(0)
    a_x = derivative(t, v)
    a_y = v * yaw_rate_from_wheels(wheel, wheel_speed)
    h = vertical_acceleration(_length(f_b), a_x, a_y, gravity)
    x, _ = horizontal_acceleration(a_x, h)
    counted = jax.vmap(lambda p: jnp.searchsorted(p, t, side="right"))(pulses)
    way = jnp.mean(counted * distance[:, None], 0)
    horizontal = cumulative_integral(t, v[0] + cumulative_integral(t, x))
    elevation = cumulative_integral(t, cumulative_integral(t, h))
    return jnp.stack([way, horizontal, elevation], -1)


def at_fractions(
    sensors: Sensors, course: Course, key: jax.Array, *, samples: int, points: int, wheel: WheelSensor = ND_PG1
) -> jax.Array:
    """Results of one run at equal fractions of its duration, the last at arrival: (points, chains, outputs)."""
    profiles = run(sensors, course, key, samples=samples, wheel=wheel)
    at = jnp.round(jnp.linspace(0, 1, points) * course.duration / DT).astype(int)
    return jnp.stack([profiles[chain][at] for chain in CHAINS], 1)


def motion(course: Course, t: jax.Array, key: jax.Array) -> Readings:
    """The cart from t = 0 on, at a pace that the key makes uneven."""
    wavenumber = 2 * pi * jnp.arange(2, 2 + WAVES) / course.horizontal
    profile = replace(
        rest_to_rest(course.horizontal, course.duration, jnp.asarray(RAMP)),
        modulation=UNEVENNESS * (2 / WAVES) ** 0.5 / wavenumber,
        wavenumber=wavenumber,
        phase=jax.random.uniform(key, (WAVES,), maxval=2 * pi),
    )
    road = slope_road(course.way, course.horizontal, course.rise)
    return ideal_readings(partial(road_pose, road, profile), t, GRAVITY)


def _shaking(sensors: Sensors, pace: jax.Array, key: jax.Array) -> jax.Array:
    """Second differences of white noise (samples, 3), as large as the pace is fast."""
    level_key, noise_key = jax.random.split(key)
    level = sensors.vibration * jnp.exp(sensors.vibration_spread * jax.random.normal(level_key))
    white = jax.random.normal(noise_key, (pace.size + 2, 3))
    return level * pace[:, None] * (white[2:] - 2 * white[1:-1] + white[:-2]) / 6**0.5


def drawn_wheel(wheel: WheelSensor, magnet_error: jax.Array, key: jax.Array) -> WheelSensor:
    """Wheels in any first position, with misplaced magnets."""
    phase_key, magnet_key = jax.random.split(key)
    return replace(
        wheel,
        phase=jax.random.uniform(phase_key, (2,), maxval=2 * pi),
        magnet_error=magnet_error * jax.random.normal(magnet_key, (2, wheel.pulses_per_turn)),
    )


def _length(v: jax.Array) -> jax.Array:
    squared = jnp.sum(v * v, -1)
    moving = squared > 0
    return jnp.where(moving, jnp.sqrt(jnp.where(moving, squared, 1)), 0)
