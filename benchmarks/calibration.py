"""Calibration of a simulated five-minute drive: how fast, how good, and whether the error bars hold.

    python -m benchmarks.calibration [500] [--rate 10]

Prints the cost of a pipeline's value and gradient over that of its value, the memory of a reverse pass over a million
samples, the time of a whole calibration of 12 parameters on 100 Hz data after compilation, and for the number of drives
asked for with random true parameters the error of each parameter beside its limit and how often its 95 % interval holds
the truth. Each drive has its own parameters, drawn within 1.3 prior standard deviations, and its own noise; the road is
the same. The simulated errors are those that the model knows, so this tells whether the fit is right, not whether the
model is: the IMU has the white noise of a consumer MEMS, without the wandering of its biases, the receiver white noise
without a slow error (which the fit is told), and there is no side slip. Nothing is scored that was fitted to: the truth
is the simulation's.

With the recordings (ALTIJAX_DATA_DIR) a real minute follows: delays and wheel scale found without its reference, beside
those that its reference shows, with the scatter of eighths of the minute.
"""

import argparse
import os
import resource
import time
from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from scipy.optimize import least_squares

import altijax as aj
from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.drives import calibrate_stretches, drive_stretches
from altijax.calibration.identifiability import describe_undetermined
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive

GRAVITY, DENSITY = 9.80665, {"gyro": float(aj.MEMS_GYRO.noise_density)}
DENSITY["accelerometer"] = float(aj.MEMS_ACCELEROMETER.noise_density)
DENSITY["receiver"] = 0.0
NOMINAL = np.array([constant.nominal for constant in DRIVE_PARAMETERS.values()])
PRIOR_STD = np.array([constant.spread for constant in DRIVE_PARAMETERS.values()])


LIMITS = {
    "wheel_scale": 1e-3,
    "wheel_delay": 5e-3,
    "gnss_delay": {10.0: 5e-3, 1.0: 20e-3},
    "accelerometer_bias_x": 5e-3,
    "accelerometer_bias_y": 5e-3,
    "accelerometer_bias_z": 5e-3,
    "mounting_pitch": np.radians(0.2),
    "mounting_yaw": np.radians(0.2),
}
"""Largest root mean square errors wanted; of the receiver's delay by its epochs per second."""


def recorder(manoeuvres: Manoeuvres, rate: float) -> Callable[[np.ndarray, int], dict[str, np.ndarray]]:
    """What sensors with given parameters record of a drive, by the number of the drive."""
    t = jnp.arange(30001) / 100
    readings = jax.jit(lambda t: town_drive(manoeuvres, t, GRAVITY))(t)
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
    return lambda truth, number: {name: np.asarray(x) for name, x in record(truth, jax.random.key(number)).items()}


def drives(count: int, rate: float) -> pd.DataFrame:
    """Errors and standard deviations of every parameter on every drive, and the seconds each fit took."""
    record = recorder(Manoeuvres(), rate)
    rng = np.random.default_rng(0)
    rows = []
    for number in range(count):
        truth = NOMINAL + PRIOR_STD * np.clip(rng.normal(size=PRIOR_STD.size), -1.3, 1.3)
        recorded = record(truth, number)
        calibration = calibrate_stretches(drive_stretches(recorded, GRAVITY, DENSITY))
        found = calibration.identification
        table = calibration.table
        rows.append(
            pd.DataFrame(
                {
                    "error": table["value"] - truth,
                    "std": table["std"],
                    "known": int(found.rank) == PRIOR_STD.size,
                    "silent": int(found.rank) < PRIOR_STD.size and not describe_undetermined(found),
                }
            )
        )
    return pd.concat(rows, keys=range(count))


def seconds_of_twelve(rate: float) -> float:
    """Best of three calibrations of the first 12 parameters on 5 min of 100 Hz data, after compilation."""
    names = list(DRIVE_PARAMETERS)[:12]
    recorded = recorder(Manoeuvres(), rate)(NOMINAL, 0)
    best = np.inf
    for _ in range(4):  # the first compiles
        start = time.perf_counter()
        calibrate_stretches(drive_stretches(recorded, GRAVITY, DENSITY), names)
        best = min(best, time.perf_counter() - start)
    return best


def straight_road(rate: float) -> str:
    """What is said of a drive that cannot tell biases from tilts, and the errors in standard deviations."""
    truth = NOMINAL + PRIOR_STD * np.clip(np.random.default_rng(1).normal(size=PRIOR_STD.size), -1.3, 1.3)
    recorded = recorder(replace(Manoeuvres(), turning=0.0, slope=0.0), rate)(truth, 0)
    calibration = calibrate_stretches(drive_stretches(recorded, GRAVITY, DENSITY))
    table = calibration.table
    worst = float(np.max(np.abs((table["value"] - truth) / table["std"])))
    said = "\n".join(describe_undetermined(calibration.identification))
    state = "converged" if calibration.converged else "NOT converged"
    return f"straight, level road: {state}, largest error {worst:.1f} standard deviations; it says:\n{said}"


def cost_of_gradient(samples: int) -> tuple[float, float, float]:
    """Value and gradient over value of the elevation by the slope; GB of the pass, and of the process at its peak."""
    t = jnp.arange(samples) / 100
    # Arguments, not constants of the compiled function: XLA would keep and fold copies of those.
    data = (t, 12 + 3 * jnp.sin(0.1 * t), 0.3 * jnp.cos(0.1 * t) + 0.3 * jnp.sin(0.03 * t))

    def misfit(x: jax.Array, t: jax.Array, speed: jax.Array, f_x: jax.Array) -> jax.Array:
        height, _ = aj.elevation_by_slope(t, f_x / x[0] - x[1], speed * x[2], GRAVITY)
        return jnp.mean(height**2)

    x = jnp.array([1.0, 0.0, 1.0])
    value, both = (jax.jit(f).lower(x, *data).compile() for f in (misfit, jax.value_and_grad(misfit)))
    assert np.allclose(value(x, *data), both(x, *data)[0])
    spent = []
    for function in (value, both):
        best = np.inf
        for _ in range(7):
            start = time.perf_counter()
            jax.block_until_ready(function(x, *data))
            best = min(best, time.perf_counter() - start)
        spent.append(best)
    used = both.memory_analysis()
    own = (used.temp_size_in_bytes + used.argument_size_in_bytes + used.output_size_in_bytes) / 2**30
    return spent[1] / spent[0], own, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def accuracy(found: pd.DataFrame, rate: float) -> pd.DataFrame:
    """Errors beside their limits, and how often the intervals hold the truth, one row a parameter."""
    by_name = found.groupby(level=1, sort=False)
    limits = {name: limit.get(rate, np.nan) if isinstance(limit, dict) else limit for name, limit in LIMITS.items()}
    inside = found["error"].abs() < 1.96 * found["std"]
    return pd.DataFrame(
        {
            "rms error": by_name["error"].apply(lambda e: float(np.sqrt(np.mean(e**2)))),
            "limit": pd.Series(limits).reindex(list(DRIVE_PARAMETERS)),
            "mean std": by_name["std"].mean(),
            "mean error / its std": by_name["error"].mean() / by_name["error"].sem(),
            "coverage of 95 %": inside.groupby(level=1, sort=False).mean(),
            "unit": pd.Series({name: constant.unit for name, constant in DRIVE_PARAMETERS.items()}),
        }
    )


def real_minute() -> pd.DataFrame:
    """Delays and wheel scale of comma2k19-example, as calibrated and as its reference has them."""
    recording = aj.load_dataset("comma2k19-example")
    table = aj.calibrate(recording, list(DRIVE_PARAMETERS), method="drive").table
    true = recording.reference[["v_e", "v_n", "v_u"]].dropna()
    t_true, v_true = true.index.to_numpy(float), true.to_numpy()
    gnss, wheel = recording.gnss[["v_e", "v_n"]].dropna(), recording.wheel["speed"]

    def of_gnss(t: np.ndarray, seen: np.ndarray) -> np.ndarray:
        return least_squares(
            lambda x: np.ravel(seen - np.stack([np.interp(t - x[0], t_true, v) for v in v_true.T[:2]], -1)), [0.1]
        ).x

    def of_wheel(t: np.ndarray, seen: np.ndarray) -> np.ndarray:
        speed = np.linalg.norm(v_true, axis=1)
        return least_squares(lambda x: x[1] * seen - np.interp(t - x[0], t_true, speed), [0.0, 1.0]).x

    rows = {}
    for names, fit, series in (
        (["gnss_delay"], of_gnss, gnss),
        (["wheel_delay", "wheel_scale"], of_wheel, wheel),
    ):
        t = series.index.to_numpy(float)
        inside = (t > t_true[0] + 0.5) & (t < t_true[-1] - 0.5)
        parts = np.array_split(np.flatnonzero(inside), 8)
        found = np.array([fit(t[part], series.to_numpy()[part]) for part in parts])
        for k, name in enumerate(names):
            rows[name] = [
                table["value"][name],
                table["std"][name],
                found[:, k].mean(),
                found[:, k].std(ddof=1) / 8**0.5,
            ]
    return pd.DataFrame.from_dict(rows, orient="index", columns=["found", "std", "by the reference", "its std"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", type=int, nargs="?", default=500)
    parser.add_argument("--rate", type=float, default=10.0, help="GNSS epochs per second")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for samples in (30_000, 1_000_000):
        ratio, own, peak = cost_of_gradient(samples)
        print(
            f"value and gradient over value, {samples} samples: {ratio:.1f} (limit 5); "
            f"memory of the pass {own:.2f} GB, of the process at its peak {peak:.2f} GB (limit 1)"
        )
    print(f"calibration of 12 parameters: {seconds_of_twelve(options.rate):.1f} s (limit 5)")
    print(straight_road(options.rate))
    found = drives(options.drives, options.rate)
    known, silent = (found.groupby(level=0)[name].first() for name in ("known", "silent"))
    print(
        f"{options.drives} drives: all directions determined in {known.mean():.0%}, silently missing in {silent.sum()}"
    )
    print(accuracy(found, options.rate).to_string(float_format=lambda x: f"{x:.5f}"))
    if "ALTIJAX_DATA_DIR" in os.environ:
        print(real_minute().to_string(float_format=lambda x: f"{x:.5f}"))


if __name__ == "__main__":
    main()
