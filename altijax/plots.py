"""Pictures: matplotlib Axes in, the same Axes out. Colours tell methods apart for colour-blind readers too."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from altijax.calibration.records import Calibration
from altijax.elevation_estimate.estimates import estimate_elevation
from altijax.elevation_estimate.model import ELEVATION_METHODS
from altijax.motion_estimate.estimates import MOTION_METHODS, estimate_motion
from altijax.motion_estimate.scores import estimate_at
from altijax.recordings import Recording
from altijax.speed_estimate.estimates import SPEED_METHODS, estimate_speed
from altijax.speed_estimate.steps import speed_of

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


def plot_calibration_correlation(calibration: Calibration, *, ax: Axes | None = None) -> Axes:
    """Correlation between calibrated constants: what is dark cannot be told apart.

    Parameters
    ----------
    calibration : Calibration
        From `calibrate`.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        With the names of the constants and the numbers.
    """
    names = list(calibration.correlation.columns)
    if ax is None:
        size = 3.0 + 0.45 * len(names)
        ax = plt.subplots(figsize=(size + 1, size), layout="constrained")[1]
    image = ax.imshow(calibration.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    for (row, column), value in np.ndenumerate(calibration.correlation.to_numpy(float)):
        ax.text(column, row, f"{value:.2f}", ha="center", va="center", color="white" if abs(value) > 0.6 else "black")
    ax.set_xticks(range(len(names)), names, rotation=40, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), names)
    ax.set_title(f"Correlation of constants, calibration of {calibration.method!r}")
    ax.figure.colorbar(image, ax=ax, label="correlation", shrink=0.7)
    return ax


def plot_calibration_errors(
    calibration: Calibration, recording: Recording, *, method: str | None = None, ax: np.ndarray | None = None
) -> np.ndarray:
    """Errors of an estimate against the reference before and after a calibration, where it was fitted and held out.

    Parameters
    ----------
    calibration : Calibration
        From `calibrate`.
    recording : Recording
        With a reference of what the method estimates.
    method : str, optional
        Method of an estimate; by default that of the calibration. A speed is aided up to where the fit ended.
    ax : array of Axes, optional
        As many as there are panels; new ones by default.

    Returns
    -------
    ax : array of Axes
        A panel a quantity, with units, the interval of the fit shaded, and root mean squares in the legends.

    Raises
    ------
    ValueError
        If the method is none of an estimate ("drive" alone estimates nothing) or the reference is missing.
    """
    method = calibration.method if method is None else method
    until = None if calibration.held_out.empty else float(calibration.held_out["until"].min())
    errors = [_errors(recording, method, known, until) for known in (None, calibration)]
    if ax is None:
        size = (8, 1.4 + 2.2 * len(errors[0]))
        ax = plt.subplots(len(errors[0]), 1, sharex=True, squeeze=False, figsize=size, layout="constrained")[1][:, 0]
    for axes, name in zip(ax, errors[0], strict=True):
        for label, colour, found in zip(("nominal", "calibrated"), _COLOURS[1::-1], errors, strict=True):
            error = found[name]
            before = error.index <= (np.inf if until is None else until)
            said = [
                f"{np.sqrt(np.mean(part**2)):.2g} {where}"
                for part, where in ((error[before], "where fitted"), (error[~before], "held out"))
                if len(part)
            ]
            axes.plot(error.index, error, color=colour, label=f"{label}: RMS {', '.join(said)}")
        if until is not None:
            axes.axvspan(errors[0][name].index[0], until, color="0.9", zorder=0)
        axes.axhline(0, color="k", linewidth=0.8)
        axes.set_ylabel(f"{name}")
        axes.margins(y=0.3)
        axes.legend(loc="upper left", fontsize="small")
    shaded = "" if until is None else ", constants fitted where shaded"
    ax[0].set_title(f"{recording.name}, {method!r}: estimate less reference{shaded}")
    ax[-1].set_xlabel("time (s)")
    return ax


def _errors(
    recording: Recording, method: str, calibration: Calibration | None, until: float | None
) -> dict[str, pd.Series]:
    """Estimate less reference by quantity and unit."""
    if method in ELEVATION_METHODS:
        t, heights = _reference(recording)
        found = np.interp(
            t, *_columns(estimate_elevation(recording, method=method, calibration=calibration), "elevation")
        )
        error = pd.Series(found - heights, t)
        return {"elevation (m)": error - error.iloc[0]}
    if method not in (*SPEED_METHODS, *MOTION_METHODS):
        known = ", ".join((*ELEVATION_METHODS, *SPEED_METHODS, *MOTION_METHODS))
        raise ValueError(f"method must be one of an estimate, {known}; got {method!r}")
    reference = recording.reference
    if reference is None or recording.imu is None:
        raise ValueError(f"recording {recording.name!r} has no reference to compare with")
    reference = reference.loc[recording.imu.index[0] : recording.imu.index[-1]]
    if method in SPEED_METHODS:
        estimate = estimate_speed(recording, method=method, calibration=calibration, aid_until=until)
        t, speed = speed_of(reference)
        return {"speed (m/s)": pd.Series(np.interp(t, *_columns(estimate, "speed")) - speed, t)}
    estimate = estimate_motion(recording, method=method, calibration=calibration)
    t = reference.index.to_numpy(float)
    at = estimate_at(estimate, t)
    angles = [name for name in ("roll", "pitch", "heading") if name in reference]
    errors = {name: at[name] - reference[name].to_numpy(float) for name in angles}
    return {
        f"{name} (deg)": pd.Series(np.degrees((error + np.pi) % (2 * np.pi) - np.pi), t).dropna()
        for name, error in errors.items()
    }


def _columns(estimate: pd.DataFrame, name: str) -> tuple[np.ndarray, np.ndarray]:
    return estimate.index.to_numpy(float), estimate[name].to_numpy(float)


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
