"""One table that holds several sensors: its columns become streams, each with the rows in which it has values."""

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.quantities import COLUMNS, QUANTITIES, factor_of, quantity_of, unit_named
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import Log, from_first_imu_sample
from altijax.formats.text_tables import Layout, layout_of, needed_layout, numbers, read_columns, seconds

_STREAMS = ("imu", "wheel", "gnss", "reference")


def reads(path: Path) -> bool:
    """Whether a path is a text file whose columns have our names, t, ax, ay, az among them."""
    if not path.is_file():
        return False
    layout = layout_of(path)
    return layout is not None and {"t", "ax", "ay", "az"} <= set(layout.names)


def read(path: Path, problems: list[str], notes: list[str]) -> Log:
    """Streams of a table whose columns have our names already."""
    layout = needed_layout(path)
    known = {column for stream in _STREAMS for column in COLUMNS[stream]}
    others = [name for name in layout.names if name not in known]
    if others:
        problems.append(f"{path.name}: columns {', '.join(others)} ignored; give columns={{...}} to say what they are")
    return read_mixed({name: name for name in layout.names if name in known}, QUANTITIES, path, problems, notes)


def read_mixed(
    columns: Mapping[str, str], stated: Collection[str], path: Path, problems: list[str], notes: list[str]
) -> Log:
    """Streams of one table.

    Parameters
    ----------
    columns : mapping of str to str
        The table's columns by ours: t, ax ..., and "gnss.speed" where a name without its stream would mean another.
        A stream may have times of its own, "gnss.t".
    stated : collection of str
        Quantities whose unit is stated elsewhere: what the table says of it does not count, and nothing is scaled.
    path : Path
        Text file.
    problems, notes : list of str
        Sentences are added.

    Returns
    -------
    tables, sheet
        As a reader gives them.
    """
    return streams_of(path, needed_layout(path), columns, stated, problems, notes)


def streams_of(
    path: Path,
    layout: Layout,
    columns: Mapping[str, str],
    stated: Collection[str],
    problems: list[str],
    notes: list[str],
) -> Log:
    """Streams of the table whose layout is known; see `read_mixed`."""
    targets = _by_stream(columns)
    missing = [source for source in columns.values() if source not in layout.names]
    if missing:
        raise ValueError(
            f"columns: {path.name} has no column {', '.join(map(repr, missing))}; its columns are "
            f"{', '.join(map(repr, layout.names))}"
        )
    table = read_columns(path, layout, set(columns.values()))
    tables = {}
    for stream, sources in targets.items():
        found = _stream(table, layout, stream, sources, stated, problems, notes)
        if len(found):
            tables[stream] = found
        else:
            problems.append(f"{path.name}, {stream}: has no row with a value; the stream is left out")
    if not tables:
        raise RecordingError(f"{path.name}: no row has a value in the columns named; name others")
    return from_first_imu_sample(tables), {"name": path.stem, "description": f"table {path.name}"}


def known_streams(path: Path, layout: Layout, columns: Mapping[str, str], problems: list[str], notes: list[str]) -> Log:
    """Streams of a format's table, by those of its columns that were found, in the units that it names."""
    if "t" not in columns or len(columns) < 2:
        raise RecordingError(
            f"{path.name}: has no time or nothing beside it that is known; its columns are "
            f"{', '.join(map(repr, layout.names))}: export it again, or say what they are with columns={{...}}"
        )
    return streams_of(path, layout, columns, (), problems, notes)


def _by_stream(columns: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """The mapping of each stream's columns, with its times; raises for names that are none of ours."""
    targets: dict[str, dict[str, str]] = {}
    for target, source in columns.items():
        stream, _, column = target.rpartition(".")
        if not stream:
            stream = _stream_of(column, columns)
        if stream not in (*_STREAMS, "") or column not in COLUMNS[stream or "imu"]:
            known = "; ".join(f"{stream}: {', '.join(COLUMNS[stream])}" for stream in _STREAMS)
            raise ValueError(f"columns has no name {target!r}; known are {known}")
        targets.setdefault(stream, {})[column] = source
    common = targets.pop("", {})
    for stream, sources in targets.items():
        if "t" not in sources | common:
            raise ValueError(f"columns names no time; add 't': the column with the time of the row (or '{stream}.t')")
        targets[stream] = common | sources
    if not targets:
        raise ValueError("columns names a time only; add 'ax', 'ay', 'az' and what else there is")
    return targets


def _stream_of(column: str, columns: Mapping[str, str]) -> str:
    """The stream that a name without one means: a speed with a course is a receiver's."""
    if column == "t":
        return ""
    if column == "speed" and {"course", "gnss.course"} & columns.keys():
        return "gnss"
    return next((stream for stream in _STREAMS if column in COLUMNS[stream]), "?")


def _stream(
    table: pd.DataFrame,
    layout: Layout,
    stream: str,
    sources: Mapping[str, str],
    stated: Collection[str],
    problems: list[str],
    notes: list[str],
) -> pd.DataFrame:
    found = {}
    for column in [column for column in COLUMNS[stream] if column in sources]:
        factor = _factor(layout, stream, column, sources[column], stated, problems, notes)
        if column == "t":
            found["t"] = seconds(table, sources["t"], factor, problems)
        else:
            with np.errstate(over="ignore"):
                found[column] = numbers(table, sources[column], problems) * factor
    frame = pd.DataFrame(found, index=table.index)
    filled = frame.drop(columns="t").notna().any(axis=1)
    frame = frame if filled.all() else frame[filled]
    frame.attrs["file"] = f"{table.attrs['file']}, {stream}"
    return without_held_rows(frame, notes) if stream == "gnss" else frame


def _factor(
    layout: Layout,
    stream: str,
    column: str,
    source: str,
    stated: Collection[str],
    problems: list[str],
    notes: list[str],
) -> float:
    """What one of the table's values is in our unit, as the table itself says."""
    quantity, text = quantity_of(stream, column), layout.units.get(source)
    if quantity is None or quantity in stated or not text:
        return 1.0
    factor = factor_of(quantity, unit_named(text))
    if factor is None:
        if column != "t":
            problems.append(
                f"column {source!r}: {text!r} is not a unit of {column} that is known; its numbers are taken as they "
                f"are, give units={{'{quantity}': ...}}"
            )
        return 1.0
    if factor != 1:
        notes.append(f"column {source!r}: read as {unit_named(text)}, as it says")
    return factor


def without_held_rows(table: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    """One row for each value of a receiver, where a faster table repeats it until the next one comes.

    Where the values stand still because the vehicle does, rows are kept as often as they change else.
    """
    values = table.drop(columns="t").to_numpy()
    if len(table) < 3:
        return table
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    changes = np.flatnonzero(np.append(True, ~same.all(1)))
    usual = int(np.median(np.diff(changes))) if changes.size > 2 else 1
    if usual < 2:
        return table
    since = np.arange(len(table)) - changes[np.searchsorted(changes, np.arange(len(table)), side="right") - 1]
    notes.append(
        f"{table.attrs['file']}: its values are repeated some {usual} times until the next; one row of each was kept"
    )
    return table[since % usual == 0]
