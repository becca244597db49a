"""Axes codes and signs against driving: every mounting is named, with what mends it."""

import itertools

import pytest

from altijax.agreement.axes import better_code, told, wrapped
from altijax.agreement.pairs import horizontal_axes
from altijax.agreement.report import agreement_report
from altijax.formats.axes import right_handed_codes
from tests.agreement.drives import ACCELEROMETER, GYRO, mounted, scaled, streams

CODES = ["".join(code) for code in itertools.product("FBLRUD", repeat=3)]
CODES = [
    code for code in CODES if len({("FB".find(c) >= 0 and 1) or ("LR".find(c) >= 0 and 2) or 3 for c in code}) == 3
]
RIGHT = right_handed_codes()


def findings(given, axes="FLU"):
    return [found for found in agreement_report(given, axes)[1] if found.stream == "imu"]


def test_there_are_48_mountings():
    assert len(CODES) == 48 and len(RIGHT) == 24


@pytest.mark.parametrize("code", [code for code in RIGHT if code != "FLU"])
def test_the_code_of_a_turned_sensor_is_found(code):
    found = findings(mounted(streams(), code))
    assert len(found) == 1 and f"axes={code!r}" in found[0].remedy
    assert findings(mounted(streams(), code), code) != [] or code == "FLU"


@pytest.mark.parametrize("code", [code for code in CODES if code not in RIGHT])
def test_left_handed_axes_are_no_matter_of_a_code(code):
    found = findings(mounted(streams(), code))
    assert found and found[0].verdict == "wrong"
    assert "-m/s^2" in found[0].remedy if code == "BRD" else True


def test_the_accelerometer_of_ios_is_named_by_its_sign():
    for given in (streams(), streams() | {"gnss": None}):
        found = findings(scaled(given, "imu", ACCELEROMETER, -1))
        assert len(found) == 1 and "iOS" in found[0].cause and "'-m/s^2'" in found[0].remedy


@pytest.mark.parametrize(("column", "named"), [("ax", "forward"), ("ay", "left"), ("az", "up")])
def test_one_reversed_axis_is_named(column, named):
    found = findings(scaled(streams(), "imu", [column], -1))
    assert len(found) == 1 and f"points {named} has the other sign" in found[0].seen and found[0].verdict == "wrong"


def test_a_reversed_gyro_and_a_gyro_with_other_axes():
    found = findings(scaled(streams(), "imu", GYRO, -1))
    assert len(found) == 1 and "to the other side" in found[0].seen and "'-rad/s'" in found[0].remedy
    found = findings(mounted(streams(), "UFL", (GYRO,)))
    assert len(found) == 1 and "gx, gy, gz" in found[0].seen and "not those of the accelerometer" in found[0].cause


def test_a_mirrored_course_is_not_put_down_to_the_sensors():
    report, found = agreement_report(scaled(streams(), "gnss", ["v_e"], -1))
    assert [finding.stream for finding in found] == ["gnss"] and (report["verdict"] == "wrong").any()


def test_without_driving_the_nearest_code_is_taken():
    level = horizontal_axes(mounted(streams(), "FRD")["imu"])
    assert better_code(level, None, "FLU") == "FRD" and better_code(level, 180.0, "FLU") == "BLD"
    assert wrapped(190) == -170 and not told(type("Found", (), {"score": 1.0, "correlation": 1.0})())
