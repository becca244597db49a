"""Axes codes and the checks of single streams, on tables made by hand."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.stream_checks import (
    RecordingError,
    check_accelerometer_unit,
    check_gyro_unit,
    check_overlap,
    clean_rows,
)


def table(t, file="imu.csv", line="line", **columns) -> pd.DataFrame:
    frame = pd.DataFrame({"t": t} | columns)
    frame.index = pd.RangeIndex(2, 2 + len(frame), name=line)
    frame.attrs["file"] = file
    return frame


def test_clean_rows_drops_what_has_no_value_and_says_so_once_a_column():
    problems: list[str] = []
    dirty = table([0.0, 1, 2, 3, 3, 4], ax=[1, np.nan, 3, 4, 5, 6], temperature=[20, 20, np.inf, 20, 20, 20])
    clean = clean_rows(dirty, {"t", "ax"}, problems)
    assert clean["t"].to_list() == [0, 2, 3, 3, 4] and clean["ax"].to_list() == [1, 3, 4, 5, 6]
    assert clean["temperature"].isna().to_list() == [False, True, False, False, False]
    assert problems == [
        "imu.csv, line 3, column ax: nan is not a number; rows like it: 1 of 6, dropped",
        "imu.csv, line 4, column temperature: inf is not a number; rows like it: 1 of 6, kept as missing",
    ]


def test_clean_rows_keeps_good_rows_and_empty_optional_columns_silently():
    problems: list[str] = []
    good = table([0.0, 0.5, 7], ax=[1.0, 2, 3], temperature=np.nan)
    pd.testing.assert_frame_equal(clean_rows(good, {"t", "ax"}, problems), good)
    assert problems == []


def test_plausible_sizes_pass():
    n = 2000
    rng = np.random.default_rng(1)
    calm = table(np.arange(n) * 0.01, **{name: rng.normal(scale=3, size=n) for name in ("ax", "ay", "gx", "gy", "gz")})
    calm["az"] = 9.8
    calm[["gx", "gy", "gz"]] /= 3
    assert list(check_accelerometer_unit(calm)) == []
    check_gyro_unit(calm)
    # A second of fast rotation is not a unit.
    calm.loc[calm.index[:1], "gx"] = 100.0
    check_gyro_unit(calm)


def indexed(t, file, **columns):
    return table(t, file, **columns).set_index("t").rename_axis("t")


def test_overlap_names_both_intervals():
    imu, wheel = indexed([0.0, 10], "imu.csv"), indexed([10.5, 20], "wheel.csv")
    message = list(check_overlap(wheel, imu))
    assert len(message) == 1 and "10.500 to 20.000" in message[0] and "0.000 to 10.000" in message[0]
    assert list(check_overlap(indexed([10.0, 20], "wheel.csv"), imu)) == []


@pytest.mark.parametrize(
    ("factor", "named"),
    [
        (1 / 9.80665, "'g'"),
        (1005 / 9.80665, "'mg'"),
        (100, "'gal'"),
        (16384 / 9.80665, "divide ax, ay, az by 16384"),
        (4080 / 9.80665, "divide ax, ay, az by 4096"),
    ],
)
def test_units_of_an_accelerometer_are_told_apart(factor, named):
    t = np.arange(0, 20, 0.01)
    force = np.random.default_rng(0).normal(scale=0.3, size=(t.size, 3)) + np.array([0, 0, 9.80665])
    read = table(t, **dict(zip(("ax", "ay", "az"), factor * force.T, strict=True)))
    with pytest.raises(RecordingError, match=named):
        list(check_accelerometer_unit(read))


@pytest.mark.parametrize(
    ("change", "named"), [(lambda f: 2 * f, "2 g"), (lambda f: f - [0, 0, 9.8], "gravity was taken out")]
)
def test_two_g_at_rest_and_gravity_removed_are_named(change, named):
    t = np.arange(0, 20, 0.01)
    force = change(np.random.default_rng(0).normal(scale=1.0, size=(t.size, 3)) + np.array([0, 0, 9.80665]))
    told = list(check_accelerometer_unit(table(t, **dict(zip(("ax", "ay", "az"), force.T, strict=True)))))
    assert len(told) == 1 and named in told[0]


def test_a_sensor_that_is_truly_turned_fast_is_not_in_degrees():
    t = np.arange(0, 60, 0.01)
    angle = 4 * t + 3 * np.sin(t / 3)
    imu = table(t, ax=9.8 * np.sin(angle), ay=0 * t, az=9.8 * np.cos(angle), gx=0 * t, gy=-4 - np.cos(t / 3), gz=0 * t)
    check_gyro_unit(imu)
    with pytest.raises(RecordingError, match="gravity does not turn so"):
        check_gyro_unit(imu.assign(ax=0.0, az=9.8 + 0.1 * np.sin(t), gy=4 * np.sin(3 * t) + 3))
