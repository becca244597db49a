"""Error measures on figures that can be checked by hand."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax import metrics


def test_rms_with_and_without_offset() -> None:
    error = np.array([[3.0, 4.0, 3.0, 4.0], [1.0, 1.0, 1.0, 1.0]])
    np.testing.assert_allclose(metrics.rms(error), [np.sqrt(12.5), 1.0], rtol=1e-15)
    np.testing.assert_allclose(metrics.rms_without_offset(error), [0.5, 0.0], rtol=1e-15)


def test_rms_of_a_perfect_estimate_has_a_gradient() -> None:
    np.testing.assert_array_equal(jax.grad(metrics.rms)(jnp.zeros(5)), np.zeros(5))


def test_accuracy_denominators_printed_in_shirai2000() -> None:
    """Table 2, experiment 3: 10.078 m over 0.098 m is 1/103; table 3, experiment 3: 163.969 m over 5.324 m is
    1/30.8."""
    found = metrics.accuracy_denominator([10.078, 163.969, 5.459], [0.098, -5.324, 0.0])
    np.testing.assert_allclose(found, [102.84, 30.80, np.inf], atol=0.005)


def test_coverage_of_gaussian_errors() -> None:
    error = np.random.default_rng(0).normal(size=(2, 20_000)) * np.array([[1.0], [5.0]])
    std = np.broadcast_to(np.array([[1.0], [5.0]]), error.shape)
    # five standard deviations of a share of 20 000
    np.testing.assert_allclose(metrics.coverage(error, std, 1.0), 0.6827, atol=0.017)
    np.testing.assert_allclose(metrics.coverage(error, std, 2.0), 0.9545, atol=0.008)
    assert metrics.coverage([1.0, -1.0, 2.1], [1.0, 1.0, 1.0], 2.0) == 2 / 3
