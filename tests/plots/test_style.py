"""The house style: settings of matplotlib are as before afterwards."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.plots.style import COLOURS, axes_or_new, draw_band, finish, house_style


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_settings_are_as_before_afterwards() -> None:
    before = dict(plt.rcParams)
    with house_style():
        assert plt.rcParams["axes.prop_cycle"].by_key()["color"] == list(COLOURS)
    assert dict(plt.rcParams) == before


def test_interaction_that_a_first_figure_switches_on_stays_on() -> None:
    with house_style():
        plt.ion()
    assert plt.isinteractive()
    plt.ioff()


def test_limits_show_the_lines_and_the_legend_the_bands() -> None:
    x = np.linspace(0, 1, 50)
    ax = axes_or_new(None)
    draw_band(ax, x, x, np.full(50, 10.0), COLOURS[0])
    ax.plot(x, x, label="line")
    finish(ax, "title")
    low, high = ax.get_ylim()
    assert -0.6 < low < 0 and 1 < high < 1.6
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["line", "band: two standard deviations"]
    assert ax.get_title(loc="left") == "title" or ax.get_title() == "title"
