"""Still stretches are found where a simulated sensor rests, and averaged one by one."""

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.calibration.standstill import means_at_rest, still_samples


def turned_by_hand() -> tuple[np.ndarray, np.ndarray]:
    """Readings of five rests of 300 samples with 200 samples of handling before each, and which of them rest."""
    rng = np.random.default_rng(0)
    directions = np.array([[9.8, 0, 0], [0, 9.8, 0], [0, 0, 9.8], [-9.8, 0, 0], [0, 6.9, -6.9]])
    parts, rests = [], []
    for direction in directions:
        parts += [direction + 3 * rng.normal(size=(200, 3)), np.tile(direction, (300, 1))]
        rests += [np.zeros(200, bool), np.ones(300, bool)]
    readings = np.concatenate(parts)
    return readings + 0.02 * rng.normal(size=readings.shape), np.concatenate(rests)


def test_rests_are_found_to_the_sample() -> None:
    readings, resting = turned_by_hand()
    still = np.asarray(still_samples(readings, 0.07))
    # a sample or two of handling may happen to be as near as noise
    assert np.sum(still != resting) <= 5
    np.testing.assert_array_equal(still_samples(np.stack([readings, readings]), 0.07)[1], still)


def test_means_of_intervals() -> None:
    readings, resting = turned_by_hand()
    mean, samples = means_at_rest(readings, resting, max_intervals=7)
    np.testing.assert_array_equal(samples, [300, 300, 300, 300, 300, 0, 0])
    for i in range(5):
        np.testing.assert_allclose(mean[i], readings[500 * i + 200 : 500 * i + 500].mean(0), atol=1e-12)
    np.testing.assert_array_equal(mean[5:], 0)
    few = means_at_rest(readings, resting, max_intervals=2)
    np.testing.assert_array_equal(few[0], mean[:2])


def test_a_drift_slower_than_the_window_is_still() -> None:
    ramp = jnp.linspace(0, 1.0, 1000)[:, None] * jnp.ones(3)
    assert still_samples(ramp, 0.1).all()
    assert not still_samples(ramp, 0.01).any()
    assert still_samples(ramp[:20], 0.1).all()  # shorter than the window


def test_window_of_one_sample_is_refused() -> None:
    with pytest.raises(ValueError, match="window must be 2 samples or more, got 1"):
        still_samples(jnp.zeros((9, 3)), 0.1, 1)
