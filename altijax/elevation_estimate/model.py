"""Elevation of a drive as a function of named constants: what the verbs evaluate, calibrate and differentiate.

The low pass is linear, so that constants may act behind it as well as before it. Then readings are filtered in NumPy,
and what is left to compile and to differentiate, arithmetic sample by sample and the integrals, does not see where the
readings end.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from weakref import WeakKeyDictionary

import jax
import jax.numpy as jnp
import numpy as np

from altijax import _safe
from altijax.altitude import slope_sine, vertical_acceleration
from altijax.calibration.parameters import ACCEPTED, CONSTANTS, triads
from altijax.drives import Array, Drive
from altijax.padding import bucket, padded
from altijax.rotations import euler_to_matrix
from altijax.series import low_pass
from altijax.signals import cumulative_integral

ELEVATION_METHODS = ("shirai", "slope", "fused")

NOMINAL = {name: constant.nominal for name, constant in CONSTANTS.items() if not math.isnan(constant.nominal)}
UNCERTAINTY = {name: constant.spread for name, constant in CONSTANTS.items()}

NAMES = tuple(ACCEPTED["fused"])
"""All that an elevation depends on, whatever its method."""

_FIRST_SECOND = 1.0
# Of the low pass, in Hz: the paper names none; 1 Hz was best on a real drive.
_CUTOFF = 1.0
# The smallest sizes that a grid, and a number of constants to differentiate by, are filled up to.
_LEAST, _LEAST_NAMES = 16384, 8


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class ElevationReadings:
    """Readings on the grid behind the low pass, filled up at the end."""

    t: Array
    f: Array  # (3, time)
    yaw_rate: Array
    yaw_rate_squared: Array
    speed: Array  # (raw, smooth and its derivative; time), of the sensor, at the delay that is presumed
    speed_by_delay: Array  # (the same)
    first: Array  # which samples are of the first second
    gravity: Array
    from_wheel: Array


_KEPT: WeakKeyDictionary[Drive, tuple[float, ElevationReadings]] = WeakKeyDictionary()


def elevation(values: Mapping[str, float], drive: Drive, method: str) -> dict[str, np.ndarray]:
    """Elevation by one of the two ways, its rate, and the speed along the road, as read and smooth, on the grid.

    "fused" is the slope way here: the two are fused in `elevation_posterior`.
    """
    return elevation_and_sensitivity(values, drive, (), method)[0]


def uncertain_constants(drive: Drive, method: str) -> dict[str, float]:
    """Standard deviation of each constant that a method depends on, for an instrument that nobody has calibrated."""
    own = {
        "shirai": ("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z", "accelerometer_scale"),
        "slope": ("accelerometer_bias_x", "accelerometer_scale_x", "mounting_pitch"),
        "fused": (
            *("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z"),
            *("accelerometer_scale", "accelerometer_scale_x", "mounting_pitch", "mounting_yaw"),
            *("lever_arm", "weight_transfer", "yaw_rate_bias"),
        ),
    }[method]
    speed = ("wheel_scale", "wheel_delay") if drive.from_wheel else ("gnss_delay",)
    deviation = {name: UNCERTAINTY[name] for name in (*own, *speed)}
    if method != "slope":
        # It is found from the slope, which the mounting pitch is in; at standstill it is known.
        deviation["initial_vertical_speed"] = float(drive.speed[0]) * UNCERTAINTY["mounting_pitch"]
    if method == "fused":
        # A speed sensor at rest may read a little.
        deviation["initial_vertical_speed"] = float(np.hypot(1.2 * deviation["initial_vertical_speed"], 0.02))
    return deviation


def elevation_and_sensitivity(
    values: Mapping[str, float], drive: Drive, names: Sequence[str], method: str
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Elevation and the rest, and the elevation's derivatives with respect to the named constants (time, names).

    One program serves all drives of about a length and all names of about a number.
    """
    if "initial_vertical_speed" in names and "initial_vertical_speed" not in values:
        # With it held the others' derivatives are not those with it found.
        values = {**values, "initial_vertical_speed": vertical_speed_at_start(values, drive, names, method)}
    found, columns = _linearised_at(values, drive, names, method)
    count = drive.t.shape[0]
    return {name: x[:count] for name, x in found.items()}, columns[: len(names), :count].T


def vertical_speed_at_start(values: Mapping[str, float], drive: Drive, names: Sequence[str], method: str) -> float:
    """Vertical speed of the first sample as it is found, in m/s; by the program that has these names' derivatives."""
    return float(_linearised_at(values, drive, names, method)[0]["vertical_speed"][0])


def _linearised_at(
    values: Mapping[str, float], drive: Drive, names: Sequence[str], method: str
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    at = {**NOMINAL, "initial_vertical_speed": np.nan, **values}
    directions = np.eye(len(NAMES))[[NAMES.index(name) for name in names]]
    with jax.enable_x64(True):
        return jax.tree.map(
            np.asarray,
            _linearised(
                np.array([at[name] for name in NAMES], float),
                padded(directions, bucket(len(names), _LEAST_NAMES), 0.0),
                readings_of(drive, at["wheel_delay" if drive.from_wheel else "gnss_delay"]),
                "slope" if method == "fused" else method,
            ),
        )


def readings_of(drive: Drive, delay: float) -> ElevationReadings:
    """Readings of a drive at a delay of its speed; the last ones are kept while the drive is, for fits ask again."""
    kept = _KEPT.get(drive)
    if kept is None or kept[0] != delay:
        kept = _KEPT[drive] = delay, _filtered(drive, delay)
    return kept[1]


def _filtered(drive: Drive, delay: float) -> ElevationReadings:
    t, count = np.asarray(drive.t), drive.t.shape[0]
    size = bucket(count, _LEAST)
    raw = np.stack(_speed_at(t + delay, np.asarray(drive.t_speed), np.asarray(drive.speed)))
    smooth = low_pass(t, np.vstack([np.transpose(drive.f), drive.yaw_rate, np.square(drive.yaw_rate), raw]), _CUTOFF)
    speed = np.stack([raw, smooth[5:], np.gradient(smooth[5:], t, axis=-1, edge_order=2)])
    fill = partial(padded, size=size, axis=-1)
    return ElevationReadings(
        t=np.append(t, t[-1] + t[1] * np.arange(1, size - count + 1)),
        f=fill(smooth[:3]),
        yaw_rate=fill(smooth[3]),
        yaw_rate_squared=fill(smooth[4]),
        speed=fill(speed[:, 0]),
        speed_by_delay=fill(speed[:, 1]),
        first=fill(t <= _FIRST_SECOND, fill=False),
        gravity=drive.gravity,
        from_wheel=drive.from_wheel,
    )


def _speed_at(t: np.ndarray, t_speed: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed by straight lines between its samples, and its change with time; on a sample that of the line before."""
    gap = np.diff(t_speed)
    change = np.append(0.0, np.divide(np.diff(speed), gap, out=np.zeros_like(gap), where=gap > 0))
    after = np.clip(np.searchsorted(t_speed, t), min(1, gap.size), gap.size)
    inside = (t >= t_speed[0]) & (t <= t_speed[-1])
    return np.interp(t, t_speed, speed), np.where(inside, change[after], 0.0)


@partial(jax.jit, static_argnames="method")
def _linearised(
    x: jax.Array, directions: jax.Array, readings: ElevationReadings, method: str
) -> tuple[dict[str, jax.Array], jax.Array]:
    """Elevation and the rest for all `NAMES`, and its derivatives (directions, time)."""

    def height(x: jax.Array) -> tuple[jax.Array, dict[str, jax.Array]]:
        found = elevation_from(dict(zip(NAMES, x, strict=True)), readings, method)
        return found["elevation"], found

    _, columns, found = jax.vmap(
        lambda direction: jax.jvp(height, (x,), (direction,), has_aux=True), out_axes=(None, 0, None)
    )(directions)
    return found, columns


def elevation_from(value: dict[str, jax.Array], readings: ElevationReadings, method: str) -> dict[str, jax.Array]:
    """Elevation and the rest for values of all `NAMES`, to be traced."""
    imu = triads(value)
    f_s = readings.f / imu.accelerometer_scale[:, None] - imu.accelerometer_bias[:, None]
    f_x, f_y, f_z = euler_to_matrix(imu.mounting) @ f_s
    # A sensor ahead of the point that moves along the path is drawn backwards in turns.
    bias = value["yaw_rate_bias"]
    f_x = f_x + value["lever_arm"] * (readings.yaw_rate_squared - 2 * bias * readings.yaw_rate + bias**2)
    # The readings are those at the delay itself: what differs from it has a derivative, but is zero.
    delay = jnp.where(readings.from_wheel, value["wheel_delay"], value["gnss_delay"])
    later = readings.speed + (delay - jax.lax.stop_gradient(delay)) * readings.speed_by_delay
    raw_speed, speed, progress = later * jnp.where(readings.from_wheel, value["wheel_scale"], 1.0)
    # The car pitches under the same load that the accelerometer reads, on a slope as much as when it speeds up.
    climb = speed * slope_sine(f_x / (1 + value["weight_transfer"]), progress, readings.gravity)
    if method == "shirai":
        way = jnp.sum(jnp.where(readings.first, raw_speed, 0))
        slope = jnp.sum(jnp.where(readings.first, climb, 0)) / jnp.where(way > 0, way, 1)
        given = value["initial_vertical_speed"]
        initial = jnp.where(jnp.isnan(given), raw_speed[0] * slope, given)
        f_norm = _safe.norm(jnp.stack([f_x, f_y, f_z], -1))
        across = speed * (readings.yaw_rate - bias)
        vertical = vertical_acceleration(f_norm, progress, across, readings.gravity)
        climb = initial + cumulative_integral(readings.t, vertical)
    height = cumulative_integral(readings.t, climb)
    return {"elevation": height, "vertical_speed": climb, "speed": raw_speed, "smooth_speed": speed}
