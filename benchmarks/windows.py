"""Attitudes of many windows of pairs (Wahba's problem) beside decompositions in numpy, JAX and scipy.

    python benchmarks/windows.py [windows]

Each does the same task in turns, after the attitudes were found equal, and the ratios are those of medians of one run;
on a machine that does other things too, run it several times.
"""

import sys
import time
from collections.abc import Callable
from statistics import median

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from altijax.wahba import fit_shared_attitude, nearest_rotation

PAIRS, ROUNDS, ONE_BY_ONE = 10, 7, 200


@jax.jit
def by_jax_svd(B):
    U, _, Vt = jnp.linalg.svd(B)
    sign = jnp.linalg.det(U) * jnp.linalg.det(Vt)
    return (U * jnp.stack([jnp.ones_like(sign), jnp.ones_like(sign), sign], -1)[..., None, :]) @ Vt


def by_numpy_svd(B):
    U, _, Vt = np.linalg.svd(B)
    sign = np.linalg.det(U) * np.linalg.det(Vt)
    return (U * np.stack([np.ones_like(sign), np.ones_like(sign), sign], -1)[..., None, :]) @ Vt


def medians(tasks: dict[str, Callable[[], object]]) -> dict[str, float]:
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(ROUNDS):
        for name, task in tasks.items():
            start = time.perf_counter()
            jax.block_until_ready(task())
            times[name].append(time.perf_counter() - start)
    return {name: median(of) for name, of in times.items()}


def main(windows: int) -> None:
    rng = np.random.default_rng(0)
    C = Rotation.random(windows, rng=rng).as_matrix()
    f_n = np.array([0, 0, 9.8]) + 2 * rng.standard_normal((windows, PAIRS, 3))
    f_b = np.einsum("nji,npj->npi", C, f_n) + 0.1 * rng.standard_normal((windows, PAIRS, 3))
    B = np.einsum("npi,npj->nij", f_n, f_b)
    arrays = [jnp.asarray(x) for x in (f_b, f_n, C, np.full(windows, 1e9), np.ones((windows, PAIRS)))]
    B_jax = jnp.asarray(B)

    expected = by_numpy_svd(B)
    np.testing.assert_allclose(nearest_rotation(B_jax), expected, atol=1e-12)
    np.testing.assert_allclose(by_jax_svd(B_jax), expected, atol=1e-12)
    np.testing.assert_allclose(fit_shared_attitude(*arrays).C_nb, expected, atol=1e-8)
    few = min(windows, ONE_BY_ONE)
    times = medians(
        {
            "nearest_rotation, of sums": lambda: nearest_rotation(B_jax),
            "fit_shared_attitude, of pairs, with covariance": lambda: fit_shared_attitude(*arrays),
            "jax.numpy svd, of sums": lambda: by_jax_svd(B_jax),
            "numpy svd, of sums": lambda: by_numpy_svd(B),
            f"scipy align_vectors, {few} of them": lambda: [
                Rotation.align_vectors(n, b) for n, b in zip(f_n[:few], f_b[:few], strict=True)
            ],
        }
    )
    first = next(iter(times.values())) / windows
    print(f"{windows:,} windows of {PAIRS} pairs")
    for name, seconds in times.items():
        each = seconds / (few if name.startswith("scipy") else windows)
        print(f"  {name:48}{each * 1e9:10.1f} ns/window{each / first:9.2f} x nearest_rotation")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
