"""An estimate made up for pictures, and a recording whose reference is the same."""

import numpy as np
import pandas as pd

from altijax.recordings import Recording

TIMES = pd.Index(np.linspace(0, 10, 101), name="t")


def estimate() -> pd.DataFrame:
    """Half a circle from East to North."""
    t = TIMES.to_numpy()
    columns = {"roll": 0.01 * t, "pitch": 0.02 * t, "heading": (6.0 + 0.1 * t) % (2 * np.pi)}
    columns |= {"v_e": 5 + 0 * t, "v_n": t, "v_u": 0 * t, "speed": np.hypot(5, t), "east": 5 * t, "north": t**2 / 2}
    columns |= {f"{name}_std": 0.01 + 0 * t for name in ("roll", "pitch", "heading", "v_e", "v_n", "v_u", "speed")}
    columns |= {"elevation": 0.1 * t, "lat": 47 + columns["north"] / 111e3, "lon": 11 + columns["east"] / 76e3}
    return pd.DataFrame(columns, TIMES).assign(valid=True)


REFERENCE = Recording(
    name="made", reference=estimate()[["roll", "pitch", "heading", "v_e", "v_n", "v_u", "lat", "lon"]]
)
