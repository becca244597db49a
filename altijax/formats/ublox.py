"""u-blox receivers' UBX logs, as tables in SI units and sensor axes."""

from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, first_bytes, from_first_imu_sample, imu_table, stream_table
from altijax.formats.ubx_frames import Frames, frames
from altijax.formats.ubx_solutions import POSLLH, PVAT, PVT, STATUS, VELNED, gnss_table, reference_table, solutions
from altijax.formats.ubx_ticks import TICKS, wheel_table

_MEAS, _RAW = 0x1002, 0x1003
_KINDS = {_RAW: "ESF-RAW", _MEAS: "ESF-MEAS"}
_NAVIGATION = {PVT: "NAV-PVT", PVAT: "NAV-PVAT", VELNED: "NAV-VELNED"}

_ACCELEROMETER, _GYRO, _TEMPERATURE, _SPEED = (16, 17, 18), (14, 13, 5), 12, 11
_SCALE = {
    **dict.fromkeys(_ACCELEROMETER, 2.0**-10),
    **dict.fromkeys(_GYRO, float(np.radians(2.0**-12))),
    _TEMPERATURE: 1e-2,
    _SPEED: 1e-3,
}
"""Types of measurement in ESF-MEAS and ESF-RAW, and SI units (degC) in one count of each."""

_LATE = 0.3
"""Seconds by which messages of one clock may come late to the log, each its own way."""


def reads(path: Path) -> bool:
    """Whether a path is a UBX log, by a frame among its first bytes, or says so by its name."""
    if not path.is_file():
        return False
    return path.suffix.lower() == ".ubx" or frames(np.frombuffer(first_bytes(path), np.uint8)).kind.size > 0


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a u-blox UBX log: ESF-RAW or else ESF-MEAS, and NAV-PVT or else NAV-PVAT or NAV-VELNED.

    Without an ESF message there is no IMU. The attitude of NAV-PVAT is the reference.
    """
    messages = frames(np.fromfile(path, np.uint8), (*_KINDS, *_NAVIGATION, STATUS, POSLLH))
    if messages.damaged.size:
        problems.append(
            f"{path.name}: {messages.damaged.size} damaged message(s) skipped, the first at byte "
            f"{messages.damaged[0]}; copy the file again if its source is whole"
        )
    kind = next((kind for kind in _KINDS if (messages.kind == kind).any()), None)
    solution = next((solution for solution in _NAVIGATION if (messages.kind == solution).any()), None)
    if kind is None and solution is None:
        raise RecordingError(
            f"{path.name}: has neither {' nor '.join([*_NAVIGATION.values(), *_KINDS.values()])} messages; switch "
            "them on and log again"
        )
    tables, epochs = {}, pd.DataFrame({"number": [], "t": [], "fixed": []})
    if solution:
        file = f"{path.name} {_NAVIGATION[solution]}"
        epochs = solutions(messages, solution)
        attitudes = solutions(messages, PVAT) if (messages.kind == PVAT).any() else None
        found = {
            "gnss": gnss_table(epochs, file, notes),
            "reference": None if attitudes is None else reference_table(attitudes, f"{path.name} NAV-PVAT", notes),
        }
        tables = {stream: table for stream, table in found.items() if table is not None}
    if kind:
        file, by = f"{path.name} {_KINDS[kind]}", f"{_NAVIGATION[solution or PVT]} messages"
        long = _dated(_measurements(messages, kind), kind, epochs, by, file, problems, notes)
        tables |= _esf(long, tables.get("gnss"), file, problems, notes)
    if "imu" not in tables:
        problems.append(f"{path.name}: there is no IMU in it (no accelerometer in ESF-RAW or ESF-MEAS)")
    return from_first_imu_sample(tables), {"name": path.stem, "description": "u-blox log", "axes": "FLU"}


def _measurements(messages: Frames, kind: int) -> pd.DataFrame:
    """Each measurement in ESF-MEAS or ESF-RAW: its message's number, provider, time tag, word of type and value."""
    parts = []
    for number, words in messages.words(kind):
        if kind == _RAW:
            # Pairs of a measurement and its tag follow one reserved word.
            data, tags = words[:, 1:-1:2], words[:, 2::2]
            held = np.ones(data.shape, bool)
            provider = np.zeros(data.shape, np.uint32)
        else:
            data = words[:, 2:]
            flags = words[:, 1:2]
            # A count of none is left out; the word of calibration stands behind the measurements.
            stated, calibrated = flags >> 11 & 0x1F, flags >> 3 & 1
            held = np.arange(data.shape[1]) < np.where(stated > 0, stated, data.shape[1] - calibrated)
            tags, provider = np.broadcast_to(words[:, :1], data.shape), np.broadcast_to(flags >> 16, data.shape)
        numbers = np.broadcast_to(number[:, None], data.shape)
        parts.append([column[held] for column in (numbers, provider, tags, data)])
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return pd.DataFrame(
        {name: c[order] for name, c in zip(("number", "provider", "tag", "word"), columns, strict=True)}
    )


def _dated(
    long: pd.DataFrame, kind: int, epochs: pd.DataFrame, by: str, file: str, problems: list[str], notes: list[str]
) -> pd.DataFrame:
    """Measurements with the receiver's time ``t``, each provider's by its place among the messages of the epochs.

    A provider whose clock agrees with that of the first, who has most measurements, is dated with it.
    """
    dating = epochs[epochs["fixed"]] if epochs["fixed"].sum() > 1 else epochs
    if len(dating) < len(epochs) and kind == _RAW:
        notes.append(
            f"{file}: dated by the {len(dating)} of {len(epochs)} epochs with a fix; the time of the others is a guess"
        )
    providers = long["provider"].value_counts().index
    dated, first = [], None
    for provider in providers:
        part = long[long["provider"] == provider]
        clock = _clock(part, kind, dating, by, file, problems)
        if clock is None:
            continue
        tags, tick, offset = clock
        age = float(np.median(np.diff(np.unique(tags)))) * tick if tags[0] != tags[-1] else 0.0
        if first is not None and abs(offset - first) > age + _LATE:
            notes.append(
                f"{file}: provider {provider} counts {offset - first:+.3f} s off the clock of provider {providers[0]}, "
                "as a host does that feeds its own time; dated by itself, which is good to its interval"
            )
        elif first is not None:
            offset = first
        first = offset if first is None else first
        dated.append(part.assign(t=tags * tick + offset))
    if dated and len(dating):
        notes.append(f"{file}: dated by its place among the {by}, which the receiver sends somewhat late")
    return pd.concat(dated) if dated else long.iloc[:0].assign(t=[])


def _clock(
    part: pd.DataFrame, kind: int, dating: pd.DataFrame, by: str, file: str, problems: list[str]
) -> tuple[np.ndarray, float, float] | None:
    """Tags of one provider without their turns, seconds of a tick, and the time of tag 0; None if undatable."""
    tags = part["tag"].to_numpy(np.int64)
    # ESF-RAW may count in 24 bits, though it hands the count on in 32.
    tags = np.unwrap(tags, period=2**24 if kind == _RAW and tags.max() < 2**24 else 2**32)
    before = np.searchsorted(part["number"].to_numpy(), dating["number"].to_numpy())
    t, at = dating["t"].to_numpy()[before > 0], tags[before[before > 0] - 1]
    if kind == _MEAS:
        return tags, 1e-3, float(np.median(t - at * 1e-3)) if t.size else 0.0
    # The length of a tick is not in the log; time of week and tags tell it together, over half of the log at a time,
    # so that a clock that is set bends little.
    half = max(len(at) // 2, 1)
    apart = at[half:] != at[:-half]
    if not apart.any():
        problems.append(f"{file}: left out, at least 2 {by} between its own are needed to date it")
        return None
    tick = float(np.median((t[half:] - t[:-half])[apart] / (at[half:] - at[:-half])[apart]))
    offset = float(np.median(t - at * tick))
    off = np.abs(t - at * tick - offset).max()
    if off > 1:
        problems.append(
            f"{file}: its counter and the receiver's time of week part by up to {off:.3g} s, as they do where a clock "
            "is set or the receiver starts again; cut the log there if its streams do not fit"
        )
    return tags, tick, offset


def _esf(
    long: pd.DataFrame, gnss: pd.DataFrame | None, file: str, problems: list[str], notes: list[str]
) -> dict[str, pd.DataFrame]:
    """IMU and wheel speed, of dated measurements."""
    kinds = long["word"].to_numpy() >> 24 & 0x3F
    words, t = long["word"].to_numpy() & 0xFFFFFF, long["t"].to_numpy()

    def raw(number: int) -> tuple[np.ndarray, np.ndarray]:
        """Times, the first of each, and 24 bits of a type of measurement."""
        times, first = np.unique(t[kinds == number], return_index=True)
        return times, words[kinds == number][first].astype(np.int64)

    def measured(*numbers: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Times that all of several types have, and their values in SI units."""
        series = [raw(number) for number in numbers]
        times = series[0][0]
        for other, _ in series[1:]:
            times = times if np.array_equal(times, other) else np.intersect1d(times, other)
        if not times.size:
            return None
        values = np.stack([bits[np.searchsorted(at, times)] for at, bits in series], -1)
        return times, ((values ^ 0x800000) - 0x800000) * [_SCALE[number] for number in numbers]

    tables = {}
    accelerometer, temperature, speed = measured(*_ACCELEROMETER), measured(_TEMPERATURE), measured(_SPEED)
    if accelerometer:
        tables["imu"] = imu_table(accelerometer, measured(*_GYRO), file, problems, notes)
        if temperature:
            tables["imu"]["temperature"] = np.interp(tables["imu"]["t"], temperature[0], temperature[1][:, 0])
    if speed:
        tables["wheel"] = stream_table(*speed, ["speed"], file)
    elif ticking := TICKS & set(kinds.tolist()):
        wheel = wheel_table({number: raw(number) for number in sorted(ticking)}, gnss, file, problems, notes)
        tables |= {} if wheel is None else {"wheel": wheel}
    return tables
