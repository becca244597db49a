"""What is compared with what, by the streams that are there."""

import numpy as np
import pandas as pd
import pytest

from altijax.agreement.pairs import STEP, horizontal_axes, pairs
from tests.agreement.drives import streams


def names(given):
    return [(pair.name, pair.second) for pair in pairs(given)]


def test_pairs_follow_from_the_streams():
    good = streams()
    assert len(names(good)) == 7
    assert names(good | {"gnss": None}) == [
        ("force and change of speed", "wheel"),
        ("turning and force to the side", "imu"),
    ]
    assert names(good | {"imu": None})[0] == ("speeds", "gnss")
    assert names({"imu": good["imu"], "wheel": None, "gnss": None}) == []
    without_gyro = good | {"imu": good["imu"][["ax", "ay", "az"]]}
    assert ("turning and course", "gnss") not in names(without_gyro)


def test_series_share_a_grid_and_say_nothing_in_gaps():
    good = streams()
    gnss = good["gnss"]
    gappy = gnss[(gnss.index < 50) | (gnss.index > 60)]
    for pair in pairs(good | {"gnss": gappy}):
        assert pair.others.shape[-1] == pair.series.size
        if pair.second == "gnss":
            assert np.isnan(pair.series[round(52 / STEP) : round(58 / STEP)]).all()
            assert np.isfinite(pair.series).mean() > 0.6


def test_gravity_gives_the_horizontal_axes_unless_the_sensor_is_turned_about():
    level = horizontal_axes(streams()["imu"])
    np.testing.assert_allclose(level @ level.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(level) == pytest.approx(1) and level[2, 2] > 0.98 and level[0, 0] > 0.98
    t = np.arange(0, 20, 0.01)
    turning = pd.DataFrame({"ax": 9.8 * np.cos(t), "ay": 9.8 * np.sin(t), "az": 0 * t}, index=t)
    assert horizontal_axes(turning) is None
