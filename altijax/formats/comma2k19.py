"""Segments of comma2k19, a public set of drives, as tables in SI units and sensor axes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pymap3d import ecef2enuv, ecef2geodetic

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import (
    DOWN_TO_UP,
    VELOCITY,
    Log,
    attitude_columns,
    from_first_imu_sample,
    imu_table,
    rotations_of,
    stream_table,
)


def reads(path: Path) -> bool:
    """Whether a path is a segment of comma2k19."""
    return (path / "processed_log").is_dir()


def read(folder: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a comma2k19 segment: IMU, four wheel speeds, u-blox receiver, and its pose as the reference."""
    arrays = {
        file.relative_to(folder).as_posix(): _read_array(file, file.relative_to(folder).as_posix(), problems)
        for part in ("processed_log", "global_pose")
        for file in sorted((folder / part).rglob("*"))
        if file.is_file() and not file.suffix
    }

    def series(name: str, width: int) -> list[np.ndarray] | None:
        """The arrays t and value under a name, or None."""
        return _matching(arrays, [f"{name}/t", f"{name}/value"], [0, width], problems)

    accelerometer = series("processed_log/IMU/accelerometer", 3)
    if accelerometer is None:
        found = ", ".join(arrays) or "nothing"
        raise RecordingError(
            f"{folder}: processed_log/IMU/accelerometer/t and value (rows of 3) are needed; found {found}"
        )
    gyro = series("processed_log/IMU/gyro", 3)
    tables = {"imu": imu_table(accelerometer, gyro, "processed_log/IMU", problems, notes)}
    wheel = series("processed_log/CAN/wheel_speed", 4)
    if wheel:
        columns = ["front_left", "front_right", "rear_left", "rear_right"]
        tables["wheel"] = stream_table(wheel[0], wheel[1], columns, "processed_log/CAN/wheel_speed")
    gnss = series("processed_log/GNSS/live_gnss_ublox", 6)
    if gnss:
        columns = ["lat", "lon", "speed", "utc", "alt", "course"]
        table = stream_table(gnss[0], gnss[1], columns, "processed_log/GNSS/live_gnss_ublox")
        tables["gnss"] = table.drop(columns="utc")
    names = [f"global_pose/frame_{name}" for name in ("times", "positions", "velocities", "orientations")]
    pose = _matching(arrays, names, [0, 3, 3, 4], problems)
    if pose:
        tables["reference"] = _comma2k19_reference(*pose)
    return from_first_imu_sample(tables), {
        "name": folder.name,
        "description": "comma2k19 segment; the reference is a fusion that used the same IMU",
        "axes": "FRD",
    }


def _read_array(path: Path, name: str, problems: list[str]) -> np.ndarray | None:
    """The complete rows of a NumPy file; None where there are none, or no numbers."""
    with path.open("rb") as stream:
        try:
            version = np.lib.format.read_magic(stream)
            read_header = (
                np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            )
            shape, fortran_order, dtype = read_header(stream)
        except ValueError as error:
            problems.append(f"{name}: not a NumPy array ({error}); left out, copy it again from its source")
            return None
        if dtype.hasobject or not shape:
            return None
        content = stream.read()
    expected = int(np.prod(shape))
    got = min(len(content) // dtype.itemsize, expected)
    # In column order a row is complete when the last column has it.
    rows = max(got - (expected - shape[0]), 0) if fortran_order else got // max(expected // max(shape[0], 1), 1)
    if got < expected:
        fate = f"only its first {rows} rows are whole" if rows else "left out"
        problems.append(
            f"{name}: cut short, {expected} elements expected and {got} got; {fate}, copy it again from its source"
        )
    if dtype.kind not in "iuf" or not rows:
        return None
    values = np.zeros(expected)
    values[:got] = np.frombuffer(content, dtype, got)
    return values.reshape(shape, order="F" if fortran_order else "C")[:rows]


def _matching(
    arrays: dict[str, np.ndarray | None], names: Sequence[str], widths: Sequence[int], problems: list[str]
) -> list[np.ndarray] | None:
    """Arrays that belong together, as many rows of each as all have; None where one is missing or misshapen."""
    found: list[np.ndarray] = []
    for name, width in zip(names, widths, strict=True):
        array = arrays.get(name)
        if array is not None and array.shape[1:] == ((width,) if width else ()):
            found.append(array)
            continue
        if any(other in arrays for other in names):
            seen = "missing" if name not in arrays else "empty" if array is None else f"of shape {array.shape}"
            problems.append(
                f"{name}: {seen}, {f'rows of {width}' if width else 'a plain series'} wanted; its stream is left out"
            )
        return None
    rows = [len(array) for array in found]
    if min(rows) < max(rows):
        problems.append(f"{', '.join(names)}: they have {rows} rows; the first {min(rows)} of each are used")
    return [array[: min(rows)] for array in found]


def _comma2k19_reference(
    t: np.ndarray, positions: np.ndarray, velocities: np.ndarray, orientations: np.ndarray
) -> pd.DataFrame:
    lat, lon, alt = ecef2geodetic(*positions.T)
    C_ne = np.stack([ecef2enuv(*axis, lat, lon) for axis in np.eye(3)], -1).swapaxes(0, 1)
    C_nb = C_ne @ rotations_of(orientations) @ DOWN_TO_UP
    columns = attitude_columns(C_nb) | dict(zip(VELOCITY, np.einsum("tij,tj->it", C_ne, velocities), strict=True))
    columns |= {"lat": lat, "lon": lon, "alt": alt}
    return stream_table(t, np.stack(list(columns.values()), -1), list(columns), "global_pose")
