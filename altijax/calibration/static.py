"""Calibration on a table: accelerometers in several positions, gyros at rest, and both while the temperature changes.

An accelerometer at rest reads gravity in whatever position it lies, so the positions need not be known: what makes all
lengths equal to gravity are the right bias, scale and misalignment. Only a turn of the triad as a whole stays unknown;
it is chosen so that the sensor's x axis is body x and its y axis lies in the plane of body x and y. Six positions on
the faces of a box suffice for bias and scale; misalignment needs three more, on edges or corners.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from altijax import _safe
from altijax._shapes import require_shape
from altijax._values import checked, varying
from altijax.calibration.serial_correlation import mean_with_std, statistical_inefficiency
from altijax.least_squares import levenberg_marquardt
from altijax.sensors import Accelerometer, Gyro, correct_accelerometer

POSITION_PARAMETERS = (
    *(f"bias_{axis}" for axis in "xyz"),
    *(f"scale_{axis}" for axis in "xyz"),
    *(f"misalignment_{pair}" for pair in ("yx", "zx", "zy")),
)
"""Order of the parameters in the covariance and Jacobian of `fit_accelerometer_positions`."""

POSITION_UNCERTAINTY = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02)
"""Standard deviations of the same for a consumer's sensor that nobody has calibrated: m/s^2, 1, rad (MPU-6050).

They are not those of `altijax.calibration.parameters.CONSTANTS`: of a sensor alone its whole tolerance counts."""

_MODELS = {"bias": 3, "bias and scale": 6, "bias, scale and misalignment": 9}


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class SensorFit:
    """Parameters of a sensor as found by a static procedure, and how well they are known.

    Attributes
    ----------
    sensor : Accelerometer or Gyro
        Parameters, for `correct_accelerometer` or `correct_gyro`; what was not fitted is nominal.
    std : Accelerometer or Gyro
        Standard deviation of each parameter in its place, zero where it was not fitted. It is very large where the data
        do not determine it.
    jacobian : (observations, terms)
        Derivatives of the residuals, each in units of its standard deviation, by the parameters: what
        `identify` takes to say which parameters the data determine.
    covariance : (terms, terms)
        Covariance of the parameters, undamped.
    rank : ()
        Number of parameters, or combinations of them, that the data determine to working precision.
    misfit : ()
        Root of the mean squared residual in units of its standard deviation, per degree of freedom: about 1 if the
        standard deviation given is right, zero where nothing is left over to judge by, 1 where it was taken from the
        residuals.
    """

    sensor: Accelerometer | Gyro
    std: Accelerometer | Gyro
    jacobian: jax.Array
    covariance: jax.Array
    rank: jax.Array
    misfit: jax.Array


def fit_accelerometer_positions(
    f_mean: ArrayLike, gravity: ArrayLike, f_std: ArrayLike, model: str = "bias, scale and misalignment"
) -> SensorFit:
    """Bias, scale and misalignment of a triad of accelerometers from its mean readings in positions of any orientation.

    Minimises the sum over the positions of ((abs(f_b) - gravity) / f_std)^2, where f_b is the corrected mean reading.
    Parameters that the positions leave open stay nominal. Derivatives by every argument are those of the minimum.

    Parameters
    ----------
    f_mean : (positions, 3) m/s^2
        Mean reading in each position.
    gravity : () m/s^2
        Magnitude of gravity at the place: an error of it goes into the scale.
    f_std : () or (positions,) m/s^2
        Standard deviation of each mean; infinite to leave a position out.
    model : {"bias, scale and misalignment", "bias and scale", "bias"}, optional
        What to fit: 9, 6 or 3 parameters, in the order of `POSITION_PARAMETERS`.

    Returns
    -------
    fit : SensorFit
        Accelerometer, standard deviations, covariance and rank.

    Raises
    ------
    ValueError
        If the shapes do not fit or the model is unknown.
    """
    f_mean = require_shape("f_mean", f_mean, (None, 3))
    gravity = require_shape("gravity", gravity, ())
    f_std = require_shape("f_std", f_std, () if jnp.ndim(f_std) == 0 else (f_mean.shape[0],))
    if model not in _MODELS:
        raise ValueError(f"model must be one of {', '.join(map(repr, _MODELS))}, got {model!r}")
    unit = jnp.asarray(POSITION_UNCERTAINTY[: _MODELS[model]], f_mean.dtype)

    def sensor(x: jax.Array) -> Accelerometer:
        return _accelerometer(jnp.concatenate([x * unit, jnp.zeros(9 - unit.size, x.dtype)]), 1.0)

    def residual(x: jax.Array) -> jax.Array:
        return (_safe.norm(correct_accelerometer(sensor(x), f_mean)) - gravity) / f_std

    x, jacobian, covariance, rank, misfit = _fit(residual, jnp.zeros_like(unit))
    std = jnp.concatenate([unit * _safe.sqrt(jnp.diag(covariance)), jnp.zeros(9 - unit.size, unit.dtype)])
    return SensorFit(
        sensor=sensor(x),
        std=_known(_accelerometer(std, 0.0)),
        jacobian=jacobian / unit,
        covariance=covariance * jnp.outer(unit, unit),
        rank=rank,
        misfit=misfit,
    )


@checked(w_b=varying)
def fit_gyro_at_rest(w_b: ArrayLike) -> SensorFit:
    """Bias of a triad of gyros from readings at rest, with the standard deviation that their correlation leaves.

    The Earth's rotation, 7e-5 rad/s, is part of what is found. What the bias wanders after the rest is not in the
    standard deviation: see `fit_allan`.

    Parameters
    ----------
    w_b : (time, 3) rad/s
        Readings at rest, at uniform times.

    Returns
    -------
    fit : SensorFit
        Gyro with its bias.

    Raises
    ------
    ValueError
        If the trailing axis of `w_b` is not 3.
    """
    w_b = require_shape("w_b", w_b, (None, 3))
    mean, std = mean_with_std(w_b.T)
    return SensorFit(
        sensor=Gyro(bias=mean),
        std=_known(Gyro(bias=std)),
        jacobian=jnp.diag(1 / jnp.maximum(std, jnp.finfo(std.dtype).tiny)),
        covariance=jnp.diag(std**2),
        rank=jnp.sum(std > 0),
        misfit=jnp.ones((), std.dtype),
    )


def fit_gyro_temperature(
    w_b: ArrayLike, temperature: ArrayLike, reference_temperature: ArrayLike = 25.0, degree: int = 1
) -> SensorFit:
    """Bias of a triad of gyros as a polynomial of its temperature, from readings at rest while that changes.

    Parameters
    ----------
    w_b : (time, 3) rad/s
        Readings at rest, at uniform times.
    temperature : (time,) degC
        Temperature of the sensor.
    reference_temperature : () degC, optional
        Where `bias` is to hold: best within what was swept.
    degree : int, optional
        Of the polynomial.

    Returns
    -------
    fit : SensorFit
        Gyro with `bias` and `bias_temperature`; its parameters are, for one power after another, those of x, y and z.
        Neighbouring residuals count as one observation as far as they are correlated.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    w_b = require_shape("w_b", w_b, (None, 3))
    powers = _powers(temperature, reference_temperature, degree, w_b)
    still = jnp.zeros_like(w_b)

    def modelled(x: jax.Array) -> jax.Array:
        return still + powers @ x.reshape(-1, 3)

    x, std, rest = _regression(modelled, w_b, jnp.zeros(3 * (degree + 1), w_b.dtype))
    bias, bias_std = x.reshape(-1, 3), std.reshape(-1, 3)
    return SensorFit(
        sensor=Gyro(bias=bias[0], bias_temperature=bias[1:], reference_temperature=reference_temperature),
        std=_known(Gyro(bias=bias_std[0], bias_temperature=bias_std[1:])),
        **rest,
    )


def fit_accelerometer_temperature(
    measured: ArrayLike,
    f_b: ArrayLike,
    temperature: ArrayLike,
    reference_temperature: ArrayLike = 25.0,
    degree: int = 1,
) -> SensorFit:
    """Bias and scale of a triad of accelerometers as polynomials of its temperature, in known positions.

    Each axis must feel gravity both ways up, or up and across, at different temperatures: from one position alone bias
    and scale cannot be told apart, and the rank says so.

    Parameters
    ----------
    measured : (time, 3) m/s^2
        Readings at rest, at uniform times within each position.
    f_b : (time, 3) m/s^2
        True specific force: gravity along the axis that points up.
    temperature : (time,) degC
        Temperature of the sensor.
    reference_temperature : () degC, optional
        Where `bias` and `scale` are to hold: best within what was swept.
    degree : int, optional
        Of both polynomials.

    Returns
    -------
    fit : SensorFit
        Accelerometer with `bias`, `scale`, `bias_temperature` and `scale_temperature`; its parameters are, for one
        power after another, the biases and then the scales of x, y and z.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    measured = require_shape("measured", measured, (None, 3))
    f_b = require_shape("f_b", f_b, measured.shape)
    powers = _powers(temperature, reference_temperature, degree, measured)

    def split(x: jax.Array) -> tuple[jax.Array, jax.Array]:
        both = x.reshape(degree + 1, 2, 3) * jnp.asarray([[1.0], [0.1]], x.dtype)
        return both[:, 0], both[:, 1]

    def modelled(x: jax.Array) -> jax.Array:
        bias, gain = split(x)
        return (1 + powers @ gain) * (f_b + powers @ bias)

    x, std, rest = _regression(modelled, measured, jnp.zeros(6 * (degree + 1), measured.dtype))
    (bias, gain), (bias_std, gain_std) = split(x), split(std)
    unit = jnp.tile(jnp.repeat(jnp.asarray([1.0, 0.1], x.dtype), 3), degree + 1)
    rest |= {"jacobian": rest["jacobian"] / unit, "covariance": rest["covariance"] * jnp.outer(unit, unit)}
    return SensorFit(
        sensor=Accelerometer(
            bias=bias[0],
            scale=1 + gain[0],
            bias_temperature=bias[1:],
            scale_temperature=gain[1:],
            reference_temperature=reference_temperature,
        ),
        std=_known(
            Accelerometer(
                bias=bias_std[0], scale=gain_std[0], bias_temperature=bias_std[1:], scale_temperature=gain_std[1:]
            )
        ),
        **rest,
    )


def _accelerometer(x: jax.Array, nominal_scale: float) -> Accelerometer:
    """Record of the nine parameters, the scale counted from `nominal_scale`."""
    misalignment = jnp.zeros(6, x.dtype).at[jnp.asarray([2, 4, 5])].set(x[6:])
    return Accelerometer(bias=x[:3], scale=nominal_scale + x[3:6], misalignment=misalignment)


def _known(std: Accelerometer | Gyro) -> Accelerometer | Gyro:
    """The record with zero in all fields that hold no standard deviation but the default of a sensor."""
    given = {
        name: value if value is not getattr(type(std), name) else 0.0  # a field that was given is an array
        for name, value in vars(std).items()
    }
    return type(std)(**given)


def _powers(temperature: ArrayLike, reference: ArrayLike, degree: int, series: jax.Array) -> jax.Array:
    if degree < 1:
        raise ValueError(f"degree must be 1 or more, got {degree}")
    temperature = require_shape("temperature", temperature, series.shape[:1]).astype(series.dtype)
    reference = require_shape("reference_temperature", reference, ())
    return (temperature - reference)[:, None] ** jnp.arange(degree + 1)


def _regression(
    modelled: Callable[[jax.Array], jax.Array], measured: jax.Array, x0: jax.Array
) -> tuple[jax.Array, jax.Array, dict[str, jax.Array]]:
    """Least squares for three axes, each with the noise and the correlation that its residuals show."""
    x, *_ = _fit(lambda x: (modelled(x) - measured).reshape(-1), x0)
    left = (modelled(x) - measured).T
    freedom = max(left.shape[-1] - x0.size / 3, 1)
    variance = jnp.sum(left**2, -1) / freedom * statistical_inefficiency(left)
    axis_std = _safe.sqrt(jnp.maximum(variance, jnp.finfo(x0.dtype).tiny))
    x, jacobian, covariance, rank, _ = _fit(lambda x: ((modelled(x) - measured) / axis_std).reshape(-1), x)
    rest = {"jacobian": jacobian, "covariance": covariance, "rank": rank, "misfit": jnp.ones((), x0.dtype)}
    return x, _safe.sqrt(jnp.diag(covariance)), rest


def _fit(
    residual: Callable[[jax.Array], jax.Array], x0: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array, jax.Array]:
    """Minimiser, Jacobian, covariance, rank, and misfit per degree of freedom, differentiable by what `residual` holds.

    The search is not differentiated: one Newton step from where it ends has the derivatives of the minimum.
    """
    fit = jax.lax.stop_gradient(levenberg_marquardt(residual, jax.lax.stop_gradient(x0)))

    def slope(x: jax.Array) -> jax.Array:
        r, transposed = jax.vjp(residual, x)
        return transposed(r)[0]

    curvature = jax.lax.stop_gradient(jax.jacfwd(slope)(fit.x))
    x = fit.x - jnp.linalg.pinv(curvature, rtol=1e-9, hermitian=True) @ slope(fit.x)
    r, jacobian = residual(x), jax.jacfwd(residual)(x)
    freedom = jnp.sum(jnp.abs(jacobian).sum(-1) > 0) - fit.rank
    misfit = jnp.where(freedom > 0, _safe.sqrt(r @ r / jnp.maximum(freedom, 1)), 0)
    return x, jacobian, fit.covariance, fit.rank, misfit
