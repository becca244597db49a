"""Calibration of a simulated five-minute drive: how fast, how good, and whether the error bars hold.

    python benchmarks/calibration.py [--drives 500] [--rate 10]

Prints the time of a whole calibration of 12 parameters on 100 Hz data after compilation, the cost of a pipeline's
value and gradient over that of its value, the memory of a reverse pass over a million samples, and for `--drives`
drives with random true parameters the error of each parameter and how often its 95 % interval holds the truth. Each
drive has its own parameters, drawn within 1.3 prior standard deviations, and its own noise; the road is the same. The
IMU has the white noise of a consumer MEMS, without the wandering of its biases; there is no side slip and no lever arm,
as on a real road there would be.
"""

import argparse
import resource
import time

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

import altijax as aj
from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.drives import calibrate_stretches, drive_stretches
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive

GRAVITY, DENSITY = 9.80665, {"gyro": float(aj.MEMS_GYRO.noise_density)}
DENSITY["accelerometer"] = float(aj.MEMS_ACCELEROMETER.noise_density)
DENSITY["receiver"] = 0.0
NOMINAL = np.array([row[0] for row in DRIVE_PARAMETERS.values()])
PRIOR_STD = np.array([row[1] for row in DRIVE_PARAMETERS.values()])


def drives(count: int, rate: float) -> pd.DataFrame:
    """Errors and standard deviations of every parameter on every drive, and the seconds each fit took."""
    t = jnp.arange(30001) / 100
    readings = jax.jit(lambda t: town_drive(Manoeuvres(), t, GRAVITY))(t)
    record = jax.jit(
        lambda truth, key: recorded_drive(
            readings,
            truth,
            accelerometer=aj.Accelerometer(noise_density=aj.MEMS_ACCELEROMETER.noise_density),
            gyro=aj.Gyro(noise_density=aj.MEMS_GYRO.noise_density),
            receiver=aj.DopplerReceiver(rate=rate, horizontal_noise=0.05, vertical_noise=0.1),
            wheel_noise=0.03,
            epochs=int(300 * rate),
            key=key,
        )
    )
    rng = np.random.default_rng(0)
    rows = []
    for number in range(count):
        truth = NOMINAL + PRIOR_STD * np.clip(rng.normal(size=PRIOR_STD.size), -1.3, 1.3)
        recorded = {name: np.asarray(value) for name, value in record(truth, jax.random.key(number)).items()}
        start = time.perf_counter()
        calibration = calibrate_stretches(drive_stretches(recorded, GRAVITY, DENSITY))
        seconds = time.perf_counter() - start
        table = calibration.table
        rows.append(
            pd.DataFrame(
                {
                    "error": table["value"] - truth,
                    "std": table["std"],
                    "seconds": seconds,
                    "known": calibration.identification.rank == PRIOR_STD.size,
                }
            )
        )
    return pd.concat(rows, keys=range(count))


def cost_of_gradient(samples: int) -> tuple[float, float]:
    """Value and gradient over value of the elevation by the slope, and peak memory so far in GB."""
    t = jnp.arange(samples) / 100
    speed = 12 + 3 * jnp.sin(0.1 * t)
    f_x = 0.3 * jnp.cos(0.1 * t) + 0.3 * jnp.sin(0.03 * t)

    def misfit(x: jax.Array) -> jax.Array:
        height, _ = aj.elevation_by_slope(t, f_x / x[0] - x[1], speed * x[2], GRAVITY)
        return jnp.mean(height**2)

    x = jnp.array([1.0, 0.0, 1.0])
    value, both = jax.jit(misfit), jax.jit(jax.value_and_grad(misfit))
    assert np.allclose(value(x), both(x)[0])
    spent = []
    for function in (value, both):
        jax.block_until_ready(function(x))
        best = np.inf
        for _ in range(7):
            start = time.perf_counter()
            jax.block_until_ready(function(x))
            best = min(best, time.perf_counter() - start)
        spent.append(best)
    return spent[1] / spent[0], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--drives", type=int, default=500)
    parser.add_argument("--rate", type=float, default=10.0, help="GNSS epochs per second")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for samples in (30_000, 1_000_000):
        ratio, memory = cost_of_gradient(samples)
        print(f"value and gradient over value, {samples} samples: {ratio:.1f}; peak memory so far {memory:.2f} GB")
    found = drives(options.drives, options.rate)
    seconds = found["seconds"]
    print(f"calibration of 12 parameters: median {seconds.median():.1f} s, first {seconds.iloc[0]:.1f} s")
    print(f"all directions determined in {found['known'].mean():.0%} of {options.drives} drives")
    table = pd.DataFrame(
        {
            "rms error": found["error"].groupby(level=1, sort=False).apply(lambda e: float(np.sqrt(np.mean(e**2)))),
            "mean std": found["std"].groupby(level=1, sort=False).mean(),
            "coverage of 95 %": (found["error"].abs() < 1.96 * found["std"]).groupby(level=1, sort=False).mean(),
            "unit": [row[2] for row in DRIVE_PARAMETERS.values()],
        }
    )
    print(table.to_string(float_format=lambda x: f"{x:.5f}"))


if __name__ == "__main__":
    main()
