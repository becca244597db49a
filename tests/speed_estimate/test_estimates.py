"""Speed of recordings: what comes out, that nothing after the aid's end is used, and what a real drive makes of it."""

from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.datasets import load_dataset
from altijax.programs import count_programs
from altijax.recordings import Recording, RecordingWarning
from altijax.speed_estimate.estimates import NOMINAL_NOISE, SPEED_METHODS, estimate_speed, fit_noise, run_filter
from altijax.speed_estimate.steps import drive_in_steps, initial_state
from tests.made_drives import curvy_recording

COLUMNS = ["speed", "speed_std", "pitch", "roll", "valid"]


@pytest.fixture(scope="module")
def drive() -> Recording:
    return curvy_recording()


@pytest.mark.parametrize("method", SPEED_METHODS)
def test_one_finite_row_a_sample(drive: Recording, method: str) -> None:
    estimate = estimate_speed(drive, method=method, aid_until=20.0)
    assert list(estimate.columns) == COLUMNS
    assert estimate.index.equals(drive.imu.index)
    assert np.isfinite(estimate[COLUMNS[:4]].to_numpy()).all() and estimate["valid"].dtype == bool
    truth = 10 + 3 * np.sin(0.25 * (estimate.index - 5))
    assert (estimate["speed"] - truth).loc[12.0:20.0].abs().max() < 0.15
    assert estimate["speed_std"].loc[21.0:].min() > estimate["speed_std"].loc[19.0:20.0].max()


@pytest.mark.parametrize("method", SPEED_METHODS)
def test_the_aid_after_its_end_and_the_reference_are_never_used(drive: Recording, method: str) -> None:
    """The leak test: garbage in their place changes nothing."""
    wheel = drive.wheel.copy()
    wheel.loc[wheel.index > 20.0, "speed"] = np.random.default_rng(2).uniform(0, 90, (wheel.index > 20.0).sum())
    reference = pd.DataFrame({"v_e": [77.0, -3.0], "v_n": [0.0, 50.0]}, index=pd.Index([5.0, 40.0], name="t"))
    spoiled = replace(drive, wheel=wheel, reference=reference)
    cut = replace(drive, wheel=drive.wheel[:20.0])
    estimate = estimate_speed(drive, method=method, aid_until=20.0)
    pd.testing.assert_frame_equal(estimate_speed(spoiled, method=method, aid_until=20.0), estimate, check_exact=True)
    pd.testing.assert_frame_equal(estimate_speed(cut, method=method, aid_until=20.0), estimate, check_exact=True)


def test_without_an_end_the_aid_serves_for_the_first_second(drive: Recording) -> None:
    cut = replace(drive, wheel=drive.wheel[:6.0])
    pd.testing.assert_frame_equal(estimate_speed(drive), estimate_speed(cut, aid_until=6.0), check_exact=True)


def test_initial_values_replace_the_aid(drive: Recording) -> None:
    alone = replace(drive, wheel=None)
    with pytest.raises(ValueError, match="give initial_speed"):
        estimate_speed(alone)
    estimate = estimate_speed(alone, initial_speed=10.0, initial_pitch=0.0)
    assert estimate["speed"].iloc[0] == pytest.approx(10.0, abs=0.5)
    assert abs(estimate["pitch"].iloc[0]) < 0.05


@pytest.mark.parametrize("method", ["conventional", "roll"])
def test_without_aid_the_initial_values_are_begun_from_exactly(method: str) -> None:
    """Error-free sensors, ten rad of turning on a level road: the first second must not move the state."""
    t = np.arange(0, 60, 0.01)
    speed, rate = 12 + 4 * np.sin(0.3 * t), 0.26 * np.sin(0.5 * t)
    readings = {"ax": 1.2 * np.cos(0.3 * t), "ay": speed * rate, "az": 9.80665, "gx": 0.0, "gy": 0.0, "gz": rate}
    exact = Recording(name="exact", imu=pd.DataFrame(readings, index=pd.Index(t + 3.0, name="t")))
    assert np.abs(rate).sum() * 0.01 > 9.5
    estimate = estimate_speed(exact, method=method, initial_speed=12.0, initial_pitch=0.0)
    assert np.abs(estimate["speed"] - speed).max() < 0.05
    assert estimate["speed_std"].iloc[0] == pytest.approx(1.0) and estimate["speed_std"].is_monotonic_increasing


def test_noise_levels_are_those_of_the_drive(drive: Recording) -> None:
    with jax.enable_x64(True):
        steps = drive_in_steps(drive, None, 20.0)
        found = fit_noise(steps, 39.0, "2+3", initial_state(steps, 40.0, None, None), NOMINAL_NOISE)
    # two readings of 0.02 m/s in each step
    assert found["aid"] == pytest.approx(0.014, rel=0.4)
    assert found["acceleration"] < 0.5 * NOMINAL_NOISE["acceleration"]


@pytest.mark.parametrize("method", SPEED_METHODS)
def test_recordings_of_other_lengths_share_programs(drive: Recording, method: str) -> None:
    estimate_speed(drive, method=method, aid_until=26.0)
    shorter = replace(drive, imu=drive.imu[:38.0])
    with count_programs() as programs:
        estimate_speed(shorter, method=method, aid_until=27.0)
    assert programs.names == []


def test_what_a_run_shares_with_one_before_is_the_same(drive: Recording) -> None:
    with jax.enable_x64(True):
        steps = drive_in_steps(drive, None, 40.0)
        initial = initial_state(steps, 40.0, None, None)
        before = run_filter(steps, 25.0, "2+3", initial, NOMINAL_NOISE, 30.0)
        shared = run_filter(steps, 35.0, "2+3", initial, NOMINAL_NOISE, before=before)
        alone = run_filter(steps, 35.0, "2+3", initial, NOMINAL_NOISE)
    assert shared.parts[0] is before.parts[0] and shared.parts[1] is not before.parts[1]
    for name, values in alone.track()[1].items():
        np.testing.assert_array_equal(shared.track()[1][name], values)
    np.testing.assert_array_equal(shared.last.covariance, alone.last.covariance)


def test_wrong_options_are_named(drive: Recording) -> None:
    with pytest.raises(ValueError, match="method must be one of conventional"):
        estimate_speed(drive, method="magic")
    with pytest.raises(ValueError, match="sensors must be one of auto"):
        estimate_speed(drive, sensors="3+3")
    with pytest.raises(ValueError, match="has no gyro"):
        estimate_speed(replace(drive, imu=drive.imu[["ax", "ay", "az"]]))
    with pytest.raises(ValueError, match="has no IMU"):
        estimate_speed(replace(drive, imu=None))


def test_the_highway_is_bridged_for_forty_seconds(data_dir: Path) -> None:
    with pytest.warns(RecordingWarning, match="magnetometer_uncalibrated"):
        recording = load_dataset("comma2k19-example")
    for method in ("conventional", "roll", "filter"):
        estimate = estimate_speed(recording, method=method, aid_until=20.0)
        assert abs(estimate["speed"].iloc[-1] - recording.wheel["speed"].iloc[-1]) < 2.0, method
