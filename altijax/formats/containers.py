"""Zips and workbooks, unpacked into a folder that lasts as long as it is read."""

import csv
import re
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import first_bytes, import_extra

MOST_MEMBERS = 10_000
"""Files in one zip: ten times the longest comma2k19 drive or phone export; more is not a recording."""

MOST_BYTES = 10_000_000_000
"""Bytes unpacked: a day of ten sensors at 100 Hz as text; more than that would fill disks unasked."""


_XLS = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
"""First bytes of Excel's older files."""


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """A folder with what a zip or workbook holds, the innermost where folders hold one folder; other paths as they are.

    A workbook gives a CSV file a sheet. Links and other special members of a zip become plain files, and all of them
    lie below that folder.
    """
    kind = _kind(path)
    if kind is None:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="altijax-") as folder:
        place = Path(folder) / path.stem
        place.mkdir()
        if kind == "workbook":
            _write_sheets(path, place)
        else:
            _unpack(path, place)
        while len(found := list(place.iterdir())) == 1 and found[0].is_dir():
            place = found[0]
        yield place


def _kind(path: Path) -> str | None:
    if not path.is_file():
        return None
    if first_bytes(path, 8) == _XLS:
        return "workbook"
    if not zipfile.is_zipfile(path):
        return None
    try:
        with zipfile.ZipFile(path) as archive:
            return "workbook" if "xl/workbook.xml" in archive.namelist() else "zip"
    except zipfile.BadZipFile:
        return "zip"


def _write_sheets(path: Path, place: Path) -> None:
    calamine = import_extra("python_calamine", path)
    try:
        book = calamine.CalamineWorkbook.from_path(path)
        for name in book.sheet_names:
            rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            with (place / f"{re.sub(r'[^0-9A-Za-z _-]', '_', name)}.csv").open(
                "w", newline="", encoding="utf-8"
            ) as file:
                csv.writer(file).writerows(rows)
    except calamine.CalamineError as error:
        raise RecordingError(
            f"{path.name}: not a workbook that can be read ({error}); save its sheet as CSV and give that"
        ) from error


def _unpack(path: Path, place: Path) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            _extract(archive, path, place)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, zlib.error) as error:
        raise RecordingError(
            f"{path.name}: it cannot be unpacked ({error}); copy it again from its source, or unpack it yourself "
            "and give the folder"
        ) from error


def _extract(archive: zipfile.ZipFile, path: Path, place: Path) -> None:
    members = [member for member in archive.infolist() if not member.is_dir()]
    size = sum(member.file_size for member in members)
    if len(members) > MOST_MEMBERS or size > MOST_BYTES:
        raise RecordingError(
            f"{path.name}: it holds {len(members)} files of {size / 1e9:.3g} GB unpacked, more than the "
            f"{MOST_MEMBERS} files or {MOST_BYTES / 1e9:g} GB that are unpacked unasked; unpack what belongs to the "
            "recording yourself and give the folder"
        )
    for member in members:
        name = PurePosixPath(member.filename)
        # What macOS adds beside each file is none of the recording.
        if name.parts[0] == "__MACOSX" or name.name == ".DS_Store":
            continue
        target = place.joinpath(*name.parts)
        if name.is_absolute() or ".." in name.parts or "\\" in member.filename or ":" in member.filename:
            raise RecordingError(
                f"{path.name}: its member {member.filename!r} points outside of it; such a zip is not unpacked"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        # A member ends at the size that was added up above, whatever its content claims.
        with archive.open(member) as source, target.open("wb") as copy:
            shutil.copyfileobj(source, copy)


def only_file(place: Path) -> Path:
    """The file that a path is, or the only one in the folder that it is."""
    if not place.exists():
        raise FileNotFoundError(f"there is no file or folder {place}")
    files = [place] if place.is_file() else sorted(file for file in place.iterdir() if file.is_file())
    if len(files) != 1:
        raise ValueError(
            f"columns is for one table; {place.name} holds {', '.join(file.name for file in files) or 'none'}: give "
            "the path of one file"
        )
    return files[0]
