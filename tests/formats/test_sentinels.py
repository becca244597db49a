"""Numbers that stand for none, and what cannot be measured."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.sentinels import without_impossible_values, without_sentinels


def table(**columns):
    n = len(next(iter(columns.values())))
    frame = pd.DataFrame({"t": np.arange(n, dtype=float)} | columns)
    frame.index = pd.RangeIndex(2, 2 + n, name="line")
    frame.attrs["file"] = "a.csv"
    return frame


def some(values, value):
    values = np.asarray(values, float).copy()
    values[10:13] = value
    return values


WAVE = 3 + np.sin(np.arange(100.0))


@pytest.mark.parametrize(
    "value", [65535.0, 655.35, 32767.0, -32768.0, -327.68, 2.0**31 - 1, 4294967.295, -999.0, 9999.0, 1e30, -1e300]
)
@pytest.mark.parametrize(("stream", "column"), [("imu", "ax"), ("wheel", "speed"), ("gnss", "v_e"), ("gnss", "alt")])
def test_full_counters_nines_and_huge_numbers_are_left_out_with_line_and_column(stream, column, value):
    problems: list[str] = []
    rest = without_sentinels(table(**{column: some(WAVE, value)}), stream, problems)
    assert np.nanmax(np.abs(rest[column])) < 5 and rest[column].notna().sum() == 97
    assert (
        len(problems) == 1 and f"a.csv, line 12, column {column}" in problems[0] and "3 of 100, left out" in problems[0]
    )


@pytest.mark.parametrize(
    ("stream", "column"), [("gnss", "speed"), ("gnss", "course"), ("gnss", "sd_e"), ("wheel", "speed")]
)
def test_minus_one_is_not_known_where_it_cannot_be(stream, column):
    problems: list[str] = []
    rest = without_sentinels(table(**{column: some(WAVE, -1)}), stream, problems)
    assert rest[column].min() > 0 and len(problems) == 1


def test_true_values_are_kept():
    problems: list[str] = []
    backwards = table(speed=np.sin(np.arange(100.0)))
    counts = table(ax=np.linspace(-32768, 32767, 100))
    west = table(course=np.linspace(-180, 180, 100), lat=np.linspace(-1, 1, 100))
    west.loc[51, ["course", "lat"]] = [-1, 0.0]
    for stream, good in (("wheel", backwards), ("imu", counts), ("gnss", west)):
        pd.testing.assert_frame_equal(without_sentinels(good, stream, problems), good)
    assert problems == []


def test_what_no_sensor_measures_is_left_out_unless_it_is_the_unit():
    problems: list[str] = []
    hit = table(ax=some(WAVE, 3.0))
    hit.loc[20, "ax"] = 330.0
    assert len(without_impossible_values(hit, "imu", problems)) == 99 and "line 20, column ax" in problems[0]
    assert len(without_impossible_values(table(ax=1000 * WAVE), "imu", problems)) == 100
