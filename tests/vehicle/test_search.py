"""A search of noise levels ends where they are more likely than the usual ones."""

from altijax.stages import stages
from altijax.vehicle.search import eased, likely, objective_of
from altijax.vehicle.sensors import levels_of
from tests.vehicle.made import USE, short_search


def test_levels_become_more_likely() -> None:
    search = short_search()
    with stages("levels") as stage:
        found = likely(search, stage, rounds=2)
    assert objective_of(found) < objective_of(search) - 10
    assert set(found.levels) == set(levels_of(USE))


def test_only_velocities_count_at_first() -> None:
    doubt = eased(short_search()).doubt
    assert doubt["velocity"].max() == 1
    assert min(x.min() for name, x in doubt.items() if name != "velocity") > 1e6
