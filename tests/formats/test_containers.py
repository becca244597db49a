"""Zips and workbooks: what they hold is read as if it had been unpacked, and what would do harm is refused."""

import zipfile

import pytest

from altijax.formats import containers
from altijax.formats.containers import only_file, unpacked
from altijax.recordings import RecordingError, RecordingWarning, read_recording

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
    many = zipped(tmp_path / "many.zip", {f"{k}.csv": "" for k in range(containers.MOST_MEMBERS + 1)})
    with pytest.raises(RecordingError, match="it holds 10001 files"):
        read_recording(many)
    monkeypatch.setattr(containers, "MOST_BYTES", 1_000_000)
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


def workbook(path, sheets):
    """A workbook of sheets by name, their rows of numbers and texts."""
    kinds = 'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml'
    parts, relations, listed = "", "", ""
    members = {}
    for k, (name, rows) in enumerate(sheets.items(), 1):
        cells = ""
        for row in rows:
            cells += "<row>"
            for value in row:
                text = f'<c t="inlineStr"><is><t>{value}</t></is></c>'
                cells += text if isinstance(value, str) else f"<c><v>{value!r}</v></c>"
            cells += "</row>"
        space = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
        members[f"xl/worksheets/sheet{k}.xml"] = f"<worksheet {space}><sheetData>{cells}</sheetData></worksheet>"
        parts += f'<Override PartName="/xl/worksheets/sheet{k}.xml" {kinds}.worksheet+xml"/>'
        office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
        relations += f'<Relationship Id="r{k}" Type="{office}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        listed += f'<sheet name="{name}" sheetId="{k}" r:id="r{k}"/>'
    package = 'xmlns="http://schemas.openxmlformats.org/package/2006'
    members |= {
        "[Content_Types].xml": f'<Types {package}/content-types">'
        f'<Default Extension="xml" ContentType="application/xml"/>'
        f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" {kinds}.sheet.main+xml"/>{parts}</Types>',
        "_rels/.rels": f'<Relationships {package}/relationships"><Relationship Id="r1" Type="{office}/officeDocument" '
        'Target="xl/workbook.xml"/></Relationships>',
        "xl/_rels/workbook.xml.rels": f'<Relationships {package}/relationships">{relations}</Relationships>',
        "xl/workbook.xml": f'<workbook {space} xmlns:r="{office}"><sheets>{listed}</sheets></workbook>',
    }
    return zipped(path, members)


def test_a_workbook_is_read_by_its_sheets(tmp_path):
    rows = [[0.01 * k, 0.1, 0.2, 9.8] for k in range(50)]
    pytest.importorskip("python_calamine")
    phyphox = [["Time (s)", *(f"Acceleration {axis} (m/s^2)" for axis in "xyz")], *rows]
    location = [["Time (s)", "Velocity (m/s)", "Direction (°)"], *([float(k) / 10, 3.0, 90.0] for k in range(5))]
    with pytest.warns(RecordingWarning, match="there is no gyro"):
        r = read_recording(workbook(tmp_path / "a.xlsx", {"Accelerometer": phyphox, "Location": location}))
    assert (r.name, len(r.imu), len(r.gnss)) == ("a", 50, 5)
    table = [["made by hand"], ["time", "x", "y", "z"], *rows]
    columns = {"t": "time", "ax": "x", "ay": "y", "az": "z"}
    assert len(read_recording(workbook(tmp_path / "b.xlsx", {"Sheet 1": table}), columns=columns).imu) == 50


def test_a_workbook_that_is_none(tmp_path):
    (tmp_path / "a.xls").write_bytes(bytes.fromhex("d0cf11e0a1b11ae1") + b"0" * 1000)
    with pytest.raises(RecordingError, match=r"a.xls: not a workbook that can be read .* save its sheet as CSV"):
        read_recording(tmp_path / "a.xls")
    (tmp_path / "b.xlsx").write_bytes(zipped(tmp_path / "c", {"xl/workbook.xml": "<nothing/>"}).read_bytes())
    with pytest.raises(RecordingError, match=r"b.xlsx"):
        read_recording(tmp_path / "b.xlsx")
