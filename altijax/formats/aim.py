"""CSV exports of AiM's Race Studio: one table at one rate, into which the receiver's values are interpolated."""

from pathlib import Path

from altijax.formats.mixed_tables import known_streams
from altijax.formats.tables import Log, first_bytes
from altijax.formats.text_tables import needed_layout

_COLUMNS = {
    "t": "Time",
    "ax": "InlineAcc",
    "ay": "LateralAcc",
    "az": "VerticalAcc",
    "gx": "RollRate",
    "gy": "PitchRate",
    "gz": "YawRate",
    "gnss.speed": "GPS Speed",
    "gnss.course": "GPS Heading",
    "gnss.lat": "GPS Latitude",
    "gnss.lon": "GPS Longitude",
    "gnss.alt": "GPS Altitude",
    "gnss.sd_e": "GPS SpdAccuracy",
    "gnss.sd_n": "GPS SpdAccuracy",
}


def reads(path: Path) -> bool:
    """Whether a path is a file whose first line names the format."""
    return path.is_file() and b"AiM CSV File" in first_bytes(path).partition(b"\n")[0]


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an export."""
    layout = needed_layout(path)
    columns = {ours: theirs for ours, theirs in _COLUMNS.items() if theirs in layout.names}
    if not {"ax", "ay", "az"} <= columns.keys():
        problems.append(
            f"{path.name}: InlineAcc, LateralAcc and VerticalAcc are not all in it, so there is no IMU; export them too"
        )
        columns = {ours: theirs for ours, theirs in columns.items() if ours == "t" or ours.startswith("gnss.")}
    notes.append(f"{path.name}: Race Studio interpolates the receiver's values to the rate of the export")
    tables, sheet = known_streams(path, layout, columns, problems, notes)
    return tables, sheet | {"description": "AiM Race Studio export"}
