"""Recordings in steps: means, vibration, standstills, calibrations, and the aid up to its end."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration, constants_table
from altijax.recordings import Recording
from altijax.speed_estimate.model import STATES
from altijax.speed_estimate.steps import STEP, drive_in_steps, from_first_aid, initial_state, steps_until
from tests.made_drives import curvy_recording


@pytest.fixture(scope="module")
def drive() -> Recording:
    return curvy_recording()


def calibration(**values: float) -> Calibration:
    columns = {"value": pd.Series(values), "std": 0.0, "unit": "1", "prior": 0.0, "prior_std": 1.0}
    return Calibration(
        method="slope",
        table=constants_table(pd.DataFrame(columns)),
        correlation=pd.DataFrame(np.eye(len(values)), list(values), list(values)),
        absorbed=pd.DataFrame(),
        undetermined=(),
        held_out=pd.DataFrame(),
    )


def test_steps_are_means_of_the_readings(drive: Recording) -> None:
    steps = drive_in_steps(drive, None, 20.0)
    t = steps.ends - STEP / 2
    np.testing.assert_allclose(steps.f_steps[:, 0], 0.75 * np.cos(0.25 * t) + 0.1, atol=0.1)
    assert np.mean(steps.w_steps[:, 1]) == pytest.approx(0.003, abs=2e-4)
    # of white noise of 0.002 rad/s a little less than its square is fast
    assert np.mean(steps.vibration) == pytest.approx(0.002**2, rel=0.15)


def test_the_aid_ends_where_it_should(drive: Recording) -> None:
    inputs = steps_until(drive_in_steps(drive, None, 20.0), 20.0)
    ends = STEP * np.arange(1, inputs["aided"].size + 1)
    assert inputs["aided"][ends <= 20.0].all() and not inputs["aided"][ends > 20.0].any()


def test_a_standing_car_is_seen(drive: Recording) -> None:
    imu = drive.imu.copy()
    standing = imu.index > 35.0
    imu.loc[standing] = [0.1, -0.05, 9.81, 0.0, 0.003, -0.002]
    still = steps_until(drive_in_steps(replace(drive, imu=imu), None, 20.0), 20.0)["still"]
    assert not still[: round(29 / STEP)].any() and still[round(32 / STEP) :].all()


def test_a_calibration_is_used_as_far_as_a_speed_depends_on_it(drive: Recording) -> None:
    plain = drive_in_steps(drive, None, 20.0)
    known = drive_in_steps(
        drive,
        calibration(accelerometer_bias_x=0.1, accelerometer_scale_y=1.01, wheel_scale=1.02, wheel_delay=0.3),
        20.0,
    )
    np.testing.assert_allclose(known.f_b, plain.f_b / [1, 1.01, 1] - [0.1, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(known.aid, 1.02 * plain.aid)
    np.testing.assert_allclose(known.t_aid, plain.t_aid - 0.3)
    tilted = drive_in_steps(drive, calibration(mounting_pitch=0.1), 20.0)
    # nose up on the car: a level car reads part of gravity forward
    np.testing.assert_allclose(tilted.f_b[:, 0], plain.f_b @ [np.cos(0.1), 0, -np.sin(0.1)], rtol=1e-12)
    np.testing.assert_allclose(tilted.w_b[:, 1], plain.w_b[:, 1])
    known = drive_in_steps(drive, calibration(gyro_bias_y=0.003, mounting_yaw=0.1, initial_vertical_speed=1.0), 20.0)
    turned = plain.w_b - [0, 0.003, 0]
    np.testing.assert_allclose(known.w_b[:, 1], turned @ [np.sin(0.1), np.cos(0.1), 0], atol=1e-12)


def test_what_was_calibrated_begins_with_its_own_error(drive: Recording) -> None:
    known = calibration(gyro_bias_y=0.003, mounting_yaw=0.1, wheel_delay=0.2, gnss_delay=0.1)
    known.table["std"] = [0.001, 0.002, 0.003, 0.004]
    known.correlation.loc["gyro_bias_y", "mounting_yaw"] = known.correlation.loc["mounting_yaw", "gyro_bias_y"] = 0.5
    covariance = drive_in_steps(drive, known, 20.0).states_covariance
    std = STATES | {"gyro_bias_y": 0.001, "travel_yaw": 0.002, "imu_delay": 0.003}
    expected = np.diag(np.square(list(std.values())))
    # The filter sees the mounting from the other side.
    bias, yaw = (list(STATES).index(name) for name in ("gyro_bias_y", "travel_yaw"))
    expected[bias, yaw] = expected[yaw, bias] = -0.5 * 0.001 * 0.002
    np.testing.assert_allclose(covariance, expected, atol=1e-15)


def test_a_late_aid_does_not_serve_beyond_its_end(drive: Recording) -> None:
    late = drive_in_steps(drive, calibration(wheel_delay=0.3), 20.0)
    inputs = steps_until(late, 20.0)
    assert not inputs["aided"][STEP * np.arange(inputs["aided"].size) > 19.8].any()


def test_a_recording_begins_with_its_first_aid_where_that_is_late(drive: Recording) -> None:
    assert from_first_aid(drive) is drive
    late = from_first_aid(replace(drive, wheel=drive.wheel[9.0:]))
    assert late.imu.index[0] == pytest.approx(9.0, abs=0.021) and len(late.wheel) == len(drive.wheel[9.0:])


def test_the_initial_state_is_that_of_the_first_second(drive: Recording) -> None:
    speed, pitch = initial_state(drive_in_steps(drive, None, 20.0), 20.0, None, None)
    assert speed == pytest.approx(10.4, abs=0.2)
    assert pitch == pytest.approx(0.1 / 9.81, abs=0.02)
    assert initial_state(drive_in_steps(drive, None, 20.0), 20.0, 3.0, 0.2) == (3.0, 0.2)


def test_gravity_is_that_of_the_places_so_far(drive: Recording) -> None:
    index = pd.Index([5.0, 15.0, 30.0], name="t")
    places = pd.DataFrame({"lat": [45.8, 45.8, 80.0], "v_e": 10.0, "v_n": 0.0}, index=index)
    gravity = drive_in_steps(replace(drive, gnss=places), None, 20.0).gravity
    assert gravity == drive_in_steps(replace(drive, gnss=places[:15.0]), None, 20.0).gravity
    assert gravity == pytest.approx(9.807, abs=0.001)
