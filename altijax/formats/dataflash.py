"""ArduPilot's DataFlash logs (.bin), as tables in SI units and sensor axes."""

import re
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import (
    Log,
    first_bytes,
    from_first_imu_sample,
    import_extra,
    stream_table,
)

_MAGIC = b"\xa3\x95\x80"
"""The message that describes messages comes first."""

_HEADER = 3
"""Bytes before a message's content: two of sync, one of its format."""

_TAIL = 528
"""Bytes that the last page of a flash chip may leave unused."""

_MESSAGES = ("IMU", "GPS", "GPA", "ATT", "POS", "WENC")
_TWO_DIMENSIONS, _THREE_DIMENSIONS = 2, 3
_NAMES = {
    "imu": {"ax": "AccX", "ay": "AccY", "az": "AccZ", "gx": "GyrX", "gy": "GyrY", "gz": "GyrZ", "temperature": "T"},
    "gnss": {"speed": "Spd", "course": "GCrs", "climb": "VZ", "lat": "Lat", "lon": "Lng", "alt": "Alt"},
    "attitude": {"roll": "Roll", "pitch": "Pitch", "heading": "Yaw"},
    "position": {"lat": "Lat", "lon": "Lng", "alt": "Alt"},
}


def reads(path: Path) -> bool:
    """Whether a path is a DataFlash log, by its first bytes."""
    return path.is_file() and first_bytes(path, len(_MAGIC)) == _MAGIC


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a DataFlash log: IMU, GPS with the accuracy of GPA, WENC; ATT and POS as the reference.

    Of several instances of a sensor the first is taken.
    """
    reader = import_extra("pymavlink.DFReader", path).DFReader_binary(str(path))
    with closing(reader.filehandle):
        formats = [form for form in reader.formats.values() if len(reader.offsets[form.type])]
        messages = {form.name: _messages(path, reader, form) for form in formats if form.name in _MESSAGES}
    messages = {name: table for name, table in messages.items() if len(table)}
    lost = path.stat().st_size - sum(len(reader.offsets[form.type]) * form.len for form in formats)
    if lost > _TAIL:
        problems.append(f"{path.name}: {lost} of its bytes are no messages; copy it again if its source is whole")
    if "IMU" not in messages:
        held = ", ".join(sorted(form.name for form in formats)) or "nothing"
        raise RecordingError(f"{path.name}: there are no IMU messages in it, only {held}; set LOG_BITMASK to log IMU")
    tables = {"imu": _table(messages["IMU"], "imu", f"{path.name} IMU")}
    if "GPS" in messages:
        gnss = _gnss(messages["GPS"], messages.get("GPA"), f"{path.name} GPS", notes)
        tables |= {} if gnss.empty else {"gnss": gnss}
    if "ATT" in messages:
        tables["reference"] = _reference(messages["ATT"], messages.get("POS"), path.name, notes)
    if "WENC" in messages:
        tables["wheel"] = _wheel(messages["WENC"], f"{path.name} WENC", notes)
    return from_first_imu_sample(tables), {
        "name": path.stem,
        "description": "ArduPilot log; the reference is its own estimate, which used the same sensors",
        "axes": "FRD",
    }


def _messages(path: Path, reader: Any, form: Any) -> pd.DataFrame:
    """All messages of a format, of its first instance, in units without multipliers; ``t`` in s."""
    content = np.memmap(path, np.uint8, "r")
    fields = re.findall(r"\d*[a-zA-Z]", form.msg_struct)
    # NumPy knows the numbers of Python's struct by the same letters, but for texts ("64s") and halves of a float.
    types = ["S" + field[:-1] if field[-1] == "s" else {"e": "<f2"}.get(field, f"<{field}") for field in fields]
    layout = np.dtype(list(zip(form.columns, types, strict=True)))
    start = np.asarray(reader.offsets[form.type], np.int64) + _HEADER
    start = start[start + layout.itemsize <= content.size]
    rows = content[start[:, None] + np.arange(layout.itemsize)].view(layout)[:, 0]
    scales = dict(zip(form.columns, form.msg_mults, strict=True))
    numbers = [name for name in form.columns if rows[name].dtype.kind in "iuf"]
    table = pd.DataFrame({name: rows[name] * scales[name] if scales[name] else rows[name] for name in numbers})
    if "I" in table:
        table = table[table["I"] == table["I"].min()]
    return table.assign(t=table["TimeUS"] * 1e-6)


def _table(messages: pd.DataFrame, stream: str, file: str) -> pd.DataFrame:
    """The columns of a stream that the messages have, under the names of a recording."""
    names = {ours: theirs for ours, theirs in _NAMES[stream].items() if theirs in messages}
    return stream_table(messages["t"].to_numpy(), messages[list(names.values())].to_numpy(float), list(names), file)


def _gnss(gps: pd.DataFrame, accuracy: pd.DataFrame | None, file: str, notes: list[str]) -> pd.DataFrame:
    fixed = (gps["Status"] >= _TWO_DIMENSIONS).to_numpy()
    if not fixed.all():
        notes.append(f"{file}: {(~fixed).sum()} rows without a fix dropped")
    gps = gps[fixed]
    table = _table(gps, "gnss", file)
    table["climb"] = np.where(gps["Status"] >= _THREE_DIMENSIONS, -table["climb"], np.nan)
    if accuracy is not None and "SAcc" in accuracy and len(gps):
        # Both are written together, the accuracy a moment later.
        deviation = np.interp(gps["t"], accuracy["t"], accuracy["SAcc"])
        table = table.assign(**dict.fromkeys(("sd_e", "sd_n", "sd_u"), deviation))
    return table


def _reference(attitude: pd.DataFrame, position: pd.DataFrame | None, file: str, notes: list[str]) -> pd.DataFrame:
    table = _table(attitude, "attitude", f"{file} ATT")
    table = table.assign(**{name: np.radians(table[name]) for name in _NAMES["attitude"]})
    if position is None:
        return table
    other = _table(position, "position", f"{file} POS")
    notes.append(f"{file}: the reference has POS interpolated to the times of ATT")
    inside = table[table["t"].between(other["t"].iloc[0], other["t"].iloc[-1])]
    merged = inside.assign(**{name: np.interp(inside["t"], other["t"], other[name]) for name in _NAMES["position"]})
    merged.attrs["file"] = f"{file} ATT, POS"
    return merged


def _wheel(encoders: pd.DataFrame, file: str, notes: list[str]) -> pd.DataFrame:
    """Speed between successive distances, the mean of the encoders that count."""
    t = encoders["t"].to_numpy()
    ways = encoders[[name for name in ("Dist0", "Dist1") if name in encoders]].to_numpy()
    counting = ways[:, (np.diff(ways, axis=0) != 0).any(0)]
    notes.append(f"{file}: the wheel speed is the change of distance of {counting.shape[1]} encoder(s)")
    ways = (counting if counting.shape[1] else ways).mean(1)
    return stream_table((t[1:] + t[:-1]) / 2, (np.diff(ways) / np.diff(t))[:, None], ["speed"], file)
