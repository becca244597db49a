"""Layouts of text files, numbers and times in them."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.text_tables import layout_of, numbers, read_columns, seconds, table_names
from altijax.recordings import RecordingError

ROWS = [[0.5, 1.25, -2.5], [1.5, 0.25, 3.0], [2.5, 0.0, 1e-3], [3.5, 1.0, 2.0]]


def write(path, lines, encoding="utf-8"):
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def rows(separator, comma=False):
    lines = [separator.join(str(value) for value in row) for row in ROWS]
    return [line.replace(".", ",") for line in lines] if comma else lines


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize(("separator", "comma"), [(",", False), (";", False), (";", True), ("\t", True)])
@pytest.mark.parametrize("above", [[], ["Session: a, b; c", "1,2,3", ""], ["sep=;"], [";;;"]])
def test_layouts(above, separator, comma, encoding, tmp_path):
    lines = [*above, separator.join(["t", "Ä (°/s)", "x"]), *rows(separator, comma)]
    path = write(tmp_path / "a.csv", lines, encoding)
    layout = layout_of(path)
    assert layout.names == ("t", "Ä (°/s)", "x") and layout.units == {"Ä (°/s)": "°/s"}
    table = read_columns(path, layout, layout.names)
    np.testing.assert_array_equal(table, ROWS)
    assert table.index[0] == len(above) + 2 and table.index.name == "line"


def test_units_and_sources_below_the_names_and_repeated_names(tmp_path):
    lines = ["made by a logger", "Format,3", "", "t,v,v,,n", "unix time,m/s,km/h,,", ",gps,calc,,5: x", "", "1,2,3,4,5"]
    layout = layout_of(write(tmp_path / "a.csv", lines))
    assert layout.names == ("t", "v", "v (2)", "4", "n") and layout.skipped == 7
    assert layout.units == {"t": "unix time", "v": "m/s", "v (2)": "km/h"}
    assert layout.sources["v (2)"] == "calc" and layout.above[0] == "made by a logger"


def test_a_block_with_numbers_above_the_names_is_not_the_table(tmp_path):
    block = ["Beacon,1.5,2.5,,", "Segments,01:02.8,00:54.9,,", ",,,,"]
    layout = layout_of(write(tmp_path / "a.csv", [*block, "Time,a,b,c,d", "s,g,g,g,", ",,,,", *["0,1,2,3,4"] * 4]))
    assert layout.names == ("Time", "a", "b", "c", "d") and layout.units["Time"] == "s"


def test_what_is_no_table(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"\0\1\2" * 100)
    for path in (tmp_path / "a.bin", write(tmp_path / "a.txt", ["some prose", "and more of it"])):
        assert layout_of(path) is None and table_names(path) == ()
    assert table_names(write(tmp_path / "b.csv", ["a;b;c"])) == ("a", "b", "c")
    assert layout_of(write(tmp_path / "c.csv", ["1;2;3"])).names == ("1", "2", "3")
    (tmp_path / "empty.csv").write_bytes(b"")
    assert layout_of(tmp_path / "empty.csv") is None


def test_rows_that_are_too_long_and_too_short(tmp_path):
    path = write(tmp_path / "a.csv", ["made by x", "a,b", "1,2", "1,2", "1,2", "1"])
    np.testing.assert_array_equal(read_columns(path, layout_of(path), ["a", "b"]), [[1, 2]] * 3 + [[1, np.nan]])
    path = write(tmp_path / "a.csv", ["made by x", "a,b", "1,2", "1,2", "1,2", "1,2,3,4"])
    with pytest.raises(RecordingError, match=r"a\.csv: Expected 2 fields in line 6, saw 4; give every row as many"):
        read_columns(path, layout_of(path), ["a", "b"])


def table_of(values):
    table = pd.DataFrame({"c": values}, index=pd.RangeIndex(5, 5 + len(values), name="line"))
    table.attrs["file"] = "a.csv"
    return table


def test_numbers_among_texts():
    problems = []
    np.testing.assert_array_equal(numbers(table_of(["1,5", " 2,5", None]), "c", problems), [1.5, 2.5, np.nan])
    assert problems == []
    np.testing.assert_array_equal(numbers(table_of(["1.5", "off", "2"]), "c", problems), [1.5, np.nan, 2])
    assert problems == ["a.csv, line 6, column c: 'off' is not a number; cells like it: 1 of 3, kept as missing"]
    with pytest.raises(RecordingError, match="nor is any other in it"):
        numbers(table_of(["on", "off"]), "c", problems)


@pytest.mark.parametrize(
    "form",
    [
        "%H:%M:%S.%f",
        "%H:%M:%S,%f",
        "%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%dT%H:%M:%S.%f+01:00",
        "%d-%b-%Y %H:%M:%S.%f",
        "%d/%m/%Y %H:%M:%S.%f",
        "%d.%m.%Y %H:%M:%S.%f",
        "%m/%d/%Y %H:%M:%S.%f",
    ],
)
def test_clock_times_that_pass_midnight(form):
    steps = np.arange(0, 12, 0.25)
    values = [(pd.Timestamp("2025-11-24 23:59:55") + pd.Timedelta(seconds=s)).strftime(form) for s in steps]
    t = seconds(table_of(values), "c", 1.0, [])
    np.testing.assert_allclose(t - t[0], steps, atol=1e-6)


def test_other_times():
    t = seconds(table_of(["2018-04-04 21:39:36:123", None, "2018-04-04 21:39:36:623"]), "c", 1.0, [])
    assert t[2] - t[0] == pytest.approx(0.5, abs=1e-6) and np.isnan(t[1])
    np.testing.assert_allclose(seconds(table_of([1000, 2000]), "c", 1e-3, []), [1, 2])
    with pytest.raises(RecordingError, match=r"line 5, column c: 'soon' is not a time that is understood"):
        seconds(table_of(["soon", "later"]), "c", 1.0, [])
