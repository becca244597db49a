"""Measurement files of the car industry (MDF 3 and 4), as tables in SI units and sensor axes."""

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from altijax.constants import STANDARD_GRAVITY
from altijax.formats.stream_checks import SPEED_UNITS, RecordingError
from altijax.formats.tables import (
    ACCELEROMETER,
    GYRO,
    VELOCITY,
    Log,
    first_bytes,
    from_first_imu_sample,
    import_extra,
    imu_table,
    stream_table,
)

_MAGIC = (b"MDF     ", b"UnFinMF ")

_DEGREE = np.pi / 180
_ACCELERATIONS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}
_RATES = {"rad/s": 1.0, "deg/s": _DEGREE, "dps": _DEGREE}
_SPEEDS = SPEED_UNITS | {"kph": SPEED_UNITS["km/h"], "kmh": SPEED_UNITS["km/h"], "knots": SPEED_UNITS["kn"]}
_ANGLES = {"deg": 1.0, "rad": 1 / _DEGREE}
_LENGTHS = {"m": 1.0}

_NAMES: dict[str, dict[str, tuple[dict[str, float], str]]] = {
    "accelerometer": {
        "ax": (_ACCELERATIONS, "ax accx accelx accelerationx longacc longitudinalacceleration"),
        "ay": (_ACCELERATIONS, "ay accy accely accelerationy latacc lateralacceleration"),
        "az": (_ACCELERATIONS, "az accz accelz accelerationz vertacc verticalacceleration"),
    },
    "gyro": {
        "gx": (_RATES, "gx wx gyrx gyrox angularratex rollrate"),
        "gy": (_RATES, "gy wy gyry gyroy angularratey pitchrate"),
        "gz": (_RATES, "gz wz gyrz gyroz angularratez yawrate"),
    },
    "wheel": {
        "front_left": (_SPEEDS, "frontleft wheelspeedfl whlspdfl wheelspeedfrontleft"),
        "front_right": (_SPEEDS, "frontright wheelspeedfr whlspdfr wheelspeedfrontright"),
        "rear_left": (_SPEEDS, "rearleft wheelspeedrl whlspdrl wheelspeedrearleft"),
        "rear_right": (_SPEEDS, "rearright wheelspeedrr whlspdrr wheelspeedrearright"),
        "speed": (_SPEEDS, "speed vehiclespeed vehspeed vehspd wheelspeed"),
    },
    "gnss": {
        "v_e": (_SPEEDS, "ve gpsveleast gnssveleast velocityeast veleast"),
        "v_n": (_SPEEDS, "vn gpsvelnorth gnssvelnorth velocitynorth velnorth"),
        "v_u": (_SPEEDS, "vu gpsvelup gnssvelup velocityup velup"),
        "speed": (_SPEEDS, "gpsspeed gnssspeed gpsgroundspeed"),
        "course": (_ANGLES, "course gpscourse gnsscourse gpsheading gpstrack"),
        "lat": (_ANGLES, "lat latitude gpslat gpslatitude gnsslatitude"),
        "lon": (_ANGLES, "lon lng longitude gpslon gpslongitude gnsslongitude"),
        "alt": (_LENGTHS, "alt altitude gpsalt gpsaltitude gnssaltitude"),
    },
}
"""Units of each column, and names of channels in small letters and digits alone, so that "WheelSpeed_FL" is one."""

Series = tuple[np.ndarray, np.ndarray]


def reads(path: Path) -> bool:
    """Whether a path is an MDF file, by its first bytes."""
    return path.is_file() and first_bytes(path, 8) in _MAGIC


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an MDF file: accelerometer, gyro, wheel speeds and GNSS by the names of its channels (`_NAMES`).

    Axes are those of ISO 8855: forward, left, up.
    """
    asammdf = import_extra("asammdf", path, extra="mdf")
    damaged = (asammdf.blocks.utils.MdfException, struct.error, ValueError)
    try:
        with asammdf.MDF(path) as file:
            channels = {_key(name): name for name in reversed(file.channels_db)}
            found = {group: _columns(file, channels, group, path.name, problems, notes) for group in _NAMES}
            held = sorted(set(channels.values()))
    except damaged as error:
        raise RecordingError(f"{path.name}: damaged or cut short ({error}); copy it again from its source") from error
    missing = [name for name in ACCELEROMETER if name not in found["accelerometer"]]
    if missing:
        shown = ", ".join(held[:30]) + (" and more" if len(held) > 30 else "") if held else "none"
        raise RecordingError(
            f"{path.name}: there is no channel for {', '.join(missing)}; its channels are {shown}. Rename them to ax, "
            "ay, az (asammdf's MDF.rename), and frames of a bus decode with its DBC (MDF.extract_bus_logging) first"
        )
    gyro = _together(found["gyro"], GYRO) if set(GYRO) <= set(found["gyro"]) else None
    accelerometer = _together(found["accelerometer"], ACCELEROMETER)
    tables = {"imu": imu_table(accelerometer, gyro, path.name, problems, notes)}
    wheel = found["wheel"]
    names = [name for name in wheel if name != "speed"] or list(wheel)
    if names:
        tables["wheel"] = stream_table(*_together(wheel, names), names, f"{path.name} wheel")
    gnss = found["gnss"]
    names = VELOCITY[:2] if set(VELOCITY[:2]) <= set(gnss) else ["speed", "course"]
    if set(names) <= set(gnss):
        names = names + [name for name in ("v_u", "lat", "lon", "alt") if name in gnss]
        tables["gnss"] = stream_table(*_together(gnss, names, needed=2), names, f"{path.name} GNSS")
    elif gnss:
        problems.append(f"{path.name}: {', '.join(gnss)} left out, for there is no GNSS velocity, nor speed and course")
    return from_first_imu_sample(tables), {"name": path.stem, "description": "MDF file", "axes": "FLU"}


def _key(name: str) -> str:
    """A channel's name without its device (behind a backslash), its message (before a point), and all signs."""
    return re.sub(r"[^a-z0-9]", "", name.split("\\")[0].split(".")[-1].lower())


def _columns(
    file: Any, channels: dict[str, str], group: str, path: str, problems: list[str], notes: list[str]
) -> dict[str, Series]:
    """Times and values in SI units (deg) of the columns of a group that are there."""
    columns = {}
    for column, (units, names) in _NAMES[group].items():
        name = next((channels[name] for name in names.split() if name in channels), None)
        if name is None:
            continue
        place = file.channels_db[name][0]
        signal = file.get(name, *place)
        if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "iuf" or not len(signal.samples):
            problems.append(f"{path}, channel {name}: it holds no series of numbers and is left out")
            continue
        unit = signal.unit.strip().replace("²", "^2").replace("s2", "s^2").replace("°", "deg")
        if unit and unit not in units:
            problems.append(
                f"{path}, channel {name}: its unit {signal.unit!r} is not known and it is left out; known are "
                f"{', '.join(units)}"
            )
            continue
        notes.append(
            f"{path}: channel {name} is {column} of the {group}, in {unit or 'no unit, taken as ' + next(iter(units))}"
        )
        columns[column] = (signal.timestamps.astype(float), signal.samples * units.get(unit, 1.0))
    return columns


def _together(columns: dict[str, Series], names: list[str], needed: int | None = None) -> Series:
    """Columns at the times of the first that all, or the first `needed`, have; interpolated where times differ."""
    t = columns[names[0]][0]
    at = [columns[name] for name in names]
    values = np.stack([v if np.array_equal(t, own) else np.interp(t, own, v, np.nan, np.nan) for own, v in at], -1)
    inside = np.all([(t >= own[0]) & (t <= own[-1]) for own, _ in at[:needed]], axis=0)
    return t[inside], values[inside]
