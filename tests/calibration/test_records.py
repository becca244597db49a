"""What a calibration is to the next estimate: its values, their errors, and what they absorbed."""

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration, prior_constants
from altijax.drives import Drive, drive_arrays
from altijax.elevation_estimate.model import UNCERTAINTY
from tests.exact import EXACT

ABSORBED = pd.DataFrame({"mounting_pitch": [9.8]}, index=["accelerometer_bias_x"])
ONE = pd.DataFrame([[1.0]], ["accelerometer_bias_x"], ["accelerometer_bias_x"])
BIAS = Calibration(
    method="slope",
    values=pd.Series({"accelerometer_bias_x": 0.2}),
    std=pd.Series({"accelerometer_bias_x": 0.01}),
    correlation=ONE,
    absorbed=ABSORBED,
    held_out=pd.DataFrame(),
)


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


def test_another_method_takes_value_and_error_alone(drive: Drive) -> None:
    prior = prior_constants(drive, "fused", BIAS)
    assert prior.names[0] == "accelerometer_bias_x" and prior.mean[0] == 0.2
    assert prior.covariance[0, 0] == pytest.approx(0.01**2)


def test_what_is_fixed_is_no_unknown(drive: Drive) -> None:
    prior = prior_constants(drive, "shirai", BIAS, {"initial_vertical_speed": 0.5})
    assert "initial_vertical_speed" not in prior.names
    assert np.isfinite(prior.mean).all()
