"""False pitch on a level road: 3 m/s^2 for 5 s, seen by attitude filters and by accelerations beside Doppler.

    python benchmarks/false_pitch.py [--picture FILE.png]

A car drives level at 10 m/s, speeds up at 3 m/s^2 for 5 s (for 10 s in the last columns), and drives on. An
accelerometer alone cannot tell that from a slope of 17 degrees. The filters of ahrs, imufusion and VQF run with their
documented default settings on the same readings, at 100 Hz; they know no velocity, need no GNSS, and run in real time.
AltiJAX takes the Doppler velocities of a 1 Hz receiver with its noise, and works afterwards. So this is no race between
equals: it shows what the velocities add. Where accelerations are short, rejecting them, as imufusion can, needs no
velocities either, and keeps their noise out.

The filters start a minute before, on a road at constant speed, where each finds its level. A filter that is not
installed is named and left out: pip install ahrs imufusion vqf
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import altijax as aj
from altijax.attitude import fit_attitude
from altijax.motion_estimate.estimates import estimate_motion
from altijax.strapdown import integrate_attitude
from altijax.wahba import fit_windows

RATE, BEFORE, AFTER = 100, 60.0, 35.0
LASTING = (5.0, 10.0)
SPEED, ACCELERATION, GRAVITY = 10.0, 3.0, 9.80665


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Times from the beginning of the acceleration, readings of the IMU, and Doppler velocities."""

    t: np.ndarray
    f_b: np.ndarray
    w_b: np.ndarray
    t_gnss: np.ndarray
    v_gnss: np.ndarray


Filter = Callable[[np.ndarray, np.ndarray], np.ndarray]


def level_drive(lasting: float, seed: int = 0) -> Drive:
    """The drive as a calibrated consumer IMU and a receiver report it.

    What calibration left: 0.03 m/s^2 and 0.1 deg/s, one standard deviation, on each axis.
    """
    t = np.arange(round((BEFORE + AFTER) * RATE) + 1) / RATE - BEFORE
    rise = 0.2
    a = ACCELERATION * np.clip(np.minimum(t, lasting + rise - t) / rise, 0, 1)
    speed = SPEED + np.concatenate([[0], np.cumsum((a[1:] + a[:-1]) / 2 / RATE)])
    still = np.zeros_like(t)
    f_b = np.stack([a, still, still + GRAVITY], -1)
    keys = jax.random.split(jax.random.key(seed), 5)
    accelerometer = replace(aj.MEMS_ACCELEROMETER, bias=0.03 * jax.random.normal(keys[0], (3,)))
    gyro = replace(aj.MEMS_GYRO, bias=np.radians(0.1) * jax.random.normal(keys[1], (3,)), g_sensitivity=0.0)
    receiver = replace(aj.DOPPLER_1_HZ, latency=0.0)
    t_gnss, v_gnss, _ = aj.doppler_velocity(
        receiver, t, np.stack([speed, still, still], -1), epochs=int(t[-1] - t[0]) + 1, key=keys[4]
    )
    return Drive(
        t=t,
        f_b=np.asarray(aj.accelerometer_output(accelerometer, f_b, 1 / RATE, key=keys[2])),
        w_b=np.asarray(aj.gyro_output(gyro, 0 * f_b, f_b, 1 / RATE, key=keys[3])),
        t_gnss=np.asarray(t_gnss),
        v_gnss=np.asarray(v_gnss),
    )


def pitch_of_up(up: np.ndarray) -> np.ndarray:
    """Nose-up pitch in degrees of the upward direction in body axes (forward, left, up)."""
    return np.degrees(np.arctan2(up[:, 0], np.hypot(up[:, 1], up[:, 2])))


def pitch_of_quaternions(q: np.ndarray) -> np.ndarray:
    """The same of quaternions (w, x, y, z) from body axes to axes whose third is up."""
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return pitch_of_up(np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1))


def by_ahrs(name: str) -> Filter:
    def pitch(f_b: np.ndarray, w_b: np.ndarray) -> np.ndarray:
        from ahrs import filters

        q = getattr(filters, name)(gyr=w_b, acc=f_b, frequency=float(RATE)).Q
        # AQUA's quaternion leads from the outer axes to the body's, the others' the other way.
        return pitch_of_quaternions(q * [1, -1, -1, -1] if name == "AQUA" else q)

    return pitch


def by_imufusion(**settings: float) -> Filter:
    def pitch(f_b: np.ndarray, w_b: np.ndarray) -> np.ndarray:
        import imufusion

        ahrs = imufusion.Ahrs()
        ahrs.set_settings(imufusion.AhrsSettings(sample_rate=RATE, **settings))
        found = []
        for f, w in zip(f_b / GRAVITY, np.degrees(w_b), strict=True):
            ahrs.update_no_magnetometer(w, f)
            found.append(ahrs.get_quaternion())
        return pitch_of_quaternions(np.array(found))

    return pitch


def by_vqf(f_b: np.ndarray, w_b: np.ndarray) -> np.ndarray:
    import vqf

    return pitch_of_quaternions(vqf.VQF(1 / RATE).updateBatch(w_b, f_b)["quat6D"])


PEERS: dict[str, tuple[str, Filter]] = {
    "ahrs: Madgwick": ("ahrs", by_ahrs("Madgwick")),
    "ahrs: Mahony": ("ahrs", by_ahrs("Mahony")),
    "ahrs: AQUA": ("ahrs", by_ahrs("AQUA")),
    "ahrs: EKF": ("ahrs", by_ahrs("EKF")),
    "imufusion": ("imufusion", by_imufusion()),
    # The rejection that its advanced example shows.
    "imufusion, rejecting": ("imufusion", by_imufusion(acceleration_rejection=10, rejection_timeout=5)),
    "VQF": ("vqf", by_vqf),
}


def by_epochs(drive: Drive) -> np.ndarray:
    """`fit_attitude` at every epoch, no gyro: the mean accelerations of accelerometer and Doppler velocities."""
    f_b, _, f_n, euler0, t_middle = epochs(drive)
    fit = jax.vmap(partial(fit_attitude, prior_std=0.2, measurement_std=0.1))(f_b, f_n, euler0)
    return np.degrees(np.interp(drive.t, t_middle, fit.euler[:, 1]))


def by_windows(drive: Drive) -> np.ndarray:
    """`fit_windows` over 15 epochs, the gyro carrying their forces into one instant and the pitch between epochs."""
    _, f_first, f_n, euler0, t_middle = epochs(drive)
    turned = integrate_attitude(drive.w_b, jnp.eye(3), 1 / RATE)
    middle = aj.interpolate_rotations(t_middle, drive.t, turned)
    f_b = jnp.einsum("kji,kj->ki", middle, f_first)
    count = len(t_middle)
    fit = fit_windows(
        f_b, f_n, aj.euler_to_matrix(euler0), jnp.full(count, 10.0), jnp.full(count, 0.1), window=15, C_gyro=middle
    )
    first = aj.interpolate_rotations(drive.t, t_middle, fit.C_nb @ jnp.swapaxes(middle, -1, -2))
    return pitch_of_up(np.asarray((first @ turned)[:, 2]))


def by_batch(drive: Drive) -> np.ndarray:
    """`estimate_motion` with its batch over the whole recording."""
    imu = pd.DataFrame(
        np.hstack([drive.f_b, drive.w_b]), pd.Index(drive.t, name="t"), ["ax", "ay", "az", "gx", "gy", "gz"]
    )
    gnss = pd.DataFrame(drive.v_gnss, pd.Index(drive.t_gnss, name="t"), ["v_e", "v_n", "v_u"])
    estimate = estimate_motion(aj.Recording(name="level road", imu=imu, gnss=gnss), method="batch")
    return np.degrees(estimate["pitch"].to_numpy())


OURS: dict[str, Callable[[Drive], np.ndarray]] = {
    "AltiJAX: epochs, no gyro": by_epochs,
    "AltiJAX: windows with gyro": by_windows,
    "AltiJAX: whole-record batch": by_batch,
}


def epochs(drive: Drive) -> tuple[jax.Array, ...]:
    """Mean specific forces between velocities: in body axes, in those of the first sample by the gyro, in navigation
    axes; initial angles (0, 0, pi/2 - COG); middles."""
    n = round(RATE * (drive.t_gnss[1] - drive.t_gnss[0]))
    turned = integrate_attitude(drive.w_b, jnp.eye(3), 1 / RATE)

    def means(f: jax.Array) -> jax.Array:
        pairs = (f[1:] + f[:-1]) / 2
        return pairs.reshape(-1, n, 3).mean(1)

    v = jnp.asarray(drive.v_gnss)
    f_n = jnp.diff(v, axis=0) / np.diff(drive.t_gnss)[:, None] + jnp.array([0.0, 0.0, GRAVITY])
    _, cog, _ = aj.velocity_to_course((v[1:] + v[:-1]) / 2)
    euler0 = jnp.stack([0 * cog, 0 * cog, aj.heading_to_yaw(cog)], -1)
    middles = (drive.t_gnss[1:] + drive.t_gnss[:-1]) / 2
    return means(jnp.asarray(drive.f_b)), means(jnp.einsum("tij,tj->ti", turned, drive.f_b)), f_n, euler0, middles


def pitches_of(drive: Drive) -> dict[str, np.ndarray]:
    """Each way's pitch in degrees at the drive's times."""
    found = {"accelerometer alone": pitch_of_up(drive.f_b)}
    for name, (module, pitch) in PEERS.items():
        if find_spec(module) is None:
            print(f"{name} is left out: {module} is not installed")
        else:
            found[name] = pitch(drive.f_b, drive.w_b)
    return found | {name: pitch(drive) for name, pitch in OURS.items()}


def errors(drive: Drive, pitches: dict[str, np.ndarray]) -> pd.DataFrame:
    """Greatest and root mean square false pitch from the beginning of the acceleration on."""
    seen = {name: pitch[drive.t >= 0] for name, pitch in pitches.items()}
    rows = {name: (np.abs(pitch).max(), np.sqrt(np.mean(pitch**2))) for name, pitch in seen.items()}
    return pd.DataFrame.from_dict(rows, orient="index", columns=["greatest (deg)", "RMS (deg)"])


def draw(drive: Drive, pitches: dict[str, np.ndarray], lasting: float) -> plt.Figure:
    """False pitch against time, the filters and AltiJAX side by side on one scale."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, layout="constrained")
    shown = (drive.t > -5) & (drive.t < 25)
    for name, pitch in pitches.items():
        if name != "accelerometer alone":
            axes[int(name in OURS)].plot(drive.t[shown], pitch[shown], linewidth=1.4, label=name)
    for ax, title in zip(axes, ("no velocity, real time", "1 Hz Doppler velocities, afterwards"), strict=True):
        ax.axvspan(0, lasting, color="0.9", label=f"{ACCELERATION:g} m/s² forward")
        ax.axhline(0, color="black", linewidth=0.8, linestyle="--", label="the road")
        ax.set(title=title, xlabel="time (s)")
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8, loc="upper right")
    axes[0].set_ylabel("pitch (deg)")
    figure.suptitle("False pitch on a level road")
    return figure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--picture", help="file to draw to")
    options = parser.parse_args()
    tables = {}
    with jax.enable_x64(True):
        for lasting in LASTING:
            drive = level_drive(lasting)
            pitches = pitches_of(drive)
            tables[f"{lasting:g} s"] = errors(drive, pitches)
            if lasting == LASTING[0]:
                figure = draw(drive, pitches, lasting)
    print(pd.concat(tables, axis=1).round(2).to_string())
    if options.picture:
        figure.savefig(options.picture, dpi=120)
