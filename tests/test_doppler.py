"""Doppler receiver: what it reports of a known motion, and the conversions of Chalko's Eq. (1)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax import doppler
from altijax.doppler import DopplerReceiver
from tests.quick import quick_jit

# Compiled whole, and with few shapes, these tests take a fraction of the time.
doppler_velocity = jax.jit(doppler.doppler_velocity, static_argnames="epochs")
velocity_to_course = jax.jit(doppler.velocity_to_course)
course_to_velocity = jax.jit(doppler.course_to_velocity)

KEY = jax.random.key(0)
T = np.linspace(10, 40, 3001)


def velocity(t):
    return np.stack([0.3 * t, 2 - 0.1 * t, 0.5 + 0 * t], -1)


@pytest.mark.parametrize("latency", [0.0, 0.15])
@pytest.mark.parametrize("rate", [1.0, 5.0])
def test_reports_the_velocity_of_the_latency_before(rate, latency):
    receiver = DopplerReceiver(rate=rate, latency=latency)
    t_epochs, v, valid = doppler_velocity(receiver, T, velocity(T), epochs=160, key=KEY)
    np.testing.assert_allclose(t_epochs, 10 + np.arange(160) / rate, rtol=1e-15)
    moved = np.asarray(t_epochs) - latency
    np.testing.assert_array_equal(valid, (moved >= 10) & (moved <= 40))
    assert valid.sum() == 30 * rate + (1 if latency == 0 else 0)
    valid = np.asarray(valid)
    np.testing.assert_allclose(np.asarray(v)[valid], velocity(moved[valid]), rtol=1e-12)
    assert np.isfinite(v).all()


@pytest.mark.parametrize("correlation_time", [0.0, 0.5, 3.0])
def test_noise_has_its_size_and_correlation_whatever_the_rate(correlation_time):
    n, rate = 20000, 4.0
    receiver = DopplerReceiver(
        rate=rate, horizontal_noise=0.05, vertical_noise=0.1, correlation_time=correlation_time, latency=0.0
    )
    t = np.array([0.0, n / rate])
    _, v, valid = doppler_velocity(receiver, t, np.zeros((2, 3)), epochs=n, key=KEY)
    assert valid.all()
    v = np.asarray(v) / np.array([0.05, 0.05, 0.1])
    keep = np.exp(-1 / (rate * correlation_time)) if correlation_time else 0.0
    # Variance of the sample variance of a first-order process.
    spread = np.sqrt(2 / n * (1 + keep**2) / (1 - keep**2))
    np.testing.assert_allclose(v.var(0), 1, atol=5 * spread)
    for lag in (1, 4):
        got = (v[lag:] * v[:-lag]).mean(0)
        np.testing.assert_allclose(got, keep**lag, atol=5 * spread)
    assert np.abs(np.corrcoef(v.T) - np.eye(3)).max() < 5 * spread


def test_correlated_noise_is_stationary_from_the_first_epoch():
    receiver = DopplerReceiver(horizontal_noise=1.0, vertical_noise=1.0, correlation_time=2.0)
    t, v_n = np.array([0.0, 9.0]), np.zeros((4000, 2, 3))
    _, v, _ = quick_jit(lambda: doppler_velocity(receiver, t, v_n, epochs=7, key=KEY))()
    np.testing.assert_allclose(np.asarray(v).var(axis=(0, 2)), 1, atol=5 * np.sqrt(2 / 12000))


def test_dropouts():
    n, p = 20000, 0.2
    receiver = DopplerReceiver(dropout_probability=p)
    _, _, valid = doppler_velocity(receiver, np.array([0.0, n]), np.zeros((2, 3)), epochs=n, key=KEY)
    valid = np.asarray(valid)
    spread = np.sqrt(p * (1 - p) / n)
    assert 1 - valid.mean() == pytest.approx(p, abs=5 * spread)
    assert (~valid[1:] & ~valid[:-1]).mean() == pytest.approx(p**2, abs=5 * spread)


def test_batches_vmap_and_jit():
    v_n = velocity(T) * np.linspace(0.5, 1.5, 10).reshape(2, 5, 1, 1)
    receiver = DopplerReceiver(latency=0.1, horizontal_noise=0.05)

    def run(v_n, key):
        return doppler.doppler_velocity(receiver, T, v_n, epochs=160, key=key)

    t_epochs, v, valid = run(v_n, KEY)
    assert t_epochs.shape == (160,) and v.shape == (2, 5, 160, 3) and valid.shape == (2, 5, 160)
    for a, b in zip(quick_jit(run)(v_n, KEY), (t_epochs, v, valid), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    keys = jax.random.split(KEY, 5)
    many = quick_jit(jax.vmap(run, out_axes=(None, 0, 0)))(v_n[0], keys)
    for i in range(5):
        _, one, _ = doppler_velocity(receiver, T, v_n[0, i], epochs=160, key=keys[i])
        np.testing.assert_allclose(many[1][i], one, rtol=1e-12)


def test_every_parameter_has_a_finite_gradient():
    def total(receiver, t, v_n):
        t_epochs, v, _ = doppler_velocity(receiver, t, v_n, epochs=20, key=KEY)
        return (jnp.sin(v) * jnp.cos(t_epochs)[:, None]).sum()

    noisy = DopplerReceiver(rate=1.3, horizontal_noise=0.1, vertical_noise=0.2, correlation_time=1.0, latency=0.2)
    gradient_of = quick_jit(jax.grad(total, argnums=(0, 1, 2)))
    for receiver in (DopplerReceiver(), noisy):
        gradient = gradient_of(receiver, T, velocity(T))
        for leaf in jax.tree.leaves(gradient):
            assert np.isfinite(leaf).all()
        assert abs(gradient[0].latency) > 0 and abs(gradient[0].horizontal_noise) > 0


@quick_jit
@jax.jacfwd
def by_latency(latency):
    return doppler_velocity(DopplerReceiver(latency=latency), T, velocity(T), epochs=7, key=KEY)[1][3]


@pytest.mark.parametrize("latency", [0.0, 0.153])
def test_derivative_by_latency_is_minus_the_acceleration(latency):
    """Also where the epochs lie on samples of the motion."""
    np.testing.assert_allclose(by_latency(latency), [-0.3, 0.1, 0.0], atol=1e-10)


def test_course_of_the_four_winds():
    v_n = np.array([[0, 2, 1], [2, 0, 1], [0, -2, 1], [-2, 0, 1], [-1e-300, 2, 1]], float)
    sog, cog, climb = velocity_to_course(v_n)
    np.testing.assert_allclose(sog, 2)
    np.testing.assert_allclose(cog, [0, np.pi / 2, np.pi, 3 * np.pi / 2, 0], atol=1e-15)
    np.testing.assert_array_equal(climb, 1)


@pytest.mark.parametrize("batch", [(), (5,), (2, 5)])
def test_course_and_velocity_are_inverse(batch):
    v_n = np.random.default_rng(0).standard_normal((*batch, 3))
    sog, cog, climb = velocity_to_course(v_n)
    assert (np.asarray(cog) >= 0).all() and (np.asarray(cog) < 2 * np.pi).all()
    compass = np.mod(np.arctan2(v_n[..., 0], v_n[..., 1]), 2 * np.pi)
    np.testing.assert_allclose(cog, compass, rtol=1e-13)
    np.testing.assert_allclose(course_to_velocity(sog, cog, climb), v_n, atol=1e-14)


def test_course_at_rest_is_finite_with_finite_gradients():
    @quick_jit
    def jacobians(v_n):
        return [jacobian(velocity_to_course)(v_n) for jacobian in (jax.jacfwd, jax.jacrev)]

    for v_n in (np.zeros(3), np.array([0.0, 0.0, 1.0])):
        sog, cog, climb = velocity_to_course(v_n)
        assert sog == 0 and cog == np.pi / 2 and climb == v_n[2]
        for leaf in jax.tree.leaves(jacobians(v_n)):
            assert np.isfinite(leaf).all()
    np.testing.assert_array_equal(course_to_velocity(0.0, 1.0, 0.0), 0)


def test_single_precision_stays():
    def run(t, v_n):
        _, v, _ = doppler.doppler_velocity(DopplerReceiver(latency=0.1), t, v_n, epochs=7, key=KEY)
        return v, *doppler.velocity_to_course(v)

    single = jax.eval_shape(run, np.float32(T), np.float32(velocity(T)))
    assert {x.dtype for x in single} == {jnp.dtype(np.float32)}


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"\bt must have shape"):
        doppler_velocity(DopplerReceiver(), 1.0, velocity(T), epochs=7, key=KEY)
    with pytest.raises(ValueError, match="v_n must have shape"):
        doppler_velocity(DopplerReceiver(), T[:5], velocity(T), epochs=7, key=KEY)
    with pytest.raises(ValueError, match="latency must have shape"):
        doppler_velocity(DopplerReceiver(latency=np.ones(2)), T, velocity(T), epochs=7, key=KEY)
    with pytest.raises(ValueError, match="v_n must have shape"):
        velocity_to_course(np.ones(2))
