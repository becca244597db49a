"""Pictures of what the sensors of a recording read."""

import numpy as np
import pandas as pd

from altijax.plots.style import COLOURS, finish, house_style, panels_or_new
from altijax.recordings import Recording


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
    with house_style():
        ax = panels_or_new(ax, len(panels))
        for axes, (quantity, series) in zip(ax, panels, strict=True):
            for (label, values), colour in zip(series, COLOURS, strict=False):
                axes.plot(values.index, values, color=colour, linewidth=0.7, label=label)
            axes.set_ylabel(quantity)
            finish(axes, recording.name if axes is ax[0] else "")
            for handle in axes.get_legend().legend_handles:
                handle.set_linewidth(2)
        ax[-1].set_xlabel("time (s)")
    return ax
