"""Pictures of attitude and velocity."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from altijax.plots.speed import broken_at_wraps
from altijax.plots.style import by_label, colours, draw_band, finish, house_style, panels_or_new
from altijax.recordings import Recording

_QUANTITIES = {"roll": "roll (deg)", "v_e": "velocity East (m/s)", "pitch": "pitch (deg)"}
_QUANTITIES |= {"v_n": "velocity North (m/s)", "heading": "heading (deg)", "v_u": "velocity up (m/s)"}
_ANGLES = ("roll", "pitch", "heading")


def plot_motion(
    estimates: Mapping[str, pd.DataFrame] | pd.DataFrame,
    recording: Recording | None = None,
    *,
    ax: np.ndarray | None = None,
) -> np.ndarray:
    """Attitude and velocity with their bands of two standard deviations.

    Parameters
    ----------
    estimates : DataFrame or mapping of str to DataFrame
        From `estimate_motion` or `estimate_drive`, by the label to show.
    recording : Recording, optional
        Its reference is drawn in black, as far as it has these.
    ax : array of Axes, optional
        Six; new ones by default, in three rows.

    Returns
    -------
    ax : array of Axes
        Roll, velocity East, pitch, velocity North, heading and velocity up, with units and common time.
    """
    labelled = by_label(estimates)
    reference = None if recording is None else recording.reference
    with house_style():
        ax = panels_or_new(ax, 3, 2)
        for axes, (name, label) in zip(ax, _QUANTITIES.items(), strict=True):
            for (of, estimate), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
                t, valid = estimate.index.to_numpy(float), estimate["valid"].to_numpy(bool)
                value, std = (_in_units(name, estimate[x].to_numpy(float)) for x in (name, f"{name}_std"))
                value = np.where(valid, value, np.nan)
                line = broken_at_wraps(value) if name == "heading" else value
                draw_band(axes, t, line, std, colour)
                axes.plot(t, line, color=colour, label=of)
            if reference is not None and name in reference:
                true = _in_units(name, reference[name].to_numpy(float))
                true = broken_at_wraps(true) if name == "heading" else true
                axes.plot(reference.index, true, "k--", linewidth=0.9, label="reference")
            axes.set_ylabel(label)
            finish(axes, columns=3)
            axes.get_legend().set_visible(axes is ax[0])
        for axes in ax[-2:]:
            axes.set_xlabel("time (s)")
    return ax


def _in_units(name: str, values: np.ndarray) -> np.ndarray:
    return np.degrees(values) if name in _ANGLES else values
