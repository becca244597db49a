"""Solutions of RTKLIB (.pos): one epoch a line, position and, where it was switched on, velocity."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
from pymap3d import ecef2enuv, ecef2geodetic

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, first_bytes, from_first_imu_sample, stream_table

_HEADER = re.compile(r"^%\s+(GPST|UTC|JST)[\s,]+(.*)$", re.MULTILINE)
_WEEK = 604_800.0
_VELOCITY = ["v_e", "v_n", "v_u"]
_DEVIATION = ["sd_e", "sd_n", "sd_u"]


def reads(path: Path) -> bool:
    """Whether a path is a text file with the line that names the columns of a solution."""
    return path.is_file() and _header(path) is not None


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a solution: gnss, or without velocities its positions as the reference."""
    header = _header(path)
    names = re.sub(r"\([^)]*\)", "", header[2]).replace(",", " ").split() if header else []
    _check_names(path, names)
    table = _rows(path, names, problems)
    if not len(table):
        raise RecordingError(
            f"{path.name}: has no epochs; look into RTKLIB's own messages for why it found no solution"
        )
    unsolved = table["Q"] == 0 if "Q" in table else pd.Series(False, table.index)
    if unsolved.any():
        notes.append(f"{path.name}: {unsolved.sum()} epochs without a solution (Q 0) dropped")
        table = table[~unsolved]
    values = _position(table)
    lat, lon = (values.get(name) for name in ("lat", "lon"))
    if "ve" in table:
        values |= {ours: table[theirs].to_numpy() for ours, theirs in zip(_VELOCITY, ("ve", "vn", "vu"), strict=True)}
        values |= {
            ours: table[f"sdv{axis}"].to_numpy()
            for ours, axis in zip(_DEVIATION, "enu", strict=True)
            if f"sdv{axis}" in table
        }
    elif "vx" in table and lat is not None:
        enu = ecef2enuv(*(table[name].to_numpy() for name in ("vx", "vy", "vz")), lat, lon)
        values |= dict(zip(_VELOCITY, enu, strict=True))
    stream = "gnss" if "v_e" in values else "reference"
    if stream == "reference" and not values:
        raise RecordingError(f"{path.name}: has distances from a base alone; {_SWITCH_ON}")
    if stream == "reference":
        problems.append(f"{path.name}: has positions and no velocities, so it is the reference only; {_SWITCH_ON}")
    columns = np.stack([np.asarray(column, float) for column in values.values()], -1)
    tables = {stream: stream_table(table["t"].to_numpy(), columns, list(values), path.name)}
    problems.append(f"{path.name}: there is no IMU in it")
    scale = {"GPST": "GPS time", "UTC": "UTC", "JST": "Japan's time"}[header[1] if header else "GPST"]
    return from_first_imu_sample(tables), {"name": path.stem, "description": f"RTKLIB solution in {scale}"}


_SWITCH_ON = "solve again with RTKLIB's 'Output Velocity' on (out-outvel=on)"


def _header(path: Path) -> re.Match[str] | None:
    return _HEADER.search(first_bytes(path).decode("utf-8", "replace"))


def _rows(path: Path, names: list[str], problems: list[str]) -> pd.DataFrame:
    """The epochs with their times in s, damaged ones left out."""
    rows, damaged = [], 0
    for line in path.read_text("utf-8", "replace").splitlines():
        cells = line.replace(",", " ").split()
        if not cells or cells[0].startswith("%"):
            continue
        try:
            if "/" in cells[0]:
                day = np.datetime64(cells[0].replace("/", "-"))
                hours, minutes, seconds = cells[1].split(":")
                t = float(day.astype("datetime64[D]").astype(int)) * 86400
                t += int(hours) * 3600 + int(minutes) * 60 + float(seconds)
            else:
                t = int(cells[0]) * _WEEK + float(cells[1])
            rows.append([t, *map(float, cells[2 : 2 + len(names)])])
        except (ValueError, IndexError):
            damaged += 1
    whole = [row for row in rows if len(row) == len(names) + 1]
    damaged += len(rows) - len(whole)
    if damaged:
        problems.append(f"{path.name}: {damaged} lines are not whole epochs and were left out")
    return pd.DataFrame(whole, columns=["t", *names])


_SETS = (
    ("latitude", "longitude", "height"),
    ("x-ecef", "y-ecef", "z-ecef"),
    ("e-baseline", "n-baseline", "u-baseline"),
    ("vn", "ve", "vu"),
    ("vx", "vy", "vz"),
)


def _check_names(path: Path, names: list[str]) -> None:
    """Raise where the line that names the columns has only part of what belongs together."""
    for together in _SETS:
        missing = [name for name in together if name not in names]
        if 0 < len(missing) < 3:
            raise RecordingError(
                f"{path.name}: its line of names has {', '.join(names)} but no {', '.join(missing)}; copy it "
                "again from its source"
            )


def _position(table: pd.DataFrame) -> dict[str, np.ndarray]:
    if "latitude" in table:
        return {
            name: table[theirs].to_numpy()
            for name, theirs in (("lat", "latitude"), ("lon", "longitude"), ("alt", "height"))
        }
    if "x-ecef" in table:
        lat, lon, alt = ecef2geodetic(*(table[f"{axis}-ecef"].to_numpy() for axis in "xyz"))
        return {"lat": np.asarray(lat), "lon": np.asarray(lon), "alt": np.asarray(alt)}
    return {}
