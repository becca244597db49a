"""CSV files of the phone app AndroSensor: one table, its receiver's values repeated in every row until the next fix."""

import dataclasses
import re
from pathlib import Path

from altijax.formats.mixed_tables import known_streams
from altijax.formats.phones import AXES
from altijax.formats.tables import Log
from altijax.formats.text_tables import needed_layout, table_names

_COLUMNS = {
    "t": r"time since start.*",
    "ax": r"accelerometer x.*",
    "ay": r"accelerometer y.*",
    "az": r"accelerometer z.*",
    "gx": r"gyroscope (x|pitch).*",
    "gy": r"gyroscope (y|roll).*",
    "gz": r"gyroscope (z|yaw).*",
    "gnss.speed": r"(location|gps) speed.*",
    "gnss.course": r"(location|gps) orientation.*",
    "gnss.lat": r"(location|gps) latitude.*",
    "gnss.lon": r"(location|gps) longitude.*",
    "gnss.alt": r"(location|gps) altitude (?!.*google).*",
}


def reads(path: Path) -> bool:
    """Whether a path is a text file with the app's names of times and of the accelerometer."""
    return path.is_file() and {"t", "ax", "ay", "az"} <= set(_mapping(table_names(path)))


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a file."""
    columns = _mapping(table_names(path))
    layout = needed_layout(path)
    layout = dataclasses.replace(layout, units=layout.units | {columns["t"]: "ms"})
    tables, sheet = known_streams(path, layout, columns, problems, notes)
    if {"lat", "lon"} <= set(tables.get("gnss", ())):
        nowhere = (tables["gnss"][["lat", "lon"]] == 0).all(axis=1)
        if nowhere.any():
            notes.append(f"{path.name}: {nowhere.sum()} rows at latitude and longitude 0, from before a fix, dropped")
            tables["gnss"] = tables["gnss"][~nowhere]
    notes.append(
        f"{path.name}: AndroSensor does not say how the phone was mounted; axes are {AXES}, flat with its top forward, "
        "unless axes= says otherwise"
    )
    return tables, sheet | {"description": "AndroSensor file", "axes": AXES}


def _mapping(names: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for ours, pattern in _COLUMNS.items():
        theirs = [name for name in names if re.fullmatch(pattern, name.strip(), re.IGNORECASE)]
        if theirs:
            found[ours] = theirs[0]
    return found
