"""Runs of all three chains of shirai2000 in one vmap, after compilation; wanted: 1,000 in less than 30 s on two cores.

python benchmarks/shirai2000.py
"""

import time
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from papers_repro.shirai2000.experiments import CHAINS, DT, Course, at_fractions, sample_count
from papers_repro.shirai2000.inference import NAMES, sensors_of

RUNS = 1000


def main() -> None:
    course = Course(
        duration=jnp.array(113.0), way=jnp.array(163.969), horizontal=jnp.array(163.824), rise=jnp.array(-5.459)
    )
    sensors = sensors_of(jnp.zeros(len(NAMES)), jnp.array(False))
    samples = sample_count(113.0)
    simulate = jax.jit(jax.vmap(partial(at_fractions, samples=samples, points=2), (None, None, 0)))
    keys = jax.random.split(jax.random.key(0, impl="rbg"), RUNS)
    start = time.perf_counter()
    compiled = simulate.lower(sensors, course, keys).compile()
    print(f"compilation {time.perf_counter() - start:.1f} s")
    start, cpu = time.perf_counter(), time.process_time()
    found = np.asarray(compiled(sensors, course, keys))[:, -1]
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    assert np.isfinite(found).all() and np.abs(np.median(found[:, 2, 0]) - 163.969) < 1.0
    print(f"{RUNS} runs of {len(CHAINS)} chains, {samples} samples of {DT} s: {seconds:.1f} s ({cpu:.1f} s of CPU)")


if __name__ == "__main__":
    main()
