"""Pictures: what is drawn is what was estimated, with units, and nothing is drawn from nothing."""

import dataclasses

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.estimates import calibrate, estimate_elevation
from altijax.plots import (
    plot_calibration_correlation,
    plot_calibration_errors,
    plot_elevation,
    plot_elevation_error,
    plot_streams,
)
from tests.exact import EXACT

ESTIMATE = estimate_elevation(EXACT, method="slope")
CALIBRATION = calibrate(EXACT, ["accelerometer_bias_x", "wheel_scale"], method="slope", until=30.0)


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
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["slope", "reference"]
    low, high = ax.get_ylim()
    assert low < ESTIMATE["elevation"].min() and high > ESTIMATE["elevation"].max()


def test_error_is_estimate_less_reference() -> None:
    _, ax = plt.subplots()
    assert plot_elevation_error({"slope": ESTIMATE + 1.0}, EXACT, fitted_until=20.0, ax=ax) is ax
    error = ax.get_lines()[0].get_ydata()
    assert error[0] == 0 and np.abs(error).max() < 0.01
    assert ax.get_ylabel() == "elevation error (m)"
    assert "constants fitted here" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_streams_get_a_panel_each() -> None:
    axes = plot_streams(EXACT)
    assert [ax.get_ylabel().split(" (")[0] for ax in axes] == ["specific force", "angular rate", "speed"]
    assert len(axes[2].get_lines()) == 2 and axes[-1].get_xlabel() == "time (s)"
    bare = dataclasses.replace(EXACT, imu=EXACT.imu[["ax", "ay", "az"]], wheel=None, gnss=None)
    assert len(plot_streams(bare)) == 1


def test_what_cannot_be_drawn_is_said() -> None:
    with pytest.raises(ValueError, match="against must be 'way' or 'time', got 'distance'"):
        plot_elevation({"slope": ESTIMATE}, against="distance")
    with pytest.raises(ValueError, match="'exact' has no reference heights to draw"):
        plot_elevation_error({"slope": ESTIMATE}, dataclasses.replace(EXACT, reference=None))
    with pytest.raises(ValueError, match="neither an IMU nor a speed"):
        plot_streams(dataclasses.replace(EXACT, imu=None, wheel=None, gnss=None))


def test_correlations_have_names_and_numbers() -> None:
    ax = plot_calibration_correlation(CALIBRATION)
    names = list(CALIBRATION.table.index)
    assert [label.get_text() for label in ax.get_xticklabels()] == names
    assert [label.get_text() for label in ax.get_yticklabels()] == names
    drawn = [text.get_text() for text in ax.texts]
    assert drawn == [f"{value:.2f}" for value in CALIBRATION.correlation.to_numpy().ravel()]


@pytest.mark.parametrize(
    ("method", "labels"),
    [(None, ["elevation (m)"]), ("roll", ["speed (m/s)"]), ("epoch", ["roll (deg)", "pitch (deg)", "heading (deg)"])],
)
def test_errors_before_and_after_a_calibration(method: str | None, labels: list[str]) -> None:
    axes = plot_calibration_errors(CALIBRATION, EXACT, method=method)
    assert [ax.get_ylabel() for ax in axes] == labels and axes[-1].get_xlabel() == "time (s)"
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert [text.split(":")[0] for text in legend] == ["nominal", "calibrated"]
    assert all("where fitted" in text and "held out" in text for text in legend)
    if method is None:
        nominal, calibrated, _ = axes[0].get_lines()
        assert np.abs(calibrated.get_ydata()).max() < np.abs(nominal.get_ydata()).max()


def test_errors_need_a_method_of_an_estimate() -> None:
    with pytest.raises(ValueError, match=r"method must be one of an estimate, shirai, .* got 'drive'"):
        plot_calibration_errors(CALIBRATION, EXACT, method="drive")
    with pytest.raises(ValueError, match="'exact' has no reference"):
        plot_calibration_errors(CALIBRATION, dataclasses.replace(EXACT, reference=None), method="roll")
