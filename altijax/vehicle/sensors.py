"""A set of sensors as a set of names: the parts of the state, noise levels and measurements that it makes up."""

from collections.abc import Mapping

from altijax.inference.layout import Layout
from altijax.vehicle import inertial
from altijax.vehicle.measurements import course, doppler_velocity, gnss_position, known_height, standstill, wheel_speed
from altijax.vehicle.parts import Kind, Level, Part

KINDS: Mapping[str, Kind] = {
    "velocity": doppler_velocity.KIND,
    "position": gnss_position.KIND,
    "wheel": wheel_speed.KIND,
    "course": course.KIND,
    "standstill": standstill.KIND,
    "height": known_height.KIND,
}
"""Kinds of measurements by name."""

LEVERS = ("antenna", "axle")
"""Parts that only a gyro tells of."""

Use = tuple[str, ...]
"""Names of `KINDS` in use, "gyro", "craft" for a body that may point off its course, and "wind" for moving air."""


def kinds_of(use: Use) -> dict[str, Kind]:
    """The kinds of measurements of a set."""
    return {name: kind for name, kind in KINDS.items() if name in use}


def parts_of(use: Use) -> dict[str, Part]:
    """The parts of the state of a set, in their order."""
    parts: dict[str, Part] = inertial.PARTS | (inertial.GYRO_PARTS if "gyro" in use else inertial.TURNING_PARTS)
    for kind in kinds_of(use).values():
        parts = parts | dict(kind.parts)
    if "gyro" not in use:
        # What turns too fast to be known tells nothing of where sensors are.
        parts = {name: part for name, part in parts.items() if name not in LEVERS}
    return parts | (course.CRAFT if "craft" in use else {}) | (course.WIND if "wind" in use else {})


def levels_of(use: Use) -> dict[str, Level]:
    """The noise levels of a set."""
    levels: dict[str, Level] = inertial.LEVELS | (inertial.GYRO_LEVELS if "gyro" in use else inertial.TURNING_LEVELS)
    for kind in kinds_of(use).values():
        levels = levels | dict(kind.levels)
    if "course" in use and "gyro" not in use:
        levels = levels | course.untold_levels("craft" in use)
    return levels


def layout_of(use: Use) -> Layout:
    """Where the parts lie."""
    return Layout(tuple((name, part.size) for name, part in parts_of(use).items()))
