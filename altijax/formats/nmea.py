"""NMEA 0183 logs of receivers, one sentence a line, other lines among them.

Velocity is RMC's, else VTG's; height is GGA's. GST tells deviations of positions, for which a recording has no column.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from altijax.constants import KNOT
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import (
    Log,
    first_bytes,
    from_first_imu_sample,
    import_extra,
    stream_table,
    with_known_velocity,
)

_SENTENCE = re.compile(rb"\$[A-Z]{2}(RMC|VTG|GGA),[^$\r\n]*")
_COLUMNS = ("speed", "course", "lat", "lon", "alt")
_DAY = 86400.0


def reads(path: Path) -> bool:
    """Whether a path is a text file with sentences of time or velocity."""
    content = first_bytes(path) if path.is_file() else b""
    return b"\0" not in content and _SENTENCE.search(content) is not None


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a log: gnss alone."""
    epochs: dict[float, dict[str, float]] = {}
    lost = dict.fromkeys(("damaged", "without a fix", "by dead reckoning"), 0)
    clock, now, has_rmc = 0.0, None, b"RMC," in first_bytes(path)
    for message in _sentences(path, import_extra("pynmeagps", path), lost):
        if message.msgID != "VTG":
            if not message.time:
                lost["without a fix"] += 1
                continue
            at = message.time
            of_day = at.hour * 3600 + at.minute * 60 + at.second + at.microsecond * 1e-6
            # The date is in RMC alone; a clock that goes back by half a day has passed midnight.
            clock = of_day if now is None else clock + (of_day - clock + _DAY / 2) % _DAY - _DAY / 2
            now = round(clock, 4)
        if now is None or not _fixed(message, lost):
            continue
        if message.msgID == "VTG" and has_rmc:
            continue
        epochs.setdefault(now, {}).update(_values(message))
    for reason, count in lost.items():
        if count:
            notes.append(f"{path.name}: {count} sentences {reason} left out")
    rows = {t: epoch for t, epoch in sorted(epochs.items()) if "speed" in epoch}
    if not rows:
        raise RecordingError(
            f"{path.name}: no RMC or VTG sentence in it has a velocity; let the receiver send RMC, and log again under "
            "an open sky"
        )
    values = np.array([[epoch.get(name, np.nan) for name in _COLUMNS] for epoch in rows.values()], float)
    table = stream_table(np.array(list(rows)), values, _COLUMNS, f"{path.name} {'RMC' if has_rmc else 'VTG'}")
    problems.append(f"{path.name}: there is no IMU in it")
    tables = from_first_imu_sample({"gnss": with_known_velocity(table, notes)})
    if tables["gnss"].empty:
        raise RecordingError(f"{path.name}: no sentence in it has both speed and course; log again while moving")
    return tables, {"name": path.stem, "description": "NMEA log"}


def _sentences(path: Path, pynmeagps: Any, lost: dict[str, int]) -> Iterator[Any]:
    for line in path.read_bytes().split(b"\n"):
        found = _SENTENCE.search(line)
        if found is None:
            continue
        try:
            message = pynmeagps.NMEAReader.parse(found[0].rstrip() + b"\r\n")
        except (pynmeagps.NMEAParseError, pynmeagps.NMEAMessageError, pynmeagps.NMEATypeError, ValueError):
            message = None
        if message is None:
            lost["damaged"] += 1
        else:
            yield message


def _fixed(message: Any, lost: dict[str, int]) -> bool:
    mode = getattr(message, "posMode", "A")
    reason = None
    if mode == "E" or getattr(message, "quality", None) == 6:
        reason = "by dead reckoning"
    elif getattr(message, "status", "A") != "A" or mode == "N" or getattr(message, "quality", None) == 0:
        reason = "without a fix"
    if reason:
        lost[reason] += 1
    return reason is None


def _values(message: Any) -> dict[str, float]:
    if message.msgID == "GGA":
        values = {"lat": message.lat, "lon": message.lon, "alt": message.alt}
    elif message.msgID == "RMC":
        values = {"speed": _knots(message.spd), "course": message.cog, "lat": message.lat, "lon": message.lon}
    else:
        values = {"speed": _knots(message.sogn), "course": message.cogt}
    return {name: value for name, value in values.items() if isinstance(value, float | int)}


def _knots(value: Any) -> Any:
    return value * KNOT if isinstance(value, float | int) else value
