"""Foreign drives as streams, and what may be done to them."""

from functools import cache

import numpy as np
import pandas as pd

from altijax.formats.axes import LETTERS
from altijax.samples.foreign_drives import foreign_drive

ACCELEROMETER, GYRO = ["ax", "ay", "az"], ["gx", "gy", "gz"]
Streams = dict[str, pd.DataFrame | None]


@cache
def _drive(seed: int) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    drive = foreign_drive(seed, duration=120.0, gnss_rate=5.0, mean_speed=10.0)
    return drive.imu, drive.wheel, drive.gnss


def streams(seed: int = 0) -> Streams:
    """Of a good drive."""
    return dict(zip(("imu", "wheel", "gnss"), _drive(seed), strict=True))


def scaled(given: Streams, stream: str, columns: list[str], factor: float) -> Streams:
    frame = given[stream]
    return given | {stream: frame.assign(**{name: frame[name] * factor for name in columns})}


def late(given: Streams, stream: str, seconds: float, rate: float = 1.0) -> Streams:
    frame = given[stream]
    return given | {stream: frame.set_axis(pd.Index(frame.index * rate + seconds, name="t"))}


def mounted(given: Streams, code: str, triads=(ACCELEROMETER, GYRO)) -> Streams:
    """As sensors mounted otherwise read it, left-handed ones too."""
    C = np.array([LETTERS[letter] for letter in code], float).T
    imu = given["imu"].copy()
    for triad in triads:
        imu[triad] = imu[triad].to_numpy() @ C
    return given | {"imu": imu}
