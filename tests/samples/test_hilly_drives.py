"""Drives over made-up hills: exact truth, errors of the size that they are drawn with."""

import numpy as np
import pytest

from altijax.samples.hilly_drives import DURATION, RATE, errors_and_bars, hilly_drive, lasting


@pytest.mark.parametrize("car", ["presumed", "strange"])
def test_a_seed_is_a_drive(car: str) -> None:
    first, again, other = (hilly_drive(seed, car) for seed in (0, 0, 1))
    assert first.imu.equals(again.imu) and not first.imu.equals(other.imu)
    assert len(first.imu) == len(first.wheel) == DURATION * RATE
    assert first.reference["alt"].iloc[0] == pytest.approx(100.0)


def test_the_wheels_turn_as_fast_as_heights_and_distances_allow() -> None:
    """The car rests where its wheels do, and climbs nowhere more than it drives."""
    recording = hilly_drive(0)
    heights = recording.reference["alt"]
    way = np.cumsum(recording.wheel["speed"]) / RATE
    resting = recording.wheel["speed"].loc[heights.index].abs() < 0.1
    climbed = heights.diff().abs()
    assert climbed[resting & resting.shift(fill_value=True)].max() < 0.01
    assert (climbed.iloc[1:] <= 0.2 * way.loc[heights.index].diff().iloc[1:] + 0.02).all()


@pytest.mark.slow
def test_where_heights_are_known_no_error_is_counted() -> None:
    recording = hilly_drive(0)
    counts = {known: errors_and_bars(recording, known)[0].size for known in ("none", "ends", "first third")}
    assert counts["first third"] < counts["none"] == counts["ends"]


def test_a_series_lasts_as_long_as_it_says() -> None:
    """Of unit variance, and correlated by 1/e over its length."""
    series = lasting(np.random.default_rng(0), 200_000, 20.0)
    # three standard deviations of a mean over 200,000 / 20 / 2 independent stretches
    assert np.mean(series**2) == pytest.approx(1.0, abs=0.06)
    assert np.mean(series[20:] * series[:-20]) == pytest.approx(np.exp(-1), abs=0.06)
