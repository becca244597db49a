"""Names of constants mean the same everywhere."""

import pytest

from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.parameters import ACCEPTED, PARAMETERS, require_parameters


def test_every_method_takes_known_names() -> None:
    for method, names in ACCEPTED.items():
        if method != "drive":
            assert set(names) <= set(PARAMETERS.index), method
        assert len(set(names)) == len(names)


def test_a_drive_means_the_same_by_the_same_name() -> None:
    for name in set(DRIVE_PARAMETERS) & set(PARAMETERS.index):
        nominal, _, unit = DRIVE_PARAMETERS[name]
        assert (nominal, unit) == (PARAMETERS["nominal"][name], PARAMETERS["unit"][name])


def test_names_are_checked_against_the_method() -> None:
    assert require_parameters("wheel_scale", "slope") == ["wheel_scale"]
    with pytest.raises(
        ValueError, match=r"'slope' must be different names out of accelerometer_bias_x, .*got gyro_bias_x"
    ):
        require_parameters("gyro_bias_x", "slope")
    with pytest.raises(ValueError, match="got wheel_scale, wheel_scale"):
        require_parameters(["wheel_scale", "wheel_scale"], "slope")
    with pytest.raises(ValueError, match=r"method must be one of slope, shirai, .*drive, got 'ekf'"):
        require_parameters("wheel_scale", "ekf")
