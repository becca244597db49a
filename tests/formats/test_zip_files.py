"""Zips: what they hold is read as if it had been unpacked, and what would do harm is refused."""

import zipfile

import pytest

from altijax.formats import zip_files
from altijax.formats.zip_files import only_file, unpacked
from altijax.recordings import RecordingError, read_recording

IMU = "t,ax,ay,az\n0,0,0,9.8\n0.01,0,0,9.8\n0.02,0,0,9.8\n"


def zipped(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def test_a_zip_is_read_like_the_folder_in_it(tmp_path):
    members = {"drive/imu.csv": IMU, "drive/recording.toml": 'axes = "FLU"', "__MACOSX/drive/._imu.csv": "x"}
    r = read_recording(zipped(tmp_path / "mine.zip", members))
    assert (r.name, len(r.imu)) == ("drive", 3) and r.source.endswith("mine.zip")
    assert read_recording(zipped(tmp_path / "flat.zip", {"imu.csv": IMU, "b.txt": ""})).name == "flat"


def test_the_folder_is_gone_afterwards_and_other_files_stay_as_they_are(tmp_path):
    with unpacked(zipped(tmp_path / "a.zip", {"x.txt": "x"})) as place:
        assert (place / "x.txt").read_text() == "x"
    assert not place.exists()
    with unpacked(tmp_path) as place:
        assert place == tmp_path


@pytest.mark.parametrize("name", ["../out.csv", "/out.csv", "a/../../out.csv", "..\\out.csv", "C:out.csv"])
def test_nothing_is_written_outside(name, tmp_path):
    path = zipped(tmp_path / "a.zip", {"imu.csv": IMU, name: "x"})
    with pytest.raises(RecordingError, match="points outside of it"), unpacked(path):
        pass
    assert list(tmp_path.rglob("out.csv")) == []


def test_too_many_members_and_too_many_bytes(tmp_path, monkeypatch):
    many = zipped(tmp_path / "many.zip", {f"{k}.csv": "" for k in range(zip_files.MOST_MEMBERS + 1)})
    with pytest.raises(RecordingError, match="it holds 10001 files"):
        read_recording(many)
    monkeypatch.setattr(zip_files, "MOST_BYTES", 1_000_000)
    with pytest.raises(RecordingError, match=r"of 0.00101 GB unpacked, more than the 10000 files or 0.001 GB"):
        read_recording(zipped(tmp_path / "big.zip", {"imu.csv": "0" * 1_010_000}))


def test_a_damaged_zip_and_an_empty_one(tmp_path):
    path = zipped(tmp_path / "a.zip", {"imu.csv": IMU * 100})
    content = bytearray(path.read_bytes())
    content[60] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="it cannot be unpacked"):
        read_recording(path)
    with pytest.raises(RecordingError, match="found an empty folder"):
        read_recording(zipped(tmp_path / "empty.zip", {}))


def test_the_only_file_of_a_place(tmp_path):
    (tmp_path / "a.csv").write_text("")
    assert only_file(tmp_path) == only_file(tmp_path / "a.csv") == tmp_path / "a.csv"
    (tmp_path / "b.csv").write_text("")
    with pytest.raises(ValueError, match=r"holds a.csv, b.csv: give the path of one file"):
        only_file(tmp_path)
