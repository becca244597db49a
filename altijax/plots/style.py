"""One house style for all pictures: legible in print, and told apart by colour-blind readers."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Patch

# Okabe and Ito's palette, without its black (the reference) and its yellow (pale on white).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

STYLE: Any = {
    "axes.grid": True,
    "axes.prop_cycle": plt.cycler(color=COLOURS),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "grid.alpha": 0.35,
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
"""Settings of matplotlib inside `house_style`."""

BAND = "band: two standard deviations"
# A line of a legend, in points.
_LINE = 13.0


@contextmanager
def house_style() -> Iterator[None]:
    """What is drawn inside has the house's style; matplotlib's settings are as before afterwards."""
    with plt.rc_context(STYLE):
        yield
        interactive = plt.isinteractive()
    # A notebook's backend, loaded with the first figure, switches interaction on; the context must not switch it off.
    matplotlib.interactive(interactive)


def by_label(estimates: Mapping[str, pd.DataFrame] | pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Estimates by the label to show; one alone is "estimate"."""
    return {"estimate": estimates} if isinstance(estimates, pd.DataFrame) else dict(estimates)


def colours(number: int) -> list[str]:
    """As many colours, from the beginning again where there are more than six."""
    return [COLOURS[i % len(COLOURS)] for i in range(number)]


def axes_or_new(ax: Axes | None, size: tuple[float, float] = (8.0, 4.0)) -> Axes:
    """The axes given, else new ones."""
    return plt.subplots(figsize=size)[1] if ax is None else ax


def panels_or_new(ax: Any, rows: int, columns: int = 1, height: float = 2.2) -> np.ndarray:
    """The axes given, else new ones below each other with a common horizontal axis; (rows * columns,)."""
    if ax is None:
        size = (8.0 if columns == 1 else 10.0, 0.6 + height * rows)
        ax = plt.subplots(rows, columns, sharex=True, squeeze=False, figsize=size)[1]
    return np.asarray(ax, object).reshape(-1)


def draw_band(ax: Axes, x: np.ndarray, y: np.ndarray, std: np.ndarray, colour: str) -> None:
    """A band of two standard deviations about a line."""
    ax.fill_between(x, y - 2 * std, y + 2 * std, color=colour, alpha=0.18, linewidth=0)


def finish(ax: Axes, title: str = "", *, columns: int = 5, band: str = BAND) -> None:
    """Limits that show the lines, and a legend above the axes, with the bands in it, below the title."""
    show_lines(ax)
    handles, labels = ax.get_legend_handles_labels()
    if _has_bands(ax):
        handles, labels = [*handles, Patch(color="0.5", alpha=0.3, linewidth=0)], [*labels, band]
    rows = 0
    if handles:
        rows = -(-len(handles) // columns)
        place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
        ax.legend(handles, labels, ncols=columns, handlelength=1.6, columnspacing=1.4, **place)
    if title:
        ax.set_title(title, pad=6 + _LINE * rows)


def show_lines(ax: Axes) -> None:
    """Vertical limits by the lines, with half as much again for bands: wide ones must not press the lines flat."""
    ends = [_ends(line.get_ydata()) for line in ax.get_lines() if len(np.atleast_1d(line.get_ydata())) > 2]
    ends = [pair for pair in ends if np.isfinite(pair).all()]
    if not ends or not _has_bands(ax) or ax.get_yscale() == "log":
        return
    low, high = min(pair[0] for pair in ends), max(pair[1] for pair in ends)
    room = max(0.5 * (high - low), 1e-9)
    bottom, top = ax.dataLim.y0, ax.dataLim.y1
    margin = 0.04 * (high - low)
    ax.set_ylim(max(bottom, low - room) - margin, min(top, high + room) + margin)


def _has_bands(ax: Axes) -> bool:
    return any(
        collection.__class__.__name__ in ("PolyCollection", "FillBetweenPolyCollection")
        for collection in ax.collections
    )


def _ends(values: Any) -> tuple[float, float]:
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    return (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
