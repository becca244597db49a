"""Tidy folders written."""

import tomllib

import pandas as pd
import pytest

from altijax.formats.tidy_writer import FORMS, write_sheet, write_table, write_tidy_folder

TABLE = pd.DataFrame({"ax": [0.1, 1 / 3], "ay": [0.0, 1e-17]}, index=pd.Index([0.1 + 0.2, 1.0], name="t"))


@pytest.mark.parametrize("form", FORMS)
def test_a_table_comes_back_to_the_last_bit(tmp_path, form):
    write_tidy_folder(tmp_path / "new", {"imu": TABLE}, {"name": "a"}, form)
    file = tmp_path / "new" / f"imu.{form}"
    found = pd.read_parquet(file) if form == "parquet" else pd.read_csv(file, index_col="t")
    pd.testing.assert_frame_equal(found, TABLE, check_exact=True)
    assert (tmp_path / "new" / "recording.toml").read_text() == 'name = "a"\n'


def test_nothing_is_written_over(tmp_path):
    write_tidy_folder(tmp_path, {"imu": TABLE}, {}, "csv")
    with pytest.raises(FileExistsError, match="holds a recording already; delete it, or save into another folder"):
        write_tidy_folder(tmp_path, {"imu": TABLE}, {}, "parquet")
    with pytest.raises(ValueError, match=r"form must be one of csv, csv.gz, parquet, got 'xlsx'"):
        write_tidy_folder(tmp_path / "other", {"imu": TABLE}, {}, "xlsx")


def test_what_is_not_known_is_not_written(tmp_path):
    write_sheet(tmp_path, {"name": "a", "site": {"latitude": None, "height": 1.5}, "wheel": {"radius": None}})
    assert tomllib.loads((tmp_path / "recording.toml").read_text()) == {"name": "a", "site": {"height": 1.5}}


def test_what_a_result_says_of_itself_does_not_hinder_parquet(tmp_path):
    table = TABLE.copy()
    table.attrs["constants"] = TABLE
    write_table(table, tmp_path / "a.parquet")
    assert "constants" in table.attrs and pd.read_parquet(tmp_path / "a.parquet").equals(TABLE)
