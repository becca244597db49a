"""A calibration as a table, as text, and as a file that gives it back to the last digit."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import (
    Calibration,
    constants_table,
    held_out_row,
    held_out_table,
    noise_levels,
    worse_where_held_out,
)

NAMES = ["accelerometer_bias_x", "mounting_pitch"]
ROW = held_out_row('a "drive" \\ é', "elevation", "m", (0.0, 30.0, 90.0), (2.0, 0.1), (5.0, 1 / 3))
FOUND = Calibration(
    method="slope",
    table=constants_table(
        pd.DataFrame(
            {"value": [0.1, 1 / 3], "std": [1e-17, np.pi], "unit": ["m/s^2", "rad"], "prior": 0.0, "prior_std": 0.3},
            index=NAMES,
        )
    ),
    correlation=pd.DataFrame([[1.0, -0.7], [-0.7, 1.0]], NAMES, NAMES),
    absorbed=pd.DataFrame({"wheel_scale": [1e300, -np.inf]}, NAMES),
    undetermined=('a "sentence"\nof two lines',),
    held_out=held_out_table([ROW]),
)


def same(a: Calibration, b: Calibration) -> bool:
    pd.testing.assert_series_equal(a.noise, b.noise, check_exact=True, check_index_type=False)
    for field in ("table", "correlation", "absorbed", "held_out"):
        # An index of no columns has no type to speak of.
        of_columns = "equiv" if len(getattr(a, field).columns) else False
        pd.testing.assert_frame_equal(
            getattr(a, field), getattr(b, field), check_exact=True, check_column_type=of_columns
        )
    np.testing.assert_equal([a.nis, b.converged], [b.nis, a.converged])
    return (a.method, a.undetermined) == (b.method, b.undetermined)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"absorbed": pd.DataFrame(index=NAMES), "held_out": pd.DataFrame(), "undetermined": ()},
        {"held_out": FOUND.held_out.assign(held_out=np.nan, worse=True)},
        {"noise": noise_levels({"GNSS horizontal": 1 / 3, "wheel": 0.01}), "nis": 1.02, "converged": False},
    ],
)
def test_a_file_gives_it_back(tmp_path: Path, changes: dict[str, object]) -> None:
    calibration = dataclasses.replace(FOUND, **changes)
    calibration.save(tmp_path / "car.toml")
    assert same(Calibration.load(tmp_path / "car.toml"), calibration)


def test_what_is_no_calibration_is_named(tmp_path: Path) -> None:
    path = tmp_path / "recording.toml"
    for text in ("name = 'a drive'", "not toml"):
        path.write_text(text)
        with pytest.raises(ValueError, match=r"recording.toml is not a calibration"):
            Calibration.load(path)


def test_the_table_has_values_errors_and_shifts() -> None:
    assert list(FOUND.table.columns) == ["value", "std", "unit", "prior", "prior_std", "shift", "bits"]
    assert FOUND.values["mounting_pitch"] == 1 / 3 and FOUND.std["mounting_pitch"] == np.pi
    np.testing.assert_allclose(FOUND.table["shift"], [1 / 3, 10 / 9])
    np.testing.assert_allclose(FOUND.table["bits"], np.log2([0.3e17, 0.3 / np.pi]))
    assert FOUND.covariance.loc["accelerometer_bias_x", "mounting_pitch"] == pytest.approx(-0.7e-17 * np.pi)


def test_a_file_from_before_noise_was_kept_is_read(tmp_path: Path) -> None:
    FOUND.save(tmp_path / "car.toml")
    text = (tmp_path / "car.toml").read_text(encoding="utf-8")
    (tmp_path / "car.toml").write_text(re.sub(r"nis = .*\nconverged = .*\n\n\[noise\]\n", "", text), encoding="utf-8")
    assert same(Calibration.load(tmp_path / "car.toml"), FOUND)


def test_what_is_determined_is_known_from_the_covariance_alone() -> None:
    """Two constants of which the data tell the sum well and the difference not at all."""
    units, information = np.array([0.3, 0.05]), 1e8 * np.array([[1.0, 1.0], [1.0, 1.0]])
    covariance = np.linalg.inv(information / np.outer(units, units) + np.diag(units**-2.0))
    std = np.sqrt(np.diag(covariance))
    rows = {"value": 0.0, "std": std, "unit": "1", "prior": 0.0, "prior_std": units}
    found = dataclasses.replace(
        FOUND,
        table=constants_table(pd.DataFrame(rows, index=NAMES)),
        correlation=pd.DataFrame(covariance / np.outer(std, std), NAMES, NAMES),
    ).identification
    assert found.names == tuple(NAMES) and found.rank == 1
    np.testing.assert_allclose(found.information, [2e8, 0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.std, std, rtol=1e-6)


def test_it_reads_as_a_table_and_says_when_it_harms() -> None:
    for text in (repr(FOUND), FOUND._repr_html_()):
        for word in ("slope", "mounting_pitch", "m/s^2", "until", "sentence"):
            assert word in text
    heard = dataclasses.replace(FOUND, noise=noise_levels({"wheel": 0.0123}), nis=1.02)
    assert "wheel 0.0123; normalised innovation squared 1.02" in repr(heard) and "wheel" in heard._repr_html_()
    assert worse_where_held_out(FOUND) == ""
    row = held_out_row("drive", "speed", "m/s", (0.0, 30.0, 90.0), (2.0, 0.1), (0.5, 0.7))
    harmful = dataclasses.replace(FOUND, held_out=held_out_table([row]))
    said = "worse where they were not fitted: speed of 'drive' (0.5 to 0.7 m/s)"
    assert said in worse_where_held_out(harmful) and said in repr(harmful)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value = 0.1", "value = nan", r"constants.accelerometer_bias_x.value is nan, which is no number"),
        ("value = 0.1", "value = 'much'", r"is not a calibration that `Calibration.save` wrote: .*much"),
        ("std = 1e-17", "std = -0.1", r"constants.accelerometer_bias_x.std is -0.1, and must be positive"),
        (
            "prior_std = 0.3",
            "prior_std = 0.0",
            r"constants.accelerometer_bias_x.prior_std is 0.0, and must be positive",
        ),
        ("mounting_pitch", "mounting_pich", r"constants has 'mounting_pich', known are wheel_scale, "),
        ('method = "slope"', 'method = "steep"', r"method is 'steep', known are slope, shirai"),
        ('unit = "m/s^2"', 'unit = "g"', r"constants.accelerometer_bias_x.unit is 'g', and it is in 'm/s\^2'"),
        ("accelerometer_bias_x = [1.0, -0.7]", "accelerometer_bias_x = [1.0]", r"is not a calibration .*columns"),
        ("accelerometer_bias_x = [1.0, -0.7]\n", "", r"correlation has rows \['mounting_pitch'\] and columns"),
        ("[1.0, -0.7]", "[1.0, nan]", r"correlation has a value that is not between -1 and 1"),
        ("[1.0, -0.7]", "[1.0, 0.7]", r"correlation is not symmetric with ones on its diagonal"),
        ("[1.0, -0.7]", "[0.9, -0.7]", r"correlation is not symmetric with ones on its diagonal"),
        ('"wheel_scale"', '"weal_scale"', r"absorbed has columns \['weal_scale'\], which are no constants"),
    ],
)
def test_a_file_that_cannot_be_right_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "car.toml"
    FOUND.save(path)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        Calibration.load(path)
