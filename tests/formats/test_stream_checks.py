"""Axes codes and the checks of single streams, on tables made by hand."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.stream_checks import (
    RecordingError,
    axes_to_matrix,
    check_accelerometer_unit,
    check_gravity,
    check_gyro_unit,
    check_overlap,
    check_time_unit,
    check_turns,
    check_wheel_unit,
    clean_rows,
)


def table(t, file="imu.csv", line="line", **columns) -> pd.DataFrame:
    frame = pd.DataFrame({"t": t} | columns)
    frame.index = pd.RangeIndex(2, 2 + len(frame), name=line)
    frame.attrs["file"] = file
    return frame


@pytest.mark.parametrize(
    ("code", "sensor", "body"),
    [
        ("FLU", [1, 2, 3], [1, 2, 3]),
        ("FRD", [1, 2, 3], [1, -2, -3]),
        ("BRU", [1, 2, 3], [-1, -2, 3]),
        ("LBU", [1, 2, 3], [-2, 1, 3]),
        ("UFL", [1, 2, 3], [2, 3, 1]),
    ],
)
def test_axes_codes_turn_sensor_vectors_into_body_vectors(code, sensor, body):
    C = axes_to_matrix(code)
    np.testing.assert_array_equal(C @ sensor, body)
    np.testing.assert_array_equal(C @ C.T, np.eye(3))
    assert np.linalg.det(C) == 1


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("FRU", r"axes 'FRU' is left-handed; right-handed and near it: FLU, FRD, BRU"),
        ("FL", r"axes 'FL' needs three letters out of F/B, L/R, U/D; right-handed and near it: FLU"),
        ("flu", r"axes 'flu' needs three letters"),
        ("XYZ", r"axes 'XYZ' needs three letters"),
        ("FBU", r"axes 'FBU' needs one letter of each pair.*: FLU"),
        ("FFU", r"axes 'FFU' needs one letter of each pair.*: FLU, RFU"),
    ],
)
def test_bad_axes_codes_are_explained(code, message):
    with pytest.raises(ValueError, match=message):
        axes_to_matrix(code)


def test_every_suggested_code_is_right_handed():
    for code in ("FRU", "BLU", "DDD", "ABC", ""):
        with pytest.raises(ValueError) as error:
            axes_to_matrix(code)
        for near in str(error.value).split("near it: ")[1].split(", "):
            assert np.linalg.det(axes_to_matrix(near)) == 1


def test_clean_rows_drops_what_has_no_value_and_says_so_once_a_column():
    problems: list[str] = []
    dirty = table([0.0, 1, 2, 3, 3, 4], ax=[1, np.nan, 3, 4, 5, 6], temperature=[20, 20, np.inf, 20, 20, 20])
    clean = clean_rows(dirty, {"t", "ax"}, problems)
    assert clean["t"].to_list() == [0, 2, 3, 4] and clean["ax"].to_list() == [1, 3, 4, 6]
    assert clean["temperature"].isna().to_list() == [False, True, False, False]
    assert problems == [
        "imu.csv, line 3, column ax: nan is not a number; rows like it: 1 of 6, dropped",
        "imu.csv, line 4, column temperature: inf is not a number; rows like it: 1 of 6, kept as missing",
        "imu.csv, line 6, column t: 3.000000 repeats the time of the row before; rows like it: 1 of 5, dropped",
    ]


def test_clean_rows_keeps_good_rows_and_empty_optional_columns_silently():
    problems: list[str] = []
    good = table([0.0, 0.5, 7], ax=[1.0, 2, 3], temperature=np.nan)
    pd.testing.assert_frame_equal(clean_rows(good, {"t", "ax"}, problems), good)
    assert problems == []


def test_time_running_backwards_counts_every_time():
    with pytest.raises(RecordingError, match=r"gnss.csv, row 4, column t: .* from 2.0* to 1.0* \(2 times in all\)"):
        clean_rows(table([0.0, 1, 2, 1, 0.5, 3], file="gnss.csv", line="row").rename(lambda k: k - 1), {"t"}, [])


@pytest.mark.parametrize(("interval", "unit"), [(10, "ms"), (1e4, "us"), (1e7, "ns"), (1000, "ms")])
def test_time_units_are_guessed_from_the_interval(interval, unit):
    t = interval * np.arange(7.0)
    with pytest.raises(RecordingError, match=rf"'time': '{unit}'"):
        check_time_unit(table(t), 1.0)
    check_time_unit(table(t / interval), 1.0)


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


def test_wheel_and_gnss_that_agree_to_five_percent_pass():
    t = np.arange(0, 60, 0.1)
    gnss = indexed(t, "gnss.csv", v_e=0 * t + 12, v_n=0 * t + 5)
    check_wheel_unit(indexed(t, "wheel.csv", speed=0 * t + 13.6), gnss)
    with pytest.raises(RecordingError, match=r"wheel.csv looks like km/h"):
        check_wheel_unit(indexed(t, "wheel.csv", speed=0 * t + 13.6 * 3.6), gnss)
    # Nothing can be said where nothing moves.
    check_wheel_unit(indexed(t, "wheel.csv", speed=0 * t + 3.6), gnss * 0.05)


def test_turns_say_nothing_on_a_straight_road_or_at_rest():
    t = np.arange(0, 60, 0.02)
    gz = np.random.default_rng(2).normal(size=t.size)
    t_gnss = np.arange(0, 60, 1.0)
    straight = indexed(t_gnss, "gnss.csv", v_e=10 + 0 * t_gnss, v_n=0.1 * np.sin(t_gnss))
    resting = indexed(t_gnss, "gnss.csv", v_e=np.sin(t_gnss), v_n=np.cos(t_gnss))
    for gnss in (straight, resting):
        assert list(check_turns(indexed(t, "imu.csv", gz=60 * gz), gnss, False)) == []


def test_signs_of_ios_are_named_where_gravity_points_the_other_way():
    imu = pd.DataFrame({"ax": 0.1, "ay": 0.2, "az": [-9.8] * 5})
    imu.attrs["file"] = "imu.csv"
    (said,) = check_gravity(imu, "FLU")
    assert "axes='FRD' would put it there" in said and "units={'accelerometer': '-m/s^2'}" in said
    (sideways,) = check_gravity(imu.rename(columns={"ax": "az", "az": "ax"}), "FLU")
    assert "iPhone" not in sideways
