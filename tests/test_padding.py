"""Sizes that arrays are filled up to."""

import numpy as np
import pytest

from altijax.padding import bucket, padded


@pytest.mark.parametrize(("count", "size"), [(0, 64), (1, 64), (64, 64), (65, 128), (129, 256), (1000, 1024)])
def test_sizes_are_doubles_of_the_least(count: int, size: int) -> None:
    assert bucket(count, 64) == size


def test_recordings_of_30_to_90_s_take_two_sizes_at_most() -> None:
    for rate in (1.0, 4.0, 10.0, 50.0, 104.0, 200.0):
        sizes = {bucket(round(rate * seconds), 16384) for seconds in np.linspace(30, 90, 61)}
        assert len(sizes) <= 2


def test_filling_is_the_last_entry_or_a_number() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(padded(values, 4), [[1, 2], [3, 4], [3, 4], [3, 4]])
    np.testing.assert_array_equal(padded(values, 3, np.inf), [[1, 2], [3, 4], [np.inf, np.inf]])
    np.testing.assert_array_equal(padded(values, 3, 0.0, axis=1), [[1, 2, 0], [3, 4, 0]])
    with pytest.raises(ValueError):
        padded(values, 1)
