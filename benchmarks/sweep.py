"""What `sweep` costs beside one `jax.vmap` over the same combinations, equal results asserted first.

    python -m benchmarks.sweep

400 combinations of a drive of one minute at 100 Hz: readings of an accelerometer with a noise and a bias, and the error
of the elevation by the slope. Compiling is left out of both. CPU seconds of this process, the least of three turns each
in alternation.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from altijax.altitude import elevation_by_slope
from altijax.constants import STANDARD_GRAVITY
from altijax.instruments import MEMS_ACCELEROMETER
from altijax.metrics import rms
from altijax.motions import ideal_readings, road_pose
from altijax.roads import rest_to_rest, winding_road
from altijax.sensors import accelerometer_output
from altijax.sweeps import sweep

MOST = 1.3
TURNS = 3
RATE, DURATION = 100.0, 60.0
GRID = {"noise": np.geomspace(1e-4, 1e-1, 20), "bias": np.linspace(-0.2, 0.2, 20)}


def drive() -> Callable[..., jax.Array]:
    """Root mean square error of the elevation by noise density, bias and key."""
    road = winding_road([0.4], [200.0], [0.5], [0.06], [300.0], [0.3], -2.0)
    pose = partial(road_pose, road, rest_to_rest(600.0, DURATION, 6.0))
    t = jnp.arange(round(RATE * DURATION) + 1) / RATE
    truth = jax.jit(partial(ideal_readings, pose))(t, STANDARD_GRAVITY)

    def error(noise: jax.Array, bias: jax.Array, key: jax.Array) -> jax.Array:
        accelerometer = replace(MEMS_ACCELEROMETER, noise_density=noise, bias=bias)
        f = accelerometer_output(accelerometer, truth.f_b, 1 / RATE, key=key)
        elevation, _ = elevation_by_slope(t, f[:, 0], truth.speed, STANDARD_GRAVITY)
        return rms(elevation - truth.position[:, 2])

    return error


def cpu_seconds(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    error = drive()
    noise, bias = (x.ravel() for x in np.meshgrid(*GRID.values(), indexing="ij"))
    # As `sweep` has it, the same key for all.
    key = jax.random.fold_in(jax.random.key(0), 0)
    at_once = jax.jit(jax.vmap(error, (0, 0, None)))

    def by_vmap() -> np.ndarray:
        return np.asarray(at_once(noise, bias, key))

    def by_sweep() -> np.ndarray:
        return sweep(error, GRID, progress=False)["value"].to_numpy()

    np.testing.assert_allclose(by_sweep(), by_vmap(), rtol=1e-9)
    turns = [(cpu_seconds(by_vmap), cpu_seconds(by_sweep)) for _ in range(TURNS)]
    vmap, swept = np.min(turns, axis=0)
    print(f"{noise.size} combinations of {DURATION:g} s: one vmap {vmap:.2f} CPU s, sweep {swept:.2f} CPU s")
    print(f"ratio {swept / vmap:.2f}; wanted: at most {MOST}")


if __name__ == "__main__":
    main()
