"""How far `estimate_speed` is off through outages of its aid, beside the limits set for it, and on cars made up.

    python -m benchmarks.speed_accuracy [a part of a row's name ...]

Needs the recordings (ALTIJAX_DATA_DIR) but for the rows "exact" and "made up". Nothing is fitted to what is printed;
the estimates never see the reference. The limits were set from a prototype that had been tuned on rtk-drive. A figure
beyond its limit is marked.

    exact            error-free readings: both steppings, and the growth of an error beside the linearised equation's
    highway          comma2k19-example, forty seconds after twenty with its wheels
    rtk              rtk-drive: errors after outages that start every 10 s, all of the past known
    made up          the same on simulated drives of their own roads and cars, outages every 20 s

The RMS of errors is in m/s, beside it the share of errors within one and two of the stated standard deviations, which
for honest normal errors are 0.68 and 0.95; "stated" is the RMS of these. A bin is a range of accumulated change of
heading in rad; the ratio is the filter's RMS over that of a method of [us20060293826] with the same sensors and
constants. A bin of few outages tells little: their number stands beside it.

The cars made up have what the filter does not know: the body squats, the cant is no Gauss-Markov process, the sensors'
scales differ, their noise and biases are those of a consumer's instrument, and the tyres slip sideways in proportion to
the lateral acceleration, which only the filter with six sensors has. The constants of each are drawn, the seeds are 0
to 7; what no driver does, more than 4 m/s^2 forwards or sideways, is drawn again.
"""

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.simulated_drives import recorded_drive
from altijax.constants import STANDARD_GRAVITY
from altijax.datasets import load_dataset
from altijax.doppler import DopplerReceiver
from altijax.instruments import MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.metrics import coverage, rms
from altijax.motions import Readings, ideal_readings, road_pose
from altijax.recordings import Recording
from altijax.roads import Road, SpeedProfile, winding_road
from altijax.rotations import rotvec_to_matrix
from altijax.samples.hilly_drives import lasting
from altijax.speed_estimate.estimates import estimate_speed
from altijax.speed_estimate.outages import outage_errors
from altijax.speed_estimate.steps import speed_of
from papers_repro.us20060293826.stability import curvy_drive, error_growth

DURATIONS = (10.0, 30.0, 60.0)
LIMITS = {"2+2": (1.1, 2.4, 2.5), "2+3": (0.8, 0.8, 0.9), "6": (0.5, 0.7, 0.7)}
"""RMS after outages of these durations on rtk-drive, in m/s, by sensors of the filter."""
HIGHWAY, EXACT, GROWTH, RATIO, ONE_STD = 2.0, 0.05, 0.05, 1.1, (0.60, 0.75)
BINS = {"<1": (0.0, 1.0), "1-3": (1.0, 3.0), ">3": (3.0, np.inf)}
SHAKING = np.array([0.02, 0.06, 0.006])
"""Vibration of a made-up car's rates at 10 m/s, in rad/s, between those of the two real cars."""
CARS, RATE, LENGTH, HARDEST = 8, 50.0, 200.0, 4.0


def beside(value: float, limit: float, digits: int = 2) -> str:
    return f"{value:.{digits}f} ({limit:g}{', MISSED' if value > limit else ''})"


def exact() -> str:
    growth = jax.jit(error_growth)(curvy_drive())
    second_order, literal = rms(growth.second_order), rms(growth.literal)
    off = float(jnp.max(jnp.abs(growth.simulated / growth.linearised - 1)))
    return (
        f"{float(growth.turning[-1]):.1f} rad in a minute: RMS {beside(second_order, EXACT, 4)} m/s, literal stepping "
        f"{literal:.1f}; an error grew {float(growth.simulated[-1]):.0f} times, off the linearised equation by "
        f"{beside(off, GROWTH, 4)}"
    )


def highway(method: str, sensors: str) -> str:
    recording = load_dataset("comma2k19-example")
    estimate = estimate_speed(recording, method=method, sensors=sensors, aid_until=20.0)
    t, speed = speed_of(recording.reference)
    error, over_wheels = (
        float(estimate["speed"].iloc[-1] - np.interp(estimate.index[-1], *other))
        for other in ((t, speed), (recording.wheel.index, recording.wheel["speed"]))
    )
    return (
        f"{error:+.2f} m/s, size {beside(abs(error), HIGHWAY)}, over the wheels {over_wheels:+.2f}, "
        f"stated {estimate['speed_std'].iloc[-1]:.2f}"
    )


def outages(load: Callable[[], list[Recording]], sensors: str, every: float, limits: tuple[float, ...] | None) -> str:
    """Errors of all drives together: the filter's, and by range of turning over those of the patent's methods."""
    methods = {name: f"{name}:{sensors}" for name in ("filter", "conventional", "roll")}
    errors = pd.concat([outage_errors(recording, tuple(methods.values()), DURATIONS, every) for recording in load()])
    lines = []
    for duration, limit in zip(DURATIONS, limits or (np.inf,) * len(DURATIONS), strict=True):
        after = errors[errors["duration"] == duration]
        of = {name: after[after["method"] == key] for name, key in methods.items()}
        error, std = (of["filter"][name].to_numpy() for name in ("error", "std"))
        one, two = (float(coverage(error, std, k)) for k in (1, 2))
        covers = "" if ONE_STD[0] <= one <= ONE_STD[1] else ", MISSED"
        mine, conventional, roll = (rms(of[name]["error"].to_numpy()) for name in methods)
        text = beside(mine, limit) if limits else f"{mine:.2f}"
        lines.append(
            f"{duration:g} s ({error.size}): {text}, stated {rms(std):.2f}, within {one:.2f} "
            f"(0.60-0.75{covers}) {two:.2f}; largest {np.abs(error).max():.1f}; without {conventional:.2f}, "
            f"with roll {roll:.2f}"
        )
        for label, (low, high) in BINS.items():
            inside = {name: rows[rows["turning"].between(low, high, inclusive="right")] for name, rows in of.items()}
            if inside["filter"].empty:
                continue
            mine, *theirs = (rms(inside[name]["error"].to_numpy()) for name in methods)
            lines.append(
                f"    {label} rad ({len(inside['filter'])}): {mine:.2f}, over conventional and roll "
                + " / ".join(beside(mine / other, RATIO) for other in theirs)
            )
    return "".join(f"\n  {line}" for line in lines)


def made_up_drives() -> list[Recording]:
    return [made_up_drive(seed) for seed in range(CARS)]


def made_up_drive(seed: int) -> Recording:
    """A road, a way of driving, a car and a set of sensors; the reference is the truth."""
    rng = np.random.default_rng(seed)
    truth = _motion(*_road_and_profile(rng))
    while float(_hardest(truth)) > HARDEST:
        truth = _motion(*_road_and_profile(rng))
    truth = _slipping(truth, rng.uniform(0.001, 0.006))
    parameters = [known.nominal + 0.5 * known.spread * rng.normal() for known in DRIVE_PARAMETERS.values()]
    recorded = _recorded(truth, jnp.asarray(parameters), jax.random.key(seed))
    f, w = (np.array(recorded[name]) for name in "fw")
    # a rougher road shakes more, a rate that shakes shows a bias
    speed = np.asarray(truth.speed)
    rough = np.exp(0.4 * lasting(rng, speed.size, RATE * 25.0)) * (0.1 + (np.abs(speed) / 10) ** 0.7)
    shaking = SHAKING * rough[:, None]
    w += shaking * _vibration(rng, w.shape)
    w[:, 1] += 0.05 * rng.normal() * shaking[:, 1] ** 2
    f += 0.5 * rough[:, None] * _vibration(rng, f.shape)
    index = pd.Index(np.asarray(truth.t), name="t")
    imu = pd.DataFrame(np.hstack([f, w]), index=index, columns=["ax", "ay", "az", "gx", "gy", "gz"])
    axes = ["v_e", "v_n", "v_u"]
    gnss = pd.DataFrame(np.asarray(recorded["v_gnss"]), columns=axes, index=pd.Index(recorded["t_gnss"], name="t"))
    reference = pd.DataFrame(np.asarray(truth.velocity), columns=axes, index=index)
    return Recording(name=f"made up {seed}", imu=imu, gnss=gnss.dropna(), reference=reference)


def _road_and_profile(rng: np.random.Generator) -> tuple[Road, SpeedProfile]:
    """Bends and hills of several lengths, a cant of its own on top of that of the bends, and a stop."""
    bends, hills, patches = 3, 3, 8

    def lengths(low: float, high: float, count: int) -> jax.Array:
        return jnp.asarray(np.exp(rng.uniform(np.log(low), np.log(high), count)))

    def shares(total: float, count: int) -> jax.Array:
        return jnp.asarray(total * rng.dirichlet(np.ones(count)))

    def phases(count: int) -> jax.Array:
        return jnp.asarray(rng.uniform(0, 2 * np.pi, count))

    road = winding_road(
        shares(rng.uniform(0.2, 0.9), bends),
        lengths(120, 500, bends),
        phases(bends),
        shares(rng.uniform(0.03, 0.1), hills),
        lengths(150, 1000, hills),
        phases(hills),
        jnp.asarray(rng.uniform(0, 2)),
    )
    wavenumber = 2 * jnp.pi / lengths(15, 300, patches)
    road = replace(
        road,
        amplitude=jnp.concatenate([road.amplitude, jnp.zeros((patches, 3))]),
        wavenumber=jnp.concatenate([road.wavenumber, wavenumber]),
        phase=jnp.concatenate([road.phase, phases(patches)]),
        cant=jnp.concatenate([road.cant, jnp.asarray(0.015 * np.sqrt(2 / patches) * rng.normal(size=patches))]),
        roll_gain=jnp.asarray(rng.uniform(0.005, 0.015)),
    )
    waves = 2 * jnp.pi / lengths(150, 400, 2)
    profile = SpeedProfile(
        start=jnp.asarray([3.0, rng.uniform(85, 100)]),
        stop=jnp.asarray([rng.uniform(65, 75), 300.0]),
        ramp=jnp.asarray([8.0, 8.0]),
        speed=jnp.asarray(rng.uniform(7, 16, 2)),
        modulation=shares(rng.uniform(0.05, 0.3), 2) / waves,
        wavenumber=waves,
        phase=phases(2),
    )
    return road, profile


@jax.jit
def _motion(road: Road, profile: SpeedProfile) -> Readings:
    return ideal_readings(partial(road_pose, road, profile), jnp.arange(0, LENGTH, 1 / RATE), STANDARD_GRAVITY)


@jax.jit
def _hardest(truth: Readings) -> jax.Array:
    """Largest acceleration along or across the way, in m/s^2."""
    return jnp.maximum(
        RATE * jnp.max(jnp.abs(jnp.gradient(truth.speed))), jnp.max(jnp.abs(truth.speed * truth.w_b[:, 2]))
    )


def _slipping(truth: Readings, slip: float) -> Readings:
    """The same motion with the car turned into the bend, by `slip` rad for each m/s^2 to the left."""
    angle = slip * truth.speed * truth.w_b[:, 2]
    up = jnp.asarray([0.0, 0.0, 1.0])
    turn = rotvec_to_matrix(angle[:, None] * up)
    f, w = (jnp.einsum("tji,tj->ti", turn, x) for x in (truth.f_b, truth.w_b))
    w = w + RATE * jnp.gradient(angle)[:, None] * up
    return replace(truth, f_b=f, w_b=w, C_nb=truth.C_nb @ turn)


@jax.jit
def _recorded(truth: Readings, parameters: jax.Array, key: jax.Array) -> dict[str, jax.Array]:
    return recorded_drive(
        truth,
        parameters,
        accelerometer=MEMS_ACCELEROMETER,
        gyro=MEMS_GYRO,
        receiver=DopplerReceiver(rate=5.0, horizontal_noise=0.05, vertical_noise=0.1),
        wheel_noise=0.02,
        epochs=round(5 * LENGTH),
        key=key,
    )


def _vibration(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Noise of unit variance that leads nowhere: the differences of white noise."""
    return np.diff(rng.normal(size=(shape[0] + 1, *shape[1:])), axis=0) / np.sqrt(2)


def rows() -> Iterator[tuple[str, Callable[[], str]]]:
    yield "exact", exact
    for method, sensors in (("conventional", "2+2"), ("roll", "2+2"), *(("filter", sensors) for sensors in LIMITS)):
        yield f"highway, {method} {sensors}", partial(highway, method, sensors)
    for sensors, limits in LIMITS.items():
        yield f"rtk, {sensors}", partial(outages, lambda: [load_dataset("rtk-drive")], sensors, 10.0, limits)
    for sensors in LIMITS:
        yield f"made up, {sensors}", partial(outages, made_up_drives, sensors, 20.0, None)


def main() -> None:
    chosen = sys.argv[1:]
    for name, measure in rows():
        if not chosen or any(part in name for part in chosen):
            start = time.perf_counter()
            line = measure()
            print(f"{name:28} {line}  [{time.perf_counter() - start:.1f} s]", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    jax.config.update("jax_enable_x64", True)
    main()
