"""Exports of the phone app phyphox: a folder, its zip, a workbook, or one of its CSV files.

Its signs are Android's on every phone. A sensor is told by the headers of its columns, in whatever language.
"""

import re
from pathlib import Path

import pandas as pd

from altijax.formats.phones import Series, location_table, phone_log, series
from altijax.formats.tables import Log
from altijax.formats.text_tables import table_names

_AXIS = re.compile(r"(?P<what>\S.*?)\s+(?P<axis>[xyz])\s+\((?P<unit>[^)]*)\)")
_FORCE, _RATE = ("m/s^2", "m/s²"), ("rad/s",)
_LOCATION = {
    "speed": "Velocity (m/s)",
    "course": "Direction (°)",
    "lat": "Latitude (°)",
    "lon": "Longitude (°)",
    "alt": "Height (m)",
}


def reads(path: Path) -> bool:
    """Whether a path is one of phyphox' CSV files or a folder with one."""
    return any(_triads(names) or _is_location(names) for names in _tables(path).values())


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an export; acceleration without gravity ("linear") is not used."""
    found: dict[str, Series] = {}
    linear, location = [], None
    for file, names in _tables(path).items():
        for (what, unit), columns in _triads(names).items():
            kind = "accelerometer" if unit in _FORCE else "gyro"
            if re.match(r"linear", what, re.IGNORECASE):
                linear.append(file.name)
            elif kind not in found and (values := series(file, columns, {}, problems, notes)):
                found[kind] = values
        if location is None and _is_location(names):
            location = _location(file, names, problems, notes)
    if linear and "accelerometer" not in found:
        problems.append(
            f"{path.name}: {linear[0]} holds acceleration without gravity and is left out; record phyphox' "
            "'Acceleration (with g)' too"
        )
    return phone_log(path, "phyphox", found.get("accelerometer"), found.get("gyro"), location, problems, notes)


def _tables(path: Path) -> dict[Path, tuple[str, ...]]:
    files = [path] if path.is_file() else sorted(path.glob("*.csv")) if path.is_dir() else []
    return {file: names for file in files if (names := table_names(file))}


def _triads(names: tuple[str, ...]) -> dict[tuple[str, str], dict[str, str]]:
    """Columns t, x, y, z of each vector in a table whose first column is a time in s, by what it is and its unit."""
    if not names[0].endswith("(s)"):
        return {}
    triads: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        match = _AXIS.fullmatch(name)
        if match and match["unit"] in _FORCE + _RATE:
            triads.setdefault((match["what"], match["unit"]), {"t": names[0]})[match["axis"]] = name
    return {key: columns for key, columns in triads.items() if len(columns) == 4}


def _is_location(names: tuple[str, ...]) -> bool:
    return names[0].endswith("(s)") and {_LOCATION["speed"], _LOCATION["course"]} <= set(names)


def _location(file: Path, names: tuple[str, ...], problems: list[str], notes: list[str]) -> pd.DataFrame | None:
    columns = {name: source for name, source in _LOCATION.items() if source in names}
    found = series(file, {"t": names[0]} | columns, {}, problems, notes)
    return location_table(found, list(columns), file.name, notes) if found else None
