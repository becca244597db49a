"""Pictures of speeds."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.plots.speed import broken_at_wraps, plot_speed
from tests.plots.made import REFERENCE, estimate


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_speed_is_drawn_where_it_is_valid() -> None:
    found = estimate()
    found.loc[found.index < 2, "valid"] = False
    ax = plot_speed({"filter": found}, REFERENCE, aided_until=3.0)
    line, reference = ax.get_lines()
    assert np.isnan(line.get_ydata()[:20]).all()
    np.testing.assert_array_equal(line.get_ydata()[20:], found["speed"][20:])
    np.testing.assert_allclose(reference.get_ydata(), found["speed"])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "speed (m/s)")
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["filter", "reference", "aided", "band: two standard deviations"]


def test_a_wrap_is_a_gap() -> None:
    np.testing.assert_array_equal(broken_at_wraps(np.array([350.0, 355.0, 1.0, 5.0])), [350, 355, np.nan, 5])
