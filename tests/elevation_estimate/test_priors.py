"""What a calibration is to the next elevation: its values, their errors, and what they absorbed."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration, constants_table
from altijax.drives import Drive, drive_arrays
from altijax.elevation_estimate.estimates import estimate_elevation
from altijax.elevation_estimate.model import UNCERTAINTY
from altijax.elevation_estimate.priors import prior_constants, with_corrected_turns
from tests.exact import EXACT

ABSORBED = pd.DataFrame({"mounting_pitch": [9.8]}, index=["accelerometer_bias_x"])


def calibration(name: str, value: float, std: float, absorbed: pd.DataFrame) -> Calibration:
    row = {"value": value, "std": std, "unit": "m/s^2", "prior": 0.0, "prior_std": 0.3}
    return Calibration(
        method="slope",
        table=constants_table(pd.DataFrame(row, [name])),
        correlation=pd.DataFrame([[1.0]], [name], [name]),
        absorbed=absorbed,
        undetermined=(),
        held_out=pd.DataFrame(),
    )


BIAS = calibration("accelerometer_bias_x", 0.2, 0.01, ABSORBED)
YAW_GYRO = calibration("gyro_bias_z", 0.1, 0.001, pd.DataFrame())


@pytest.fixture(scope="module")
def drive() -> Drive:
    return drive_arrays(EXACT, turns=True)[0]


def test_a_calibrated_constant_is_off_by_itself_and_by_what_it_absorbed(drive: Drive) -> None:
    prior = prior_constants(drive, "slope", BIAS)
    bias, pitch = (prior.names.index(name) for name in ("accelerometer_bias_x", "mounting_pitch"))
    assert prior.mean[bias] == 0.2
    absorbed = 9.8 * UNCERTAINTY["mounting_pitch"]
    assert prior.covariance[bias, bias] == pytest.approx(0.01**2 + absorbed**2)
    assert prior.covariance[bias, pitch] == pytest.approx(absorbed * UNCERTAINTY["mounting_pitch"])


def test_another_method_takes_the_same_of_it(drive: Drive) -> None:
    prior, own = (prior_constants(drive, method, BIAS) for method in ("fused", "slope"))
    assert prior.names[0] == "accelerometer_bias_x" and prior.mean[0] == 0.2
    assert prior.covariance[0, 0] == own.covariance[0, 0]
    # The way without a mounting does not know what it absorbed.
    assert prior_constants(drive, "shirai", BIAS).covariance[0, 0] == pytest.approx(0.01**2)


def test_what_is_fixed_is_no_unknown(drive: Drive) -> None:
    prior = prior_constants(drive, "shirai", BIAS, {"initial_vertical_speed": 0.5})
    assert "initial_vertical_speed" not in prior.names
    assert np.isfinite(prior.mean).all()


def test_a_constant_of_no_elevation_is_left_out(drive: Drive) -> None:
    assert prior_constants(drive, "slope", YAW_GYRO).names == prior_constants(drive, "slope").names


def test_the_yaw_gyro_is_corrected_where_it_is_used() -> None:
    """With a track width the wheels tell the rate of turn."""
    biased = dataclasses.replace(EXACT, imu=EXACT.imu.assign(gz=EXACT.imu["gz"] + 0.1))
    corrected = with_corrected_turns(biased, YAW_GYRO)
    np.testing.assert_allclose(corrected.imu["gz"], EXACT.imu["gz"], atol=1e-12)
    assert with_corrected_turns(biased, BIAS).imu.equals(biased.imu)
    by_gyro = dataclasses.replace(biased, track_width=None)
    wrong, right = (estimate_elevation(by_gyro, method="shirai", calibration=c) for c in (None, YAW_GYRO))
    assert abs(right["elevation"] - wrong["elevation"]).max() > 1.0
    reference = estimate_elevation(dataclasses.replace(EXACT, track_width=None), method="shirai")
    np.testing.assert_allclose(right["elevation"], reference["elevation"], atol=1e-9)


def test_single_wheels_are_corrected_where_they_tell_the_rate_of_turn() -> None:
    assert EXACT.wheel is not None and EXACT.track_width is not None
    true = EXACT.wheel
    shown = true.assign(left=true["left"] / 1.02 / 0.995, right=true["right"] / 1.02 / 1.005)
    rows = {"wheel_scale": (1.02, 1.0), "wheel_difference": (0.01, 0.0), "track_width": (EXACT.track_width, 1.5)}
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "prior"])
    table = constants_table(table.assign(std=1e-3, unit="", prior_std=0.1))
    found = dataclasses.replace(
        BIAS, method="drive", table=table, correlation=pd.DataFrame(np.eye(3), table.index, table.index)
    )
    corrected = with_corrected_turns(dataclasses.replace(EXACT, wheel=shown, track_width=None), found)
    assert corrected.track_width == EXACT.track_width
    np.testing.assert_allclose(corrected.wheel, shown.assign(left=true["left"], right=true["right"]), atol=1e-12)
