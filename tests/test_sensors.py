"""Accelerometer and gyro: the correction inverts the model, and each error has the statistics its parameter says."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from altijax.sensors import (
    Accelerometer,
    Gyro,
    accelerometer_output,
    correct_accelerometer,
    correct_gyro,
    gyro_output,
    saturated,
)

KEY = jax.random.key(0)
DT = 0.01


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
    return record(**{name: jnp.asarray(value) for name, value in parameters.items()})


def read(sensor, f_b, w_b, dt=DT, temperature=None, key=KEY):
    if isinstance(sensor, Gyro):
        return gyro_output(sensor, w_b, f_b, dt, temperature, key=key)
    return accelerometer_output(sensor, f_b, dt, temperature, key=key)


def correct(sensor, measured, f_b, temperature=None):
    if isinstance(sensor, Gyro):
        return correct_gyro(sensor, measured, f_b, temperature)
    return correct_accelerometer(sensor, measured, temperature)


@pytest.mark.parametrize("record", [Accelerometer, Gyro])
def test_default_is_ideal(record):
    f_b, w_b, temperature = motion()
    true = w_b if record is Gyro else f_b
    np.testing.assert_array_equal(read(record(), f_b, w_b, temperature=temperature), true)
    assert not saturated(record(), true).any()


@pytest.mark.parametrize("batch", [(), (2, 5)])
@pytest.mark.parametrize("record", [Accelerometer, Gyro])
def test_correction_inverts_the_model(record, batch):
    f_b, w_b, temperature = motion(batch)
    sensor = deterministic(record)
    measured = read(sensor, f_b, w_b, temperature=temperature)
    true = w_b if record is Gyro else f_b
    assert np.abs(measured - true).max() > 0.1
    np.testing.assert_allclose(correct(sensor, measured, f_b, temperature), true, atol=1e-12)
    at_reference = read(sensor, f_b, w_b)
    np.testing.assert_allclose(correct(sensor, at_reference, f_b), true, atol=1e-12)


def test_convention_of_bias_and_scale():
    """true = measured / scale - bias, at the reference temperature and without misalignment."""
    sensor = Accelerometer(bias=jnp.array([0.1, -0.2, 0.3]), scale=jnp.array([1.1, 0.9, 1.2]))
    f_b, _, _ = motion()
    np.testing.assert_allclose(
        accelerometer_output(sensor, f_b, DT, key=KEY),
        np.array([1.1, 0.9, 1.2]) * (f_b + np.array([0.1, -0.2, 0.3])),
        rtol=1e-14,
    )


def test_misalignment_elements():
    sensor = Accelerometer(misalignment=jnp.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]))
    coupling = np.array([[1, 0.01, 0.02], [0.03, 1, 0.04], [0.05, 0.06, 1]])
    measured = accelerometer_output(sensor, np.eye(3), DT, key=KEY)
    np.testing.assert_allclose(measured, coupling.T, atol=1e-15)


def test_g_sensitivity_columns_are_directions_of_force():
    gyro = Gyro(g_sensitivity=jnp.arange(9.0).reshape(3, 3))
    measured = gyro_output(gyro, np.zeros((3, 3)), np.eye(3), DT, key=KEY)
    np.testing.assert_allclose(measured, np.arange(9.0).reshape(3, 3).T, atol=1e-14)


def test_temperature_polynomial_against_numpy():
    sensor = deterministic(Accelerometer)
    temperature = np.linspace(-10, 60, 7)
    measured = np.asarray(
        accelerometer_output(dataclasses.replace(sensor, misalignment=0.0), np.zeros((7, 3)), DT, temperature, key=KEY)
    )
    for axis in range(3):
        bias = np.polynomial.Polynomial([sensor.bias[axis], *sensor.bias_temperature[:, axis]])(temperature - 20)
        scale = np.polynomial.Polynomial([sensor.scale[axis], *sensor.scale_temperature[:, axis]])(temperature - 20)
        np.testing.assert_allclose(measured[:, axis], scale * bias, rtol=1e-13)


def test_one_number_is_linear_in_temperature_on_all_axes():
    sensor = Accelerometer(bias_temperature=0.5)
    measured = accelerometer_output(sensor, np.zeros((7, 3)), DT, np.full(7, 27.0), key=KEY)
    np.testing.assert_allclose(measured, 1.0)


@pytest.mark.parametrize("dt", [1e-3, 1e-2, 0.1])
def test_white_noise_density(dt):
    """scipy's one-sided spectrum of white noise is density squared, whatever the time step."""
    n, density = 2**16, 0.02
    noise = read(Accelerometer(noise_density=density), np.zeros((n, 3)), None, dt)
    _, spectrum = scipy.signal.periodogram(noise, 1 / dt, axis=0, detrend=False)
    inner = spectrum[1:-1]
    # Each bin is exponentially distributed: the mean of N has the relative standard deviation 1 / sqrt(N).
    assert inner.mean() == pytest.approx(density**2, rel=5 / inner.size**0.5)
    low = inner[: n // 16]
    assert low.mean() == pytest.approx(density**2, rel=5 / low.size**0.5)


@pytest.mark.parametrize("dt", [1e-2, 0.1])
def test_bias_random_walk(dt):
    sensor, n, walks = Gyro(bias_random_walk=jnp.array([0.3, 0.5, 0.7])), 41, 3000
    walk = np.asarray(read(sensor, np.zeros((walks, n, 3)), np.zeros((walks, n, 3)), dt))
    np.testing.assert_array_equal(walk[:, 0], 0)
    for k in (n // 2, n - 1):
        expected = np.array([0.3, 0.5, 0.7]) ** 2 * k * dt
        np.testing.assert_allclose(walk[:, k].var(axis=0), expected, rtol=5 * (2 / walks) ** 0.5)


def test_noise_is_independent_over_batch_axes_and_samples():
    noise = np.asarray(read(Accelerometer(noise_density=1.0), np.zeros((5, 400, 3)), None))
    columns = noise.transpose(0, 2, 1).reshape(15, 400)
    correlation = np.corrcoef(columns) - np.eye(15)
    assert np.abs(correlation).max() < 5 / 400**0.5
    assert np.abs(np.corrcoef(noise[0, 1:, 0], noise[0, :-1, 0])[0, 1]) < 5 / 400**0.5


@pytest.mark.parametrize("bandwidth", [0.5, 7.0, 80.0])
def test_low_pass_is_scipys_exact_response_to_linear_input(bandwidth):
    t = np.arange(60) * DT
    f_b = np.random.default_rng(3).standard_normal((60, 3))
    time_constant = 1 / (2 * np.pi * bandwidth)
    system = scipy.signal.StateSpace([[-1 / time_constant]], [[1 / time_constant]], [[1.0]], [[0.0]])
    measured = accelerometer_output(Accelerometer(bandwidth=bandwidth), f_b, DT, key=KEY)
    for axis in range(3):
        _, expected, _ = scipy.signal.lsim(system, f_b[:, axis], t, X0=[f_b[0, axis]])
        np.testing.assert_allclose(measured[:, axis], expected, atol=1e-12)


def test_low_pass_has_lost_3_db_and_45_degrees_at_its_bandwidth():
    bandwidth, dt = 5.0, 1e-4
    t = np.arange(2**16) * dt
    f_b = np.cos(2 * np.pi * bandwidth * t)[:, None] * np.ones(3)
    measured = np.asarray(accelerometer_output(Accelerometer(bandwidth=bandwidth), f_b, dt, key=KEY))
    settled = slice(2**16 - 40000, 2**16)
    amplitude = 2 * (measured[settled, 0] * np.exp(-2j * np.pi * bandwidth * t[settled])).mean()
    # What linear interpolation between samples leaves is of the order (2 pi bandwidth dt)^2 / 12.
    assert amplitude == pytest.approx((1 - 1j) / 2, abs=1e-6)


def test_bandwidth_differs_by_axis_and_infinite_is_none():
    f_b, _, _ = motion(n=60)
    sensor = Accelerometer(bandwidth=jnp.array([5.0, np.inf, 5.0]))
    measured = accelerometer_output(sensor, f_b, DT, key=KEY)
    np.testing.assert_array_equal(measured[:, 1], f_b[:, 1])
    assert np.abs(measured[1:, [0, 2]] - f_b[1:, [0, 2]]).min() > 0
    wide = accelerometer_output(Accelerometer(bandwidth=1e7), f_b, DT, key=KEY)
    np.testing.assert_allclose(wide, f_b, atol=1e-4)


def test_bandwidth_limits_the_noise():
    """First order passes the noise of pi / 2 times its bandwidth."""
    density, bandwidth, n = 0.1, 5.0, 2**16
    noise = np.asarray(read(Accelerometer(noise_density=density, bandwidth=bandwidth), np.zeros((n, 3)), None, 1e-3))
    expected = density**2 * np.pi / 2 * bandwidth
    # Correlated over 1 / (2 pi bandwidth): independent values number pi bandwidth T.
    independent = np.pi * bandwidth * n * 1e-3 * 3
    assert noise.var() == pytest.approx(expected, rel=5 * (2 / independent) ** 0.5)


def test_quantisation_error_is_uniform():
    step = 0.05
    f_b = np.random.default_rng(4).uniform(-3, 3, (2**16, 3))
    measured = np.asarray(accelerometer_output(Accelerometer(resolution=step), f_b, DT, key=KEY))
    np.testing.assert_allclose(measured / step, np.round(measured / step), atol=1e-9)
    error = (measured - f_b).ravel() / step
    assert np.abs(error).max() <= 0.5 + 1e-9
    count, _ = np.histogram(error, 10, (-0.5, 0.5))
    expected = error.size / 10
    assert ((count - expected) ** 2 / expected).sum() < 34  # chi square, 9 degrees of freedom: 1e-4


def test_range_clips_and_flags():
    sensor = Gyro(range=jnp.array([1.0, 2.0, np.inf]), resolution=jnp.array([0.0, 0.25, 0.0]))
    w_b = np.array([[0.5, 0.5, 0.5], [1.0, 1.8, 99.0], [-3.0, -3.0, -99.0]])
    measured = gyro_output(sensor, w_b, np.zeros((3, 3)), DT, key=KEY)
    np.testing.assert_allclose(measured, [[0.5, 0.5, 0.5], [1.0, 1.75, 99.0], [-1.0, -2.0, -99.0]])
    np.testing.assert_array_equal(
        saturated(sensor, measured), [[False, False, False], [True, False, False], [True, True, False]]
    )


def test_clipping_and_steps_keep_the_derivative():
    """The Jacobian is that of the exact reading, so a misfit's gradient differs only by steps times it."""
    f_b, _, temperature = motion(n=60)
    smooth = deterministic(Accelerometer)
    stepped = dataclasses.replace(smooth, resolution=jnp.asarray(0.01), range=jnp.asarray(9.0))

    def reading(bias, record):
        return accelerometer_output(dataclasses.replace(record, bias=bias), f_b, DT, temperature, key=KEY)

    bias = jnp.array([0.1, 0.2, 0.3])
    assert np.asarray(saturated(stepped, reading(bias, stepped))).mean() > 0.1
    for jacobian in (jax.jacfwd, jax.jacrev):
        np.testing.assert_array_equal(jacobian(reading)(bias, stepped), jacobian(reading)(bias, smooth))

    fine = dataclasses.replace(smooth, resolution=jnp.asarray(1e-3))
    target = reading(jnp.zeros(3), smooth)
    misfit = jax.grad(lambda bias, record: ((reading(bias, record) - target) ** 2).sum())
    slope = np.abs(jax.jacfwd(reading)(bias, smooth)).sum(axis=(0, 1))
    difference = np.abs(misfit(bias, fine) - misfit(bias, smooth))
    assert (difference <= 2 * 0.5e-3 * slope).all() and difference.max() > 0


@pytest.mark.parametrize("record", [Accelerometer, Gyro])
@pytest.mark.parametrize("at", ["default", "everything"])
def test_gradients_of_every_parameter_are_finite(record, at):
    f_b, w_b, temperature = motion(n=60)
    sensor = record()
    if at == "everything":
        sensor = dataclasses.replace(
            deterministic(record), noise_density=0.1, bias_random_walk=0.1, bandwidth=5.0, range=9.0, resolution=0.1
        )

    def total(sensor, f_b, w_b, dt, temperature):
        measured = read(sensor, f_b, w_b, dt, temperature)
        return (measured * jnp.arange(180.0).reshape(60, 3)).sum() + correct(sensor, measured, f_b, temperature).sum()

    gradient = jax.grad(total, argnums=(0, 1, 2, 3, 4))(sensor, f_b, w_b, DT, temperature)
    for leaf in jax.tree.leaves(gradient):
        assert np.isfinite(leaf).all()
    for name in ("bias", "scale", "misalignment", "noise_density", "bias_random_walk"):
        assert np.abs(getattr(gradient[0], name)).max() > 0, name
    if at == "everything":
        assert abs(gradient[0].bandwidth) > 0 and np.abs(gradient[0].bias_temperature).min() > 0


def test_many_sensors_by_vmap_and_jit():
    f_b, w_b, temperature = motion()
    keys = jax.random.split(KEY, 5)
    sensors = Gyro(
        bias=jnp.arange(15.0).reshape(5, 3), noise_density=jnp.linspace(0, 0.1, 5), bandwidth=jnp.linspace(5, 9, 5)
    )
    axes = Gyro(
        **{field.name: None for field in dataclasses.fields(Gyro)} | {"bias": 0, "noise_density": 0, "bandwidth": 0}
    )
    many = jax.jit(jax.vmap(lambda s, key: gyro_output(s, w_b, f_b, DT, temperature, key=key), in_axes=(axes, 0)))(
        sensors, keys
    )
    for i in range(5):
        one = dataclasses.replace(
            sensors, bias=sensors.bias[i], noise_density=sensors.noise_density[i], bandwidth=sensors.bandwidth[i]
        )
        np.testing.assert_allclose(many[i], gyro_output(one, w_b, f_b, DT, temperature, key=keys[i]), rtol=1e-12)


def test_series_of_one_sample():
    sensor = Accelerometer(bias=0.5, bandwidth=5.0)
    np.testing.assert_allclose(accelerometer_output(sensor, np.ones((1, 3)), DT, key=KEY), 1.5)


def test_single_precision_stays():
    f_b, w_b, temperature = (np.float32(x) for x in motion())
    for record in (Accelerometer, Gyro):
        measured = read(deterministic(record), f_b, w_b, DT, temperature)
        assert measured.dtype == np.float32
        assert correct(deterministic(record), measured, f_b, temperature).dtype == np.float32


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
