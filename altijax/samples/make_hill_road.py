"""Make the shipped recording: a car over hills and bends, by the package's own models.

    python -m altijax.samples.make_hill_road FOLDER

Two legs with a stop between them; a consumer's MEMS unit, mounted a little askew; a pulse generator on each rear
wheel; a Doppler receiver. What a unit's data sheet leaves open is drawn within its tolerances from a fixed seed.
"""

import gzip
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.doppler import DopplerReceiver, doppler_velocity
from altijax.earth import enu_to_geodetic, normal_gravity
from altijax.instruments import MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.motions import ideal_readings, road_pose
from altijax.roads import SpeedProfile, winding_road
from altijax.rotations import euler_to_matrix, matrix_to_euler, yaw_to_heading
from altijax.sensors import accelerometer_output, gyro_output
from altijax.wheels import WheelSensor, wheel_pulses

ORIGIN_DEG = (47.0, 11.0, 600.0)
"""Latitude and longitude in degrees and height in m of the start: somewhere in the Alps."""

DURATION, RATE, SEED = 90.0, 50.0, 0
VIBRATION = 0.3
"""m/s^2, of each axis at 10 m/s: an ordinary road surface, assumed; white within the sensor's band."""

SHEET = """\
name = "hill-road"
description = "simulated car over hills and bends with a stop, by altijax.samples.make_hill_road; reference exact"
axes = "FLU"

[wheel]
pulses_per_turn = 8
radius = 0.31
track_width = 1.52

[source]
origin = "made by AltiJAX's own models"
licence = "MIT"
"""


def simulate() -> dict[str, pd.DataFrame]:
    """Tables of the recording by file name, in the units and with the digits of the files."""
    origin = jnp.array([*np.radians(ORIGIN_DEG[:2]), ORIGIN_DEG[2]])
    gravity = normal_gravity(origin[0], origin[2])
    road = winding_road(
        jnp.radians(jnp.array([16.0, 6.0])),
        jnp.array([310.0, 127.0]),
        jnp.array([0.3, 1.9]),
        jnp.array([0.06, 0.025]),
        jnp.array([510.0, 173.0]),
        jnp.array([-0.4, 2.2]),
        jnp.asarray(-3.0),
    )
    road = replace(road, roll_gain=jnp.asarray(0.012))
    profile = SpeedProfile(
        start=jnp.array([5.0, 50.0]),
        stop=jnp.array([34.0, 76.0]),
        ramp=jnp.array([12.0, 10.0]),
        speed=jnp.array([13.0, 11.0]),
        modulation=jnp.array([2.5]),
        wavenumber=jnp.array([2 * jnp.pi / 130]),
        phase=jnp.array([0.0]),
    )
    t = jnp.arange(round(DURATION * RATE) + 1) / RATE
    truth = ideal_readings(partial(road_pose, road, profile), t, gravity)
    keys = jax.random.split(jax.random.key(SEED), 6)

    unit = jax.random.normal(keys[0], (4, 3))
    accelerometer = replace(MEMS_ACCELEROMETER, bias=0.1 * unit[0], scale=1 + 0.005 * unit[1])
    gyro = replace(MEMS_GYRO, bias=0.01 * unit[2])
    C_sb = euler_to_matrix(jnp.radians(jnp.array([0.6, -1.4, 0.0]) + 0.3 * unit[3])).T
    shaking = VIBRATION * truth.speed[:, None] / 10 * jax.random.normal(keys[1], (t.size, 3))
    f_s, w_s = (truth.f_b + shaking) @ C_sb.T, truth.w_b @ C_sb.T
    f = accelerometer_output(accelerometer, f_s, 1 / RATE, key=keys[2])
    w = gyro_output(gyro, w_s, f_s, 1 / RATE, key=keys[3])

    wheel = WheelSensor(radius=0.31, track_width=1.52, pulses_per_turn=8, scale=1.006)
    t_pulses, count = wheel_pulses(wheel, t, truth.speed, truth.w_b[:, 2], max_pulses=4096)
    if (count > t_pulses.shape[-1]).any():
        raise ValueError(f"room for {t_pulses.shape[-1]} pulses, got {count}")
    receiver = DopplerReceiver(rate=5.0, horizontal_noise=0.05, vertical_noise=0.1, latency=0.12)
    t_gnss, v_gnss, valid = doppler_velocity(receiver, t, truth.velocity, epochs=round(5 * DURATION), key=keys[4])

    degrees = np.array([np.degrees(1), np.degrees(1), 1])
    place = np.asarray(enu_to_geodetic(truth.position, origin)) * degrees
    metres = 2.0 * np.asarray(jax.random.normal(keys[5], (t_gnss.size, 3))) * [1 / 111e3, 1 / 76e3, 1]
    fix = np.stack([np.interp(t_gnss - 0.12, t, column) for column in place.T], -1) + metres
    euler = np.asarray(matrix_to_euler(truth.C_nb))[::5]
    attitude = {"roll": euler[:, 0], "pitch": euler[:, 1], "heading": np.asarray(yaw_to_heading(euler[:, 2]))}
    pulses = [
        pd.DataFrame({"t": np.asarray(times)[np.isfinite(times)].round(5), "wheel": side})
        for times, side in zip(t_pulses, ("left", "right"), strict=True)
    ]
    stamps = {"t": np.asarray(t).round(4)}
    return {
        "imu": pd.DataFrame(stamps | _columns("ax ay az", f, 4) | _columns("gx gy gz", w, 5)),
        "pulses": pd.concat(pulses).sort_values(["t", "wheel"], ignore_index=True),
        "gnss": pd.DataFrame(
            {"t": np.asarray(t_gnss).round(4)}
            | _columns("v_e v_n v_u", v_gnss, 3)
            | _columns("lat lon", fix[:, :2], 7)
            | _columns("alt", fix[:, 2:], 2)
        )[np.asarray(valid)],
        "reference": pd.DataFrame(
            {"t": stamps["t"][::5]}
            | {name: values.round(6) for name, values in attitude.items()}
            | _columns("v_e v_n v_u", truth.velocity[::5], 4)
            | _columns("lat lon", place[::5, :2], 9)
            | _columns("alt", place[::5, 2:], 4)
        ),
    }


def write(folder: Path) -> None:
    """Write the recording as a tidy folder; the same bytes each time."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.toml").write_text(SHEET, encoding="utf-8")
    with jax.enable_x64(True):
        tables = simulate()
    for name, table in tables.items():
        text = table.to_csv(index=False, lineterminator="\n").encode()
        (folder / f"{name}.csv.gz").write_bytes(gzip.compress(text, compresslevel=9, mtime=0))


def _columns(names: str, values: jax.Array | np.ndarray, digits: int) -> dict[str, np.ndarray]:
    # + 0.0 makes zeros positive that rounding made negative.
    return dict(zip(names.split(), np.asarray(values).round(digits).T + 0.0, strict=True))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
