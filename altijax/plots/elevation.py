"""Pictures of elevations."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from altijax.plots.style import axes_or_new, by_label, colours, draw_band, finish, house_style
from altijax.recordings import Recording


def plot_elevation(
    estimates: Mapping[str, pd.DataFrame] | pd.DataFrame,
    recording: Recording | None = None,
    *,
    against: str = "way",
    ax: Axes | None = None,
) -> Axes:
    """Elevation profiles with their bands of two standard deviations.

    Parameters
    ----------
    estimates : DataFrame or mapping of str to DataFrame
        From `estimate_elevation`, by the label to show.
    recording : Recording, optional
        Its reference is drawn in black, from the height at the first IMU sample.
    against : {"way", "time"}
        What the horizontal axis shows.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        With title, units and legend.
    """
    labelled = by_label(estimates)
    with house_style():
        ax = axes_or_new(ax)
        for (label, estimate), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
            x = _abscissa(estimate, against)
            height = estimate["elevation"].to_numpy()
            draw_band(ax, x, height, estimate["elevation_std"].to_numpy(), colour)
            ax.plot(x, height, color=colour, label=label)
        if recording is not None:
            first = next(iter(labelled.values()))
            t, reference = reference_of(recording)
            ax.plot(np.interp(t, first.index, _abscissa(first, against)), reference, "k--", label="reference")
        ax.set(xlabel=_label(against), ylabel="elevation (m)")
        finish(ax, "Elevation")
    return ax


def plot_elevation_error(
    estimates: Mapping[str, pd.DataFrame] | pd.DataFrame,
    recording: Recording,
    *,
    against: str = "way",
    fitted_until: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Error of elevation profiles against the reference, from the first reference height on.

    Parameters
    ----------
    estimates : DataFrame or mapping of str to DataFrame
        From `estimate_elevation`, by the label to show.
    recording : Recording
        With a reference.
    against : {"way", "time"}
        What the horizontal axis shows.
    fitted_until : float, optional
        End of what the calibration saw, in s; shaded.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        With title, units and legend.
    """
    labelled = by_label(estimates)
    t, reference = reference_of(recording)
    with house_style():
        ax = axes_or_new(ax)
        for (label, estimate), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
            x = np.interp(t, estimate.index, _abscissa(estimate, against))
            error = np.interp(t, estimate.index, estimate["elevation"]) - reference
            ax.plot(x, error - error[0], color=colour, label=f"{label}: {np.std(error):.2f} m RMS without offset")
        if fitted_until is not None:
            ax.axvspan(x[0], np.interp(fitted_until, t, x), color="0.9", zorder=0, label="constants fitted here")
        ax.axhline(0, color="k", linewidth=0.8)
        ax.set(xlabel=_label(against), ylabel="elevation error (m)")
        finish(ax, "Error against the reference")
    return ax


def reference_of(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Times and heights of the reference within the IMU's span, from the first of them."""
    if recording.reference is None or "alt" not in recording.reference or recording.imu is None:
        raise ValueError(f"recording {recording.name!r} has no reference heights to draw")
    heights = recording.reference["alt"].dropna()
    heights = heights[(heights.index >= recording.imu.index[0]) & (heights.index <= recording.imu.index[-1])]
    return heights.index.to_numpy(float), heights.to_numpy(float) - float(heights.iloc[0])


def _abscissa(estimate: pd.DataFrame, against: str) -> np.ndarray:
    if against not in ("way", "time"):
        raise ValueError(f"against must be 'way' or 'time', got {against!r}")
    return estimate["way"].to_numpy() if against == "way" else estimate.index.to_numpy(float)


def _label(against: str) -> str:
    return {"way": "way (m)", "time": "time (s)"}[against]
