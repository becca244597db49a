"""Exports of the phone app Sensor Logger: a folder, or its zip, with one CSV file a sensor."""

import csv
from pathlib import Path

import pandas as pd

from altijax.constants import STANDARD_GRAVITY
from altijax.formats.phones import Series, added, location_table, phone_log, series
from altijax.formats.tables import Log
from altijax.formats.text_tables import table_names

_FILES = (
    "TotalAcceleration",
    "Accelerometer",
    "AccelerometerUncalibrated",
    "Gyroscope",
    "GyroscopeUncalibrated",
    "Location",
)
_LOCATION = {
    "speed": "speed",
    "course": "bearing",
    "lat": "latitude",
    "lon": "longitude",
    "alt": "altitude",
    "sd_e": "speedAccuracy",
    "sd_n": "speedAccuracy",
}


def reads(path: Path) -> bool:
    """Whether a path is a folder in which one of the app's files has its columns of time."""
    return path.is_dir() and any("seconds_elapsed" in _names(path, name) for name in _FILES)


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an export.

    Specific force is TotalAcceleration, else Accelerometer (which has no gravity) plus Gravity, else
    AccelerometerUncalibrated; iOS reverses all three signs, unless the app was told to standardise them.
    """
    ios, reversed_signs = _conventions(path, problems, notes)
    sign = -1.0 if reversed_signs else 1.0

    def triad(name: str, scale: float = 1.0) -> Series | None:
        if not {"x", "y", "z"} <= set(_names(path, name)):
            return None
        columns = {"t": "seconds_elapsed", "x": "x", "y": "y", "z": "z"}
        return series(path / f"{name}.csv", columns, dict.fromkeys("xyz", scale), problems, notes)

    f = triad("TotalAcceleration", sign)
    moving, gravity = (None, None) if f else (triad("Accelerometer", sign), triad("Gravity", sign))
    if moving and gravity:
        f = added(moving, gravity)
    if f is None:
        f = triad("AccelerometerUncalibrated", sign * (STANDARD_GRAVITY if ios and reversed_signs else 1.0))
    if f is None and moving:
        problems.append(
            f"{path.name}: Accelerometer.csv is without gravity and is left out; log Gravity, TotalAcceleration or "
            "the uncalibrated accelerometer too"
        )
    gyro = triad("Gyroscope") or triad("GyroscopeUncalibrated")
    return phone_log(path, "Sensor Logger", f, gyro, _location(path, problems, notes), problems, notes)


def _names(path: Path, name: str) -> tuple[str, ...]:
    file = path / f"{name}.csv"
    return table_names(file) if file.is_file() else ()


def _conventions(path: Path, problems: list[str], notes: list[str]) -> tuple[bool, bool]:
    """Whether the phone runs iOS, and whether the signs of its accelerometer are reversed."""
    file = path / "Metadata.csv"
    rows = list(csv.DictReader(file.read_text("utf-8-sig", "replace").splitlines())) if file.is_file() else []
    platform = str(rows[0].get("platform", "")).lower() if rows else ""
    if platform not in ("ios", "android"):
        problems.append(
            f"{path.name}: Metadata.csv does not say the platform; signs are taken as Android's, an iPhone has them "
            "reversed: read with units={'accelerometer': '-m/s^2'} if it was one"
        )
        return False, False
    standardised = str(rows[0].get("standardisation", "")).lower() == "true"
    if platform == "ios" and not standardised:
        notes.append(f"{path.name}: iOS gives the accelerometer with all signs reversed, which was undone")
    return platform == "ios", platform == "ios" and not standardised


def _location(path: Path, problems: list[str], notes: list[str]) -> pd.DataFrame | None:
    there = _names(path, "Location")
    columns = {name: source for name, source in _LOCATION.items() if source in there}
    if not {"speed", "course"} <= set(columns):
        return None
    found = series(path / "Location.csv", {"t": "seconds_elapsed"} | columns, {}, problems, notes)
    return location_table(found, list(columns), "Location.csv", notes) if found else None
