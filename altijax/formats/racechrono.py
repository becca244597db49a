"""CSV exports of the app RaceChrono, formats 2 and 3: one table of its receiver, phone and OBD adapter."""

import re
from pathlib import Path

from altijax.formats.mixed_tables import known_streams
from altijax.formats.tables import Log, first_bytes
from altijax.formats.text_tables import Layout, needed_layout

_COLUMNS = {
    "t": r"timestamp|time",
    "ax": r"x_acc(eleration)?",
    "ay": r"y_acc(eleration)?",
    "az": r"z_acc(eleration)?",
    "gx": r"x_rate_of_rotation",
    "gy": r"y_rate_of_rotation",
    "gz": r"z_rate_of_rotation",
    "gnss.speed": r"speed gps",
    "gnss.course": r"bearing",
    "gnss.lat": r"latitude",
    "gnss.lon": r"longitude",
    "gnss.alt": r"altitude",
    "wheel.speed": r"speed (obd|canbus)",
}


def reads(path: Path) -> bool:
    """Whether a path is a file whose first line says that the app made it."""
    return path.is_file() and b"created using RaceChrono" in first_bytes(path)[:200]


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an export; what the app calculates itself is not read."""
    layout = needed_layout(path)
    columns = _mapping(layout)
    if "t" not in columns:
        columns["t"] = layout.names[0]
    if "ax" not in columns:
        problems.append(
            f"{path.name}: there is no accelerometer in it; let RaceChrono use the phone's and export again"
        )
    tables, sheet = known_streams(path, layout, columns, problems, notes)
    return tables, sheet | {"description": "RaceChrono export"}


def _mapping(layout: Layout) -> dict[str, str]:
    """Their columns by ours. A name is followed by its source where several sources have it."""
    described = {}
    for name in layout.names:
        source = layout.sources.get(name, "") or (re.search(r"\*\s*(\w+)", name) or [""])[0]
        plain = re.sub(r"\s*(\*.*|\([^)]*\))", "", name).strip().lower().replace(" ", "_")
        described[name] = (plain, re.sub(r"[^a-z]", "", source.lower()))
    found = {}
    for ours, pattern in _COLUMNS.items():
        for name, (plain, source) in described.items():
            if (
                ours not in found
                and source != "calc"
                and (re.fullmatch(pattern, plain) or re.fullmatch(pattern, f"{plain} {source}"))
            ):
                found[ours] = name
    if "gnss.speed" not in found:
        speeds = [name for name, (plain, _) in described.items() if plain == "speed"]
        found |= {"gnss.speed": speeds[0]} if speeds and "gnss.course" in found else {}
    return found
