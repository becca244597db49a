"""Telemetry in the videos of GoPro cameras (GPMF), as tables in SI units and camera axes."""

from pathlib import Path
from typing import Any

import numpy as np

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, first_bytes, from_first_imu_sample, import_extra, imu_table, stream_table

_WITHOUT_ORIN = "ZXY"
"""Order of the HERO5's axes, which it does not tell; later cameras do."""

_PAYLOAD = 1_001_000
"""Microseconds that a payload lasts; the HERO5 has no stamps."""

_FIX, _GPS9 = "0x47505346", "0x47505339"
"""Keys that the parser leaves as numbers, GPSF and GPS9, the latter with its content as it stands in the file."""

_GPS9_HEADER = 8
_GPS9_ROW = np.dtype([("values", ">i4", 7), ("dop", ">u2"), ("fix", ">u2")])
_AROUND = 0.5
"""Seconds to either side over which positions give a course: the receivers smooth, and repeat, within that time."""


def reads(path: Path) -> bool:
    """Whether a path is a video in MP4, of which only a GoPro's can be read."""
    return path.is_file() and first_bytes(path, 12)[4:8] == b"ftyp"


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a GoPro video: ACCL and GYRO in camera axes (x left, y back, z up), and GPS9 or else GPS5."""
    parser = import_extra("telemetry_parser", path)
    without = f"{path.name}: it holds no telemetry of a GoPro"
    mend = "take the file as it is on the camera's card, for cutting and messengers remove it"
    try:
        video = parser.Parser(str(path))
    except OSError as error:
        raise RecordingError(f"{without} ({error}); {mend}") from error
    if video.camera != "GoPro":
        raise RecordingError(f"{without} but of {video.camera}, whose axes are not known here; write an imu.csv of it")
    payloads = video.telemetry()
    streams = {
        name: [payload[name] for payload in payloads if payload.get(name, {}).get(key)]
        for name, key in {"Accelerometer": "Data", "Gyroscope": "Data", "GPS9": _GPS9, "GPS": "Data"}.items()
    }
    if not streams["Accelerometer"]:
        raise RecordingError(f"{path.name}: there is no accelerometer in its telemetry; {mend}")
    if "TimestampUs" not in streams["Accelerometer"][0]:
        notes.append(f"{path.name}: it has no stamps; {_PAYLOAD * 1e-6} s are taken for each of its payloads")
    gyro = _inertial(streams["Gyroscope"]) if streams["Gyroscope"] else None
    tables = {"imu": imu_table(_inertial(streams["Accelerometer"]), gyro, path.name, problems, notes)}
    positions = _gps9(streams["GPS9"]) if streams["GPS9"] else _gps5(streams["GPS"])
    t, rows = positions[0][positions[2]], positions[1][positions[2]]
    if len(positions[0]) > len(t):
        notes.append(f"{path.name} GPS: {len(positions[0]) - len(t)} rows without a fix dropped")
    if len(t):
        notes.append(f"{path.name} GPS: it has no course; that of the positions is taken")
        lat, lon, alt, speed = rows[:, :4].T
        columns = ["speed", "course", "lat", "lon", "alt"]
        values = np.stack([speed, _course(t, lat, lon), lat, lon, alt], -1)
        tables["gnss"] = stream_table(t, values, columns, f"{path.name} GPS")
    notes.append(
        f"{path.name}: axes 'LBU' are those of a camera that looks ahead and stands upright; say axes= if it does not"
    )
    return from_first_imu_sample(tables), {"name": path.stem, "description": "GoPro video", "axes": "LBU"}


def _times(parts: list[dict[str, Any]], counts: list[int]) -> np.ndarray:
    """Times in s of all rows, spread evenly from the stamp of each payload to that of the next."""
    stamps = np.array([part.get("TimestampUs", k * _PAYLOAD) for k, part in enumerate(parts)], float) * 1e-6
    first = np.concatenate([[0], np.cumsum(counts)])
    last = counts[-1] * (stamps[-1] - stamps[-2]) / counts[-2] if len(parts) > 1 else _PAYLOAD * 1e-6
    return np.interp(np.arange(first[-1]), first, np.append(stamps, stamps[-1] + last))


def _inertial(parts: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Times and vectors in SI units; ORIN names the axis of each value, in small letters the opposite one.

    The parser calls the three values x, y and z in the order of the file, whatever ORIN says.
    """
    scaled = []
    for part in parts:
        values = np.array([(row["x"], row["y"], row["z"]) for row in part["Data"]], float) / part["Scale"]
        axes = part.get("OrientationIn", _WITHOUT_ORIN)
        vectors = np.empty_like(values)
        for column, axis in enumerate(axes):
            vectors[:, "XYZ".index(axis.upper())] = values[:, column] * (1 if axis.isupper() else -1)
        scaled.append(vectors)
    return _times(parts, [len(vectors) for vectors in scaled]), np.concatenate(scaled)


def _gps5(parts: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, rows (latitude, longitude, altitude, speeds) and whether there is a fix, which a payload has as one."""
    if not parts:
        return np.empty(0), np.empty((0, 5)), np.empty(0, bool)
    rows = [np.array(part["Data"], float) / part["Scale"] for part in parts]
    counts = [len(values) for values in rows]
    fixed = np.repeat([part.get(_FIX, 0) >= 2 for part in parts], counts)
    return _times(parts, counts), np.concatenate(rows), fixed


def _gps9(parts: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `_gps5`; here each row has its fix."""
    raw = [np.frombuffer(bytes(part[_GPS9][_GPS9_HEADER:]), np.uint8) for part in parts]
    rows = [content[: content.size // _GPS9_ROW.itemsize * _GPS9_ROW.itemsize].view(_GPS9_ROW) for content in raw]
    values = [row["values"] / part["Scale"][:7] for row, part in zip(rows, parts, strict=True)]
    fixed = np.concatenate([row["fix"] for row in rows]) >= 2
    return _times(parts, [len(row) for row in rows]), np.concatenate(values), fixed


def _course(t: np.ndarray, lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """Course in deg by the way between positions before and after each time."""
    east, north = np.radians(lon) * np.cos(np.radians(lat)), np.radians(lat)
    before, after = t - _AROUND, t + _AROUND
    d_east, d_north = (np.interp(after, t, axis) - np.interp(before, t, axis) for axis in (east, north))
    return np.degrees(np.arctan2(d_east, d_north)) % 360
