"""A calibration becomes what is believed of the states."""

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration, constants_table
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.sensors import layout_of

USE = ("gyro", "wheel", "velocity", "course")


def calibration() -> Calibration:
    names = ["accelerometer_bias_x", "wheel_scale"]
    rows = {names[0]: (0.2, 0.01, "m/s^2", 0.0, 0.3), names[1]: (1.02, 0.002, "1", 1.0, 0.01)}
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "std", "unit", "prior", "prior_std"])
    return Calibration(
        method="drive",
        table=constants_table(table),
        correlation=pd.DataFrame([[1.0, 0.5], [0.5, 1.0]], names, names),
        absorbed=pd.DataFrame(index=names),
        undetermined=(),
        held_out=pd.DataFrame(),
    )


def test_calibrated_constants_have_their_values_errors_and_correlation() -> None:
    belief, layout = belief_of(USE, calibration()), layout_of(USE)
    bias, scale = layout.at("accelerometer_bias").start, layout.at("wheel_scale").start
    assert belief.mean[bias] == 0.2
    # A wheel reads what it should divided by its scale.
    assert belief.mean[scale] == pytest.approx(1 / 1.02 - 1)
    P = belief.covariance
    assert np.sqrt(P[bias, bias]) == pytest.approx(0.01)
    assert np.sqrt(P[scale, scale]) == pytest.approx(0.002 / 1.02**2)
    assert P[bias, scale] / np.sqrt(P[bias, bias] * P[scale, scale]) == pytest.approx(-0.5)


def test_without_a_receiver_the_drive_starts_to_the_east() -> None:
    for use, known in ((USE, False), (("gyro", "wheel", "course"), True)):
        yaw = layout_of(use).at("attitude").start + 2
        assert (belief_of(use).covariance[yaw, yaw] < 1e-4) == known
