"""Quantities of columns and how their units are spelled."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.quantities import check_units, factor_of, in_si_units, quantity_of, unit_named


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("m/s²", "m/s^2"),
        ("[m/s2]", "m/s^2"),
        (" G ", "g"),
        ("°/s", "deg/s"),
        ("dps", "deg/s"),
        (" Kmh", "km/h"),
        ("µs", "us"),
        ("μs", "us"),
        ("unix time", "s"),
        ("knots", "kn"),
        ("mm", None),
        ("", None),
    ],
)
def test_units_in_their_spellings(text, unit):
    assert unit_named(text) == unit


def test_every_column_with_units_has_its_quantity():
    assert quantity_of("imu", "ay") == "accelerometer" and quantity_of("gnss", "speed") == "gnss_speed"
    assert quantity_of("wheel", "speed") == "speed" and quantity_of("gnss", "lat") is None
    assert factor_of("gyro", "deg/s") == pytest.approx(np.pi / 180)
    assert factor_of("gyro", "m/s") is None and factor_of("gyro", None) is None


def test_the_sign_of_ios_is_a_unit():
    check_units({"accelerometer": "-g"})
    tables = {"imu": pd.DataFrame({"t": [0.0], "ax": [0.0], "ay": [0.0], "az": [-1.0]})}
    in_si_units(tables, {"accelerometer": "-g"})
    assert tables["imu"]["az"].tolist() == [9.80665]
    with pytest.raises(ValueError, match="accelerometer has no unit 'ft'; known are m/s"):
        check_units({"accelerometer": "ft"})
