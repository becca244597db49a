"""The columns of a recording's streams, the quantity of each, and the units it may be stored in."""

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd

from altijax.constants import GAL, STANDARD_GRAVITY
from altijax.formats.stream_checks import SPEED_UNITS

WHEELS = ("left", "right", "front_left", "front_right", "rear_left", "rear_right")
COLUMNS = {
    "imu": ("t", "ax", "ay", "az", "gx", "gy", "gz", "temperature"),
    "wheel": ("t", "speed", *WHEELS),
    "pulses": ("t", "wheel"),
    "gnss": ("t", "v_e", "v_n", "v_u", "speed", "course", "climb", "lat", "lon", "alt", "sd_e", "sd_n", "sd_u"),
    "reference": ("t", "roll", "pitch", "heading", "v_e", "v_n", "v_u", "lat", "lon", "alt"),
}

_UNITS: dict[str, tuple[dict[str, float], dict[str, tuple[str, ...]]]] = {
    "time": (
        {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0},
        {stream: ("t",) for stream in COLUMNS},
    ),
    "accelerometer": (
        {
            "m/s^2": 1.0,
            "g": STANDARD_GRAVITY,
            "mg": 1e-3 * STANDARD_GRAVITY,
            "gal": GAL,
            "-m/s^2": -1.0,
            "-g": -STANDARD_GRAVITY,
        },
        {"imu": ("ax", "ay", "az")},
    ),
    "gyro": (
        {
            "rad/s": 1.0,
            "deg/s": np.pi / 180,
            "mrad/s": 1e-3,
            "mdeg/s": np.pi / 180e3,
            "deg/h": np.pi / 648e3,
            "-rad/s": -1.0,
            "-deg/s": -np.pi / 180,
        },
        {"imu": ("gx", "gy", "gz")},
    ),
    "speed": (SPEED_UNITS, {"wheel": ("speed", *WHEELS)}),
    "gnss_speed": (SPEED_UNITS, {"gnss": ("v_e", "v_n", "v_u", "speed", "climb", "sd_e", "sd_n", "sd_u")}),
    "height": ({"m": 1.0, "ft": 0.3048}, {"gnss": ("alt",), "reference": ("alt",)}),
    "course": ({"deg": 1.0, "rad": 180 / np.pi}, {"gnss": ("course",)}),
    "attitude": ({"rad": 1.0, "deg": np.pi / 180}, {"reference": ("roll", "pitch", "heading")}),
}
QUANTITIES = tuple(_UNITS)
"""Quantities that may be stored in other units."""

_SPELLINGS = {
    "m/s^2": ("m/s2", "m/s/s", "ms^-2", "ms-2", "m*s^-2", "m/sec^2", "meters/second^2"),
    "g": ("gs", "g-force", "gforce"),
    "rad/s": ("rad/sec", "rads/s", "radians/s"),
    "deg/s": ("deg/sec", "dps", "degrees/s", "degree/s", "degs/s"),
    "m/s": ("mps", "m/sec", "meters/second"),
    "km/h": ("kmh", "kph", "km/hr", "kmph"),
    "mph": ("mi/h", "miles/h"),
    "kn": ("kt", "kts", "knot", "knots"),
    "s": ("sec", "secs", "second", "seconds", "unixtime"),
    "ms": ("msec", "millisecond", "milliseconds"),
    "us": ("usec", "microsecond", "microseconds"),
    "ns": ("nsec", "nanosecond", "nanoseconds"),
    "deg": ("degree", "degrees"),
    "rad": ("radian", "radians"),
    "m": ("meter", "meters", "metre", "metres"),
    "ft": ("feet", "foot"),
}
_UNIT_OF = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in (unit, *others)}
_UNIT_OF |= {unit: unit for factors, _ in _UNITS.values() for unit in factors}


def quantity_of(stream: str, column: str) -> str | None:
    """The quantity of a column, None for one that has one unit only."""
    return next((name for name, (_, targets) in _UNITS.items() if column in targets.get(stream, ())), None)


def unit_named(text: str) -> str | None:
    """The unit that a text in a header means, in whatever spelling; None where it means none that we know."""
    text = re.sub(r"\s|[\[\]()]", "", text.lower())
    for sign, plain in (
        ("\u00b2", "^2"),
        ("\u00b0", "deg"),
        ("\u00b5", "u"),
        ("\u03bc", "u"),
        ("\u00b7", "*"),
        ("**", "^"),
    ):
        text = text.replace(sign, plain)
    return _UNIT_OF.get(text)


def factor_of(quantity: str, unit: str | None) -> float | None:
    """SI (or the unit of `COLUMNS`) in one of a unit; None where the quantity has no such unit."""
    return _UNITS[quantity][0].get(unit or "")


def check_units(units: Mapping[str, str]) -> None:
    """Raise for a quantity or a unit that is not known."""
    for quantity, unit in units.items():
        if quantity not in _UNITS:
            raise ValueError(f"units has no quantity {quantity!r}; known are {', '.join(_UNITS)}")
        if unit not in _UNITS[quantity][0]:
            raise ValueError(f"units: {quantity} has no unit {unit!r}; known are {', '.join(_UNITS[quantity][0])}")


def in_si_units(tables: dict[str, pd.DataFrame], units: Mapping[str, str]) -> None:
    """Scale the tables from the units that were stated; raise for a quantity that none of them has."""
    for quantity, unit in units.items():
        factors, targets = _UNITS[quantity]
        used = False
        for stream in targets.keys() & tables.keys():
            columns = [column for column in targets[stream] if column in tables[stream].columns]
            used |= bool(columns)
            scaled = {column: tables[stream][column] * factors[unit] for column in columns}
            tables[stream] = tables[stream].assign(**scaled)
        if not used:
            places = "; ".join(f"{stream}: {', '.join(columns)}" for stream, columns in targets.items())
            raise ValueError(
                f"units gives {quantity!r} in {unit!r}, but the recording has none of its columns ({places})"
            )


def si_units(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """The unit that stands unscaled, of each quantity of which the tables have a column."""
    return {
        quantity: next(unit for unit, factor in factors.items() if factor == 1)
        for quantity, (factors, targets) in _UNITS.items()
        if any(set(targets[stream]) & set(tables[stream].columns) for stream in targets.keys() & tables.keys())
    }
