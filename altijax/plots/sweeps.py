"""Pictures of sweeps: lines over one value, maps with iso-lines over two, and what a sensor must be read off them."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import LogLocator, MaxNLocator

from altijax.plots.style import axes_or_new, colours, draw_band, finish, house_style
from altijax.sweeps import read_off, spaced_by_factors


def plot_sweep(
    result: pd.DataFrame,
    value: str | None = None,
    *,
    limit: float | None = None,
    at: dict[str, Any] | None = None,
    kind: str | None = None,
    unit: str = "",
    ax: Axes | None = None,
) -> Axes:
    """A sweep as lines or as a map, and what a sensor must be for a limit.

    Parameters
    ----------
    result : DataFrame
        From `sweep`.
    value : str, optional
        Which column; the first one by default.
    limit : float, optional
        Of the number: drawn, and where it is crossed written beside (`read_off`).
    at : dict of str, optional
        Values at which others of the grid are held, so that one or two are left.
    kind : {"lines", "map"}, optional
        A map is the default over two numbers. Lines are over the first value, one for each of the second.
    unit : str, optional
        Of the number.
    ax : Axes, optional
        Where to draw; new axes by default.

    Returns
    -------
    ax : Axes
        Lines with a band of two standard errors where there were repeats; scales by factors where values are so.

    Raises
    ------
    ValueError
        If more than two values are left, or a map is wanted of fewer or of labels.
    """
    name = str(result.columns[0]) if value is None else value
    for held, x in (at or {}).items():
        result = result[result.index.get_level_values(held) == x].droplevel(held)
    names = list(map(str, result.index.names))
    if len(names) > 2:
        raise ValueError(f"{', '.join(names)} are swept: hold all but two of them by at=")
    numbers = [pd.api.types.is_numeric_dtype(result.index.get_level_values(axis)) for axis in names]
    kind = kind or ("map" if len(names) == 2 and all(numbers) else "lines")
    if kind == "map" and (len(names) < 2 or not all(numbers)):
        raise ValueError(f"a map needs two numbers; {', '.join(names)} are swept")
    with house_style():
        ax = axes_or_new(ax, (7.5, 4.8))
        draw = _map if kind == "map" else _lines
        draw(ax, result, name, limit, f"{name} ({unit})" if unit else name)
    return ax


def _lines(ax: Axes, result: pd.DataFrame, name: str, limit: float | None, label: str) -> None:
    along, *others = map(str, result.index.names)
    groups = list(result.groupby(level=others[0], sort=False)) if others else [("", result)]
    by_factors = False
    shades: list[Any] = list(colours(len(groups)))
    if others and pd.api.types.is_numeric_dtype(result.index.get_level_values(others[0])):
        # From dark to light as the number grows; the lightest yellow is pale on white.
        shades = list(plt.get_cmap("viridis")(np.linspace(0, 0.9, len(groups))))
    for (of, part), colour in zip(groups, shades, strict=True):
        part = part.droplevel(others[0]) if others else part
        if pd.api.types.is_numeric_dtype(part.index):
            part = part.sort_index()
            by_factors = spaced_by_factors(part.index.to_numpy(float))
        x, y = part.index.to_numpy(), part[name].to_numpy(float)
        text = f"{others[0]} {_short(of)}" if others else name
        if limit is not None and pd.api.types.is_numeric_dtype(part.index):
            crossing = read_off(part, limit, value=name)
            if np.isfinite(crossing):
                text += f": {_short(limit)} at {along} {crossing:.3g}"
                ax.plot(crossing, limit, "o", color=colour, markersize=7, markerfacecolor="w", zorder=4)
        if f"{name}_error" in part:
            draw_band(ax, x, y, part[f"{name}_error"].to_numpy(float), colour)
        ax.plot(x, y, ".-", color=colour, label=text)
    if limit is not None:
        ax.axhline(limit, color="k", linewidth=0.8, linestyle="--")
    values = result[name].dropna()
    if by_factors:
        ax.set_xscale("log")
    if len(values) and values.min() > 0 and values.max() > 20 * values.min():
        ax.set_yscale("log")
    ax.set(xlabel=str(along), ylabel=label)
    finish(ax, f"{name} by {' and '.join(map(str, result.index.names))}", columns=2, band="band: two standard errors")


def _map(ax: Axes, result: pd.DataFrame, name: str, limit: float | None, label: str) -> None:
    along, up = result.index.names
    table = result[name].unstack(along).sort_index().sort_index(axis=1)
    x, y, z = table.columns.to_numpy(float), table.index.to_numpy(float), table.to_numpy(float)
    wide = np.nanmin(z) > 0 and np.nanmax(z) > 10 * np.nanmin(z)
    levels = (
        LogLocator(subs=(1, 2, 5)).tick_values(np.nanmin(z), np.nanmax(z))
        if wide
        else MaxNLocator(8).tick_values(np.nanmin(z), np.nanmax(z))
    )
    norm = (LogNorm if wide else Normalize)(np.nanmin(z), np.nanmax(z))
    mesh = ax.pcolormesh(x, y, z, cmap="cividis", shading="gouraud", norm=norm)
    # Labels make their gaps in the lines as they are drawn: the scales come first.
    for values, scale in ((x, ax.set_xscale), (y, ax.set_yscale)):
        if spaced_by_factors(values):
            scale("log")
    lines = ax.contour(x, y, z, levels=[level for level in levels if level != limit], colors="w", linewidths=0.8)
    ax.clabel(lines, fmt=_short, fontsize=8)
    if limit is not None and np.nanmin(z) < limit < np.nanmax(z):
        bold = ax.contour(x, y, z, levels=[limit], colors="#D55E00", linewidths=2.5)
        for text in ax.clabel(bold, fmt=lambda level: f"{name} {_short(level)}", fontsize=9):
            text.set(color="k", bbox={"facecolor": "w", "edgecolor": "none", "pad": 1.5})
    ax.grid(visible=False)
    ax.figure.colorbar(mesh, ax=ax, label=label)
    ax.set(xlabel=str(along), ylabel=str(up), title=f"{name} by {along} and {up}")


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, int | float | np.number) else str(value)
