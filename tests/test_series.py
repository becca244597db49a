"""Sampled series in NumPy agree with those of JAX."""

import numpy as np

from altijax.series import interpolated, low_pass, means_between, supported
from altijax.signals import interval_means, low_pass as low_pass_in_jax, resample


def gapped() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.uniform(0.005, 0.015, 400))
    t[200:] += 0.7
    return t, rng.normal(size=(400, 3))


def test_interpolation_and_support_are_those_of_resample() -> None:
    t, values = gapped()
    # on samples, beyond both ends, within the gap
    at = np.sort(np.concatenate([np.linspace(t[0] - 0.5, t[-1] + 0.5, 999), t[::17]]))
    expected, mask = resample(at, t, values, 0.1, axis=-2)
    np.testing.assert_allclose(interpolated(at, t, values), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(interpolated(at, t, values[:, 1]), expected[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(supported(at, t, 0.1), mask)
    assert 0.3 < mask.mean() < 0.95


def test_a_single_sample_supports_its_own_time_only() -> None:
    np.testing.assert_array_equal(supported(np.array([0.9, 1.0, 1.1]), np.array([1.0]), 9.0), [False, True, False])


def test_means_between_samples_are_those_of_interval_means() -> None:
    t, values = gapped()
    edges = t[::7]
    expected = interval_means(t, values.T, edges).T
    np.testing.assert_allclose(means_between(edges, t, values), expected, rtol=0, atol=1e-11)
    several = np.stack([edges[:9], edges[8:17]])
    np.testing.assert_allclose(
        means_between(several, t, values), np.stack([expected[:8], expected[8:16]]), rtol=0, atol=1e-11
    )


def test_means_hold_the_whole_integral_wherever_the_edges_are() -> None:
    t, values = gapped()
    edges = np.linspace(t[0], t[-1], 57)
    whole = np.diff(edges) @ means_between(edges, t, values)
    np.testing.assert_allclose(whole, np.trapezoid(values, t, axis=0), rtol=1e-12)


def test_the_low_pass_is_that_of_signals() -> None:
    t = 3.0 + 0.01 * np.arange(400)
    walk = np.cumsum(np.random.default_rng(0).normal(size=(2, 400)), -1)
    for cutoff in (0.1, 1.0, 20.0, np.inf):
        for count in (2, 3, 400):
            expected = low_pass_in_jax(t[:count], walk[:, :count], cutoff)
            np.testing.assert_allclose(low_pass(t[:count], walk[:, :count], cutoff), expected, rtol=0, atol=1e-12)
