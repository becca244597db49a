"""Twenty seconds of the drive that ships with the package, as the smoother takes them."""

from dataclasses import replace
from functools import cache

import jax

from altijax.datasets import load_dataset
from altijax.recordings import Recording
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.search import Search, begun, eased, passed
from altijax.vehicle.sensors import layout_of

USE = ("gyro", "wheel", "velocity", "position", "course", "standstill", "height")
HEIGHTS = [(1.0, 600.0), (19.0, 601.0)]


def cut(recording: Recording, first: float, last: float) -> Recording:
    streams = {name: getattr(recording, name) for name in ("imu", "wheel", "gnss", "reference")}
    return replace(
        recording, **{name: frame if frame is None else frame[first:last] for name, frame in streams.items()}
    )


@cache
def short_drive() -> Recording:
    return cut(load_dataset("hill-road"), 0.0, 20.0)


@cache
def short_search() -> Search:
    """Converged, with every kind of measurement."""
    with jax.enable_x64(True):
        belief = belief_of(USE)
        belief.mean[layout_of(USE).at("datum")] = HEIGHTS[0][1]
        start = begun(short_drive(), USE, 0.1, belief, HEIGHTS)
        return passed(replace(passed(eased(start), 4), doubt=start.doubt), 8)
