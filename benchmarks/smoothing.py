"""`smooth_velocity` beside a Kalman filter and smoother of 2x2 matrices that steps through every sample.

    python benchmarks/smoothing.py [samples]

Both do the same task in turns, after their velocities were found equal; ratios are those of medians of one run, and on
a machine that does other things too it should be run several times.
"""

import sys
import time
from statistics import median

import jax
import jax.numpy as jnp
import numpy as np

from altijax.smoothing import smooth_velocity

DT, EVERY, A_NOISE, BIAS_WALK, BIAS_STD, GNSS_STD = 0.02, 50, 0.05, 0.02, 0.3, 0.1
ROUNDS = 9


@jax.jit
def step_by_step(a, z, measured):
    """Velocities and their standard deviations, as a textbook has it."""
    F = jnp.array([[1.0, -DT], [0.0, 1.0]])
    q_a, q_b = A_NOISE**2, BIAS_WALK**2
    Q = jnp.array([[q_a * DT + q_b * DT**3 / 3, -q_b * DT**2 / 2], [-q_b * DT**2 / 2, q_b * DT]])
    gained = jnp.concatenate([jnp.zeros(1), 0.5 * DT * (a[1:] + a[:-1])])

    def forward(carry, sample):
        x, P, first = carry
        du, z, measured = sample
        x_p = jnp.where(first, x, F @ x + jnp.array([1.0, 0.0]) * du)
        P_p = jnp.where(first, P, F @ P @ F.T + Q)
        K = jnp.where(measured & ~first, P_p[:, 0] / (P_p[0, 0] + GNSS_STD**2), 0)
        later = x_p + K * (z - x_p[0]), P_p - jnp.outer(K, P_p[0])
        return (*later, False), (x_p, P_p, *later)

    start = jnp.array([z[0], 0.0]), jnp.diag(jnp.array([GNSS_STD**2, BIAS_STD**2])), True
    x_p, P_p, x, P = jax.lax.scan(forward, start, (gained, z, measured))[1]

    def backward(carry, sample):
        x_next, P_next = carry
        x, P, x_p, P_p = sample
        G = jnp.linalg.solve(P_p, F @ P).T
        carry = x + G @ (x_next - x_p), P + G @ (P_next - P_p) @ G.T
        return carry, carry

    last = x[-1], P[-1]
    smoothed = jax.lax.scan(backward, last, (x[:-1], P[:-1], x_p[1:], P_p[1:]), reverse=True)[1]
    v = jnp.append(smoothed[0][:, 0], last[0][0])
    return v, jnp.sqrt(jnp.append(smoothed[1][:, 0, 0], last[1][0, 0]))


def main(samples: int) -> None:
    rng = np.random.default_rng(0)
    t = DT * np.arange(samples)
    a = np.cos(0.7 * t) + A_NOISE / np.sqrt(DT) * rng.standard_normal(samples)
    v = np.sin(0.7 * t) / 0.7 + GNSS_STD * rng.standard_normal(samples)
    measured = np.arange(samples) % EVERY == 0
    t, a, v, measured = (jnp.asarray(x) for x in (t, a, v, measured))
    t_gnss, z = t[::EVERY], v[::EVERY]
    std = jnp.full(z.shape, GNSS_STD)

    def ours():
        found = smooth_velocity(t, a, t_gnss, z, std, A_NOISE, BIAS_WALK, BIAS_STD, jnp.inf)
        return found.v, found.v_std

    tasks = {"smooth_velocity": ours, "scan of 2x2 matrices": lambda: step_by_step(a, v, measured)}
    for x, y in zip(*(task() for task in tasks.values()), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-8)
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(ROUNDS):
        for name, task in tasks.items():
            start = time.perf_counter()
            jax.block_until_ready(task())
            times[name].append(time.perf_counter() - start)
    best = median(times["smooth_velocity"])
    print(f"{samples:,} samples, a velocity every {EVERY}")
    for name, of in times.items():
        print(f"  {name:24}{median(of) / samples * 1e9:9.1f} ns/sample{median(of) / best:8.2f} x smooth_velocity")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
