"""Planted constants are found; on the real drives, what is fitted early serves later."""

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from altijax import estimates
from altijax.programs import count_programs
from altijax.recordings import Recording, RecordingWarning, read_recording
from tests.exact import EXACT, exact_drive


def biased(recording: Recording, scale: float = 1.0, **bias: float) -> Recording:
    """The recording by an IMU with true = measured / scale - bias."""
    imu = recording.imu.copy()
    imu[["ax", "ay", "az"]] *= scale
    for axis, value in bias.items():
        imu[axis] += scale * value
    return dataclasses.replace(recording, imu=imu)


def test_calibration_does_not_look_beyond_until() -> None:
    later = EXACT.reference.copy()
    later.loc[later.index > 30.0, "alt"] += np.arange((later.index > 30.0).sum())
    first = estimates.calibrate(EXACT, "accelerometer_bias_x", method="slope", until=30.0)
    second = estimates.calibrate(
        dataclasses.replace(EXACT, reference=later), "accelerometer_bias_x", method="slope", until=30.0
    )
    pd.testing.assert_series_equal(first.values, second.values)
    pd.testing.assert_series_equal(first.std, second.std)
    assert first.held_out["until"].item() == 30.0
    assert second.held_out["held_out"].item() > 1


@pytest.mark.parametrize(
    ("method", "planted", "recording"),
    [
        ("slope", {"accelerometer_bias_x": 0.3}, biased(EXACT, ax=0.3)),
        ("slope", {"accelerometer_bias_x": -0.2, "accelerometer_scale_x": 1.02}, biased(EXACT, 1.02, ax=-0.2)),
        ("shirai", {"accelerometer_bias_z": 0.1, "initial_vertical_speed": 0.0}, biased(EXACT, az=0.1)),
        ("shirai", {"accelerometer_scale": 1.01}, biased(EXACT, 1.01)),
    ],
)
def test_planted_constants_are_found(method: str, planted: dict[str, float], recording: Recording) -> None:
    calibration = estimates.calibrate(recording, list(planted), method=method)
    # Shirai's remainder and the low pass shift the constants of exact data by this much
    for name, value in planted.items():
        assert calibration.values[name] == pytest.approx(value, abs=0.01)
        assert 0 < calibration.std[name] < 0.05
    raw = estimates.score_elevation(estimates.estimate_elevation(recording, method=method), recording)
    better = estimates.score_elevation(
        estimates.estimate_elevation(recording, method=method, calibration=calibration), recording
    )
    assert better["rms"] < 0.2 * raw["rms"]


def test_a_fused_calibration_keeps_what_goes_with_its_constants() -> None:
    """The forward bias takes up g times the mounting pitch, and with that the next estimate holds beyond `until`."""
    recording = biased(EXACT, ax=0.3)
    calibration = estimates.calibrate(recording, "accelerometer_bias_x", method="fused", until=30.0)
    assert calibration.values.item() == pytest.approx(0.3, abs=0.05)
    assert abs(calibration.absorbed["mounting_pitch"].item()) == pytest.approx(9.8, rel=0.1)
    held_out = calibration.held_out.iloc[0]
    assert held_out["held_out"] < 0.3 * held_out["held_out_nominal"]


def test_wheel_scale_and_delay_are_found() -> None:
    late = EXACT.wheel.copy() / 1.02
    late.index = late.index + 0.1
    recording = biased(dataclasses.replace(EXACT, wheel=late), ax=0.1)
    names = ["accelerometer_bias_x", "wheel_scale", "wheel_delay"]
    calibration = estimates.calibrate(recording, names, method="slope")
    np.testing.assert_allclose(calibration.values[names], [0.1, 1.02, 0.1], atol=0.01)


def test_several_recordings_share_their_constants() -> None:
    other = biased(exact_drive(start=1000.0), ax=0.3)
    other = dataclasses.replace(
        other, reference=other.reference.assign(alt=other.reference["alt"] + 200.0), name="later"
    )
    calibration = estimates.calibrate([biased(EXACT, ax=0.3), other], "accelerometer_bias_x", method="slope")
    assert calibration.values["accelerometer_bias_x"] == pytest.approx(0.3, abs=0.005)
    assert list(calibration.held_out.index) == ["exact", "later"]
    assert calibration.held_out["held_out"].isna().all()


def test_initial_vertical_speed() -> None:
    """Given, it goes before the calibration's; found, it is the slope's of the first second."""
    moving = dataclasses.replace(
        EXACT, **{s: getattr(EXACT, s).loc[12.0:] for s in ("imu", "wheel", "gnss", "reference")}
    )
    zero = estimates.estimate_elevation(moving, method="shirai", initial_vertical_speed=0.0)
    climb = estimates.estimate_elevation(moving, method="shirai", initial_vertical_speed=0.5)
    np.testing.assert_allclose(climb["elevation"] - zero["elevation"], 0.5 * (zero.index - 12.0), atol=1e-9)
    found = estimates.estimate_elevation(moving, method="shirai")
    truth = moving.gnss["v_u"].iloc[0]
    # the slope half a second on, times the speed now
    assert found["vertical_speed"].iloc[0] == pytest.approx(truth, abs=0.1)
    calibration = estimates.calibrate(moving, ["accelerometer_bias_z", "initial_vertical_speed"], method="shirai")
    again = estimates.estimate_elevation(moving, method="shirai", calibration=calibration, initial_vertical_speed=0.5)
    assert again["vertical_speed"].iloc[0] == pytest.approx(0.5)


def test_another_constant_another_end_and_another_length_compile_nothing() -> None:
    recording = biased(EXACT, ax=0.3)
    estimates.calibrate(recording, "accelerometer_bias_x", method="slope")
    shorter = dataclasses.replace(recording, imu=recording.imu.loc[:50.0])
    with count_programs() as programs:
        estimates.calibrate(recording, "mounting_pitch", method="slope")
        estimates.calibrate(recording, "accelerometer_bias_x", method="slope", until=40.0)
        estimates.calibrate(shorter, "accelerometer_bias_x", method="slope")
    assert programs.names == []


def test_what_cannot_be_told_apart_is_named() -> None:
    noise = 0.5 * np.random.default_rng(0).normal(size=len(EXACT.reference))
    rough = dataclasses.replace(EXACT, reference=EXACT.reference.assign(alt=EXACT.reference["alt"] + noise))
    names = ["accelerometer_bias_x", "mounting_pitch"]
    with pytest.warns(UserWarning, match="accelerometer_bias_x and mounting_pitch cannot be told apart here"):
        calibration = estimates.calibrate(rough, names, method="slope", until=20.0)
    assert "mounting_pitch can" in calibration.undetermined[0]


def test_what_harms_later_is_said() -> None:
    """Heights that go astray up to `until` only: the constant that fits them is wrong."""
    reference = EXACT.reference.copy()
    early = reference.index <= 30.0
    reference.loc[early, "alt"] += 0.002 * (reference.index[early] - 30.0) ** 2
    astray = dataclasses.replace(EXACT, reference=reference)
    with pytest.warns(UserWarning, match="worse where they were not fitted: elevation of 'exact'"):
        calibration = estimates.calibrate(astray, "accelerometer_bias_x", method="slope", until=30.0)
    assert calibration.held_out["worse"].item()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: estimates.calibrate(EXACT, "accelerometer_bias", method="slope"),
            "names out of wheel_scale, .* got accelerometer_bias",
        ),
        (lambda: estimates.calibrate(EXACT, [], method="slope"), "got none"),
        (lambda: estimates.calibrate([], "wheel_scale", method="slope"), "one recording or more, got none"),
        (
            lambda: estimates.calibrate(EXACT, "accelerometer_bias_z", method="slope"),
            "accelerometer_bias_z: changes nothing in method 'slope'",
        ),
        (lambda: estimates.calibrate(EXACT, "gnss_delay", method="slope"), "gnss_delay: changes nothing"),
        (
            lambda: estimates.calibrate(dataclasses.replace(EXACT, reference=None), "wheel_scale", method="slope"),
            "'exact' has no reference heights",
        ),
        (lambda: estimates.calibrate(EXACT, "wheel_scale", method="slope", until=0.1), "need more reference than"),
        (
            lambda: estimates.calibrate([EXACT, EXACT], "initial_vertical_speed", method="shirai"),
            "belongs to one recording",
        ),
    ],
)
def test_what_cannot_be_done_is_said(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.fixture(scope="module")
def comma(data_dir: Path) -> Recording:
    with pytest.warns(RecordingWarning, match="magnetometer_uncalibrated"):
        return read_recording(data_dir / "comma2k19-example")


@pytest.fixture(scope="module")
def rtk(data_dir: Path) -> Recording:
    return read_recording(data_dir / "rtk-drive")


def rms(recording: Recording, parameters: list[str], method: str, until: float | None) -> float:
    calibration = estimates.calibrate(recording, parameters, method=method, until=until)
    estimate = estimates.estimate_elevation(recording, method=method, calibration=calibration)
    return estimates.score_elevation(estimate, recording)["rms_without_offset"]


def test_comma_minute(comma: Recording) -> None:
    """One constant on the first 20 s, scored on the minute; Shirai's in sample, its gross offset gone."""
    assert rms(comma, ["accelerometer_bias_x"], "slope", 20.0) <= 1.6
    assert rms(comma, ["accelerometer_bias_z", "initial_vertical_speed"], "shirai", None) <= 0.2


def test_rtk_drive(rtk: Recording) -> None:
    """In sample over 32 m of relief, and with the constant from the first 110 s."""
    assert rms(rtk, ["accelerometer_bias_x"], "slope", None) <= 1.0
    assert rms(rtk, ["accelerometer_bias_x"], "slope", rtk.imu.index[0] + 110.0) <= 1.5


@pytest.mark.slow
def test_two_standard_deviations_cover_the_real_drives_out_of_sample(comma: Recording, rtk: Recording) -> None:
    for recording, until in ((comma, 20.0), (rtk, rtk.imu.index[0] + 110.0)):
        for method, names in (
            ("slope", ["accelerometer_bias_x"]),
            ("shirai", ["accelerometer_bias_z", "initial_vertical_speed"]),
        ):
            calibration = estimates.calibrate(recording, names, method=method, until=until)
            estimate = estimates.estimate_elevation(recording, method=method, calibration=calibration)
            assert estimates.score_elevation(estimate, recording, after=until)["within_2_std"] > 0.6
