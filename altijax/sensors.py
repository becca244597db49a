"""Accelerometers and gyros: what a triad of either puts out during a motion, and the way back.

One chain serves both. Along its own axes a sensor feels ``coupling @ true`` (a gyro ``+ g_sensitivity @ f_b``), and

    reading = quantised(clipped(scale(T) (low_pass(felt + white noise) + bias(T) + walk of the bias)))

where T is the temperature. The correction inverts what can be known, exactly:

    true = coupling^-1 (reading / scale(T) - bias(T))        (a gyro: less g_sensitivity @ f_b inside the bracket)

which without misalignment is the package's ``true = measured / scale - bias``. A record is one sensor: `jax.vmap` over
records makes many, over split keys independent noise. Numbers of a record take the precision of the series they meet.

Clipping and quantisation are straight through: the value is exact, the derivative that of the reading before them.
Their own derivative is zero almost everywhere, which would tell a fit that no parameter matters; yet the average of a
quantised reading over noise or motion larger than a step does follow the unquantised one. The average of a reading
clipped for long does not, so mask those samples (`saturated`).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax._shapes import record_field, require_shape


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Accelerometer:
    """Parameters of a triad of accelerometers; without arguments an ideal one.

    Where an array is asked for, one number stands for all its elements.

    Attributes
    ----------
    bias : (3,) m/s^2
        Of the input: at the reference temperature true = measured / scale - bias.
    scale : (3,)
        Reading over input at the reference temperature.
    misalignment : (6,) rad
        Small angles by which the axes lean: elements xy, xz, yx, yz, zx, zy of the coupling matrix, whose diagonal is
        one (what a diagonal would do, `scale` does); xy is what the x axis feels of the true y component.
    bias_temperature : (degree, 3) m/s^2/K^power
        Polynomial of `bias` about the reference temperature: row 0 times the difference, row 1 times its square, ...
    scale_temperature : (degree, 3) 1/K^power
        The same of `scale`.
    reference_temperature : () degC
        Where `bias` and `scale` hold.
    noise_density : (3,) m/s^2/sqrt(Hz)
        White noise as data sheets give it, one-sided: in a band of B hertz its standard deviation is density sqrt(B),
        in a single sample density / sqrt(2 dt); the integral walks by density / sqrt(2) in one second.
    bias_random_walk : (3,) m/s^2/sqrt(s)
        Standard deviation of the change of the bias in one second, sqrt(T) times that in T seconds; zero at the start.
    bandwidth : (3,) Hz
        Frequency at which the first-order low pass, which the white noise passes too, has lost 3 dB; infinite for none.
    range : (3,) m/s^2
        Largest reading of either sign; infinite for none.
    resolution : (3,) m/s^2
        Step between neighbouring readings; zero for none.
    """

    bias: ArrayLike = 0.0
    scale: ArrayLike = 1.0
    misalignment: ArrayLike = 0.0
    bias_temperature: ArrayLike = 0.0
    scale_temperature: ArrayLike = 0.0
    reference_temperature: ArrayLike = 25.0
    noise_density: ArrayLike = 0.0
    bias_random_walk: ArrayLike = 0.0
    bandwidth: ArrayLike = float("inf")
    range: ArrayLike = float("inf")
    resolution: ArrayLike = 0.0


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Gyro:
    """Parameters of a triad of gyros; without arguments an ideal one.

    Where an array is asked for, one number stands for all its elements. What is said of `Accelerometer` holds here.

    Attributes
    ----------
    bias : (3,) rad/s
        Of the input: at the reference temperature true = measured / scale - bias.
    scale : (3,)
        Reading over input at the reference temperature.
    misalignment : (6,) rad
        Elements xy, xz, yx, yz, zx, zy of the coupling matrix, whose diagonal is one.
    g_sensitivity : (3, 3) (rad/s)/(m/s^2)
        Rate felt per specific force along x, y, z (columns).
    bias_temperature : (degree, 3) rad/s/K^power
        Polynomial of `bias` about the reference temperature, without its constant.
    scale_temperature : (degree, 3) 1/K^power
        The same of `scale`.
    reference_temperature : () degC
        Where `bias` and `scale` hold.
    noise_density : (3,) rad/s/sqrt(Hz)
        White noise, one-sided.
    bias_random_walk : (3,) rad/s/sqrt(s)
        Standard deviation of the change of the bias in one second.
    bandwidth : (3,) Hz
        Frequency at which the first-order low pass has lost 3 dB; infinite for none.
    range : (3,) rad/s
        Largest reading of either sign; infinite for none.
    resolution : (3,) rad/s
        Step between neighbouring readings; zero for none.
    """

    bias: ArrayLike = 0.0
    scale: ArrayLike = 1.0
    misalignment: ArrayLike = 0.0
    g_sensitivity: ArrayLike = 0.0
    bias_temperature: ArrayLike = 0.0
    scale_temperature: ArrayLike = 0.0
    reference_temperature: ArrayLike = 25.0
    noise_density: ArrayLike = 0.0
    bias_random_walk: ArrayLike = 0.0
    bandwidth: ArrayLike = float("inf")
    range: ArrayLike = float("inf")
    resolution: ArrayLike = 0.0


@jax.jit
def accelerometer_output(
    accelerometer: Accelerometer,
    f_b: ArrayLike,
    dt: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    key: jax.Array,
) -> jax.Array:
    """Readings of a triad of accelerometers.

    Parameters
    ----------
    accelerometer : Accelerometer
        Parameters.
    f_b : (..., time, 3) m/s^2
        True specific force in body axes, at uniform times; the low pass takes it as linear in between.
    dt : () s
        Time between samples.
    temperature : (..., time) degC, optional
        Of the sensor; the reference temperature where not given.
    key : key
        Source of the noise.

    Returns
    -------
    measured : (..., time, 3) m/s^2
        Readings.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    f_b = require_shape("f_b", f_b, (..., None, 3))
    felt = _turn(_coupling(accelerometer, f_b.dtype), f_b)
    return _output(accelerometer, felt, dt, temperature, key)


@jax.jit
def gyro_output(
    gyro: Gyro,
    w_b: ArrayLike,
    f_b: ArrayLike,
    dt: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    key: jax.Array,
) -> jax.Array:
    """Readings of a triad of gyros.

    Parameters
    ----------
    gyro : Gyro
        Parameters.
    w_b : (..., time, 3) rad/s
        True angular rate in body axes, at uniform times; the low pass takes it as linear in between.
    f_b : (..., time, 3) m/s^2
        True specific force in body axes, for the g-sensitivity.
    dt : () s
        Time between samples.
    temperature : (..., time) degC, optional
        Of the sensor; the reference temperature where not given.
    key : key
        Source of the noise.

    Returns
    -------
    measured : (..., time, 3) rad/s
        Readings.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    w_b = require_shape("w_b", w_b, (..., None, 3))
    f_b = require_shape("f_b", f_b, (..., w_b.shape[-2], 3))
    felt = _turn(_coupling(gyro, w_b.dtype), w_b) + _turn(record_field(gyro, "g_sensitivity", (3, 3), w_b.dtype), f_b)
    return _output(gyro, felt, dt, temperature, key)


def correct_accelerometer(
    accelerometer: Accelerometer, measured: ArrayLike, temperature: ArrayLike | None = None
) -> jax.Array:
    """Specific force from readings: the inverse of `accelerometer_output`, but for noise, low pass, range and steps.

    Parameters
    ----------
    accelerometer : Accelerometer
        Parameters.
    measured : (..., time, 3) m/s^2
        Readings.
    temperature : (..., time) degC, optional
        Of the sensor; the reference temperature where not given.

    Returns
    -------
    f_b : (..., time, 3) m/s^2
        Specific force in body axes.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    measured = require_shape("measured", measured, (..., None, 3))
    felt = _felt(accelerometer, measured, temperature)
    return _turn(jnp.linalg.inv(_coupling(accelerometer, measured.dtype)), felt)


def correct_gyro(gyro: Gyro, measured: ArrayLike, f_b: ArrayLike, temperature: ArrayLike | None = None) -> jax.Array:
    """Angular rate from readings: the inverse of `gyro_output`, but for noise, low pass, range and steps.

    Parameters
    ----------
    gyro : Gyro
        Parameters.
    measured : (..., time, 3) rad/s
        Readings.
    f_b : (..., time, 3) m/s^2
        Specific force in body axes, corrected, for the g-sensitivity.
    temperature : (..., time) degC, optional
        Of the sensor; the reference temperature where not given.

    Returns
    -------
    w_b : (..., time, 3) rad/s
        Angular rate in body axes.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    measured = require_shape("measured", measured, (..., None, 3))
    f_b = require_shape("f_b", f_b, (..., measured.shape[-2], 3))
    felt = _felt(gyro, measured, temperature) - _turn(record_field(gyro, "g_sensitivity", (3, 3), measured.dtype), f_b)
    return _turn(jnp.linalg.inv(_coupling(gyro, measured.dtype)), felt)


def saturated(sensor: Accelerometer | Gyro, measured: ArrayLike) -> jax.Array:
    """Whether readings are at the end of the range, where they say no more than that the truth lies beyond.

    Parameters
    ----------
    sensor : Accelerometer or Gyro
        Parameters.
    measured : (..., time, 3)
        Readings, m/s^2 or rad/s.

    Returns
    -------
    saturated : (..., time, 3)
        True at the last step before the end of the range, or beyond.

    Raises
    ------
    ValueError
        If the trailing axis of `measured` is not 3.
    """
    measured = require_shape("measured", measured, (..., None, 3))
    end = (
        record_field(sensor, "range", (3,), measured.dtype)
        - record_field(sensor, "resolution", (3,), measured.dtype) / 2
    )
    return jnp.abs(measured) >= end


def _output(
    sensor: Accelerometer | Gyro, felt: jax.Array, dt: ArrayLike, temperature: ArrayLike | None, key: jax.Array
) -> jax.Array:
    """Readings of a triad for what it feels along its own axes."""
    dtype = felt.dtype
    dt = require_shape("dt", dt, ()).astype(dtype)
    scale, bias = _scale_and_bias(sensor, felt, temperature)
    felt = jnp.broadcast_to(felt, jnp.broadcast_shapes(felt.shape, bias.shape))
    white_key, walk_key = jax.random.split(key)
    white = jax.random.normal(white_key, felt.shape, dtype) * jnp.sqrt(0.5 / dt)
    steps = jax.random.normal(walk_key, felt.shape, dtype).at[..., 0, :].set(0) * jnp.sqrt(dt)
    walk = record_field(sensor, "bias_random_walk", (3,), dtype) * jnp.cumsum(steps, -2)
    passed = _low_pass(
        felt + record_field(sensor, "noise_density", (3,), dtype) * white,
        dt,
        record_field(sensor, "bandwidth", (3,), dtype),
    )
    exact = scale * (passed + bias + walk)
    end = record_field(sensor, "range", (3,), dtype)
    return _straight_through(
        _quantised(jnp.clip(exact, -end, end), record_field(sensor, "resolution", (3,), dtype)), exact
    )


def _felt(sensor: Accelerometer | Gyro, measured: jax.Array, temperature: ArrayLike | None) -> jax.Array:
    scale, bias = _scale_and_bias(sensor, measured, temperature)
    return measured / scale - bias


def _scale_and_bias(
    sensor: Accelerometer | Gyro, series: jax.Array, temperature: ArrayLike | None
) -> tuple[jax.Array, jax.Array]:
    """Both at the temperature, broadcasting against `series` (..., time, 3)."""
    dtype = series.dtype
    reference = record_field(sensor, "reference_temperature", (), dtype)
    if temperature is None:
        excess = jnp.zeros((1, 1), dtype)
    else:
        temperature = require_shape("temperature", temperature, (..., series.shape[-2])).astype(dtype)
        excess = (temperature - reference)[..., None]
    both = []
    for name in ("scale", "bias"):
        rows = jnp.asarray(getattr(sensor, f"{name}_temperature"), dtype)
        rows = require_shape(f"{name}_temperature", jnp.full((1, 3), rows) if rows.ndim == 0 else rows, (None, 3))
        change = jnp.zeros((1, 3), dtype)
        for row in rows[::-1]:
            change = (change + row) * excess
        both.append(record_field(sensor, name, (3,), dtype) + change)
    return both[0], both[1]


def _coupling(sensor: Accelerometer | Gyro, dtype: jnp.dtype) -> jax.Array:
    xy, xz, yx, yz, zx, zy = record_field(sensor, "misalignment", (6,), dtype)
    one = jnp.ones_like(xy)
    return jnp.stack([one, xy, xz, yx, one, yz, zx, zy, one]).reshape(3, 3)


def _turn(matrix: jax.Array, v: jax.Array) -> jax.Array:
    return jnp.einsum("ij,...j->...i", matrix, v)


def _low_pass(x: jax.Array, dt: jax.Array, bandwidth: jax.Array) -> jax.Array:
    """First-order lag of series (..., time, 3), exact for an input linear between samples, at rest at the first one."""
    ideal = jnp.isinf(bandwidth)
    turn = 2 * jnp.pi * jnp.where(ideal, 1, bandwidth) * dt
    decay = jnp.exp(-turn)
    mean_decay = -jnp.expm1(-turn) / turn
    drive = (mean_decay - decay) * x[..., :-1, :] + (1 - mean_decay) * x[..., 1:, :]

    def step(y: jax.Array, driven: jax.Array) -> tuple[jax.Array, jax.Array]:
        y = decay * y + driven
        return y, y

    first = x[..., 0, :]
    later = jax.lax.scan(step, first, jnp.moveaxis(drive, -2, 0))[1]
    lagged = jnp.concatenate([first[..., None, :], jnp.moveaxis(later, 0, -2)], -2)
    return jnp.where(ideal, x, lagged)


def _quantised(x: jax.Array, resolution: jax.Array) -> jax.Array:
    stepped = resolution > 0
    step = jnp.where(stepped, resolution, 1)
    return jnp.where(stepped, step * jnp.round(x / step), x)


@jax.custom_jvp
def _straight_through(value: jax.Array, smooth: jax.Array) -> jax.Array:
    """`value` with the derivative of `smooth`."""
    del smooth
    return value


@_straight_through.defjvp
def _straight_through_jvp(
    primals: tuple[jax.Array, jax.Array], tangents: tuple[jax.Array, jax.Array]
) -> tuple[jax.Array, jax.Array]:
    return _straight_through(*primals), tangents[1]
