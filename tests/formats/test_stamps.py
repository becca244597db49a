"""Counters that start again, packed times, wild stamps, restarts, and units of time."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.stamps import UnusableStreamError, check_time_unit, mended_clocks, steady
from altijax.formats.stream_checks import RecordingError

SCALES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def table(t, file="imu.csv"):
    frame = pd.DataFrame({"t": np.asarray(t, float), "ax": np.arange(len(t), dtype=float)})
    frame.index = pd.RangeIndex(2, 2 + len(frame), name="line")
    frame.attrs["file"] = file
    return frame


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("unit", SCALES)
@pytest.mark.parametrize("form", ["counts", "seconds", "signed"])
def test_a_counter_goes_on_where_it_starts_again(bits, unit, form):
    # Steps of a tenth of a short period, and of 10 ms where it is long.
    period = 2**bits
    step = max(min(period // 10, int(0.01 * SCALES[unit])), 1)
    counts = np.mod(period - 700 * step + step * np.arange(1000, dtype=np.int64), period)
    if form == "signed":
        counts = np.mod(counts + period // 2 - 300 * step, period) - period // 2
    t = counts / SCALES[unit] if form == "seconds" else counts.astype(float)
    if not (np.diff(t) < 0).any():
        pytest.skip("does not turn here")
    problems: list[str] = []
    mended = mended_clocks({"imu": table(t)}, problems)["imu"]["t"].to_numpy()
    expected = step / (SCALES[unit] if form == "seconds" else 1.0)
    np.testing.assert_allclose(np.diff(mended), expected, rtol=1e-3)
    assert len(problems) == 1 and "that starts again" in problems[0] and "imu.csv, line" in problems[0]


def test_a_stream_that_begins_after_the_turn_is_put_on_the_same_count():
    t = np.arange(0, 120, 0.01)
    problems: list[str] = []
    period = 2**32 / 1e6
    tables = {"imu": table(np.mod(t + period - 60, period)), "wheel": table(np.arange(0, 50, 0.1), "wheel.csv")}
    mended = mended_clocks(tables, problems)
    assert mended["wheel"]["t"].iloc[0] == pytest.approx(period) and len(problems) == 1


@pytest.mark.parametrize("start", [45290.0, 3570.0, 86370.0])
@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_packed_clock_times_are_unpacked_over_minutes_hours_and_midnight(start, scale):
    t = np.mod(np.round(start + np.arange(0, 150, 0.1), 3), 86400)
    packed = np.floor(t / 3600) * 10000 + np.floor(t / 60) % 60 * 100 + np.round(t % 60, 3)
    problems: list[str] = []
    mended = mended_clocks({"imu": table(packed * scale), "gnss": table(packed[:50] * scale, "gnss.csv")}, problems)
    np.testing.assert_allclose(np.diff(mended["imu"]["t"]), 0.1 * scale, rtol=1e-5)
    assert mended["gnss"]["t"].iloc[0] == mended["imu"]["t"].iloc[0]
    assert "packed as HHMMSS" in problems[0] and "gnss.csv" in problems[0]


@pytest.mark.parametrize(("row", "value"), [(0, 0.0), (-1, 1.7e9 + 1e6), (500, 0.0), (500, 1e12)])
def test_a_wild_stamp_is_left_out_and_named(row, value):
    t = 1.7e9 + np.arange(0, 10, 0.01)
    t[row] = value
    problems: list[str] = []
    kept = steady(table(t), problems)
    assert len(kept) == 999 and np.ptp(kept["t"]) < 10 and len(problems) == 1
    assert f"line {range(2, 1002)[row]}, column t" in problems[0] and "left out" in problems[0]


def test_pauses_are_kept():
    t = np.concatenate([np.arange(0, 60, 0.01), np.arange(300, 360, 0.01)])
    problems: list[str] = []
    assert len(steady(table(t), problems)) == t.size and problems == []


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda t: np.where(t >= 30, t - 30, t), "starts again, as after a restart"),
        (lambda t: np.where(t >= 30, t - 1.0, t), "was set back by about 0.99"),
        (lambda t: t[::-1], "sort the rows"),
    ],
)
def test_clocks_that_fall_are_named_as_what_they_are(change, named):
    with pytest.raises(UnusableStreamError, match=named):
        steady(table(change(np.arange(0, 60, 0.01))), [])


@pytest.mark.parametrize(
    ("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("min", 1 / 60), ("h", 1 / 3600), ("d", 1 / 86400)]
)
def test_the_unit_of_time_is_named_for_all_files_or_one(unit, factor):
    wrong, right = table(np.arange(0, 60, 0.01) * factor), table(np.arange(0, 60, 0.2), "gnss.csv")
    with pytest.raises(RecordingError, match=rf"'time': '{unit}'"):
        check_time_unit(wrong, "imu", {"imu": wrong})
    with pytest.raises(RecordingError, match=rf"as if t were in {unit}, in which gnss are not; (divide|multiply)"):
        check_time_unit(wrong, "imu", {"imu": wrong, "gnss": right})
    check_time_unit(right, "gnss", {"gnss": right})
