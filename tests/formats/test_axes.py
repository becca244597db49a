"""Axes codes."""

import numpy as np
import pytest

from altijax.formats.axes import axes_to_matrix, likeness, right_handed_codes


@pytest.mark.parametrize(
    ("code", "sensor", "body"),
    [
        ("FLU", [1, 2, 3], [1, 2, 3]),
        ("FRD", [1, 2, 3], [1, -2, -3]),
        ("BRU", [1, 2, 3], [-1, -2, 3]),
        ("LBU", [1, 2, 3], [-2, 1, 3]),
        ("UFL", [1, 2, 3], [2, 3, 1]),
    ],
)
def test_axes_codes_turn_sensor_vectors_into_body_vectors(code, sensor, body):
    C = axes_to_matrix(code)
    np.testing.assert_array_equal(C @ sensor, body)
    np.testing.assert_array_equal(C @ C.T, np.eye(3))
    assert np.linalg.det(C) == 1


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("FRU", r"axes 'FRU' is left-handed; right-handed and near it: FLU, FRD, BRU"),
        ("FL", r"axes 'FL' needs three letters out of F/B, L/R, U/D; right-handed and near it: FLU"),
        ("flu", r"axes 'flu' needs three letters"),
        ("XYZ", r"axes 'XYZ' needs three letters"),
        ("FBU", r"axes 'FBU' needs one letter of each pair.*: FLU"),
        ("FFU", r"axes 'FFU' needs one letter of each pair.*: FLU, RFU"),
    ],
)
def test_bad_axes_codes_are_explained(code, message):
    with pytest.raises(ValueError, match=message):
        axes_to_matrix(code)


def test_every_suggested_code_is_right_handed():
    for code in ("FRU", "BLU", "DDD", "ABC", ""):
        with pytest.raises(ValueError) as error:
            axes_to_matrix(code)
        for near in str(error.value).split("near it: ")[1].split(", "):
            assert np.linalg.det(axes_to_matrix(near)) == 1


def test_there_are_24_codes():
    assert len(set(right_handed_codes())) == 24
    assert likeness("FLU", "FRD") == 1
