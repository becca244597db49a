"""A set of names makes up states, levels and measurements."""

from altijax.vehicle.sensors import KINDS, kinds_of, layout_of, levels_of, parts_of

EVERYTHING = ("gyro", "craft", "wind", *KINDS)


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


def test_slips_are_not_fitted_where_no_gyro_tells_of_the_attitude() -> None:
    for use, size in ((("velocity", "course"), 0.05), (("velocity", "course", "craft"), 0.1)):
        levels = levels_of(use)
        assert all(levels[name].spread == 0 for name in ("sideslip", "attack", "slip_time"))
        assert levels["sideslip"].usual == size
    assert levels_of(("gyro", "velocity", "course"))["sideslip"].spread > 0


def test_the_mount_of_a_craft_is_in_its_sideslip() -> None:
    assert parts_of(("velocity", "course", "craft"))["mounting"].std == (0.0, 0.1)
    assert "wind" not in parts_of(("velocity", "course", "craft"))


def test_the_layout_has_all_parts() -> None:
    assert layout_of(EVERYTHING).names == tuple(parts_of(EVERYTHING))
