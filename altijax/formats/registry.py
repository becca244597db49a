"""The formats that `read_recording` knows, and how to add one's own.

A format is a pair of functions in a file of its own: ``reads(path)`` says by the content whether a file or folder is of
this format, ``read(path, problems, notes)`` makes tables of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from altijax.formats import (
    aim,
    androsensor,
    comma2k19,
    dataflash,
    gopro,
    kitti,
    mdf,
    mixed_tables,
    nmea,
    phyphox,
    racechrono,
    ros,
    rtklib,
    sensor_logger,
    tidy_folder,
    ublox,
    ulog,
    vbo,
)
from altijax.formats.quantities import COLUMNS
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log
from altijax.formats.text_tables import table_names


@dataclass(frozen=True)
class Format:
    """One format of recordings.

    Attributes
    ----------
    name : str
        What it is called in messages, with what tells it from others.
    reads : callable
        Whether a file or folder is of this format.
    read : callable
        Its streams and sheet.
    fixes_units : bool
        Whether the format itself says its units, so that there is nothing to state.
    """

    name: str
    reads: Callable[[Path], bool]
    read: Callable[[Path, list[str], list[str]], Log]
    fixes_units: bool = True


# One line a format; what a folder or file is must be told apart by `reads`, the order only settles mixtures.
FORMATS = [
    Format(
        "a folder with imu.csv (and recording.toml, wheel.csv, gnss.csv, reference.csv)",
        tidy_folder.reads,
        tidy_folder.read,
        fixes_units=False,
    ),
    Format("a text table with columns t, ax, ay, az (.csv)", mixed_tables.reads, mixed_tables.read, fixes_units=False),
    Format("a comma2k19 segment (a folder with processed_log)", comma2k19.reads, comma2k19.read),
    Format("a PX4 ULog (.ulg)", ulog.reads, ulog.read),
    Format("a u-blox log (.ubx)", ublox.reads, ublox.read),
    Format("an ArduPilot log (.bin)", dataflash.reads, dataflash.read),
    Format("a GoPro video (.mp4)", gopro.reads, gopro.read),
    Format("a ROS bag (.bag, .mcap, .db3, or a folder with metadata.yaml)", ros.reads, ros.read, fixes_units=False),
    Format("an MDF file (.mf4, .mdf)", mdf.reads, mdf.read, fixes_units=False),
    Format("a KITTI drive (a folder with oxts)", kitti.reads, kitti.read),
    Format("an export of Sensor Logger", sensor_logger.reads, sensor_logger.read, fixes_units=False),
    Format("of phyphox", phyphox.reads, phyphox.read, fixes_units=False),
    Format("of AndroSensor (.csv)", androsensor.reads, androsensor.read, fixes_units=False),
    Format("of RaceChrono (.csv)", racechrono.reads, racechrono.read, fixes_units=False),
    Format("of AiM Race Studio (.csv)", aim.reads, aim.read, fixes_units=False),
    Format("a Racelogic file (.vbo)", vbo.reads, vbo.read, fixes_units=False),
    Format("an RTKLIB solution (.pos)", rtklib.reads, rtklib.read),
    Format("an NMEA log (.nmea)", nmea.reads, nmea.read),
]


def register_format(
    name: str, reads: Callable[[Path], bool], read: Callable[[Path, list[str], list[str]], Log]
) -> None:
    """Let `read_recording` read a format of one's own.

    Parameters
    ----------
    name : str
        What messages call it, say "a Foo log (.foo)". A name that is there already is replaced.
    reads : callable
        ``reads(path) -> bool``: whether a file or folder (Path) is of this format, from its first bytes or lines. Asked
        before the formats that come with the package, the last registered first.
    read : callable
        ``read(path, problems, notes) -> (tables, sheet)``. `tables` is a dict of DataFrames, "imu", "wheel", "gnss" or
        "reference", with the columns of a tidy folder (see `read_recording`) in SI units and sensor axes, and ``t`` in
        s. `sheet` is a dict of what a recording.toml would say: name, description, axes. To `problems` it appends a
        sentence for whatever was left out (each becomes a warning), to `notes` what is only worth knowing.

    Raises
    ------
    ValueError
        If `reads` or `read` cannot be called.

    Examples
    --------
    >>> import pandas as pd
    >>> def reads(path):
    ...     return path.is_file() and path.read_bytes()[:4] == b"FOO1"
    >>> def read(path, problems, notes):
    ...     rows = pd.read_csv(path, skiprows=1, names=["t", "ax", "ay", "az"])
    ...     notes.append(f"{path.name}: milliseconds became seconds")
    ...     return {"imu": rows.assign(t=rows["t"] / 1000)}, {"name": path.stem, "axes": "FRD"}
    >>> register_format("a Foo log (.foo)", reads, read)
    """
    for argument, function in (("reads", reads), ("read", read)):
        if not callable(function):
            raise ValueError(f"{argument} must be a function of a path, got {function!r}")
    FORMATS[:] = [Format(name, reads, read), *(known for known in FORMATS if known.name != name)]


def format_of(path: Path) -> tuple[Format, Path]:
    """The format of a file or folder, and what to read by it: a folder of one file only may stand for that file.

    Raises for what is missing or of no format.
    """
    if not path.exists():
        raise FileNotFoundError(f"there is no file or folder {path}")
    inside = sorted(path.iterdir()) if path.is_dir() else []
    for place in [path, *(inside if len(inside) == 1 else [])]:
        for known in FORMATS:
            if known.reads(place):
                return known, place
    found = "a file" if path.is_file() else ", ".join(file.name for file in inside) or "an empty folder"
    raise RecordingError(
        f"{path} is not a recording: expected {', '.join(known.name for known in FORMATS)}; found {found}{_told(path)}"
    )


def _told(path: Path) -> str:
    """What helps further with a file that no format reads: its columns, where it is a table."""
    if not path.is_file():
        return ""
    names = table_names(path)
    if names:
        return (
            f" with the columns {', '.join(map(repr, names))}; say what they are: read_recording(path, "
            "columns={'t': ..., 'ax': ..., 'ay': ..., 'az': ...})"
        )
    return (
        "; a table of text, in whatever columns, is read with columns={'t': ..., 'ax': ...}, and a format of your own "
        "once register_format knows it"
    )


def described(tables: dict[str, pd.DataFrame], path: Path, problems: list[str]) -> dict[str, pd.DataFrame]:
    """Tables as `stream_checks` wants them: known columns, rows that are counted, and the file's name."""
    unknown = [stream for stream in tables if stream not in COLUMNS]
    if unknown:
        raise ValueError(
            f"the format of {path.name} gave the streams {', '.join(unknown)}; known are {', '.join(COLUMNS)}"
        )
    described = {}
    for stream, table in tables.items():
        file = table.attrs.get("file", f"{path.name}, {stream}")
        others = [str(column) for column in table.columns if column not in COLUMNS[stream]]
        if others:
            problems.append(f"{file}: columns {', '.join(others)} ignored; known are {', '.join(COLUMNS[stream])}")
        table = table[[column for column in COLUMNS[stream] if column in table.columns]]
        if table.index.name is None:
            table = table.set_axis(pd.RangeIndex(1, 1 + len(table), name="row"))
        table.attrs["file"] = file
        described[stream] = table
    return described
