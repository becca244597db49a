"""Recordings made of tables in memory, and estimates written as tables and tracks."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.quantities import check_units
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import import_extra
from altijax.formats.tidy_folder import check_sheet, known_columns
from altijax.formats.tidy_writer import write_table
from altijax.recordings import Recording, recording_of, tell

_POSITION = ["lat", "lon", "height"]
_ENDINGS = (".csv", ".csv.gz", ".parquet", ".gpx", ".kml")


def recording_from_tables(
    name: str,
    *,
    imu: pd.DataFrame,
    wheel: pd.DataFrame | None = None,
    gnss: pd.DataFrame | None = None,
    reference: pd.DataFrame | None = None,
    axes: str = "FLU",
    units: Mapping[str, str] | None = None,
    site: Mapping[str, float] | None = None,
) -> Recording:
    """A recording of tables in memory, checked like one that is read.

    Parameters
    ----------
    name : str
        What the recording is called.
    imu, wheel, gnss, reference : DataFrame
        The streams, with the columns of a tidy folder (see `read_recording`) and the time as a column or index ``t``.
        All but the first are optional. They are left as they are.
    axes : str, optional
        Where the sensor's x, y and z point: F or B, L or R, U or D.
    units : mapping of str to str, optional
        Units by quantity where they are not SI, as in `read_recording`.
    site : mapping of str to float, optional
        ``latitude`` in deg and ``height`` in m, for gravity where gnss has no position.

    Returns
    -------
    recording : Recording
        Streams in SI units and body axes; `Recording.save` writes it.

    Raises
    ------
    RecordingError
        If a table cannot be right; it names table, row (counted from 0), column, what was seen and the fix.
    ValueError
        If `axes` or `units` is not valid.
    """
    units = dict(units or {})
    check_units(units)
    problems: list[str] = []
    sheet = {"name": name, "site": dict(site or {})}
    check_sheet(sheet, "site" if site else "name", problems)
    given = {"imu": imu, "wheel": wheel, "gnss": gnss, "reference": reference}
    tables = {stream: _stream(table, stream, problems) for stream, table in given.items() if table is not None}
    recording, problems = recording_of(tables, sheet, problems, [], axes=axes, given=units)
    tell(problems)
    return recording


def save_estimate(estimate: pd.DataFrame, path: str | Path) -> None:
    """Write an estimate, or any other table indexed by time, to a file.

    Parameters
    ----------
    estimate : DataFrame
        What a verb returned. Its ``attrs`` are not written.
    path : path
        File to write; one that exists is replaced. Its ending chooses the form: ``.csv``, ``.csv.gz`` and ``.parquet``
        hold every column, ``.gpx`` and ``.kml`` the track: the rows that are valid and have lat, lon (deg) and height
        (m), in a piece of its own wherever rows between are not so.

    Raises
    ------
    ValueError
        If the ending is none of these, or there is no position to draw.
    """
    path = Path(path)
    ending = next((ending for ending in _ENDINGS if path.name.lower().endswith(ending)), None)
    if ending is None:
        raise ValueError(f"{path.name}: the ending must be one of {', '.join(_ENDINGS)}")
    if ending == ".gpx":
        _write_gpx(_track(estimate, path), path)
    elif ending == ".kml":
        _write_kml(_track(estimate, path), path)
    else:
        write_table(estimate, path)


def _stream(table: pd.DataFrame, stream: str, problems: list[str]) -> pd.DataFrame:
    file = f"table {stream}"
    if not isinstance(table, pd.DataFrame):
        raise ValueError(
            f"{stream} must be a DataFrame, got {type(table).__name__}; make one by pd.DataFrame({stream})"
        )
    if table.index.name == "t" and "t" not in table.columns:
        table = table.reset_index()
    if not table.columns.is_unique:
        twice = ", ".join(map(str, table.columns[table.columns.duplicated()]))
        raise RecordingError(f"{file}: there are several columns {twice}; keep one of each name")
    if "t" not in table.columns:
        seen = ", ".join(map(str, table.columns)) or "nothing"
        raise RecordingError(
            f"{file}: there is no column or index t, in s, among {seen}; rename yours: "
            f"{stream}={stream}.rename(columns={{'time': 't'}}) or {stream}={stream}.rename_axis('t')"
        )
    if not len(table):
        raise RecordingError(f"{file}: has no rows; leave the table out")
    if table["t"].dtype.kind in "mM":
        raise RecordingError(
            f"{file}, column t: holds {table['t'].dtype}, not s; write {stream}.assign(t=({stream}['t'] - "
            "start).dt.total_seconds()) with the same start for every table"
        )
    return known_columns(table.set_axis(pd.RangeIndex(len(table), name="row")), file, stream, problems)


def _track(estimate: pd.DataFrame, path: Path) -> list[np.ndarray]:
    """Pieces (rows, 3) of latitude, longitude and height without a break in their support."""
    missing = [name for name in _POSITION if name not in estimate.columns]
    if missing:
        raise ValueError(
            f"{path.name}: a track needs the columns {', '.join(_POSITION)}, and {', '.join(missing)} of them are not "
            "among those of this estimate; estimate_drive(recording) gives them where gnss has lat and lon"
        )
    points = estimate[_POSITION].to_numpy(float)
    usable = np.isfinite(points).all(1)
    if not usable.any():
        raise ValueError(
            f"{path.name}: no row has a position, as from a recording without gnss or whose gnss has no lat, lon; "
            "read one that has them, or save the estimate as .csv"
        )
    if "valid" in estimate.columns:
        usable &= estimate["valid"].to_numpy(bool)
    breaks = np.flatnonzero(np.diff(usable)) + 1
    pieces = np.split(points, breaks)[0 if usable[0] else 1 :: 2]
    if not pieces:
        raise ValueError(f"{path.name}: no row with a position is valid; save the estimate as .csv to look at them")
    return pieces


def _write_gpx(pieces: list[np.ndarray], path: Path) -> None:
    gpx = import_extra("gpxpy.gpx", path, doing="writing", extra="export")
    segments = [
        gpx.GPXTrackSegment([gpx.GPXTrackPoint(lat, lon, elevation=height) for lat, lon, height in piece.tolist()])
        for piece in pieces
    ]
    document, track = gpx.GPX(), gpx.GPXTrack(path.stem)
    track.segments.extend(segments)
    document.tracks.append(track)
    path.write_text(document.to_xml(), encoding="utf-8")


def _write_kml(pieces: list[np.ndarray], path: Path) -> None:
    kml = import_extra("simplekml", path, doing="writing", extra="export")
    document = kml.Kml(name=path.stem)
    for piece in pieces:
        coordinates = [(lon, lat, height) for lat, lon, height in piece.tolist()]
        document.newlinestring(name=path.stem, coords=coordinates, altitudemode=kml.AltitudeMode.absolute)
    document.save(path)
