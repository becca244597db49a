"""Places of a GNSS receiver's antenna over ground, late, with errors that last."""

import jax
import numpy as np
import pymap3d

from altijax.drives import start_of
from altijax.recordings import Recording
from altijax.vehicle.measurements.doppler_velocity import ANTENNA, GNSS_DELAY, means_at
from altijax.vehicle.parts import Instant, Kind, Level, Part, Rows, State

# Of a single place of a receiver under open sky, m, half of it gone by the next epoch.
_STD = 1.0


def expected(state: State, at: Instant, lead: jax.Array) -> jax.Array:
    """Place of the antenna, East and North of the first one (2,), m."""
    later = lead - (state["gnss_delay"] - at.delay)
    place = state["position"] + state["velocity"] * later
    if "antenna" in state:
        place = place + state["C_nb"] @ state["antenna"]
    return place[:2] + state["place"] + state["place_error"]


def measured(recording: Recording, t: np.ndarray) -> Rows | None:
    """Means of the places that lie closer to an instant, on the receiver's clock, than to any other."""
    if recording.gnss is None or "lat" not in recording.gnss:
        return None
    gnss = recording.gnss.dropna(subset=["lat", "lon"])
    origin = origin_of(recording)
    if origin is None:
        return None
    stamp = gnss.index.to_numpy(float) - start_of(recording)
    east, north, _ = pymap3d.geodetic2enu(gnss["lat"].to_numpy(float), gnss["lon"].to_numpy(float), origin[2], *origin)
    value = np.stack([east, north], -1)
    return means_at(t, stamp, value, np.full_like(value, _STD), 0.5 * float(np.median(np.diff(t))))


def origin_of(recording: Recording) -> tuple[float, float, float] | None:
    """Latitude and longitude (deg) and height (m) of the first place of the receiver; None where there is none."""
    gnss = recording.gnss
    if gnss is None or not {"lat", "lon"} <= set(gnss):
        return None
    places = gnss[["lat", "lon"]].dropna()
    if not len(places):
        return None
    height = float(gnss["alt"].dropna().iloc[0]) if "alt" in gnss and gnss["alt"].notna().any() else 0.0
    return float(places["lat"].iloc[0]), float(places["lon"].iloc[0]), height


KIND = Kind(
    rows=("east", "north"),
    expected=expected,
    measured=measured,
    by_receiver=True,
    parts={
        "antenna": ANTENNA,
        "gnss_delay": GNSS_DELAY,
        # Of the origin of the receiver's places in the coordinates that begin with the vehicle.
        "place": Part(size=2, entries=("e", "n"), std=100.0),
        "place_error": Part(size=2, level=("place_error",), time="place_time"),
    },
    levels={
        "place": Level(usual=1.0, spread=1.0),
        "place_error": Level(usual=2.0, spread=1.0),
        "place_time": Level(usual=60.0, spread=1.0),
    },
    factor=("place", "place"),
)
