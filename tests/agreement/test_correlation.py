"""The lag between two series: found with gaps, not found in noise."""

import numpy as np
import pytest

from altijax.agreement.correlation import MAX_LAG, match

STEP = 0.25


def wandering(rng: np.random.Generator, count: int, k: int = 1) -> np.ndarray:
    """Noise of some seconds' memory."""
    white = rng.normal(size=(k, count + 40))
    return np.stack([np.convolve(row, np.ones(9) / 3, "same")[20:-20] for row in white])


@pytest.mark.parametrize("lag", [-60.0, -3.0, 0.0, 0.25, 18.0])
def test_a_lag_is_found_with_its_sign_and_scale(lag):
    rng = np.random.default_rng(1)
    x = wandering(rng, 800)
    series = np.full(800, np.nan)
    shift = round(lag / STEP)
    source = np.arange(800) - shift
    inside = (source >= 0) & (source < 800)
    series[inside] = -2.5 * x[0, source[inside]] + 0.1 * rng.normal(size=inside.sum())
    x[0, 100:150] = np.nan
    found = match(x, series, STEP)
    assert found.lag == pytest.approx(lag, abs=3 * found.lag_std) and found.lag_std < 0.2
    assert found.coefficients[0] == pytest.approx(-2.5, abs=0.1)
    assert found.scale[0] <= 2.55 and found.scale[1] >= 2.45 and found.correlation > 0.98
    assert abs(found.lag) <= MAX_LAG


def test_the_direction_among_three_axes_is_found():
    rng = np.random.default_rng(2)
    x = wandering(rng, 600, 3)
    found = match(x, x[1] - 0.5 * x[2] + 0.2 * rng.normal(size=600), STEP)
    np.testing.assert_allclose(found.coefficients, [0, 1, -0.5], atol=0.05)
    assert (np.abs(found.coefficients - [0, 1, -0.5]) < 4 * found.coefficient_std).all()


def test_unrelated_series_are_not_sure():
    rng = np.random.default_rng(3)
    found = [match(wandering(rng, 480), wandering(rng, 480)[0], STEP) for _ in range(50)]
    assert np.mean([match is not None and match.score > 5 for match in found]) < 0.05


def test_parts_of_a_record_tell_a_clock_that_was_set():
    rng = np.random.default_rng(4)
    x = wandering(rng, 2400)
    late = np.concatenate([x[0, :1200], x[0, 1192:2392]])
    found = match(x, late, STEP)
    assert found.lags[0, 1] == pytest.approx(0, abs=0.3) and found.lags[-1, 1] == pytest.approx(2, abs=0.3)


@pytest.mark.parametrize("series", [np.full(400, np.nan), np.zeros(400), np.r_[np.ones(30), np.full(370, np.nan)]])
def test_too_little_is_none(series):
    assert match(np.random.default_rng(5).normal(size=(1, 400)), series, STEP) is None
    assert match(np.zeros((1, 400)), np.random.default_rng(5).normal(size=400), STEP) is None
