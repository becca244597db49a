"""Pictures of calibrations: names, numbers, and errors before and after."""

import dataclasses

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.estimates import calibrate
from altijax.plots.calibration import plot_calibration, plot_calibration_correlation, plot_calibration_errors
from tests.exact import EXACT

CALIBRATION = calibrate(EXACT, ["accelerometer_bias_x", "wheel_scale"], method="slope", until=30.0)


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_constants_stand_in_standard_deviations_of_what_was_believed() -> None:
    ax = plot_calibration(CALIBRATION)
    assert [label.get_text() for label in ax.get_yticklabels()] == list(CALIBRATION.table.index[::-1])
    shift = ((CALIBRATION.table["value"] - CALIBRATION.table["prior"]) / CALIBRATION.table["prior_std"])[::-1]
    np.testing.assert_allclose(ax.get_lines()[0].get_xdata(), shift)
    assert all("±" in text.get_text() for text in ax.texts) and len(ax.texts) == 2


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
