"""Pictures of attitude and velocity."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from altijax.plots.motion import plot_motion
from tests.plots.made import REFERENCE, estimate


@pytest.fixture(autouse=True)
def close_figures() -> object:
    yield
    plt.close("all")


def test_six_panels_with_units() -> None:
    axes = plot_motion(estimate(), REFERENCE)
    assert [ax.get_ylabel() for ax in axes] == [
        "roll (deg)",
        "velocity East (m/s)",
        "pitch (deg)",
        "velocity North (m/s)",
        "heading (deg)",
        "velocity up (m/s)",
    ]
    line, reference = axes[0].get_lines()
    np.testing.assert_allclose(line.get_ydata(), np.degrees(estimate()["roll"]))
    np.testing.assert_allclose(reference.get_ydata(), line.get_ydata())
    assert np.isnan(axes[4].get_lines()[0].get_ydata()).sum() == 1
    assert plot_motion(estimate(), ax=axes)[0] is axes[0]
