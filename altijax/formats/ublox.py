"""u-blox receivers' UBX logs, as tables in SI units and sensor axes."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, first_bytes, from_first_imu_sample, import_extra, imu_table, stream_table

_PVT, _MEAS, _RAW = 0x0107, 0x1002, 0x1003
_WEEK = 604_800_000
"""Milliseconds after which the receiver's time of week starts again."""

_ACCELEROMETER, _GYRO, _TEMPERATURE, _SPEED = (16, 17, 18), (14, 13, 5), 12, 11
_TICKS = {6, 7, 8, 9, 10}
_SCALE = {
    **dict.fromkeys(_ACCELEROMETER, 2.0**-10),
    **dict.fromkeys(_GYRO, float(np.radians(2.0**-12))),
    _TEMPERATURE: 1e-2,
    _SPEED: 1e-3,
}
"""Types of measurement in ESF-MEAS and ESF-RAW, and SI units (degC) in one count of each."""


def reads(path: Path) -> bool:
    """Whether a path is a UBX log, by a frame among its first bytes, or says so by its name."""
    return path.is_file() and (path.suffix.lower() == ".ubx" or _has_frame(first_bytes(path)))


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a u-blox UBX log: ESF-RAW or else ESF-MEAS, and NAV-PVT. Without an ESF message there is no IMU."""
    pyubx2 = import_extra("pyubx2", path)
    errors: list[Exception] = []
    measurements: dict[str, list[tuple[int, int, int]]] = {"ESF-RAW": [], "ESF-MEAS": []}
    epochs: list[list[float]] = []
    with path.open("rb") as stream:
        reader = pyubx2.UBXReader(
            stream,
            protfilter=pyubx2.UBX_PROTOCOL,
            quitonerror=pyubx2.ERR_LOG,
            errorhandler=errors.append,
            msgfilter=(_PVT, _MEAS, _RAW),
        )
        for _, m in reader:
            if m is not None and m.identity == "NAV-PVT":
                before = [len(measured) for measured in measurements.values()]
                solution = [m.velE, m.velN, -m.velD, m.lat, m.lon, m.height, m.sAcc, m.sAcc, m.sAcc]
                epochs.append([m.iTOW, m.gnssFixOk, *solution, *before])
            elif m is not None:
                measurements[m.identity] += _measurements(m.identity, m.payload)
    if errors:
        problems.append(f"{path.name}: {len(errors)} damaged message(s) skipped, the first: {errors[0]}")
    if not epochs and not any(measurements.values()):
        raise RecordingError(
            f"{path.name}: has neither NAV-PVT nor ESF-RAW nor ESF-MEAS messages; switch them on and log again"
        )
    columns = np.array(epochs, float).reshape(-1, 13).T
    itow, fixed, before_raw, before_meas = columns[[0, 1, 11, 12]]
    t = np.unwrap(itow, period=_WEEK) * 1e-3
    tables = _gnss(t, fixed > 0, columns[2:11].T, f"{path.name} NAV-PVT", notes)
    kind, before = ("ESF-RAW", before_raw) if measurements["ESF-RAW"] else ("ESF-MEAS", before_meas)
    long = _dated(measurements[kind], kind, before.astype(int), t, f"{path.name} {kind}", problems, notes)
    if long is not None:
        tables |= _esf(long, f"{path.name} {kind}", problems, notes)
    if "imu" not in tables:
        problems.append(f"{path.name}: there is no IMU in it (no accelerometer in ESF-RAW or ESF-MEAS)")
    return from_first_imu_sample(tables), {"name": path.stem, "description": "u-blox log", "axes": "FLU"}


def _has_frame(content: bytes) -> bool:
    """Whether a UBX frame with the right check sum is among the bytes; its two bytes of sync are in any large file."""
    for sync in re.finditer(b"\xb5\x62", content):
        length = int.from_bytes(content[sync.end() + 2 : sync.end() + 4], "little")
        end = sync.end() + 4 + length
        summed = np.frombuffer(content[sync.end() : end], np.uint8).astype(np.int64)
        if content[end : end + 2] == bytes([summed.sum() & 0xFF, summed.cumsum().sum() & 0xFF]):
            return True
    return False


def _measurements(identity: str, payload: bytes) -> list[tuple[int, int, int]]:
    """Time tag, type and value of each measurement in an ESF-MEAS or ESF-RAW message."""
    words = np.frombuffer(payload, "<u4", len(payload) // 4).astype(np.int64)
    if identity == "ESF-RAW":
        data, tags = words[1::2], words[2::2]
    else:
        data = words[2 : 2 + (words[1] >> 11 & 0x1F)]
        tags = np.full(data.size, words[0])
    values = ((data & 0xFFFFFF) ^ 0x800000) - 0x800000
    return list(zip(tags.tolist(), (data >> 24 & 0x3F).tolist(), values.tolist(), strict=False))


def _gnss(
    t: np.ndarray, fixed: np.ndarray, solution: np.ndarray, file: str, notes: list[str]
) -> dict[str, pd.DataFrame]:
    if not fixed.all():
        notes.append(f"{file}: {(~fixed).sum()} epochs without a fix dropped")
    if not fixed.any():
        return {}
    columns = ["v_e", "v_n", "v_u", "lat", "lon", "alt", "sd_e", "sd_n", "sd_u"]
    # The receiver gives millimetres, but degrees as they are.
    scale = np.array([1e-3, 1e-3, 1e-3, 1, 1, 1e-3, 1e-3, 1e-3, 1e-3])
    return {"gnss": stream_table(t[fixed], solution[fixed] * scale, columns, file)}


def _dated(
    measurements: list[tuple[int, int, int]],
    kind: str,
    before: np.ndarray,
    t_epochs: np.ndarray,
    file: str,
    problems: list[str],
    notes: list[str],
) -> pd.DataFrame | None:
    """Measurements with the receiver's time, from how many of them stand before each NAV-PVT message in the log."""
    if not measurements:
        return None
    long = pd.DataFrame(measurements, columns=["tag", "type", "value"])
    # ESF-RAW may count in 24 bits, though it hands the count on in 32.
    period = 2**24 if kind == "ESF-RAW" and long["tag"].max() < 2**24 else 2**32
    tags = np.unwrap(long["tag"].to_numpy(), period=period)
    t, at = t_epochs[before > 0], tags[before[before > 0] - 1]
    if kind == "ESF-MEAS":
        tick = 1e-3
    elif np.unique(at).size > 1:
        # The length of a tick is not in the log; time of week and tags tell it together.
        tick = float(np.polyfit(at - at[0], t - t[0], 1)[0])
    else:
        problems.append(f"{file}: left out, at least 2 NAV-PVT messages between its own are needed to date it")
        return None
    if t.size:
        notes.append(f"{file}: dated by its place among the NAV-PVT messages, which the receiver sends somewhat late")
    return long.assign(t=tags * tick + (np.median(t - at * tick) if t.size else 0.0))


def _esf(long: pd.DataFrame, file: str, problems: list[str], notes: list[str]) -> dict[str, pd.DataFrame]:
    """IMU and wheel speed, of dated measurements."""
    wide = long.pivot_table(index="t", columns="type", values="value", aggfunc="first")

    def measured(*types: int) -> tuple[np.ndarray, np.ndarray] | None:
        if not set(types) <= set(wide.columns):
            return None
        rows = wide[list(types)].dropna()
        return rows.index.to_numpy(float), rows.to_numpy() * [_SCALE[number] for number in types]

    tables = {}
    accelerometer, temperature, speed = measured(*_ACCELEROMETER), measured(_TEMPERATURE), measured(_SPEED)
    if accelerometer:
        tables["imu"] = imu_table(accelerometer, measured(*_GYRO), file, problems, notes)
        if temperature:
            tables["imu"]["temperature"] = np.interp(tables["imu"]["t"], temperature[0], temperature[1][:, 0])
    if speed:
        tables["wheel"] = stream_table(*speed, ["speed"], file)
    elif _TICKS & set(wide.columns):
        problems.append(
            f"{file}: wheel ticks left out, the log does not say how far one is; put speeds into a wheel.csv"
        )
    return tables
