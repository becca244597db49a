"""Planted constants are found from a reference speed, and the rest of the drive says what they are worth."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from altijax.estimates import calibrate, estimate_speed
from altijax.programs import count_programs
from altijax.recordings import Recording
from altijax.speed_estimate.calibration import calibrate_speed
from altijax.speed_estimate.steps import drive_in_steps
from tests.exact import EXACT


def planted(**errors: float) -> Recording:
    """The exact drive with an error added to columns of its IMU, heights left out of the reference."""
    imu = EXACT.imu.assign(**{name: EXACT.imu[name] + error for name, error in errors.items()})
    return dataclasses.replace(EXACT, imu=imu, reference=EXACT.reference[["v_e", "v_n", "v_u"]])


@pytest.mark.parametrize("method", ["conventional", "roll", "aided", "filter"])
def test_a_pitch_gyro_is_calibrated(method: str) -> None:
    recording = planted(gy=0.01)
    calibration = calibrate_speed([recording], ["gyro_bias_y"], method=method, until=40.0)
    # Where the roll is left out, the drive's bends are in the constant.
    assert calibration.values["gyro_bias_y"] == pytest.approx(0.01, abs=2e-3 if method == "conventional" else 6e-4)
    assert 0 < calibration.std["gyro_bias_y"] < 1e-3
    held_out = calibration.held_out.iloc[0]
    assert held_out[["start", "until", "end"]].tolist() == [0.0, 40.0, 60.0]
    # Up to an outage its aid tells the gyro's bias, calibrated or not.
    assert 0 < held_out["held_out"] < 0.5 and 0 < held_out["held_out_nominal"] < 0.5


def test_without_an_aid_it_holds_longer() -> None:
    recording = planted(gy=0.01)
    calibration = calibrate_speed([recording], ["gyro_bias_y"], method="roll", until=40.0)
    truth = np.interp(25.0, EXACT.wheel.index, EXACT.wheel["speed"])
    off = [
        abs(estimate_speed(recording, method="roll", calibration=known)["speed"].loc[25.0] - truth)
        for known in (None, calibration)
    ]
    assert off[1] < 0.2 * off[0]


@pytest.mark.parametrize(("method", "other"), [("conventional", "gyro_bias_y"), ("filter", "gyro_bias_z")])
def test_other_lengths_and_constants_share_programs(method: str, other: str) -> None:
    recording = planted(gy=0.01)
    calibrate_speed([recording], ["gyro_bias_y"], method=method, until=40.0)
    shorter = dataclasses.replace(recording, imu=recording.imu[:55.0])
    with count_programs() as programs:
        calibrate_speed([shorter], [other], method=method, until=35.0)
    assert programs.names == []


def test_two_drives_are_better_than_one() -> None:
    recordings = [planted(gy=0.01), dataclasses.replace(planted(gy=0.01), name="again")]
    one, both = (calibrate_speed(r, ["gyro_bias_y"], method="filter", until=40.0) for r in (recordings[:1], recordings))
    assert both.std["gyro_bias_y"] < one.std["gyro_bias_y"]
    assert list(both.held_out.index) == ["exact", "again"]


def test_the_wheels_are_set_by_the_reference_and_not_beyond_the_end() -> None:
    late = EXACT.wheel / 1.02
    late.index = late.index + 0.1
    recording = dataclasses.replace(planted(), wheel=late)
    names = ["wheel_delay", "wheel_scale"]
    calibration = calibrate_speed([recording], names, method="roll", until=40.0)
    np.testing.assert_allclose(calibration.values, [0.1, 1.02], atol=1e-3)
    assert list(calibration.values.index) == names
    assert set(calibration.held_out["quantity"]) == {"speed of the aid", "speed in outages of 10 s"}
    wrong = recording.reference.copy()
    wrong.loc[wrong.index > 40.0] *= 2
    again = calibrate_speed([dataclasses.replace(recording, reference=wrong)], names, method="roll", until=40.0)
    pd.testing.assert_series_equal(calibration.values, again.values)


def test_both_kinds_make_one_calibration_for_the_estimate() -> None:
    calibration = calibrate_speed([planted(gy=0.01)], ["wheel_scale", "gyro_bias_y"], method="conventional", until=40.0)
    assert list(calibration.correlation.columns) == list(calibration.table.index) == ["wheel_scale", "gyro_bias_y"]
    drive = drive_in_steps(planted(gy=0.01), calibration, 20.0)
    assert np.median(drive.w_b[:, 1] - EXACT.imu["gy"]) == pytest.approx(0, abs=2e-3)


def test_a_forward_bias_is_the_pitch_that_a_stretch_begins_with() -> None:
    with pytest.warns(UserWarning, match="less of accelerometer_bias_x than was known before"):
        calibrate(planted(ax=0.1), "accelerometer_bias_x", method="conventional")


def test_what_cannot_be_done_is_said() -> None:
    with pytest.raises(ValueError, match="'exact' has no reference speeds"):
        calibrate(dataclasses.replace(EXACT, reference=EXACT.reference[["alt"]]), "gyro_bias_y", method="roll")
    for method in ("roll", "filter"):
        with pytest.raises(ValueError, match="needs a reference speed for 20 s"):
            calibrate(planted(), "gyro_bias_y", method=method, until=10.0)
    with pytest.raises(ValueError, match="gnss_delay: changes nothing in method 'roll'"):
        calibrate(planted(), "gnss_delay", method="roll")
    with pytest.raises(ValueError, match="'exact' has no gyro"):
        bare = dataclasses.replace(planted(), imu=EXACT.imu[["ax", "ay", "az"]])
        calibrate(bare, "accelerometer_bias_x", method="roll")
