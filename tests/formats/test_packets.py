"""Rows of one stamp: packets are spread, fixes averaged, repeated rows dropped."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.packets import without_shared_stamps


def table(t, **columns):
    frame = pd.DataFrame({"t": np.asarray(t, float)} | columns)
    frame.index = pd.RangeIndex(2, 2 + len(frame), name="line")
    frame.attrs["file"] = "a.csv"
    return frame


@pytest.mark.parametrize("size", [2, 5, 20])
@pytest.mark.parametrize("apart", [0.0, 1e-5])
def test_packets_are_spread_over_the_time_before(size, apart):
    k = np.arange(600)
    t = (k // size + 1) * size * 0.01 + apart * (k % size)
    problems: list[str] = []
    spread = without_shared_stamps(table(t, ax=k.astype(float)), "imu", problems)
    np.testing.assert_allclose(spread["t"], (k + 1) * 0.01, atol=2 * size * apart + 1e-12)
    assert len(problems) == 1 and "100 Hz" in problems[0] and f"{size} rows come at once" in problems[0]


def test_jitter_and_gaps_are_no_packets():
    t = np.cumsum(np.random.default_rng(0).uniform(0.002, 0.03, 500))
    t[250:] += 5
    problems: list[str] = []
    assert without_shared_stamps(table(t, ax=t), "imu", problems)["t"].to_list() == t.tolist() and problems == []


def test_fixes_of_one_instant_are_averaged_by_their_accuracies():
    fixes = table([0.0, 1, 1, 2], v_e=[1.0, 2, 5, 3], sd_e=[1.0, 1, 2, 1], lat=[45.0, 46, np.nan, 47])
    problems: list[str] = []
    averaged = without_shared_stamps(fixes, "gnss", problems)
    assert averaged["v_e"].to_list() == pytest.approx([1, (2 + 5 / 4) / 1.25, 3])
    assert averaged["sd_e"].to_list() == pytest.approx([1, 0.8**0.5, 1]) and averaged["lat"].to_list() == [45, 46, 47]
    assert "averaged by their accuracies" in problems[0]


def test_a_course_is_averaged_through_north_and_repeats_are_dropped():
    fixes = table([0.0, 0, 1, 1], speed=[3.0, 3, 4, 4], course=[350.0, 20, 90, 90])
    problems: list[str] = []
    assert without_shared_stamps(fixes, "gnss", problems)["course"].to_list() == pytest.approx([5, 90])
    assert len(problems) == 2 and "repeats the row before" in problems[0]
