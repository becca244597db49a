"""Accelerometer and gyro: the correction inverts the model, and each error has the statistics its parameter says."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from altijax import sensors
from altijax.sensors import Accelerometer, Gyro
from tests.quick import quick_jit

# Compiled whole, and with few shapes, these tests take a fraction of the time.
accelerometer_output = jax.jit(sensors.accelerometer_output)
gyro_output = jax.jit(sensors.gyro_output)
correct_accelerometer = jax.jit(sensors.correct_accelerometer)
correct_gyro = jax.jit(sensors.correct_gyro)
saturated = jax.jit(sensors.saturated)

KEY = jax.random.key(0)
DT = 0.01
SIZES = {"misalignment": 6, "g_sensitivity": (3, 3), "bias_temperature": (3, 3), "scale_temperature": (2, 3)}


def motion(batch=(), n=7, seed=1):
    rng = np.random.default_rng(seed)
    f_b = rng.standard_normal((*batch, n, 3)) + np.array([0, 0, 9.8])
    return f_b, rng.standard_normal((*batch, n, 3)), 25 + 20 * rng.standard_normal((*batch, n))


def deterministic(record, seed=2):
    rng = np.random.default_rng(seed)
    parameters = dict(
        bias=rng.standard_normal(3),
        scale=1 + 0.1 * rng.standard_normal(3),
        misalignment=0.1 * rng.standard_normal(6),
        bias_temperature=1e-2 * rng.standard_normal((3, 3)) / np.array([[1], [1e2], [1e4]]),
        scale_temperature=1e-3 * rng.standard_normal((2, 3)) / np.array([[1], [1e2]]),
        reference_temperature=20.0,
    )
    if record is Gyro:
        parameters["g_sensitivity"] = 0.1 * rng.standard_normal((3, 3))
    return record(**{name: np.asarray(value) for name, value in parameters.items()})


def everything(record):
    return dataclasses.replace(
        deterministic(record), noise_density=0.1, bias_random_walk=0.1, bandwidth=5.0, range=9.0, resolution=0.1
    )


def full(sensor):
    """The same with all elements of all parameters."""
    shapes = {field.name: SIZES.get(field.name, 3) for field in dataclasses.fields(sensor)}
    shapes["reference_temperature"] = ()
    elements = {name: np.broadcast_to(getattr(sensor, name), shape) for name, shape in shapes.items()}
    return dataclasses.replace(sensor, **elements)


def read(sensor, f_b, w_b, dt=DT, temperature=None, key=KEY):
    if isinstance(sensor, Gyro):
        return gyro_output(sensor, w_b, f_b, dt, temperature, key=key)
    return accelerometer_output(sensor, f_b, dt, temperature, key=key)


read_once = quick_jit(read)


def read_alike(sensor, true, dt=DT, temperature=25.0, f_b=0.0):
    """Readings of one series, compiled alike for all records and series."""
    n, samples = len(true), 60 if isinstance(sensor, Gyro) else 2**16
    true, f_b = (np.resize(np.broadcast_to(x, (n, 3)), (samples, 3)) for x in (true, f_b))
    forces = (f_b, true) if isinstance(sensor, Gyro) else (true, f_b)
    temperature = np.resize(np.broadcast_to(temperature, n), samples)
    return np.asarray(read(full(sensor), *forces, np.float64(dt), temperature))[:n]


def correct(sensor, measured, f_b, temperature=None):
    if isinstance(sensor, Gyro):
        return correct_gyro(sensor, measured, f_b, temperature)
    return correct_accelerometer(sensor, measured, temperature)


@pytest.mark.parametrize("record", [Accelerometer, Gyro])
def test_default_is_ideal(record):
    f_b, w_b, temperature = motion()
    true = w_b if record is Gyro else f_b
    np.testing.assert_array_equal(read_once(record(), f_b, w_b, temperature=temperature), true)
    assert not saturated(record(), true).any()


@pytest.mark.parametrize("batch", [(), (2, 5)])
@pytest.mark.parametrize("record", [Accelerometer, Gyro])
def test_correction_inverts_the_model(record, batch):
    f_b, w_b, temperature = motion(batch)
    sensor = deterministic(record)
    true = w_b if record is Gyro else f_b

    @quick_jit
    def there_and_back(f_b, w_b, temperature):
        measured = read(sensor, f_b, w_b, temperature=temperature)
        at_reference = read(sensor, f_b, w_b)
        return measured, correct(sensor, measured, f_b, temperature), correct(sensor, at_reference, f_b)

    measured, back, back_at_reference = there_and_back(f_b, w_b, temperature)
    assert np.abs(measured - true).max() > 0.1
    np.testing.assert_allclose(back, true, atol=1e-12)
    np.testing.assert_allclose(back_at_reference, true, atol=1e-12)


def test_convention_of_bias_and_scale():
    """true = measured / scale - bias, at the reference temperature and without misalignment."""
    sensor = Accelerometer(bias=np.array([0.1, -0.2, 0.3]), scale=np.array([1.1, 0.9, 1.2]))
    f_b, _, _ = motion()
    np.testing.assert_allclose(
        read_alike(sensor, f_b),
        np.array([1.1, 0.9, 1.2]) * (f_b + np.array([0.1, -0.2, 0.3])),
        rtol=1e-14,
    )


def test_misalignment_elements():
    sensor = Accelerometer(misalignment=np.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]))
    coupling = np.array([[1, 0.01, 0.02], [0.03, 1, 0.04], [0.05, 0.06, 1]])
    measured = read_alike(sensor, np.eye(3))
    np.testing.assert_allclose(measured, coupling.T, atol=1e-15)


def test_g_sensitivity_columns_are_directions_of_force():
    gyro = Gyro(g_sensitivity=np.arange(9.0).reshape(3, 3))
    measured = read_alike(gyro, np.zeros((3, 3)), f_b=np.eye(3))
    np.testing.assert_allclose(measured, np.arange(9.0).reshape(3, 3).T, atol=1e-14)


def test_temperature_polynomial_against_numpy():
    sensor = deterministic(Accelerometer)
    temperature = np.linspace(-10, 60, 7)
    measured = read_alike(dataclasses.replace(sensor, misalignment=0.0), np.zeros((7, 3)), temperature=temperature)
    for axis in range(3):
        bias = np.polynomial.Polynomial([sensor.bias[axis], *sensor.bias_temperature[:, axis]])(temperature - 20)
        scale = np.polynomial.Polynomial([sensor.scale[axis], *sensor.scale_temperature[:, axis]])(temperature - 20)
        np.testing.assert_allclose(measured[:, axis], scale * bias, rtol=1e-13)


def test_one_number_is_linear_in_temperature_on_all_axes():
    sensor = Accelerometer(bias_temperature=0.5)
    measured = read_once(sensor, np.zeros((7, 3)), np.zeros((7, 3)), temperature=np.full(7, 27.0))
    np.testing.assert_allclose(measured, 1.0)


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 0.1])
def test_white_noise_density(dt):
    """scipy's one-sided spectrum of white noise is density squared, whatever the time step."""
    n, density = 2**16, 0.02
    noise = read_alike(Accelerometer(noise_density=density), np.zeros((n, 3)), dt)
    _, spectrum = scipy.signal.periodogram(noise, 1 / dt, axis=0, detrend=False)
    inner = spectrum[1:-1]
    # Each bin is exponentially distributed: the mean of N has the relative standard deviation 1 / sqrt(N).
    assert inner.mean() == pytest.approx(density**2, rel=5 / inner.size**0.5)
    low = inner[: n // 16]
    assert low.mean() == pytest.approx(density**2, rel=5 / low.size**0.5)


@pytest.mark.parametrize("dt", [1e-2, 0.1])
def test_bias_random_walk(dt):
    sensor, n, walks = Gyro(bias_random_walk=np.array([0.3, 0.5, 0.7])), 41, 3000
    still = np.zeros((walks, n, 3))
    walk = np.asarray(read_once(sensor, still, still, dt))
    np.testing.assert_array_equal(walk[:, 0], 0)
    for k in (n // 2, n - 1):
        expected = np.array([0.3, 0.5, 0.7]) ** 2 * k * dt
        np.testing.assert_allclose(walk[:, k].var(axis=0), expected, rtol=5 * (2 / walks) ** 0.5)


def test_noise_is_independent_over_batch_axes_and_samples():
    sensor, n, series = Gyro(noise_density=1.0, bias_random_walk=np.zeros(3)), 41, 3000
    still = np.zeros((series, n, 3))
    noise = np.asarray(read_once(sensor, still, still, DT))
    columns = noise.reshape(series, n * 3).T
    correlation = np.corrcoef(columns) - np.eye(n * 3)
    assert np.abs(correlation).max() < 5 / series**0.5
    assert np.abs(np.corrcoef(noise[1:, 0, 0], noise[:-1, 0, 0])[0, 1]) < 5 / series**0.5


@pytest.mark.parametrize("bandwidth", [0.5, 7.0, 80.0])
def test_low_pass_is_scipys_exact_response_to_linear_input(bandwidth):
    t = np.arange(60) * DT
    f_b = np.random.default_rng(3).standard_normal((60, 3))
    time_constant = 1 / (2 * np.pi * bandwidth)
    system = scipy.signal.StateSpace([[-1 / time_constant]], [[1 / time_constant]], [[1.0]], [[0.0]])
    measured = read_alike(Accelerometer(bandwidth=bandwidth), f_b)
    for axis in range(3):
        _, expected, _ = scipy.signal.lsim(system, f_b[:, axis], t, X0=[f_b[0, axis]])
        np.testing.assert_allclose(measured[:, axis], expected, atol=1e-12)


def test_low_pass_has_lost_3_db_and_45_degrees_at_its_bandwidth():
    bandwidth, dt = 5.0, 1e-4
    t = np.arange(2**16) * dt
    f_b = np.cos(2 * np.pi * bandwidth * t)[:, None] * np.ones(3)
    measured = read_alike(Accelerometer(bandwidth=bandwidth), f_b, dt)
    settled = slice(2**16 - 40000, 2**16)
    amplitude = 2 * (measured[settled, 0] * np.exp(-2j * np.pi * bandwidth * t[settled])).mean()
    # What linear interpolation between samples leaves is of the order (2 pi bandwidth dt)^2 / 12.
    assert amplitude == pytest.approx((1 - 1j) / 2, abs=1e-6)


def test_bandwidth_differs_by_axis_and_infinite_is_none():
    f_b, _, _ = motion(n=60)
    sensor = Accelerometer(bandwidth=np.array([5.0, np.inf, 5.0]))
    measured = read_alike(sensor, f_b)
    np.testing.assert_array_equal(measured[:, 1], f_b[:, 1])
    assert np.abs(measured[1:, [0, 2]] - f_b[1:, [0, 2]]).min() > 0
    wide = read_alike(Accelerometer(bandwidth=1e7), f_b)
    np.testing.assert_allclose(wide, f_b, atol=1e-4)


def test_bandwidth_limits_the_noise():
    """First order passes the noise of pi / 2 times its bandwidth."""
    density, bandwidth, n = 0.1, 5.0, 2**16
    noise = read_alike(Accelerometer(noise_density=density, bandwidth=bandwidth), np.zeros((n, 3)), 1e-3)
    expected = density**2 * np.pi / 2 * bandwidth
    # Correlated over 1 / (2 pi bandwidth): independent values number pi bandwidth T.
    independent = np.pi * bandwidth * n * 1e-3 * 3
    assert noise.var() == pytest.approx(expected, rel=5 * (2 / independent) ** 0.5)


def test_quantisation_error_is_uniform():
    step = 0.05
    f_b = np.random.default_rng(4).uniform(-3, 3, (2**16, 3))
    measured = read_alike(Accelerometer(resolution=step), f_b)
    np.testing.assert_allclose(measured / step, np.round(measured / step), atol=1e-9)
    error = (measured - f_b).ravel() / step
    assert np.abs(error).max() <= 0.5 + 1e-9
    count, _ = np.histogram(error, 10, (-0.5, 0.5))
    expected = error.size / 10
    assert ((count - expected) ** 2 / expected).sum() < 34  # chi square, 9 degrees of freedom: 1e-4


def test_range_clips_and_flags():
    sensor = Gyro(range=np.array([1.0, 2.0, np.inf]), resolution=np.array([0.0, 0.25, 0.0]))
    w_b = np.array([[0.5, 0.5, 0.5], [1.0, 1.8, 99.0], [-3.0, -3.0, -99.0]])
    measured = read_alike(sensor, w_b)
    np.testing.assert_allclose(measured, [[0.5, 0.5, 0.5], [1.0, 1.75, 99.0], [-1.0, -2.0, -99.0]])
    np.testing.assert_array_equal(
        saturated(sensor, measured), [[False, False, False], [True, False, False], [True, True, False]]
    )


def test_clipping_and_steps_keep_the_derivative():
    """The Jacobian is that of the exact reading, so a misfit's gradient differs only by steps times it."""
    f_b, _, temperature = motion(n=60)
    smooth = full(deterministic(Accelerometer))
    stepped = dataclasses.replace(smooth, resolution=np.full(3, 0.01), range=np.full(3, 9.0))
    fine = dataclasses.replace(smooth, resolution=np.full(3, 1e-3))
    target = read_alike(dataclasses.replace(smooth, bias=np.zeros(3)), f_b, temperature=temperature)

    def reading(bias, record):
        return accelerometer_output(dataclasses.replace(record, bias=bias), f_b, DT, temperature, key=KEY)

    def misfit(bias, record):
        return ((reading(bias, record) - target) ** 2).sum()

    @quick_jit
    def reading_jacobians_and_gradient(record):
        bias = jnp.array([0.1, 0.2, 0.3])
        jacobians = [jacobian(reading)(bias, record) for jacobian in (jax.jacfwd, jax.jacrev)]
        return reading(bias, record), *jacobians, jax.grad(misfit)(bias, record)

    measured, *of_stepped, _ = reading_jacobians_and_gradient(stepped)
    _, *of_smooth, smooth_gradient = reading_jacobians_and_gradient(smooth)
    assert np.asarray(saturated(stepped, measured)).mean() > 0.1
    for got, expected in zip(of_stepped, of_smooth, strict=True):
        np.testing.assert_array_equal(got, expected)

    slope = np.abs(of_smooth[0]).sum(axis=(0, 1))
    difference = np.abs(reading_jacobians_and_gradient(fine)[-1] - smooth_gradient)
    assert (difference <= 2 * 0.5e-3 * slope).all() and difference.max() > 0


@quick_jit
@partial(jax.grad, argnums=(0, 1, 2, 3, 4))
def gradient_of_sum(sensor, f_b, w_b, dt, temperature):
    measured = read(sensor, f_b, w_b, dt, temperature)
    return (measured * jnp.arange(180.0).reshape(60, 3)).sum() + correct(sensor, measured, f_b, temperature).sum()


@pytest.mark.parametrize(
    "sensor",
    [Accelerometer(), full(everything(Accelerometer)), full(Gyro()), full(everything(Gyro))],
    ids=["ideal accelerometer", "accelerometer", "ideal gyro", "gyro"],
)
def test_gradients_of_every_parameter_are_finite(sensor):
    f_b, w_b, temperature = motion(n=60)
    gradient = gradient_of_sum(sensor, f_b, w_b, DT, temperature)
    for leaf in jax.tree.leaves(gradient):
        assert np.isfinite(leaf).all()
    for name in ("bias", "scale", "misalignment", "noise_density", "bias_random_walk"):
        assert np.abs(getattr(gradient[0], name)).max() > 0, name
    if np.isfinite(sensor.bandwidth).all():
        assert np.abs(gradient[0].bandwidth).min() > 0 and np.abs(gradient[0].bias_temperature).min() > 0


def test_many_sensors_by_vmap_and_jit():
    f_b, w_b, temperature = motion(n=60)
    keys = jax.random.split(KEY, 5)
    gyros = Gyro(
        bias=np.arange(15.0).reshape(5, 3), noise_density=np.linspace(0, 0.1, 5), bandwidth=np.linspace(5, 9, 5)
    )
    axes = Gyro(
        **{field.name: None for field in dataclasses.fields(Gyro)} | {"bias": 0, "noise_density": 0, "bandwidth": 0}
    )
    many = quick_jit(jax.vmap(lambda s, key: gyro_output(s, w_b, f_b, DT, temperature, key=key), in_axes=(axes, 0)))(
        gyros, keys
    )
    for i in range(5):
        one = dataclasses.replace(
            gyros, bias=gyros.bias[i], noise_density=gyros.noise_density[i], bandwidth=gyros.bandwidth[i]
        )
        expected = read(full(one), f_b, w_b, np.float64(DT), temperature, key=keys[i])
        np.testing.assert_allclose(many[i], expected, rtol=1e-12)


def test_series_of_one_sample():
    sensor = Accelerometer(bias=0.5, bandwidth=5.0)
    np.testing.assert_allclose(read_once(sensor, np.ones((1, 3)), None), 1.5)


def test_single_precision_stays():
    f_b, w_b, temperature = (np.float32(x) for x in motion())
    for record in (Accelerometer, Gyro):
        sensor = deterministic(record)
        measured = jax.eval_shape(partial(read, sensor), f_b, w_b, DT, temperature)
        assert measured.dtype == np.float32
        assert jax.eval_shape(partial(correct, sensor), measured, f_b, temperature).dtype == np.float32


def test_wrong_shapes_are_named():
    f_b, w_b, temperature = motion()
    with pytest.raises(ValueError, match="f_b must have shape"):
        accelerometer_output(Accelerometer(), f_b[:, :2], DT, key=KEY)
    with pytest.raises(ValueError, match="temperature must have shape"):
        accelerometer_output(Accelerometer(), f_b, DT, temperature[:5], key=KEY)
    with pytest.raises(ValueError, match="dt must have shape"):
        accelerometer_output(Accelerometer(), f_b, np.ones(7), key=KEY)
    with pytest.raises(ValueError, match="w_b must have shape"):
        gyro_output(Gyro(), w_b[:, :2], f_b, DT, key=KEY)
    with pytest.raises(ValueError, match="f_b must have shape"):
        gyro_output(Gyro(), w_b, f_b[:5], DT, key=KEY)
    with pytest.raises(ValueError, match="measured must have shape"):
        correct_accelerometer(Accelerometer(), f_b[:, :2])
    with pytest.raises(ValueError, match="measured must have shape"):
        saturated(Accelerometer(), f_b[:, :2])
    with pytest.raises(ValueError, match="f_b must have shape"):
        correct_gyro(Gyro(), w_b, f_b[:5])
    with pytest.raises(ValueError, match=r"bias must have shape \(3,\), got \(2,\)"):
        accelerometer_output(Accelerometer(bias=np.zeros(2)), f_b, DT, key=KEY)
    with pytest.raises(ValueError, match=r"bias_temperature must have shape \(any, 3\), got \(3,\)"):
        accelerometer_output(Accelerometer(bias_temperature=np.zeros(3)), f_b, DT, key=KEY)
    with pytest.raises(ValueError, match=r"misalignment must have shape \(6,\), got \(3, 3\)"):
        correct_accelerometer(Accelerometer(misalignment=np.zeros((3, 3))), f_b)
