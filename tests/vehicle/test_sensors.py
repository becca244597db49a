"""A set of names makes up states, levels and measurements."""

from altijax.vehicle.sensors import KINDS, kinds_of, layout_of, levels_of, parts_of

EVERYTHING = ("gyro", "wind", *KINDS)


def test_what_is_not_in_use_brings_nothing() -> None:
    assert "wheel_scale" not in parts_of(("gyro", "velocity"))
    assert "antenna" not in parts_of(("velocity", "course"))
    assert "gyro_scale" not in parts_of(("velocity",))
    assert tuple(kinds_of(("course", "velocity"))) == ("velocity", "course")


def test_every_level_that_a_part_names_exists() -> None:
    for use in (EVERYTHING, ("gyro", "velocity"), ("velocity", "course"), ("wheel", "course")):
        levels = levels_of(use)
        for name, part in parts_of(use).items():
            assert {part.walk, part.time, *part.level} - {""} <= set(levels), name
            assert len(part.entries) >= part.size, name
        for name, kind in kinds_of(use).items():
            assert set(kind.factor) <= set(levels), name


def test_the_layout_has_all_parts() -> None:
    assert layout_of(EVERYTHING).names == tuple(parts_of(EVERYTHING))
