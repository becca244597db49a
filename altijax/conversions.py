"""Known recordings made from what their origins hold: the same tidy tables from the same originals, bit for bit.

Each function takes the folder with the originals and returns the text of every file of the tidy folder by its name.
Digits are those with which the recordings were first converted, since `datasets` knows the files by their checksums.
"""

import io
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io

from altijax.constants import STANDARD_GRAVITY

_GNSS_TABLE = ("lat", "lon", "v_e", "v_n", "v_u", "sd_e", "sd_n", "sd_u")


def rtk_drive(originals: Path) -> dict[str, str]:
    """A drive with RTKLIB's solution (.pos) and an IMU log whose clock is tied to GPS time by RTKLIB's time tags.

    The tags say when the log began and how long it took, by which the IMU's milliseconds are stretched.
    """
    solution = pd.read_csv(originals / "gnss_1934_sf.pos", sep=r"\s+", skiprows=1, header=None)
    stamps = pd.to_datetime(solution[0] + " " + solution[1])
    t_first = (stamps[0] - pd.Timestamp(0)).total_seconds()
    columns = dict(lat=2, lon=3, alt=4, v_n=15, v_e=16, v_u=17, sd_n=18, sd_e=19, sd_u=20)
    gnss = pd.DataFrame({name: solution[column] for name, column in columns.items()})
    gnss.insert(0, "t", (stamps - stamps[0]).dt.total_seconds())
    gnss = gnss[gnss["t"] < 330]

    tags = (originals / "imu_1934.csv.tag").read_bytes()
    whole, fraction = struct.unpack_from("<Id", tags, 64)
    lasted = struct.unpack_from("<I", tags, len(tags) - 8)[0] / 1000
    # The log's last line is cut short.
    log = np.genfromtxt(originals / "imu_1934.csv", skip_header=1, skip_footer=1, delimiter=",")
    since = log[:, 6] / 1000 - log[0, 6] / 1000
    imu = pd.DataFrame({"t": whole + fraction + since * (lasted / since[-1]) - t_first})
    imu[["ax", "ay", "az"]] = log[:, :3] * STANDARD_GRAVITY
    imu[["gx", "gy", "gz"]] = np.radians(log[:, 3:6])
    # By the decimal number, for numpy's round multiplies first and goes the other way at ties.
    imu = imu[imu["t"] < 330].map(lambda value: float(f"{value:.5f}"))
    return {
        "recording.toml": _sheet(
            "rtk-drive",
            "car in hilly streets, roof IMU and RTK GNSS with Doppler velocity",
            "BRU",
            "github rtklibexplorer/GNSS_IMU 8235ee6c5f data/drive_0708",
            "BSD-3-Clause (c) 2025 rtklibexplorer",
        ),
        "imu.csv": _csv(imu),
        "gnss.csv": _csv(gnss[["t", *_GNSS_TABLE]]),
        "reference.csv": _csv(gnss[["t", "lat", "lon", "alt", "v_e", "v_n", "v_u"]]),
    }


def umn_thor75(originals: Path) -> dict[str, str]:
    """A flight as MATLAB arrays on the IMU's times; GNSS values stand until the receiver's time of week changes."""
    name = "thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat"
    arrays = scipy.io.loadmat(originals / name, squeeze_me=True, struct_as_record=False)["flight_data"]
    flown = (arrays.time >= 226) & (arrays.time < 420)
    fixed = flown & np.append(False, np.diff(arrays.GPS_TOW) != 0)

    def table(rows: np.ndarray, digits: int, **columns: np.ndarray) -> pd.DataFrame:
        return pd.DataFrame({name: np.round(values[rows], digits) for name, values in columns.items()})

    f = arrays
    imu = table(flown, 6, t=f.time, ax=f.ax, ay=f.ay, az=f.az, gx=f.p, gy=f.q, gz=f.r)
    gnss = table(fixed, 7, t=f.time, lat=f.lat, lon=f.lon, alt=f.alt, v_e=f.ve, v_n=f.vn, v_u=-f.vd)
    filtered = dict(v_e=f.navve, v_n=f.navvn, v_u=-f.navvd, alt=f.navalt)
    reference = table(flown, 5, t=f.time, roll=f.phi, pitch=f.theta, heading=f.psi, **filtered)
    reference["heading"] %= 2 * np.pi
    return {
        "recording.toml": _sheet(
            "umn-thor75",
            "small fixed-wing aircraft flying squares: 50 Hz IMU, 1 Hz GPS velocity; reference = on-board filter of "
            "the same sensors (not independent)",
            "FRD",
            "github NorthStarUAS/insgnss_tools 0b5f6b16f0 flight_data thor flight 75",
            "MIT (c) 2006-2018 Curtis L. Olson",
        ),
        "imu.csv": _csv(imu),
        "gnss.csv": _csv(gnss),
        "reference.csv": _csv(reference),
    }


def dresden_motorbike(originals: Path) -> dict[str, str]:
    """A telephone's log in one table; iOS logs minus the specific force, in g, and stamps each sensor by itself.

    The gyro is interpolated to the accelerometer's times. GNSS has Unix time: the clocks are tied by the time of
    logging, two hours ahead of UTC, of the rows of the accelerometer.
    """
    log = pd.read_csv(originals / "2016-08-09-Motorbike.csv", low_memory=False)
    forces = log[["accelerometerTimestamp_sinceReboot", *(f"accelerometerAcceleration{axis}" for axis in "XYZ")]]
    logged = (pd.to_datetime(log["loggingTime"]) - pd.Timestamp(0)).dt.total_seconds() - 2 * 3600
    late = np.nanmedian(logged.to_numpy() - forces.iloc[:, 0].to_numpy())
    force = forces.dropna().to_numpy()
    rate = log[["gyroTimestamp_sinceReboot", *(f"gyroRotation{axis}" for axis in "XYZ")]].dropna().to_numpy()
    imu = pd.DataFrame({"t": force[:, 0] - force[0, 0]})
    imu[["ax", "ay", "az"]] = np.round(-force[:, 1:] * STANDARD_GRAVITY, 6)
    for axis, name in enumerate(("gx", "gy", "gz"), 1):
        imu[name] = np.round(np.interp(force[:, 0], rate[:, 0], rate[:, axis]), 6)
    columns = ("Timestamp_since1970", "Latitude", "Longitude", "Altitude", "Speed", "Course")
    gnss = log[[f"location{column}" for column in columns]].dropna()
    gnss.columns = ["t", "lat", "lon", "alt", "speed", "course"]
    gnss = gnss.assign(t=gnss["t"] - (late + force[0, 0]), lat=gnss["lat"].round(7), lon=gnss["lon"].round(7))
    return {
        "recording.toml": _sheet(
            "dresden-motorbike",
            "telephone on a motorbike: 51 Hz IMU, 1 Hz GPS speed and course (degrees), no climb; GPS about 0.55 s "
            "late; signs as logged after negating the accelerometer",
            "LBU",
            "github balzer82/Kalman 61b1ec4e (Dresden motorbike lean-angle recordings 2016-08-09",
            "CC-BY-SA-2.0",
        ),
        "imu.csv": _csv(imu),
        "gnss.csv": _csv(gnss),
    }


CONVERSIONS: dict[str, Callable[[Path], dict[str, str]]] = {
    "rtk-drive": rtk_drive,
    "umn-thor75": umn_thor75,
    "dresden-motorbike": dresden_motorbike,
}
"""How each recording is made from a folder with its originals."""


def _csv(table: pd.DataFrame) -> str:
    forms = {"t": "{:.6f}", "lat": "{:.9f}", "lon": "{:.9f}"}
    columns = [table[name].map(forms.get(name, "{:.7g}").format) for name in table.columns]
    text = io.StringIO()
    pd.concat(columns, axis=1).to_csv(text, index=False, lineterminator="\n")
    return text.getvalue()


def _sheet(name: str, description: str, axes: str, origin: str, licence: str) -> str:
    return (
        f'name = "{name}"\n'
        f'description = "{description}"\n'
        f'axes = "{axes}"  # where the IMU axes x, y, z point on the vehicle: F/B, L/R, U/D\n'
        "\n[source]\n"
        f'origin = "{origin}"\n'
        f'licence = "{licence}"\n'
    )
