"""KITTI's OXTS folders, as tables in SI units and sensor axes."""

from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import ACCELEROMETER, GYRO, VELOCITY, Log, from_first_imu_sample, stream_table

_FIELDS = (
    "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu pos_accuracy vel_accuracy navstat "
    "numsats posmode velmode orimode"
).split()
"""The 30 numbers of each file, as the set's own dataformat.txt names them."""


def reads(path: Path) -> bool:
    """Whether a path is a drive of KITTI's raw data, or its folder oxts."""
    return _oxts(path) is not None


def read(folder: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of an OXTS folder: IMU, velocities, and the pose as the reference.

    The unit gives out one solution, of its GNSS and its IMU, so ``gnss`` holds velocities of the reference itself.
    """
    oxts = _oxts(folder)
    if oxts is None:
        raise RecordingError(f"{folder}: there is no oxts/data with text files in it; unpack the drive's zip whole")
    t = _times(oxts)
    files = sorted((oxts / "data").glob("*.txt"))
    if len(files) != len(t):
        problems.append(
            f"{oxts.name}/timestamps.txt has {len(t)} times for {len(files)} files in {oxts.name}/data; the files are "
            "taken by the numbers in their names, those without a time left out"
        )
    # A frame that the unit lost has a time and no file.
    numbers = np.array([int(file.stem) if file.stem.isdigit() else -1 for file in files])
    timed = (numbers >= 0) & (numbers < len(t))
    files = [file for file, there in zip(files, timed, strict=True) if there]
    values = pd.DataFrame([_numbers(file) for file in files], columns=_FIELDS)
    t = t[numbers[timed]]
    velocity = values[["ve", "vn", "vu"]].to_numpy()
    deviation = values[["vel_accuracy"]].to_numpy()
    place = values[["lat", "lon", "alt"]].to_numpy()
    # Here pitch is positive with the front down, and yaw counts from East to the left.
    attitude = np.stack([values["roll"], -values["pitch"], np.mod(np.pi / 2 - values["yaw"].to_numpy(), 2 * np.pi)], -1)
    notes.append(
        f"{oxts.name}: gnss and reference are the same solution, which the unit fuses of its GNSS and this IMU; do not "
        "judge one by the other"
    )
    tables = {
        "imu": stream_table(
            t, values[["ax", "ay", "az", "wx", "wy", "wz"]].to_numpy(), ACCELEROMETER + GYRO, oxts.name
        ),
        "gnss": stream_table(
            t,
            np.concatenate([velocity, place, np.repeat(deviation, 3, 1)], 1),
            [*VELOCITY, "lat", "lon", "alt", "sd_e", "sd_n", "sd_u"],
            f"{oxts.name} velocities",
        ),
        "reference": stream_table(
            t,
            np.concatenate([attitude, velocity, place], 1),
            ["roll", "pitch", "heading", *VELOCITY, "lat", "lon", "alt"],
            f"{oxts.name} pose",
        ),
    }
    name = oxts.parent.name if oxts.name == "oxts" else oxts.name
    return from_first_imu_sample(tables), {"name": name, "description": "KITTI raw data", "axes": "FLU"}


def _oxts(path: Path) -> Path | None:
    for place in (path, path / "oxts"):
        if (place / "timestamps.txt").is_file() and any((place / "data").glob("*.txt")):
            return place
    return None


def _times(oxts: Path) -> np.ndarray:
    """Seconds since the first time; the files have nanoseconds of local wall time."""
    lines = (oxts / "timestamps.txt").read_text(encoding="utf-8").splitlines()
    filled = [line for line in lines if line.strip()]
    try:
        times = pd.to_datetime(pd.Series(filled), format="%Y-%m-%d %H:%M:%S.%f").astype("datetime64[ns]")
    except ValueError as error:
        raise RecordingError(f"{oxts.name}/timestamps.txt: {error}; copy it again from its source") from error
    return (times - times.iloc[0]).dt.total_seconds().to_numpy()


def _numbers(file: Path) -> np.ndarray:
    words = file.read_text(encoding="utf-8").split()
    try:
        numbers = np.array(words, float)
    except ValueError as error:
        raise RecordingError(f"{file.name}: {error}; copy it again from its source") from error
    if len(numbers) != len(_FIELDS):
        raise RecordingError(
            f"{file.name}: {len(_FIELDS)} numbers expected and {len(numbers)} got; copy it again from its source"
        )
    return numbers
