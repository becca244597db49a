"""A small run of the benchmark of damaged recordings: none crashes, few are silent, and the good one is right."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))
import hostile


def test_there_are_four_hundred_variants_and_each_changes_the_recording():
    tables = hostile.good_drive()
    found = list(hostile.variants())
    assert len(found) > 400 and len({(kind, name) for kind, name, _ in found}) > 0.98 * len(found)
    for _, name, change in found[::10]:
        other = change(tables)
        assert other.keys() != tables.keys() or any(not other[stream].equals(tables[stream]) for stream in tables), name


@pytest.mark.slow
def test_damage_is_mended_refused_or_told():
    found = hostile.study(every=12)
    assert (found["outcome"] != "crash").all() and found["seconds"].max() < 10
    assert (found["outcome"] == "silent").mean() < 0.1
