"""Which format reads what, and a format of one's own in twenty lines."""

import pandas as pd
import pytest

from altijax.formats import registry
from altijax.formats.registry import FORMATS, format_of, register_format
from altijax.recordings import RecordingError, RecordingWarning, read_recording


@pytest.fixture(autouse=True)
def formats_as_they_were(monkeypatch):
    monkeypatch.setattr(registry, "FORMATS", list(FORMATS))


def reads(path):
    return path.is_file() and path.read_bytes()[:4] == b"FOO1"


def read(path, problems, notes):
    rows = pd.read_csv(path, skiprows=1, names=["t", "ax", "ay", "az"])
    notes.append(f"{path.name}: milliseconds became seconds")
    return {"imu": rows.assign(t=rows["t"] / 1000)}, {"name": path.stem, "axes": "FRD"}


def test_a_format_of_ones_own(tmp_path):
    (tmp_path / "drive.bar").write_text("FOO1\n0,0.1,0.2,-9.8\n10,0.1,0.2,-9.8\n20,0.1,0.2,-9.8\n")
    with pytest.raises(RecordingError, match="is not a recording"):
        read_recording(tmp_path / "drive.bar")
    register_format("a Foo log (.foo)", reads, read)
    r = read_recording(tmp_path / "drive.bar")
    assert (r.name, r.axes, len(r.imu)) == ("drive", "FRD", 3)
    assert r.imu.index[-1] == 0.02 and r.imu["az"].iloc[0] == 9.8
    assert r.notes == ("drive.bar: milliseconds became seconds",)
    (tmp_path / "other.txt").write_text("nothing")
    with pytest.raises(RecordingError, match=r"expected a Foo log \(\.foo\), a folder with imu.csv"):
        read_recording(tmp_path / "other.txt")


def test_a_name_is_registered_once_and_the_last_is_asked_first(tmp_path):
    (tmp_path / "a").write_text("FOO1")
    register_format("one", reads, read)
    register_format("two", reads, read)
    assert format_of(tmp_path / "a")[0].name == "two"
    register_format("one", reads, read)
    assert format_of(tmp_path / "a")[0].name == "one"
    assert [known.name for known in registry.FORMATS].count("one") == 1


def test_what_cannot_be_called_is_no_format():
    with pytest.raises(ValueError, match="read must be a function"):
        register_format("one", reads, None)


def test_what_is_not_there_and_what_is_empty(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file or folder"):
        format_of(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match="found an empty folder"):
        format_of(tmp_path)


def test_a_folder_of_one_file_stands_for_it_and_columns_that_nobody_knows_are_said(tmp_path):
    (tmp_path / "drive.bar").write_text("FOO1\n0,0.1,0.2,-9.8\n10,0.1,0.2,-9.8\n20,0.1,0.2,-9.8\n")
    register_format("a Foo log (.foo)", reads, lambda *a: ({"imu": read(*a)[0]["imu"].assign(mood=1)}, {"axes": "FRD"}))
    with pytest.warns(RecordingWarning, match="drive.bar, imu: columns mood ignored; known are t, ax"):
        assert read_recording(tmp_path).imu.columns.tolist() == ["ax", "ay", "az"]
    register_format("a Foo log (.foo)", reads, lambda *a: ({"moods": pd.DataFrame()}, {}))
    with pytest.raises(ValueError, match="gave the streams moods; known are imu, wheel"):
        read_recording(tmp_path)
