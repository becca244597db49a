"""Stretches that stand still or were filled in, limits, dead axes and wheels."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.stream_checks import RecordingError
from altijax.formats.stuck import (
    check_ranges,
    without_dead_wheels,
    without_filled_stretches,
    without_frozen_fixes,
    without_frozen_speeds,
)


def table(t, **columns):
    frame = pd.DataFrame({"t": t} | columns)
    frame.index = pd.RangeIndex(2, 2 + len(frame), name="line")
    frame.attrs["file"] = "a.csv"
    return frame


def live_imu():
    t = np.arange(0, 20, 0.02)
    values = np.random.default_rng(0).normal(scale=0.1, size=(t.size, 6)) + np.array([0, 0, 9.8, 0, 0, 0])
    return table(t, **dict(zip(("ax", "ay", "az", "gx", "gy", "gz"), values.T, strict=True)))


@pytest.mark.parametrize("fill", [lambda a, b, n: np.full(n, a), np.linspace])
def test_frozen_and_interpolated_rows_are_left_out(fill):
    imu = live_imu()
    for column in ("ax", "ay", "az"):
        imu.loc[202:261, column] = fill(imu[column][202], imu[column][261], 60)
    problems: list[str] = []
    assert 935 <= len(without_filled_stretches(imu, problems)) <= 943 and "line 20" in problems[0]


def test_a_simulated_sensor_without_noise_and_a_living_one_are_kept():
    problems: list[str] = []
    t = np.arange(0, 20, 0.02)
    smooth = table(t, ax=np.sin(t / 5), ay=0 * t, az=9.8 + 0 * t)
    for imu in (smooth, live_imu()):
        assert without_filled_stretches(imu, problems) is not None and len(
            without_filled_stretches(imu, problems)
        ) == len(imu)
    assert problems == []


def fixes(speed):
    t = np.arange(0, 60, 0.5)
    return table(t, v_e=speed * np.cos(t / 9), v_n=speed * np.sin(t / 9), lat=45 + 1e-5 * t, lon=7 + 1e-5 * t)


def test_fixes_that_repeat_while_it_moves_are_left_out_and_those_at_rest_kept():
    problems: list[str] = []
    for speed, kept in ((10.0, 101), (0.0, 120)):
        gnss = fixes(speed)
        gnss.loc[42:61, ["v_e", "v_n", "lat", "lon"]] = gnss.loc[42, ["v_e", "v_n", "lat", "lon"]].to_numpy()
        assert len(without_frozen_fixes(gnss, problems)) == kept
    assert len(problems) == 1 and "repeats to the last digit for" in problems[0]


def test_zeros_in_the_middle_of_a_drive_are_no_stop():
    gnss = fixes(12.0)
    gnss.loc[42:61, ["v_e", "v_n"]] = 0.0
    gnss.loc[42:61, ["lat", "lon"]] = gnss.loc[42, ["lat", "lon"]].to_numpy()
    assert len(without_frozen_fixes(gnss, [])) == 100


def test_a_log_faster_than_its_receiver_keeps_each_fix_once():
    gnss = fixes(10.0)
    held = gnss.loc[gnss.index.repeat(4)].assign(t=np.arange(480) / 8)
    held.attrs = gnss.attrs
    assert len(without_frozen_fixes(held, [])) == 120


def test_a_wheel_that_hangs_is_left_out_and_whole_numbers_are_not():
    t = np.arange(0, 60, 0.05)
    speed = 10 + np.sin(t / 3)
    hanging = np.where((t > 20) & (t < 30), speed[400], speed)
    assert len(without_frozen_speeds(table(t, speed=hanging), [])) == pytest.approx(1000, abs=3)
    assert len(without_frozen_speeds(table(t, speed=np.round(speed / 2) * 2), [])) == 1200


def test_limits_dead_axes_and_odd_units_are_told():
    assert list(check_ranges(live_imu())) == []
    clipped = live_imu()
    clipped["gz"] = (3 * clipped["gz"]).clip(upper=0.35)
    assert "range ends" in next(check_ranges(clipped)) and "column gz" in next(check_ranges(clipped))
    dead, odd = live_imu().assign(gz=0.0), live_imu()
    assert "column gz: 0 in every row" in next(check_ranges(dead))
    odd["gx"] *= 57.3
    assert "column gx" in next(check_ranges(odd)) and "another unit" in next(check_ranges(odd))


def test_a_dead_wheel_is_left_out_and_wheels_in_two_units_refused():
    t = np.arange(0, 10, 0.1)
    problems: list[str] = []
    rest = without_dead_wheels(table(t, left=0 * t, right=10 + t), ["left", "right"], problems)
    assert list(rest.columns) == ["t", "right"] and "column left: stands" in problems[0]
    with pytest.raises(RecordingError, match=r"columns left, right: the first is 3.6 times"):
        without_dead_wheels(table(t, left=36 + t, right=10 + t / 3.6), ["left", "right"], problems)
    assert len(without_dead_wheels(table(t, left=10 + t, right=10.2 + t), ["left", "right"], problems).columns) == 3
