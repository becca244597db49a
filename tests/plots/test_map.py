"""Maps: streets where there are places, else metres."""

import matplotlib

matplotlib.use("Agg")

import folium
import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.plots.map import plot_map
from tests.plots.made import REFERENCE, estimate


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_a_track_in_metres() -> None:
    _, ax = plt.subplots()
    assert plot_map(estimate(), REFERENCE, ax=ax) is ax
    pieces = np.array(ax.collections[0].get_segments())
    np.testing.assert_allclose(pieces[:, 0], estimate()[["east", "north"]][:-1])
    # The Earth is flat to some centimetres here, and a degree not quite 111 km.
    reference = np.column_stack(ax.get_lines()[0].get_data())
    np.testing.assert_allclose(reference, estimate()[["east", "north"]], atol=0.3)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("East (m)", "North (m)")


def test_streets_need_places() -> None:
    streets = plot_map(estimate(), REFERENCE)
    assert isinstance(streets, folium.Map)
    assert "elevation (m)" in streets.get_root().render()
    assert not isinstance(plot_map(estimate().drop(columns=["lat", "lon"])), folium.Map)


def test_what_cannot_be_mapped_is_said() -> None:
    with pytest.raises(ValueError, match="no east, north: take one of estimate_drive"):
        plot_map(estimate().drop(columns=["east", "north"]))
