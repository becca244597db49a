"""How the errors change with the instruments: noise, rates, bandwidth, bias and delay; and with the device's turning.

Each case is simulated with several units and judged for two methods: the paper's, epoch by epoch (Levenberg's damping
from (0, 0, COG)), and windows of epochs carried by a gyro.
"""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.doppler import DopplerReceiver, doppler_velocity
from altijax.instruments import MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import Readings, Windsurfer, gybing_windsurfer, ideal_readings, windsurfer_pose
from altijax.rotations import euler_to_matrix, matrix_to_euler, wrap_angle
from altijax.sensors import accelerometer_output, gyro_output
from altijax.wahba import fit_windows
from papers_repro.chalko2010.epochs import (
    Epochs,
    epochs_of_arrays,
    full_rate_attitude,
    full_rate_velocity,
    interpolated_velocity,
)
from papers_repro.chalko2010.experiments import ACCELEROMETER_RATE, DURATION, FINE_RATE, LEFT_BIAS, LEFT_GYRO_BIAS, G
from papers_repro.chalko2010.strategies import FREE, MEASUREMENT_STD, WINDOW, levenberg

# Simulated units of every case.
UNITS = 2


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Instruments:
    """What is swept: horizontal Doppler noise (m/s; vertical twice that), length of the accelerometer's bias (m/s^2),
    its bandwidth (Hz), how much later the velocities are stamped than they were (s), and both rates (Hz)."""

    noise: float = 0.05
    bias: float = LEFT_BIAS
    bandwidth: float = 20.0
    delay: float = 0.0
    gnss_rate: float = 1.0
    accelerometer_rate: float = ACCELEROMETER_RATE


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Errors:
    """RMS errors of one method, of shape () or that of a batch: of the upward direction and of the heading at
    mid-epoch, of the upward direction at full rate (deg), and of the velocity at full rate (m/s)."""

    tilt: jax.Array
    heading: jax.Array
    tilt_full_rate: jax.Array
    velocity: jax.Array


SWEEPS: dict[str, tuple[str, list[float]]] = {
    "Doppler noise (m/s)": ("noise", [0.01, 0.02, 0.05, 0.1, 0.2, 0.5]),
    "GNSS rate (Hz)": ("gnss_rate", [1.0, 5.0]),
    "accelerometer rate (Hz)": ("accelerometer_rate", [10.0, 50.0]),
    "accelerometer bandwidth (Hz)": ("bandwidth", [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]),
    "accelerometer bias (m/s²)": ("bias", [0.003, 0.01, 0.03, 0.1, 0.3]),
    "delay left in the velocities (s)": ("delay", [0.0, 0.02, 0.05, 0.1, 0.2, 0.4]),
}
FREQUENCIES = np.geomspace(0.02, 2.0, 13)


def sweep(readings: Readings, name: str) -> dict[str, Errors]:
    """Errors (values,) of each method along one sweep on one motion, root mean square over the units."""
    parameter, values = SWEEPS[name]
    cases = [errors(readings, replace(Instruments(), **{parameter: value}), units=UNITS) for value in values]
    return jax.tree.map(lambda *x: jnp.stack(x), *cases)


def errors(readings: Readings, instruments: Instruments, *, units: int) -> dict[str, Errors]:
    """Errors of each method on one motion given at `FINE_RATE`, root mean square over some units."""
    keys = jax.random.split(jax.random.key(0), units)
    rates = instruments.gnss_rate, instruments.accelerometer_rate
    numbers = replace(instruments, gnss_rate=0.0, accelerometer_rate=0.0)
    epochs = _epochs(readings, _imu(readings, numbers, keys), _doppler(readings, numbers, keys, rates[0]), rates[1])
    C_middle = jnp.stack([_epoch_by_epoch(epochs), _carried(epochs, rates[0])], 1)
    squares = _judge(readings, epochs, C_middle, *rates)
    return jax.tree.map(lambda x: jnp.sqrt(jnp.mean(x * x)), squares)


@jax.jit
def _imu(readings: Readings, instruments: Instruments, keys: jax.Array) -> tuple[jax.Array, jax.Array]:
    """What the sensors of each unit put out at `FINE_RATE`; they are filtered there and sampled afterwards."""

    def unit(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        direction_key, bias_key, accelerometer_key, gyro_key = jax.random.split(key, 4)
        direction = jax.random.normal(direction_key, (3,))
        accelerometer = replace(
            MEMS_ACCELEROMETER,
            bias=instruments.bias * direction / jnp.linalg.norm(direction),
            bandwidth=instruments.bandwidth,
        )
        gyro = replace(MEMS_GYRO, bias=LEFT_GYRO_BIAS * jax.random.normal(bias_key, (3,)), g_sensitivity=0.0)
        return (
            accelerometer_output(accelerometer, readings.f_b, 1 / FINE_RATE, key=accelerometer_key),
            gyro_output(gyro, readings.w_b, readings.f_b, 1 / FINE_RATE, key=gyro_key),
        )

    return jax.vmap(unit)(keys)


@partial(jax.jit, static_argnames="rate")
def _doppler(readings: Readings, instruments: Instruments, keys: jax.Array, rate: float) -> tuple[jax.Array, jax.Array]:
    """Times (knots,) and velocities (units, knots, 3) that the receivers report."""
    receiver = DopplerReceiver(
        rate=rate,
        horizontal_noise=instruments.noise,
        vertical_noise=2 * jnp.asarray(instruments.noise),
        latency=instruments.delay,
    )
    count = int((readings.t.size - 1) / FINE_RATE * rate)

    def unit(key: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        return doppler_velocity(receiver, readings.t, readings.velocity, epochs=count, key=jax.random.fold_in(key, 1))

    t_knots, v_knots, _ = jax.vmap(unit)(keys)
    # What a delayed receiver reports of the time before the recording is not there.
    return t_knots[0, 1:], v_knots[:, 1:]


@partial(jax.jit, static_argnames="rate")
def _epochs(
    readings: Readings, imu: tuple[jax.Array, jax.Array], doppler: tuple[jax.Array, jax.Array], rate: float
) -> Epochs:
    """Each unit's epochs of samples at a rate."""
    step = round(FINE_RATE / rate)
    t_knots, v_knots = doppler

    def unit(f_b: jax.Array, w_b: jax.Array, v_knots: jax.Array) -> Epochs:
        return epochs_of_arrays(readings.t[::step], f_b, w_b, t_knots, v_knots, jnp.asarray(G))

    return jax.vmap(unit)(imu[0][:, ::step], imu[1][:, ::step], v_knots)


_epoch_by_epoch = jax.jit(jax.vmap(levenberg))


def _carried(epochs: Epochs, rate: float) -> jax.Array:
    """Attitudes from windows of `WINDOW` seconds, carried by the gyro."""
    count = epochs.f_n.shape[:-1]
    window = 2 * round(WINDOW * rate / 2) + 1
    std = jnp.full(count, FREE), jnp.full(count, MEASUREMENT_STD)
    start = euler_to_matrix(epochs.euler0)
    return fit_windows(epochs.f_b_carried, epochs.f_n, start, *std, window, epochs.turned_middle).C_nb


@partial(jax.jit, static_argnames=("gnss_rate", "accelerometer_rate"))
def _judge(
    readings: Readings, epochs: Epochs, C_middle: jax.Array, gnss_rate: float, accelerometer_rate: float
) -> dict[str, Errors]:
    """Errors (units,) of attitudes (units, 2, epochs, 3, 3), the second of them carried by the gyro."""
    step = round(FINE_RATE / accelerometer_rate)
    t, true, velocity = readings.t[::step], readings.C_nb[::step], readings.velocity[::step]
    t_knots = epochs.t_knots[0]
    # Ends are extrapolated, which is not what is asked here.
    inside = (t >= t_knots[1]) & (t <= t_knots[-2])
    first, half = round(FINE_RATE / gnss_rate), round(FINE_RATE / gnss_rate / 2)
    true_middle = readings.C_nb[first + half :: first][: C_middle.shape[2]]

    def judged(C_middle: jax.Array, C_nb: jax.Array, v_n: jax.Array) -> Errors:
        heading = wrap_angle(matrix_to_euler(C_middle)[:, 2] - matrix_to_euler(true_middle)[:, 2])
        return Errors(
            tilt=_rms(_tilt(C_middle, true_middle)),
            heading=_rms(jnp.degrees(heading)),
            tilt_full_rate=_rms(_tilt(C_nb, true), inside),
            velocity=_rms(jnp.linalg.norm(v_n - velocity, axis=-1), inside),
        )

    def unit(epochs: Epochs, C_middle: jax.Array) -> dict[str, Errors]:
        aligned = C_middle.at[1].set(C_middle[1] @ jnp.swapaxes(epochs.turned_middle, -1, -2))
        C_nb = full_rate_attitude(epochs, aligned, carried=False)
        C_nb = C_nb.at[1].set(C_nb[1] @ epochs.turned)
        both = jax.vmap(judged)(C_middle, C_nb, full_rate_velocity(epochs, C_nb))
        straight = judged(C_middle[0], C_nb[0], interpolated_velocity(epochs, epochs.v_knots))
        return {
            "epochs": jax.tree.map(lambda x: x[0], both),
            "gyro windows": jax.tree.map(lambda x: x[1], both),
            "interpolated velocity": straight,
        }

    return jax.vmap(unit)(epochs, C_middle)


@jax.jit
def turning_readings(frequency: jax.Array) -> Readings:
    """A board on its course without chop, and a head that rolls, nods and turns by 15 degrees, a third out of step."""
    calm = gybing_windsurfer(8.0, 0.5, 150.0, DURATION + 20.0, DURATION + 20.0)
    none = jnp.zeros((3, 3))
    head: Windsurfer = replace(
        calm,
        height=jnp.asarray(0.0),
        frequency=jnp.full(3, 2 * jnp.pi * frequency),
        phase=2 * jnp.pi / 3 * jnp.arange(3),
        displacement=none,
        sway=none,
        head=jnp.radians(15.0) * jnp.eye(3),
    )
    t = jnp.arange(round(DURATION * FINE_RATE) + 1) / FINE_RATE
    return ideal_readings(partial(windsurfer_pose, head), t, G)


def turning_sweep(frequencies: np.ndarray) -> dict[str, Errors]:
    """Errors (frequencies,) of each method with a device that turns faster and faster."""
    cases = [errors(turning_readings(f), Instruments(), units=UNITS) for f in frequencies]
    return jax.tree.map(lambda *x: jnp.stack(x), *cases)


def _tilt(C: jax.Array, true: jax.Array) -> jax.Array:
    """Angle between the upward directions of two attitudes in body axes, in degrees."""
    up, right = C[..., 2, :], true[..., 2, :]
    return jnp.degrees(jnp.arctan2(jnp.linalg.norm(jnp.cross(up, right), axis=-1), jnp.sum(up * right, -1)))


def _rms(error: jax.Array, where: jax.Array | None = None) -> jax.Array:
    return jnp.sqrt(jnp.mean(error * error, where=where))
