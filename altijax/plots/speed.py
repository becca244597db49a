"""Pictures of speeds."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from altijax.plots.style import axes_or_new, by_label, colours, draw_band, finish, house_style
from altijax.recordings import Recording
from altijax.speed_estimate.steps import speed_of


def plot_speed(
    estimates: Mapping[str, pd.DataFrame] | pd.DataFrame,
    recording: Recording | None = None,
    *,
    aided_until: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Speeds with their bands of two standard deviations.

    Parameters
    ----------
    estimates : DataFrame or mapping of str to DataFrame
        From `estimate_speed` or `estimate_drive`, by the label to show.
    recording : Recording, optional
        The speed of its reference is drawn in black.
    aided_until : float, optional
        End of the aid, in s; shaded.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        With title, units and legend; gaps where the estimate is not valid.
    """
    labelled = by_label(estimates)
    with house_style():
        ax = axes_or_new(ax)
        for (label, estimate), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
            t = estimate.index.to_numpy(float)
            speed = estimate["speed"].where(estimate["valid"]).to_numpy(float)
            draw_band(ax, t, speed, estimate["speed_std"].to_numpy(float), colour)
            ax.plot(t, speed, color=colour, label=label)
        if recording is not None and recording.reference is not None and "v_e" in recording.reference:
            ax.plot(*speed_of(recording.reference), "k--", label="reference")
        if aided_until is not None:
            begin = min(float(estimate.index[0]) for estimate in labelled.values())
            ax.axvspan(begin, aided_until, color="0.93", zorder=0, linewidth=0, label="aided")
        ax.set(xlabel="time (s)", ylabel="speed (m/s)")
        finish(ax, "Speed along the path")
    return ax


def broken_at_wraps(angle: np.ndarray) -> np.ndarray:
    """An angle in degrees with a gap in place of each jump by a whole turn."""
    jumps = np.abs(np.diff(angle, prepend=angle[:1])) > 180
    return np.where(jumps, np.nan, angle)
