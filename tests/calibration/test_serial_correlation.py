"""Statistical inefficiency against the exact one of autoregressive series, and the coverage of a mean's interval."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from altijax.calibration.serial_correlation import mean_with_std, statistical_inefficiency


def autoregressive(keep: float, repetitions: int, n: int) -> np.ndarray:
    white = np.random.default_rng(0).normal(size=(repetitions, n + 500))
    return lfilter([1.0], [1.0, -keep], white)[:, 500:]


@pytest.mark.parametrize("keep", [0.0, 0.8])
def test_first_order_autoregression(keep: float) -> None:
    """The sum of keep^k is (1 + keep) / (1 - keep)."""
    found = statistical_inefficiency(autoregressive(keep, 60, 8000))
    assert np.mean(found) == pytest.approx((1 + keep) / (1 - keep), rel=0.06)


@pytest.mark.parametrize("keep", [0.0, 0.9])
def test_intervals_of_the_mean_hold_it(keep: float) -> None:
    mean, std = mean_with_std(autoregressive(keep, 1000, 2000))
    inside = np.mean(np.abs(mean) < 1.96 * std)
    assert 0.92 < inside < 0.97


def test_edges() -> None:
    assert statistical_inefficiency(jnp.full(50, 0.3)) == 1
    assert statistical_inefficiency(jnp.tile(jnp.array([1.0, -1.0]), 30)) == 1
    mean, std = mean_with_std(jnp.full(50, 0.3))
    assert (float(mean), float(std)) == (pytest.approx(0.3), pytest.approx(0, abs=1e-12))
    assert np.isfinite(jax.grad(lambda x: mean_with_std(x)[1])(jnp.full(50, 0.3))).all()
    white = jnp.asarray(np.random.default_rng(1).normal(size=500))
    assert mean_with_std(white)[1] == pytest.approx(float(jnp.std(white)) / 500**0.5, rel=0.3)
