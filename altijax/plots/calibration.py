"""Pictures of calibrations."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from altijax.calibration.records import Calibration
from altijax.elevation_estimate.estimates import estimate_elevation
from altijax.elevation_estimate.model import ELEVATION_METHODS
from altijax.motion_estimate.estimates import MOTION_METHODS, estimate_motion
from altijax.motion_estimate.scores import estimate_at
from altijax.plots.elevation import reference_of
from altijax.plots.style import COLOURS, axes_or_new, finish, house_style, panels_or_new
from altijax.recordings import Recording
from altijax.speed_estimate.estimates import SPEED_METHODS, estimate_speed
from altijax.speed_estimate.steps import speed_of


def plot_calibration(calibration: Calibration, *, ax: Axes | None = None) -> Axes:
    """What a calibration has found, in standard deviations of what was believed before.

    Parameters
    ----------
    calibration : Calibration
        From `calibrate`.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        A row a constant: what was believed (grey, one and two standard deviations), the value with two standard
        deviations, and both as numbers with units.
    """
    table = calibration.table[::-1]
    rows = np.arange(len(table))
    found = ((table["value"] - table["prior"]) / table["prior_std"]).to_numpy(float)
    std = (table["std"] / table["prior_std"]).to_numpy(float)
    with house_style():
        ax = axes_or_new(ax, (8.0, 1.3 + 0.32 * len(table)))
        ax.axvspan(-2, 2, color="0.93", zorder=0)
        ax.axvspan(-1, 1, color="0.85", zorder=0, label="before: one and two standard deviations")
        style: dict[str, Any] = dict(fmt="o", color=COLOURS[0], markersize=5, capsize=3, elinewidth=1.5)
        ax.errorbar(found, rows, xerr=2 * std, label="found, with two standard deviations", **style)
        ax.set_yticks(rows, list(table.index))
        ax.set_ylim(-0.6, len(table) - 0.4)
        reach = max(2.4, 1.1 * float(np.max(np.abs(found) + np.minimum(2 * std, 2))))
        ax.set_xlim(-reach, reach)
        for row, (_, constant) in zip(rows, table.iterrows(), strict=True):
            unit = "" if constant["unit"] == "1" else f" {constant['unit']}"
            text = f"{constant['value']:.4g} ± {constant['std']:.2g}{unit}"
            ax.annotate(text, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize=8)
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("change from what was believed (standard deviations of it)")
        finish(ax, f"Constants, calibration of {calibration.method!r}", columns=2)
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
    size = 3.0 + 0.45 * len(names)
    with house_style():
        ax = axes_or_new(ax, (size + 1, size))
        _draw_correlation(calibration, names, ax)
    return ax


def _draw_correlation(calibration: Calibration, names: list[str], ax: Axes) -> None:
    ax.grid(visible=False)
    image = ax.imshow(calibration.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    for (row, column), value in np.ndenumerate(calibration.correlation.to_numpy(float)):
        ax.text(column, row, f"{value:.2f}", ha="center", va="center", color="white" if abs(value) > 0.6 else "black")
    ax.set_xticks(range(len(names)), names, rotation=40, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), names)
    ax.set_title(f"Correlation of constants, calibration of {calibration.method!r}")
    ax.figure.colorbar(image, ax=ax, label="correlation", shrink=0.7)


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
    with house_style():
        ax = panels_or_new(ax, len(errors[0]))
        for axes, name in zip(ax, errors[0], strict=True):
            _draw_errors(axes, name, [found[name] for found in errors], until)
        shaded = "" if until is None else ", constants fitted where shaded"
        finish(ax[0], f"{recording.name}, {method!r}: estimate less reference{shaded}", columns=1)
        ax[-1].set_xlabel("time (s)")
    return ax


def _draw_errors(ax: Axes, name: str, errors: list[pd.Series], until: float | None) -> None:
    for label, colour, error in zip(("nominal", "calibrated"), COLOURS[1::-1], errors, strict=True):
        before = error.index <= (np.inf if until is None else until)
        said = [
            f"{np.sqrt(np.mean(part**2)):.2g} {where}"
            for part, where in ((error[before], "where fitted"), (error[~before], "held out"))
            if len(part)
        ]
        ax.plot(error.index, error, color=colour, label=f"{label}: RMS {', '.join(said)}")
    if until is not None:
        ax.axvspan(errors[0].index[0], until, color="0.9", zorder=0)
    ax.axhline(0, color="k", linewidth=0.8)
    ax.set_ylabel(name)
    finish(ax, columns=1)


def _errors(
    recording: Recording, method: str, calibration: Calibration | None, until: float | None
) -> dict[str, pd.Series]:
    """Estimate less reference by quantity and unit."""
    if method in ELEVATION_METHODS:
        t, heights = reference_of(recording)
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
