"""Pictures of sweeps: lines, maps, and where a limit is crossed."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.plots.sweeps import plot_sweep
from altijax.sweeps import sweep


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


GRID = {"noise": np.geomspace(0.01, 10, 7), "gain": [1.0, 2.0, 3.0]}
RESULT = sweep(lambda noise, gain: {"rms": noise * gain, "twice": 2 * noise}, GRID, progress=False)
LABELLED = sweep(lambda noise, car: noise * car, {"noise": [1.0, 2.0], "car": {"old": 2.0, "new": 1.0}}, progress=False)


def test_lines_say_where_the_limit_is_crossed() -> None:
    ax = plot_sweep(RESULT, limit=1.0, kind="lines", unit="m")
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend[0].startswith("gain 1: 1 at noise 1") and len(legend) == 3
    assert ax.get_xscale() == "log" and (ax.get_xlabel(), ax.get_ylabel()) == ("noise", "rms (m)")
    assert len(plot_sweep(LABELLED).get_lines()) == 2


def test_a_map_has_iso_lines_and_the_limit() -> None:
    ax = plot_sweep(RESULT, limit=1.0)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_xscale()) == ("noise", "gain", "log")
    assert "rms 1" in [text.get_text() for text in ax.texts]


def test_others_are_held() -> None:
    line = plot_sweep(RESULT, "twice", at={"gain": 2.0}).get_lines()[0]
    np.testing.assert_allclose(line.get_ydata(), 2 * GRID["noise"])


def test_what_cannot_be_drawn_is_said() -> None:
    three = sweep(lambda a, b, c: a * b * c, {"a": [1.0], "b": [1.0], "c": [1.0]}, progress=False)
    with pytest.raises(ValueError, match="hold all but two"):
        plot_sweep(three)
    with pytest.raises(ValueError, match="a map needs two numbers"):
        plot_sweep(LABELLED, kind="map")
