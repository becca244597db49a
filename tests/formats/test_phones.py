"""What the exports of phone apps have in common."""

import numpy as np
import pytest

from altijax.formats.phones import added, location_table, phone_log, series
from altijax.recordings import RecordingError


def write(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_series_has_rows_with_values_in_the_order_of_their_times(tmp_path):
    path = write(tmp_path / "a.csv", ["time,x,y", "2,20,1", "1,10,", "1,11,5", "3,,", ",4,4"])
    problems, notes = [], []
    t, values = series(path, {"t": "time", "x": "x", "y": "y"}, {"t": 0.5, "x": 2.0}, problems, notes)
    np.testing.assert_array_equal(t, [0.5, 1.0])
    np.testing.assert_array_equal(values, [[20, np.nan], [40, 1]])
    assert (
        problems == [] and any("2 rows without time or value" in n for n in notes) and any("sorted" in n for n in notes)
    )


def test_a_file_without_two_rows_is_left_out(tmp_path):
    problems = []
    assert series(write(tmp_path / "a.csv", ["time,x", "1,2"]), {"t": "time", "x": "x"}, {}, problems, []) is None
    assert series(write(tmp_path / "b.csv", ["time,x"]), {"t": "time", "x": "x"}, {}, problems, []) is None
    assert problems == [
        "a.csv: has 1 usable row(s) and needs 2; it is left out",
        "b.csv: has no row of numbers; it is left out",
    ]


def test_vectors_are_added_where_both_are():
    t, values = added((np.arange(4.0), np.ones((4, 3))), (np.array([0.5, 3.5]), np.array([[1.0] * 3, [4.0] * 3])))
    np.testing.assert_allclose(t, [1, 2, 3])
    np.testing.assert_allclose(values[:, 0], [2.5, 3.5, 4.5])


def test_negative_means_unknown_and_fixes_kept_from_before_are_left_out(tmp_path):
    t = np.array([-900.0, 0.0, 1.0, 2.0])
    values = np.array([[3.0, 10], [-1, -1], [2, -1], [5, 90]])
    notes, problems = [], []
    table = location_table((t, values), ["speed", "course"], "Location.csv", notes)
    # What is left: the old one, and the last.
    assert table["speed"].tolist() == [3, 5] and len(notes) == 3
    f = (np.arange(0, 3, 0.01), np.tile([0.0, 0, 9.8], (300, 1)))
    tables, sheet = phone_log(tmp_path, "app", f, None, table, problems, notes)
    assert tables["gnss"]["t"].tolist() == [2] and sheet["axes"] == "RFU"
    assert any("1 fixes from before the recording dropped" in note for note in notes)
    assert any("axes are RFU" in note for note in notes)


def test_nothing_usable_is_said_with_what_was_found(tmp_path):
    write(tmp_path / "Light.csv", ["x"])
    with pytest.raises(RecordingError, match=r"neither an accelerometer with gravity nor a location; found Light.csv"):
        phone_log(tmp_path, "app", None, None, None, [], [])
