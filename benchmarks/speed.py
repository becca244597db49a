"""The loop of `speed_with_roll` beside the same recurrence in numba, and its gradient beside itself.

    python benchmarks/speed.py

Needs numba beside the package. Each task is done in turns by all that can do it, after their results were found equal,
and the ratios are those of medians of one run; on a machine that does other things too, run it several times.
A batch lies in memory as suits each: time first for `jax.vmap`, which takes many trajectories a step, time last for
numba, which takes one trajectory after another, on all cores.
"""

import math
import sys
import time
from collections.abc import Callable
from statistics import median

import jax
import jax.numpy as jnp
import numpy as np

from altijax.speed import speed_with_roll

try:
    from numba import njit, prange
except ImportError:
    sys.exit("benchmarks/speed.py needs numba, which is no dependency of altijax: pip install numba")

GRAVITY, DT = 9.81, 0.01
ROUNDS = 15


@njit(inline="always", error_model="numpy")
def rate_of_g_x(speed, g_x, f_y, w_y, w_z, gravity):
    g_y = f_y - w_z * speed
    across = gravity * gravity - g_x * g_x
    upward = across - g_y * g_y
    if upward >= 0:
        return w_z * g_y - w_y * math.sqrt(upward)
    return w_z * math.copysign(math.sqrt(max(across, 0.0)), g_y)


@njit(error_model="numpy")
def one_by_numba(f_x, f_y, w_y, w_z, speed0, pitch0, gravity, dt):
    found = np.empty_like(f_x)
    half = 0.5 * dt
    v, g_x = speed0, gravity * math.sin(pitch0)
    found[0] = v
    rate = rate_of_g_x(v, g_x, f_y[0], w_y[0], w_z[0], gravity)
    for i in range(1, f_x.size):
        known = v + half * (f_x[i - 1] - g_x + f_x[i])
        guess = g_x + dt * rate
        other = rate_of_g_x(known - half * guess, guess, f_y[i], w_y[i], w_z[i], gravity)
        g_x = min(max(g_x + half * (rate + other), -gravity), gravity)
        v = known - half * g_x
        rate = rate_of_g_x(v, g_x, f_y[i], w_y[i], w_z[i], gravity)
        found[i] = v
    return found


@njit(parallel=True)
def batch_by_numba(f_x, f_y, w_y, w_z, speed0, pitch0, gravity, dt):
    found = np.empty_like(f_x)
    for i in prange(f_x.shape[0]):
        found[i] = one_by_numba(f_x[i], f_y[i], w_y[i], w_z[i], speed0[i], pitch0[i], gravity, dt)
    return found


def drives(batch: int, samples: int) -> tuple[np.ndarray, ...]:
    """Readings (batch, samples) of gentle turns: the loop's growth must not carry rounding errors away."""
    rng = np.random.default_rng(0)
    t = DT * np.arange(samples)
    phase = rng.uniform(0, 2 * np.pi, (batch, 1))
    noise = rng.standard_normal((3, batch, samples))
    w_z = 1e-4 * np.sin(0.1 * t + phase)
    return (
        0.3 * np.sin(0.05 * t + phase) + 0.1 * noise[0],
        10 * w_z + 0.1 * noise[1],
        1e-5 * noise[2],
        w_z,
        10 + rng.random(batch),
        np.zeros(batch),
    )


def in_turns(tasks: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median time of each in s."""
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(ROUNDS):
        for name, task in tasks.items():
            start = time.perf_counter()
            jax.block_until_ready(task())
            times[name].append(time.perf_counter() - start)
    return {name: median(of) for name, of in times.items()}


def report(title: str, times: dict[str, float], samples: int, reference: str, wanted: str) -> None:
    print(f"\n{title}; wanted: {wanted}")
    for name, seconds in times.items():
        ratio = seconds / times[reference]
        print(f"  {name:42}{seconds * 1e3:9.1f} ms{seconds / samples * 1e9:8.1f} ns/sample{ratio:8.2f} x {reference}")


def single(samples: int = 1_000_000) -> None:
    readings = drives(1, samples)
    numbers = tuple(x[0] for x in readings)
    arrays = tuple(jnp.asarray(x) for x in numbers)
    speed = jax.jit(lambda *a: speed_with_roll(*a, GRAVITY, DT)[0])

    def misfit(constants, readings):
        moved = [x + c for x, c in zip(readings, constants, strict=False)]
        return jnp.mean(speed_with_roll(*moved, *constants[4:], DT)[0] ** 2)

    constants = jnp.array([0.0, 0.0, 0.0, 0.0, numbers[4], numbers[5], GRAVITY])
    forward, reverse = jax.jit(misfit), jax.jit(jax.value_and_grad(misfit))
    slopes = jax.jit(jax.jacfwd(misfit))(constants, arrays[:4])

    np.testing.assert_allclose(speed(*arrays), one_by_numba(*numbers, GRAVITY, DT), atol=1e-9)
    np.testing.assert_allclose(reverse(constants, arrays[:4])[1], slopes, rtol=1e-7, atol=1e-7)
    times = in_turns(
        {
            "numba": lambda: one_by_numba(*numbers, GRAVITY, DT),
            "speed_with_roll": lambda: speed(*arrays),
        }
    )
    report(f"one trajectory of {samples:,} samples", times, samples, "numba", "at most 1.3")
    times = in_turns(
        {
            "misfit": lambda: forward(constants, arrays[:4]),
            "misfit and its gradient by 7 constants": lambda: reverse(constants, arrays[:4]),
        }
    )
    report(f"gradient over {samples:,} samples", times, samples, "misfit", "at most 3.5")


def batched(batch: int = 1024, samples: int = 10_000) -> None:
    numbers = drives(batch, samples)
    arrays = (*(jnp.asarray(x.T.copy()) for x in numbers[:4]), *(jnp.asarray(x) for x in numbers[4:]))
    axes = (-1, -1, -1, -1, 0, 0)
    speed = jax.jit(jax.vmap(lambda *a: speed_with_roll(*a, GRAVITY, DT)[0], axes, out_axes=-1))
    np.testing.assert_allclose(speed(*arrays).T, batch_by_numba(*numbers, GRAVITY, DT), atol=1e-9)
    times = in_turns(
        {
            "vmap of speed_with_roll": lambda: speed(*arrays),
            "numba": lambda: batch_by_numba(*numbers, GRAVITY, DT),
        }
    )
    title = f"batch of {batch:,} trajectories of {samples:,} samples"
    report(title, times, batch * samples, "vmap of speed_with_roll", "numba at least 1.5")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    single()
    batched()
