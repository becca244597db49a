"""What is known of constants beforehand: the table, a calibration, and that every verb trusts one alike."""

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.parameters import CONSTANTS
from altijax.calibration.priors import PARAMETERS, prior_of
from altijax.calibration.records import Calibration, constants_table
from altijax.drives import drive_arrays
from altijax.elevation_estimate.priors import prior_constants
from altijax.speed_estimate.model import OF_CONSTANTS, STATES
from altijax.speed_estimate.steps import drive_in_steps
from tests.exact import EXACT

BIAS, PITCH, LATE = "accelerometer_bias_x", "mounting_pitch", "wheel_delay"
ABSORBED = pd.DataFrame({PITCH: [-9.8, 0.3], "accelerometer_bias_y": [0.4, -0.02]}, [BIAS, LATE])
TABLE = {"value": [0.2, 0.05], "std": [0.02, 0.03], "unit": ["m/s^2", "s"], "prior": 0.0, "prior_std": [0.3, 0.1]}
FOUND = Calibration(
    method="slope",
    table=constants_table(pd.DataFrame(TABLE, [BIAS, LATE])),
    correlation=pd.DataFrame([[1.0, -0.6], [-0.6, 1.0]], [BIAS, LATE], [BIAS, LATE]),
    absorbed=ABSORBED,
    undetermined=(),
    held_out=pd.DataFrame(),
)


def test_the_table_is_that_of_the_constants() -> None:
    assert list(PARAMETERS.index) == list(CONSTANTS)
    for name, row in PARAMETERS.iterrows():
        constant = CONSTANTS[str(name)]
        assert (row["uncertainty"], row["unit"]) == (constant.spread, constant.unit)
    assert list(PARAMETERS.index[PARAMETERS["nominal"].isna()]) == ["initial_vertical_speed"]


def test_what_was_not_calibrated_is_nominal_with_the_table_s_spread_or_the_method_s() -> None:
    mean, covariance = prior_of(["wheel_scale", BIAS, "lever_arm"], None, {BIAS: 0.05})
    np.testing.assert_array_equal(mean, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(covariance, np.diag(np.square([0.01, 0.05, 1.0])))


def test_what_was_calibrated_is_off_together_with_what_it_absorbed() -> None:
    """As if drawn: the others first, then the calibrated ones by their own errors and by those."""
    names = [PITCH, BIAS, "wheel_scale", LATE]
    mean, covariance = prior_of(names, FOUND)
    np.testing.assert_array_equal(mean, [0.0, 0.2, 1.0, 0.05])
    pitch, scale = CONSTANTS[PITCH].spread, CONSTANTS["wheel_scale"].spread
    own = np.linalg.cholesky(FOUND.covariance)
    drawn = np.array([[pitch, 0, 0, 0], [-9.8 * pitch, 0, *own[0]], [0, scale, 0, 0], [0.3 * pitch, 0, *own[1]]])
    np.testing.assert_allclose(covariance, drawn @ drawn.T, atol=1e-15)
    surer = prior_of(names, FOUND, {PITCH: 0.01})[1]
    assert surer[1, 1] == pytest.approx(0.02**2 + 0.098**2) and surer[0, 1] == pytest.approx(-9.8 * 0.01**2)
    # A method that takes the direction of travel for less sure knows as much of the bias as all others.
    wider = prior_of(names, FOUND, {PITCH: 0.1})[1]
    np.testing.assert_allclose(wider[1:, 1:], covariance[1:, 1:])
    assert wider[0, 0] == pytest.approx(0.01) and np.linalg.eigvalsh(wider).min() > 0


def test_elevation_and_speed_trust_a_calibration_alike() -> None:
    elevation = prior_constants(drive_arrays(EXACT, turns=True)[0], "fused", FOUND)
    speed = drive_in_steps(EXACT, FOUND, 20.0).states_covariance
    of_speed = OF_CONSTANTS | {"imu_delay": (LATE, -1.0)}
    shared = {name: (state, sign) for state, (name, sign) in of_speed.items() if name in elevation.names}
    rows = [elevation.names.index(name) for name in shared]
    states, signs = [list(STATES).index(state) for state, _ in shared.values()], [sign for _, sign in shared.values()]
    assert {BIAS, LATE, PITCH, "accelerometer_bias_y"} <= set(shared)
    found = [elevation.covariance[np.ix_(rows, rows)], speed[np.ix_(states, states)] * np.outer(signs, signs)]
    calibrated = np.isin(list(shared), [BIAS, LATE])
    np.testing.assert_allclose(found[0][calibrated], found[1][calibrated], atol=1e-15)
    assert np.count_nonzero(found[0][calibrated]) == 2 * 4
