"""A u-blox receiver's own solutions: NAV-PVT, NAV-PVAT or NAV-VELNED, and which of them are GNSS at all."""

import numpy as np
import pandas as pd

from altijax.formats.tables import VELOCITY, stream_table
from altijax.formats.ubx_frames import Frames

PVT, PVAT, VELNED, STATUS, POSLLH = 0x0107, 0x0117, 0x0112, 0x0103, 0x0102
_WEEK = 604_800_000
"""Milliseconds after which the receiver's time of week starts again."""


def _layout(size: int, **fields: tuple[str, int]) -> np.dtype:
    """Named fields of a payload, each with its type and offset."""
    forms, offsets = zip(*fields.values(), strict=True)
    return np.dtype({"names": list(fields), "formats": forms, "offsets": offsets, "itemsize": size})


# Sizes are those of the oldest version that has the fields. Positions are in 1e-7 deg and mm, velocities in mm/s.
_PVT = _layout(
    80,
    itow=("<u4", 0),
    fix=("u1", 20),
    flags=("u1", 21),
    lon=("<i4", 24),
    lat=("<i4", 28),
    height=("<i4", 32),
    v_n=("<i4", 48),
    v_e=("<i4", 52),
    v_d=("<i4", 56),
    sd=("<u4", 68),
    flags3=("u1", 78),
)
_PVAT = _layout(
    94,
    itow=("<u4", 0),
    fix=("u1", 24),
    flags=("u1", 25),
    lon=("<i4", 28),
    lat=("<i4", 32),
    height=("<i4", 36),
    v_n=("<i4", 52),
    v_e=("<i4", 56),
    v_d=("<i4", 60),
    sd=("<u4", 68),
    roll=("<i4", 72),
    pitch=("<i4", 76),
    heading=("<i4", 80),
)
_VELNED = _layout(32, itow=("<u4", 0), v_n=("<i4", 4), v_e=("<i4", 8), v_d=("<i4", 12), sd=("<u4", 28))
_STATUS = _layout(6, itow=("<u4", 0), fix=("u1", 4), flags=("u1", 5))
_POSLLH = _layout(16, itow=("<u4", 0), lon=("<i4", 4), lat=("<i4", 8), height=("<i4", 12))

_NO_FIX, _DEAD_RECKONING, _TWO_DIMENSIONS, _FUSED, _TIME_ONLY = 0, 1, 2, 4, 5
_WITHOUT_GNSS = {_NO_FIX: "without a fix", _DEAD_RECKONING: "of dead reckoning alone", _TIME_ONLY: "of time alone"}
_ROLL_PITCH_HEADING_VALID = 0b111000


def solutions(frames: Frames, kind: int) -> pd.DataFrame:
    """Epochs of one kind of message: its number in the file, ``t`` in s, whether there is a fix of GNSS, and values."""
    if kind == VELNED:
        return _merged_velned(frames)
    number, m = frames.structures(kind, _PVT if kind == PVT else _PVAT)
    # Since protocol 24 a NAV-PVT may say that its position is none.
    placed = ~(m["flags3"] & 1).astype(bool) if kind == PVT else np.ones(len(m), bool)
    columns = {name: np.where(placed, m[name] * 1e-7, np.nan) for name in ("lat", "lon")}
    columns |= {"alt": np.where(placed, m["height"] * 1e-3, np.nan)}
    columns |= {"v_e": m["v_e"] * 1e-3, "v_n": m["v_n"] * 1e-3, "v_u": m["v_d"] * -1e-3, "sd": m["sd"] * 1e-3}
    if kind == PVAT:
        columns |= {name: np.radians(m[name] * 1e-5) for name in ("roll", "pitch", "heading")}
        columns |= {"attitude": (m["flags"] & _ROLL_PITCH_HEADING_VALID) == _ROLL_PITCH_HEADING_VALID}
    return _epochs(number, m["itow"], m["fix"], (m["flags"] & 1).astype(bool), columns)


def gnss_table(epochs: pd.DataFrame, file: str, notes: list[str]) -> pd.DataFrame | None:
    """The epochs with a fix of GNSS, or None; what the others are, and what is special about these, becomes notes."""
    dropped = epochs.loc[~epochs["fixed"], "fix"]
    for fix, what in _WITHOUT_GNSS.items():
        if (dropped == fix).any():
            notes.append(f"{file}: {(dropped == fix).sum()} epochs {what} dropped")
    unsure = ~dropped.isin(list(_WITHOUT_GNSS))
    if unsure.any():
        notes.append(f"{file}: {unsure.sum()} epochs dropped, whose fix the receiver itself does not trust")
    epochs = epochs[epochs["fixed"]]
    if epochs.empty:
        return None
    fused, flat = (epochs["fix"] == _FUSED).to_numpy(), (epochs["fix"] == _TWO_DIMENSIONS).to_numpy()
    if fused.any():
        notes.append(
            f"{file}: {fused.sum()} of {len(epochs)} epochs are fused with the receiver's own IMU and wheel ticks, so "
            "they are no measurements independent of these; switch the fusion off for velocities of GNSS alone"
        )
    if flat.any():
        notes.append(f"{file}: {flat.sum()} epochs with a fix in two dimensions; their alt and v_u are left out")
        epochs = epochs.assign(**{name: epochs[name].mask(flat) for name in ("alt", "v_u")})
    deviations = {name: epochs["sd"] for name in ("sd_e", "sd_n", "sd_u")}
    columns = [*VELOCITY, *(name for name in ("lat", "lon", "alt") if name in epochs), *deviations]
    return stream_table(epochs["t"].to_numpy(), epochs.assign(**deviations)[columns].to_numpy(), columns, file)


def reference_table(epochs: pd.DataFrame, file: str, notes: list[str]) -> pd.DataFrame | None:
    """The vehicle's attitude and velocity of NAV-PVAT where all of its angles are valid, or None."""
    epochs = epochs[epochs["attitude"]]
    if epochs.empty:
        return None
    notes.append(f"{file}: the reference is the receiver's own fusion, which used the same IMU")
    columns = ["roll", "pitch", "heading", *VELOCITY]
    return stream_table(epochs["t"].to_numpy(), epochs[columns].to_numpy(), columns, file)


def _merged_velned(frames: Frames) -> pd.DataFrame:
    """NAV-VELNED, with the position of NAV-POSLLH and the fix of NAV-STATUS of the same epoch."""
    number, m = frames.structures(VELNED, _VELNED)
    _, position = frames.structures(POSLLH, _POSLLH)
    _, status = frames.structures(STATUS, _STATUS)
    columns = {"v_e": m["v_e"] * 1e-2, "v_n": m["v_n"] * 1e-2, "v_u": m["v_d"] * -1e-2, "sd": m["sd"] * 1e-2}

    def of_epoch(other: np.ndarray, values: np.ndarray) -> np.ndarray:
        return pd.Series(values, other["itow"]).groupby(level=0).last().reindex(m["itow"]).to_numpy(float)

    if len(position):
        columns |= {name: of_epoch(position, position[name] * 1e-7) for name in ("lat", "lon")}
        columns |= {"alt": of_epoch(position, position["height"] * 1e-3)}
    if not len(status):
        # Only its deviation tells of a fix: a receiver without one states tens of metres per second.
        return _epochs(number, m["itow"], np.where(columns["sd"] < 10, 3, _NO_FIX), np.ones(len(m), bool), columns)
    fix = np.nan_to_num(of_epoch(status, status["fix"])).astype(int)
    return _epochs(number, m["itow"], fix, of_epoch(status, status["flags"] & 1) == 1, columns)


def _epochs(
    number: np.ndarray, itow: np.ndarray, fix: np.ndarray, trusted: np.ndarray, columns: dict[str, np.ndarray]
) -> pd.DataFrame:
    fixed = trusted & ~np.isin(fix, list(_WITHOUT_GNSS))
    t = np.unwrap(itow.astype(float), period=_WEEK) * 1e-3
    return pd.DataFrame({"number": number, "t": t, "fix": fix, "fixed": fixed} | columns)
