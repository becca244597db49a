"""Pictures of elevations: what is drawn is what was estimated, with units."""

import dataclasses

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.elevation_estimate.estimates import estimate_elevation
from altijax.plots.elevation import plot_elevation, plot_elevation_error
from tests.exact import EXACT

ESTIMATE = estimate_elevation(EXACT, method="slope")


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


@pytest.mark.parametrize(("against", "label"), [("way", "way (m)"), ("time", "time (s)")])
def test_profile_shows_estimate_and_reference(against: str, label: str) -> None:
    ax = plot_elevation({"slope": ESTIMATE}, EXACT, against=against)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (label, "elevation (m)")
    estimate, reference = ax.get_lines()
    np.testing.assert_array_equal(estimate.get_ydata(), ESTIMATE["elevation"])
    expected = EXACT.reference["alt"] - EXACT.reference["alt"].iloc[0]
    np.testing.assert_array_equal(reference.get_ydata(), expected)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "slope",
        "reference",
        "band: two standard deviations",
    ]
    low, high = ax.get_ylim()
    assert low < ESTIMATE["elevation"].min() and high > ESTIMATE["elevation"].max()


def test_error_is_estimate_less_reference() -> None:
    _, ax = plt.subplots()
    assert plot_elevation_error({"slope": ESTIMATE + 1.0}, EXACT, fitted_until=20.0, ax=ax) is ax
    error = ax.get_lines()[0].get_ydata()
    assert error[0] == 0 and np.abs(error).max() < 0.01
    assert ax.get_ylabel() == "elevation error (m)"
    assert "constants fitted here" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_a_wide_band_does_not_press_the_profile_flat() -> None:
    wide = ESTIMATE.assign(elevation_std=100.0)
    low, high = plot_elevation(wide).get_ylim()
    relief = float(np.ptp(ESTIMATE["elevation"]))
    assert relief < high - low < 2.5 * relief


def test_what_cannot_be_drawn_is_said() -> None:
    with pytest.raises(ValueError, match="against must be 'way' or 'time', got 'distance'"):
        plot_elevation({"slope": ESTIMATE}, against="distance")
    with pytest.raises(ValueError, match="'exact' has no reference heights to draw"):
        plot_elevation_error({"slope": ESTIMATE}, dataclasses.replace(EXACT, reference=None))
