"""Planted constants are found from a reference attitude, and held-out attitudes get better by them."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration
from altijax.estimates import calibrate
from altijax.motion_estimate.calibration import calibrate_motion
from altijax.motion_estimate.estimates import estimate_motion
from altijax.recordings import Recording
from tests.exact import EXACT

PLANTED = {"ax": 0.1, "ay": -0.15, "gz": 0.01}
NAMES = ["accelerometer_bias_x", "accelerometer_bias_y", "gyro_bias_z"]


@pytest.fixture(scope="module")
def recording() -> Recording:
    imu = EXACT.imu.assign(**{name: EXACT.imu[name] + error for name, error in PLANTED.items()})
    noise = 0.02 * np.random.default_rng(0).normal(size=EXACT.gnss.shape)
    return dataclasses.replace(EXACT, imu=imu[8.0:], gnss=(EXACT.gnss + noise)[8.0:])


@pytest.fixture(scope="module")
def found(recording: Recording) -> Calibration:
    return calibrate_motion([recording], NAMES, method="batch", until=40.0)


@pytest.mark.slow
def test_batch_finds_biases(found: Calibration) -> None:
    off = found.values - np.array(list(PLANTED.values()))
    assert (np.abs(off) < [0.03, 0.03, 0.001]).all(), found
    assert (found.std > 0).all() and (found.std < found.table["prior_std"] / 3).all()
    roll = found.held_out[found.held_out["quantity"] == "roll"].iloc[0]
    assert roll["held_out"] < 0.5 * roll["held_out_nominal"]
    assert roll[["start", "until", "end"]].tolist() == pytest.approx([8.0, 40.0, 60.0])


@pytest.mark.slow
def test_value_and_error_are_the_prior_of_the_next_batch(recording: Recording, found: Calibration) -> None:
    constants = estimate_motion(recording, calibration=found).attrs["constants"]
    for name in NAMES[:2]:
        # They walk from where the calibration holds them; unheld they would be off by .15 to begin with.
        assert abs(constants[name][0] - found.values[name]) < 0.01
        assert constants[name][1] < 0.01


@pytest.mark.parametrize("method", ["epoch", "window"])
def test_methods_without_biases_of_their_own_get_them(recording: Recording, method: str) -> None:
    calibration = calibrate_motion([recording], NAMES[:2], method=method, until=40.0)
    np.testing.assert_allclose(calibration.values, [0.1, -0.15], atol=0.03)
    assert list(calibration.held_out["quantity"]) == ["roll", "pitch", "heading"]


def test_nothing_is_learnt_after_the_end(recording: Recording) -> None:
    wrong = recording.reference.copy()
    wrong.loc[wrong.index > 40.0] += 0.3
    spoiled = dataclasses.replace(recording, reference=wrong)
    a, b = (calibrate_motion([r], NAMES[:1], method="window", until=40.0) for r in (recording, spoiled))
    pd.testing.assert_series_equal(a.values, b.values)


def test_what_cannot_be_done_is_said(recording: Recording) -> None:
    with pytest.raises(ValueError, match=r"'exact' has no reference of the motion: .* roll, pitch, heading$"):
        bare = dataclasses.replace(recording, reference=recording.reference[["alt"]])
        calibrate(bare, NAMES[0], method="window")
    with pytest.raises(ValueError, match="needs 3 samples of the reference"):
        calibrate(recording, NAMES[0], method="window", until=8.1)
