"""The report: good drives raise no false alarm, units are named, and little motion is said."""

import numpy as np
import pandas as pd
import pytest

from altijax.agreement.report import COLUMNS, agreement_report
from altijax.samples.foreign_drives import MISMATCHES, foreign_drive
from tests.agreement.drives import GYRO, scaled, streams


@pytest.mark.parametrize("mismatch", MISMATCHES)
def test_good_drives_with_harmless_mismatches_raise_no_alarm(mismatch):
    for seed in range(4):
        drive = foreign_drive(seed, mismatch)
        report, found = agreement_report({"imu": drive.imu, "wheel": drive.wheel, "gnss": drive.gnss}, drive.axes)
        assert found == [] and set(report["verdict"]) <= {"ok", "undecidable"}


@pytest.mark.slow
def test_a_hundred_good_drives_raise_no_alarm():
    for seed in range(100):
        drive = foreign_drive(seed)
        assert agreement_report({"imu": drive.imu, "wheel": drive.wheel, "gnss": drive.gnss}, drive.axes)[1] == []


@pytest.mark.parametrize(
    ("stream", "columns", "quantity", "unit", "factor"),
    [
        ("wheel", ["speed"], "speed", "km/h", 3.6),
        ("wheel", ["speed"], "speed", "mph", 2.23694),
        ("wheel", ["speed"], "speed", "kn", 1.94384),
        ("gnss", ["v_e", "v_n", "v_u"], "gnss_speed", "km/h", 3.6),
        ("gnss", ["v_e", "v_n", "v_u"], "gnss_speed", "kn", 1.94384),
        ("imu", GYRO, "gyro", "deg/s", 57.29578),
        ("imu", GYRO, "gyro", "mrad/s", 1e3),
    ],
)
def test_a_unit_is_named_with_the_call_that_mends_it(stream, columns, quantity, unit, factor):
    report, found = agreement_report(scaled(streams(), stream, columns, factor))
    assert [finding.verdict for finding in found] == ["wrong"] and found[0].stream == stream
    assert f"units={{'{quantity}': '{unit}'}}" in found[0].remedy
    assert (report["verdict"] == "wrong").any() and list(report.columns) == list(COLUMNS)


def test_a_speed_in_kmh_is_told_by_the_accelerometer_alone():
    found = agreement_report(scaled(streams() | {"gnss": None}, "wheel", ["speed"], 3.6))[1]
    assert len(found) == 1 and "units={'speed': 'km/h'}" in found[0].remedy


def test_too_little_motion_is_said():
    t = np.arange(0, 60, 0.02)
    rng = np.random.default_rng(0)
    imu = pd.DataFrame(
        rng.normal(scale=0.02, size=(t.size, 3)) + np.array([0, 0, 9.8]), index=t, columns=["ax", "ay", "az"]
    )
    wheel = pd.DataFrame({"speed": 0.0}, index=t[::2])
    report, found = agreement_report({"imu": imu, "wheel": wheel, "gnss": None})
    assert found == [] and report.loc["force and change of speed (wheel)", "verdict"] == "undecidable"
    assert agreement_report({"imu": None, "wheel": None, "gnss": None})[0].empty
