"""Racelogic's .vbo files, as VBOX, RaceChrono and RaceBox write them.

Positions are in minutes of arc with West positive, speeds in km/h, times of day packed as HHMMSS.SS.
"""

import csv
import io
import re
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.constants import STANDARD_GRAVITY
from altijax.formats.stream_checks import SPEED_UNITS, RecordingError
from altijax.formats.tables import Log, first_bytes, from_first_imu_sample, imu_table, stream_table

_DAY = 86400.0
_LARGEST = 1e12
"""Beyond every number that such a file can hold, packed times included."""

_GNSS = {
    "speed": r"velocity",
    "course": r"heading",
    "climb": r"vert-?vel|vertical_velocity",
    "lat": r"lat|latitude",
    "lon": r"long|lng|lon|longitude",
    "alt": r"height",
}
_ACCELEROMETERS = (
    ("longacc", "latacc", "vertacc"),
    ("x_acc-acc", "y_acc-acc", "z_acc-acc"),
    ("x_accel", "y_accel", "z_accel"),
)
_GYROS = (
    ("x-rotation-gyroscope", "y-rotation-gyroscope", "z-rotation-gyroscope"),
    ("x_rate_of_rotation-gyro", "y_rate_of_rotation-gyro", "z_rate_of_rotation-gyro"),
    ("rollrate", "pitchrate", "yawrate"),
)
"""Names of three axes by program; VBOX' long and lat accelerations alone are those of its receiver."""


def reads(path: Path) -> bool:
    """Whether a path is a text file with the section that names the columns, or that of the data below a header."""
    content = first_bytes(path).lower() if path.is_file() else b""
    return b"[column names]" in content or (b"[header]" in content and b"[data]" in content)


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a file: gnss, and imu where three axes of an accelerometer are in it."""
    sections = _sections(path)
    names = " ".join(sections.get("column names", [])).lower().split()
    long_names = [name.lower() for name in sections.get("header", [])]
    if not names:
        names = [name.replace(" ", "_") for name in long_names]
    table = _rows(path, names, sections.get("data", []), problems)
    if "time" not in table or not len(table):
        raise RecordingError(f"{path.name}: has no rows with a time under [data]; save it again from its program")
    t = _seconds_of(table["time"].to_numpy())
    unlocked = (table["sats"] % 64 == 0).to_numpy() if "sats" in table else np.zeros(len(table), bool)
    if unlocked.any() and not unlocked.all():
        notes.append(f"{path.name}: {unlocked.sum()} rows without a satellite dropped from gnss")
    tables = _gnss(path, table, t, unlocked & ~unlocked.all(), dict(zip(names, long_names, strict=False)))
    f, w = _triad(table, _ACCELEROMETERS), _triad(table, _GYROS)
    if f is not None:
        gyro = None if w is None else (t, np.radians(w))
        tables["imu"] = imu_table((t, f * STANDARD_GRAVITY), gyro, f"{path.name}, imu", problems, notes)
    else:
        problems.append(f"{path.name}: there is no accelerometer with three axes in it")
    if not tables:
        raise RecordingError(
            f"{path.name}: has neither velocity and heading nor an accelerometer; its columns are {', '.join(names)}"
        )
    return from_first_imu_sample(tables), {"name": path.stem, "description": "Racelogic .vbo file"}


def _sections(path: Path) -> dict[str, list[str]]:
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in path.read_text("utf-8-sig", "replace").splitlines():
        name = re.fullmatch(r"\[(.+)\]", line.strip())
        if name:
            lines = sections.setdefault(name[1].lower(), [])
        elif line.strip():
            lines.append(line.strip())
    return sections


def _rows(path: Path, names: list[str], lines: list[str], problems: list[str]) -> pd.DataFrame:
    whole = [line for line in lines if len(line.split()) == len(names)]
    if len(whole) < len(lines):
        problems.append(
            f"{path.name}: {len(lines) - len(whole)} rows under [data] have other than {len(names)} values; left out"
        )
    if not whole:
        return pd.DataFrame(columns=names)
    text = "\n".join(whole)
    if "," in text[:4096]:
        text = text.replace(",", ".")
    table = pd.read_csv(
        io.StringIO(text), sep=r"\s+", header=None, names=list(range(len(names))), quoting=csv.QUOTE_NONE
    )
    table.columns = pd.Index([f"{name} ({k})" if name in names[:k] else name for k, name in enumerate(names)])
    numbers = table.apply(pd.to_numeric, errors="coerce")
    return numbers.where(numbers.abs() < _LARGEST)


def _seconds_of(packed: np.ndarray) -> np.ndarray:
    """Seconds of HHMMSS.SS, going on past midnight."""
    hours, minutes = np.floor(packed / 1e4), np.floor(packed / 100) % 100
    t = hours * 3600 + minutes * 60 + packed % 100
    known = np.isfinite(t)
    t[known] = np.unwrap(np.round(t[known], 4), period=_DAY)
    return t


def _triad(table: pd.DataFrame, triads: tuple[tuple[str, str, str], ...]) -> np.ndarray | None:
    names = next((list(triad) for triad in triads if set(triad) <= set(table.columns)), None)
    return None if names is None else table[names].to_numpy(float)


def _gnss(
    path: Path, table: pd.DataFrame, t: np.ndarray, without: np.ndarray, long_names: dict[str, str]
) -> dict[str, pd.DataFrame]:
    values = {}
    for ours, pattern in _GNSS.items():
        theirs = [name for name in table.columns if re.fullmatch(pattern, name)]
        if theirs:
            values[ours] = table[theirs[0]].to_numpy(float)
    if not {"speed", "course"} <= set(values):
        return {}
    for name in {"speed", "climb"} & values.keys():
        told = next((long for short, long in long_names.items() if re.fullmatch(_GNSS[name], short)), "")
        values[name] = values[name] * SPEED_UNITS["m/s" if told.endswith("m/s") else "km/h"]
    if "lat" in values:
        values["lat"] = values["lat"] / 60
    if "lon" in values:
        values["lon"] = -values["lon"] / 60
    columns = np.stack(list(values.values()), -1)
    return {"gnss": stream_table(t[~without], columns[~without], list(values), f"{path.name}, gnss")}
