"""Maps of drives: with streets where folium is there and places are known, else on plain axes in metres."""

from importlib.util import find_spec
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

from altijax.plots.style import axes_or_new, house_style
from altijax.recordings import Recording

_UNITS = {"elevation": "m", "height": "m", "distance": "m", "speed": "m/s"}
# From dark to light alike for all readers and in print.
_MAP = "viridis"
# Points of a line on a street map: more make the notebook heavy and nothing finer.
_MOST_POINTS = 1500
_SHADES = 12


def plot_map(
    estimate: pd.DataFrame,
    recording: Recording | None = None,
    *,
    colour_by: str = "elevation",
    ax: Axes | None = None,
) -> Any:
    """Where a drive went, coloured by a quantity.

    Parameters
    ----------
    estimate : DataFrame
        From `estimate_drive`.
    recording : Recording, optional
        The places of its reference are drawn in black.
    colour_by : str, optional
        A column of the estimate.
    ax : Axes, optional
        Where to draw. Without, a street map where folium is installed (extra ``lab``) and the estimate has places;
        its tiles come over the network when it is shown. Else new axes, in metres East and North.

    Returns
    -------
    map : folium.Map or Axes
        With start, end and a scale of the colours.

    Raises
    ------
    ValueError
        If the estimate has no such column or no positions.
    """
    missing = [name for name in ("east", "north", colour_by) if name not in estimate]
    if missing:
        raise ValueError(f"the estimate has no {', '.join(missing)}: take one of estimate_drive")
    valid = estimate[estimate["valid"]]
    if ax is None and find_spec("folium") is not None and "lat" in valid and valid["lat"].notna().any():
        return _streets(valid, recording, colour_by)
    with house_style():
        wide, high = (float(np.ptp(valid[name])) for name in ("east", "north"))
        size = (8.0, float(np.clip(7.0 * high / max(wide, 1e-9), 2.2, 7.0)) + 0.8)
        return _plain(valid, recording, colour_by, axes_or_new(ax, size))


def _plain(estimate: pd.DataFrame, recording: Recording | None, colour_by: str, ax: Axes) -> Axes:
    places = estimate[["east", "north"]].to_numpy(float)
    pieces = np.stack([places[:-1], places[1:]], 1)
    lines = LineCollection(list(pieces), cmap=_MAP, linewidth=2.5)
    lines.set_array(estimate[colour_by].to_numpy(float)[1:])
    ax.add_collection(lines)
    true = _reference(estimate, recording)
    if true is not None and {"lat", "lon"} <= set(estimate):
        ax.plot(*_metres(true, estimate).T, "k--", linewidth=0.9, label="reference", zorder=3)
    for place, marker, label in ((places[0], "o", "start"), (places[-1], "s", "end")):
        ax.plot(*place, marker, color="k", markerfacecolor="w", markersize=7, label=label, zorder=4)
    ax.autoscale_view()
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="East (m)", ylabel="North (m)", title="Track")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    ax.figure.colorbar(lines, ax=ax, label=_with_unit(colour_by), shrink=0.8)
    return ax


def _streets(estimate: pd.DataFrame, recording: Recording | None, colour_by: str) -> Any:
    import branca.colormap
    import folium

    thin = estimate.iloc[:: max(1, len(estimate) // _MOST_POINTS)]
    places = thin[["lat", "lon"]].to_numpy(float)
    found = folium.Map(control_scale=True)
    shades = [to_hex(plt.get_cmap(_MAP)(x)) for x in np.linspace(0, 1, _SHADES)]
    values = thin[colour_by].to_numpy(float)
    low, high = float(values.min()), float(values.max())
    scale = branca.colormap.LinearColormap(shades, vmin=low, vmax=max(high, low + 1e-9))
    scale.caption = _with_unit(colour_by)
    true = _reference(estimate, recording)
    if true is not None:
        folium.PolyLine(true.tolist(), color="black", weight=2, dash_array="6", tooltip="reference").add_to(found)
    folium.ColorLine(places.tolist(), values[1:].tolist(), colormap=scale, weight=5).add_to(found)
    for place, label in ((places[0], "start"), (places[-1], "end")):
        folium.CircleMarker(
            place.tolist(), radius=6, color="black", fill_color="white", fill_opacity=1, tooltip=label
        ).add_to(found)
    scale.add_to(found)
    found.fit_bounds([places.min(0).tolist(), places.max(0).tolist()])
    return found


def _reference(estimate: pd.DataFrame, recording: Recording | None) -> np.ndarray | None:
    """Latitudes and longitudes of the reference while there is an estimate."""
    if recording is None or recording.reference is None or not {"lat", "lon"} <= set(recording.reference):
        return None
    return recording.reference.loc[estimate.index[0] : estimate.index[-1], ["lat", "lon"]].dropna().to_numpy(float)


def _metres(places: np.ndarray, estimate: pd.DataFrame) -> np.ndarray:
    """Places East and North, m, where those of the estimate are; the Earth flat over a drive."""
    lat, lon, east, north = (float(estimate[name].mean()) for name in ("lat", "lon", "east", "north"))
    metre = 6371000.0 * np.radians(1.0)
    return np.column_stack(
        [east + (places[:, 1] - lon) * metre * np.cos(np.radians(lat)), north + (places[:, 0] - lat) * metre]
    )


def _with_unit(name: str) -> str:
    return f"{name} ({_UNITS[name]})" if name in _UNITS else name
