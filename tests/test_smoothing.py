"""The smoother against dense Gaussian conditioning, its own statistics, and the endpoint-matched form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.signals import cumulative_integral
from altijax.smoothing import match_endpoints, smooth_velocity

A_NOISE, BIAS_WALK, BIAS_STD = 0.05, 0.02, 0.3


def conditioned(t, gained, t_gnss, gained_at, z, std, used):
    """Mean and std of v and of the bias at `t`, by the covariance of the whole process under a flat prior of v."""
    first = t_gnss[np.argmax(used)]
    times = np.concatenate([t, t_gnss[used]]) - first
    du = np.concatenate([gained, gained_at[used]])
    s, u = np.meshgrid(times, times)
    low = np.where(s * u > 0, np.minimum(np.abs(s), np.abs(u)), 0)
    high = np.maximum(np.abs(s), np.abs(u))
    # of b: walk from the first epoch both ways; v integrates it, and white noise
    walk_b = BIAS_WALK**2 * low
    walk_v = BIAS_WALK**2 * low**2 * (3 * high - low) / 6
    P_bb = BIAS_STD**2 + walk_b
    P_vv = BIAS_STD**2 * s * u + walk_v + A_NOISE**2 * low
    # covariance of v at s (columns) and b at u (rows): minus the integral of that of b
    x = np.where(s * u > 0, np.minimum(np.abs(s), np.abs(u)), 0)
    between = np.where(s * u > 0, np.where(np.abs(s) < np.abs(u), s**2 / 2, np.abs(u) * np.abs(s) - u**2 / 2), 0)
    P_vb = -(BIAS_STD**2 * s + BIAS_WALK**2 * np.sign(s) * between)
    del x
    n, m = t.size, int(used.sum())
    measured = slice(n, n + m)
    R = np.diag(std[used] ** 2)
    S_inverse = np.linalg.inv(P_vv[measured, measured] + R)
    one = np.ones(m)
    y = z[used] - du[measured]
    level_var = 1 / (one @ S_inverse @ one)
    level = level_var * (one @ S_inverse @ y)
    gain_v = P_vv[:n, measured] @ S_inverse
    # rows of P_vb are u (of b)
    gain_b = P_vb[:n, measured] @ S_inverse
    v = du[:n] + level + gain_v @ (y - level)
    b = gain_b @ (y - level)
    lost_v, lost_b = 1 - gain_v @ one, -gain_b @ one
    var_v = np.diag(P_vv)[:n] - np.sum(gain_v * P_vv[:n, measured], 1) + level_var * lost_v**2
    var_b = np.diag(P_bb)[:n] - np.sum(gain_b * P_vb[:n, measured], 1) + level_var * lost_b**2
    residual = y - level
    # density of the other epochs given the first: of all under a flat prior, which leaves out the level
    log_density = -0.5 * (
        residual @ S_inverse @ residual
        - np.linalg.slogdet(S_inverse)[1]
        - np.log(level_var)
        + (m - 1) * np.log(2 * np.pi)
    )
    return v, np.sqrt(var_v), b, np.sqrt(var_b), log_density


def example(seed=0, missing=()):
    rng = np.random.default_rng(seed)
    t = np.cumsum(0.01 + 0.02 * rng.random(400))
    a = np.cumsum(rng.standard_normal(400)) * 0.1
    t_gnss = np.sort(rng.uniform(0.5, t[-1] - 0.4, 9))
    z = rng.standard_normal(9)
    std = rng.uniform(0.03, 0.3, 9)
    std[list(missing)] = np.inf
    return t, a, t_gnss, z, std


def fine_integral(t, a, t_new):
    """Of the piecewise linear acceleration, with the new times put in among the old."""
    merged = np.sort(np.concatenate([t, t_new]))
    return np.interp(t_new, merged, cumulative_integral(merged, np.interp(merged, t, a)))


@pytest.mark.parametrize("missing", [(), (0, 1), (4, 8), (0, 1, 2, 3, 5, 6, 7, 8)])
def test_smoother_is_gaussian_conditioning(missing):
    """Mean, standard deviation and likelihood at every sample: irregular times, gaps, epochs between samples."""
    t, a, t_gnss, z, std = example(missing=missing)
    found = smooth_velocity(t, a, t_gnss, z, std, A_NOISE, BIAS_WALK, BIAS_STD, np.inf)
    used = np.isfinite(std)
    v, v_std, b, b_std, log_density = conditioned(
        t, np.asarray(cumulative_integral(t, a)), t_gnss, fine_integral(t, a, t_gnss), z, std, used
    )
    np.testing.assert_array_equal(found.used, used)
    np.testing.assert_allclose(found.v, v, atol=1e-9)
    np.testing.assert_allclose(found.v_std, v_std, rtol=1e-9)
    np.testing.assert_allclose(found.bias, b, atol=1e-9)
    np.testing.assert_allclose(found.bias_std, b_std, rtol=1e-9)
    assert found.log_likelihood == pytest.approx(log_density, abs=1e-9)


def simulated(runs, seed, gnss_std=0.1):
    """Motions by the model itself: truth, readings of 20 s at 50 Hz, velocities of 1 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(1001) * 0.02
    dt = 0.02
    truth = np.sin(0.7 * t + rng.uniform(0, 6, (runs, 1))) * rng.uniform(1, 5, (runs, 1)) / 0.7
    a = np.gradient(truth, dt, axis=-1)
    # what integrating `a` leaves against the truth: white noise and a walking bias, step by step
    bias = BIAS_STD * rng.standard_normal((runs, 1)) + np.cumsum(
        BIAS_WALK * np.sqrt(dt) * rng.standard_normal((runs, 1001)), -1
    )
    white = A_NOISE / np.sqrt(dt) * rng.standard_normal((runs, 1001))
    t_gnss = np.arange(0.0, 20.5, 1.0)
    z = truth[:, ::50] + gnss_std * rng.standard_normal((runs, 21))
    return t, a + bias + white, t_gnss, z, truth, bias


def smooth(t, a, t_gnss, z, std=0.1, gate=np.inf, a_noise=A_NOISE):
    return smooth_velocity(t, a, t_gnss, z, jnp.full(z.shape, std), a_noise, BIAS_WALK, BIAS_STD, gate)


def test_errors_are_as_large_as_stated():
    t, a, t_gnss, z, truth, bias = simulated(200, 0)
    found = smooth(t, a, t_gnss, z)
    middle = slice(100, 900, 50)
    nees = ((found.v - truth) / found.v_std)[:, middle] ** 2
    # 200 runs of 16 epochs a few apart; white noise over a sample and trapezoids differ from the model by 1 %
    assert np.mean(nees) == pytest.approx(1, abs=0.1)
    assert np.mean(((found.bias - bias) / found.bias_std)[:, middle] ** 2) == pytest.approx(1, abs=0.15)
    assert np.mean(found.nis[:, 1:]) == pytest.approx(1, abs=0.07)
    assert np.mean(np.abs(found.v - truth)[:, middle] < 1.96 * found.v_std[:, middle]) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("gnss_std", [0.001, 0.03, 0.1, 0.3])
def test_never_worse_than_matched_endpoints(gnss_std):
    t, a, t_gnss, z, truth, _ = simulated(200, 1, gnss_std)
    smoothed = np.sqrt(np.mean((smooth(t, a, t_gnss, z, gnss_std).v - truth) ** 2))
    literal = np.sqrt(np.mean((match_endpoints(t, a, t_gnss, z) - truth) ** 2))
    assert smoothed < literal
    if gnss_std >= 0.1:
        assert smoothed < 0.75 * literal


def test_likelihood_finds_the_noise():
    """Over 200 records together the maximum lies where the noise was made, and its slope is the quotient's."""
    t, a, t_gnss, z, _, _ = simulated(200, 2)

    def total(levels, a, z):
        found = smooth(t, a, t_gnss, z, jnp.exp(levels[0]), np.inf, jnp.exp(levels[1]))
        return jnp.sum(found.log_likelihood)

    at = np.log([0.1, A_NOISE])
    slope = np.asarray(jax.jit(jax.jacfwd(total))(at, a, z))
    curvature = []
    for h in 0.05 * np.eye(2):
        up, here, down = (float(total(x, a, z)) for x in (at + h, at, at - h))
        assert slope @ h / 0.05 == pytest.approx((up - down) / 0.1, rel=0.02, abs=20)
        curvature.append((2 * here - up - down) / 0.05**2)
    assert (np.abs(slope) < 4 * np.sqrt(curvature)).all()


def test_outliers_are_taken_out_and_nothing_else():
    """Also where the first epoch is one, and where two follow each other."""
    t, a, t_gnss, z, truth, _ = simulated(200, 3)
    bad = z.copy()
    bad[:, [0, 7, 8, 15]] += np.array([4.0, -3.0, 5.0, 2.0])
    found = smooth(t, a, t_gnss, bad, gate=5.0)
    good = np.ones(21, bool)
    good[[0, 7, 8, 15]] = False
    assert np.mean(found.used == good) > 0.995
    assert np.sqrt(np.mean((found.v - truth) ** 2)) < 1.3 * np.sqrt(np.mean((smooth(t, a, t_gnss, z).v - truth) ** 2))
    assert np.mean(smooth(t, a, t_gnss, z, gate=5.0).used) > 0.999


def test_missing_epochs_are_not_finite_and_none_at_all_is_survived():
    t, a, t_gnss, z, _, _ = simulated(1, 4)
    z[:, 3] = np.nan
    found = smooth(t, a, t_gnss, z)
    assert not found.used[0, 3] and found.used.sum() == 20
    assert np.isfinite(found.v).all()
    nothing = smooth(t, a, t_gnss, np.full_like(z, np.nan))
    assert np.isinf(nothing.v_std).all() and np.isfinite(nothing.v).all() and not nothing.used.any()
    slopes = jax.grad(lambda a: jnp.sum(smooth(t, a, t_gnss, z).v_std + smooth(t, a, t_gnss, z).v))(a)
    assert np.isfinite(slopes).all()


def test_matched_endpoints_meet_the_velocities():
    t, a, t_gnss, z, _, _ = simulated(1, 5)
    found = match_endpoints(t, a, t_gnss, z)
    np.testing.assert_allclose(found[:, ::50], z, atol=1e-12)
    off = found - cumulative_integral(t, a)
    np.testing.assert_allclose(np.diff(off[:, :50], 2), 0, atol=1e-12)
