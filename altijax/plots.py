"""Pictures: matplotlib Axes in, the same Axes out. Colours tell methods apart for colour-blind readers too."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from altijax.recordings import Recording

# Okabe and Ito's palette, without its black (the reference) and its yellow (pale on white).
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def plot_elevation(
    estimates: Mapping[str, pd.DataFrame],
    recording: Recording | None = None,
    *,
    against: str = "way",
    ax: Axes | None = None,
) -> Axes:
    """Elevation profiles with their bands of two standard deviations.

    Parameters
    ----------
    estimates : mapping of str to DataFrame
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
    ax = _axes(ax)
    for (label, estimate), colour in zip(estimates.items(), _colours(len(estimates)), strict=True):
        x = _abscissa(estimate, against)
        height, std = estimate["elevation"], estimate["elevation_std"]
        ax.fill_between(x, height - 2 * std, height + 2 * std, color=colour, alpha=0.15, linewidth=0)
        ax.plot(x, height, color=colour, label=label)
    top = max(float(np.ptp(estimate["elevation"])) for estimate in estimates.values())
    heights = list(estimates.values())
    if recording is not None:
        t, reference = _reference(recording)
        ax.plot(np.interp(t, heights[0].index, _abscissa(heights[0], against)), reference, "k--", label="reference")
        top = max(top, float(np.ptp(reference)))
    middle = float(np.mean([0.5 * (e["elevation"].max() + e["elevation"].min()) for e in heights]))
    # A band wider than the road is high would press the profile flat.
    ax.set_ylim(middle - 1.2 * top, middle + 1.2 * top)
    ax.set(title="Elevation", xlabel=_label(against), ylabel="elevation (m)")
    ax.legend()
    return ax


def plot_elevation_error(
    estimates: Mapping[str, pd.DataFrame],
    recording: Recording,
    *,
    against: str = "way",
    fitted_until: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Error of elevation profiles against the reference, from the first reference height on.

    Parameters
    ----------
    estimates : mapping of str to DataFrame
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
    ax = _axes(ax)
    t, reference = _reference(recording)
    for (label, estimate), colour in zip(estimates.items(), _colours(len(estimates)), strict=True):
        x = np.interp(t, estimate.index, _abscissa(estimate, against))
        error = np.interp(t, estimate.index, estimate["elevation"]) - reference
        ax.plot(x, error - error[0], color=colour, label=f"{label}: {np.std(error):.2f} m RMS without offset")
    if fitted_until is not None:
        ax.axvspan(x[0], np.interp(fitted_until, t, x), color="0.9", zorder=0, label="constants fitted here")
    ax.axhline(0, color="k", linewidth=0.8)
    ax.set(title="Error against the reference", xlabel=_label(against), ylabel="elevation error (m)")
    ax.legend()
    return ax


def plot_streams(recording: Recording, *, ax: np.ndarray | None = None) -> np.ndarray:
    """What the sensors of a recording read, one panel a quantity.

    Parameters
    ----------
    recording : Recording
        Any recording.
    ax : array of Axes, optional
        As many as there are panels; new ones by default.

    Returns
    -------
    ax : array of Axes
        Specific force, angular rate and speed, as far as recorded, with common time.
    """
    panels: list[tuple[str, list[tuple[str, pd.Series]]]] = []
    imu = recording.imu
    if imu is not None:
        panels.append(
            ("specific force (m/s$^2$)", [(n, imu[c]) for n, c in zip("xyz", ("ax", "ay", "az"), strict=True)])
        )
        if "gx" in imu:
            panels.append(
                ("angular rate (rad/s)", [(n, imu[c]) for n, c in zip("xyz", ("gx", "gy", "gz"), strict=True)])
            )
    speeds = []
    if recording.wheel is not None:
        speeds.append(("wheel", recording.wheel["speed"]))
    if recording.gnss is not None:
        ground_speed = np.hypot(recording.gnss["v_e"], recording.gnss["v_n"])
        speeds.append(("GNSS", pd.Series(ground_speed, recording.gnss.index)))
    if speeds:
        panels.append(("speed (m/s)", speeds))
    if not panels:
        raise ValueError(f"recording {recording.name!r} has neither an IMU nor a speed to draw")
    if ax is None:
        size = (8, 2.2 * len(panels))
        ax = plt.subplots(len(panels), 1, sharex=True, squeeze=False, figsize=size, layout="constrained")[1][:, 0]
    for axes, (quantity, series) in zip(ax, panels, strict=True):
        for (label, values), colour in zip(series, _COLOURS, strict=False):
            axes.plot(values.index, values, color=colour, linewidth=0.6, label=label)
        axes.set_ylabel(quantity)
        for handle in axes.legend(loc="upper right", ncols=3).legend_handles:
            handle.set_linewidth(2)
    ax[0].set_title(recording.name)
    ax[-1].set_xlabel("time (s)")
    return ax


def _axes(ax: Axes | None) -> Axes:
    return plt.subplots(figsize=(8, 4), layout="constrained")[1] if ax is None else ax


def _colours(number: int) -> list[str]:
    return [_COLOURS[i % len(_COLOURS)] for i in range(number)]


def _abscissa(estimate: pd.DataFrame, against: str) -> np.ndarray:
    if against not in ("way", "time"):
        raise ValueError(f"against must be 'way' or 'time', got {against!r}")
    return estimate["way"].to_numpy() if against == "way" else estimate.index.to_numpy(float)


def _label(against: str) -> str:
    return {"way": "way (m)", "time": "time (s)"}[against]


def _reference(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Times and heights of the reference within the IMU's span, from the first of them."""
    if recording.reference is None or "alt" not in recording.reference or recording.imu is None:
        raise ValueError(f"recording {recording.name!r} has no reference heights to draw")
    heights = recording.reference["alt"].dropna()
    heights = heights[(heights.index >= recording.imu.index[0]) & (heights.index <= recording.imu.index[-1])]
    return heights.index.to_numpy(float), heights.to_numpy(float) - float(heights.iloc[0])
