"""Pictures of streams: a panel a quantity."""

import dataclasses

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import pytest

from altijax.plots.streams import plot_streams
from tests.exact import EXACT


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_streams_get_a_panel_each() -> None:
    axes = plot_streams(EXACT)
    assert [ax.get_ylabel().split(" (")[0] for ax in axes] == ["specific force", "angular rate", "speed"]
    assert len(axes[2].get_lines()) == 2 and axes[-1].get_xlabel() == "time (s)"
    bare = dataclasses.replace(EXACT, imu=EXACT.imu[["ax", "ay", "az"]], wheel=None, gnss=None)
    assert len(plot_streams(bare)) == 1


def test_nothing_is_drawn_from_nothing() -> None:
    with pytest.raises(ValueError, match="neither an IMU nor a speed"):
        plot_streams(dataclasses.replace(EXACT, imu=None, wheel=None, gnss=None))
