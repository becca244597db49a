"""Tables in text files as people's programs write them: their layout found, their numbers and times read.

The names may stand below lines of other content and above a line of units; columns are separated by commas, semicolons
or tabs; decimals may have a comma; a time may be a number or a clock's.
"""

import csv
import re
import warnings
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from altijax.formats.quantities import unit_named
from altijax.formats.stream_checks import RecordingError
from altijax.formats.tables import first_bytes

_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?")
_CLOCK = re.compile(r"\d{1,4}[-:/.]\w{1,3}[-:/.]\d.*")
_MISSING = ["-", "--", "\u221e"]
"""What apps write for no value, beside what pandas knows."""
_HOUR, _DAY = 3600.0, 86400.0


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a text file holds its table.

    Attributes
    ----------
    names : tuple of str
        Names of the columns, "1", "2" ... where none are given; repeated ones with their place: "speed (2)".
    units : dict of str to str
        Units, as far as a name or the line below the names says them, as they are written.
    sources : dict of str to str
        What further lines below the names say of a column.
    above : tuple of str
        Lines above the names.
    skipped : int
        Lines before the first row.
    """

    names: tuple[str, ...]
    units: dict[str, str] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    above: tuple[str, ...] = ()
    skipped: int
    separator: str
    decimal: str
    encoding: str


def layout_of(path: Path) -> Layout | None:
    """The layout of the table in a text file, from its first 64 KiB; None where there is none."""
    content = first_bytes(path)
    if not content or (b"\0" in content and not content.startswith((b"\xff\xfe", b"\xfe\xff"))):
        return None
    text, encoding = _decoded(content)
    lines = text.splitlines()
    if path.stat().st_size > len(content):
        lines = lines[:-1]
    for separator in (";", "\t", ","):
        rows = [_fields(line, separator) for line in lines]
        first = next((k for k in range(len(rows)) if all(map(_is_data, rows[k : k + 3]))), None)
        # A table of names alone is told by its first line, which then has rows in none of the three ways.
        if first is not None:
            return _layout(lines, rows, first, separator, encoding)
    return None


def needed_layout(path: Path) -> Layout:
    """The layout of the table in a text file; raises where there is none."""
    layout = layout_of(path)
    if layout is None:
        raise RecordingError(
            f"{path.name}: there is no table of numbers in it, one row a sample, separated by commas, semicolons or "
            "tabs; look into it with a text editor, and export it again"
        )
    return layout


def table_names(path: Path) -> tuple[str, ...]:
    """Names of the columns of a text file's table, also where it has no rows; empty for another file."""
    layout = layout_of(path)
    if layout is not None:
        return layout.names
    content = first_bytes(path)
    lines = [] if b"\0" in content else [line for line in _decoded(content)[0].splitlines() if line.strip()]
    for separator in (";", "\t", ",") if lines else ():
        fields = _fields(lines[0], separator)
        if len(fields) > 1:
            return tuple(fields)
    return ()


def read_columns(path: Path, layout: Layout, names: Collection[str]) -> pd.DataFrame:
    """Those columns of a text file's table, as numbers where they are, else as text; rows are counted by lines."""
    try:
        table = pd.read_csv(
            path,
            sep=layout.separator,
            decimal=layout.decimal,
            header=None,
            names=list(layout.names),
            skiprows=layout.skipped,
            encoding=layout.encoding,
            encoding_errors="replace",
            index_col=False,
            skip_blank_lines=False,
            skipinitialspace=True,
            low_memory=False,
            na_values=_MISSING,
        )
    except pd.errors.ParserError as error:
        reason = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise RecordingError(f"{path.name}: {reason}; give every row as many values as there are names") from error
    first = layout.skipped + 1
    table.index = pd.RangeIndex(first, first + len(table), name="line")
    table.attrs["file"] = path.name
    chosen = table[[name for name in layout.names if name in names]]
    return chosen if chosen.notna().any(axis=1).all() else chosen.dropna(how="all")


def numbers(table: pd.DataFrame, column: str, problems: list[str]) -> np.ndarray:
    """A column as numbers; single texts in it become missing values, with a sentence, mere text raises."""
    values = table[column]
    if values.dtype.kind in "iuf":
        return values.to_numpy(float)
    text = values.astype(str).str.strip().mask(values.isna(), "")
    found = pd.to_numeric(text, errors="coerce")
    if found.isna().all():
        found = pd.to_numeric(text.str.replace(",", ".", regex=False), errors="coerce")
    bad = found.isna() & (text != "")
    if bad.any():
        seen = (
            f"{table.attrs['file']}, {table.index.name} {table.index[bad][0]}, column {column}: {text[bad].iloc[0]!r}"
        )
        if found.isna().all():
            raise RecordingError(f"{seen} is not a number, nor is any other in it; choose another column")
        problems.append(f"{seen} is not a number; cells like it: {bad.sum()} of {len(table)}, kept as missing")
    return found.to_numpy(float)


def is_clock(values: pd.Series) -> bool:
    """Whether a column is a clock's times rather than numbers, by its first value."""
    text = values.dropna()
    return values.dtype.kind not in "iuf" and bool(len(text)) and bool(_CLOCK.fullmatch(str(text.iloc[0]).strip()))


def seconds(table: pd.DataFrame, column: str, factor: float, problems: list[str]) -> np.ndarray:
    """A column of times in s: numbers times `factor`, or a clock's, which may pass midnight, with or without a date."""
    values = table[column]
    if values.dtype.kind in "iuf":
        return numbers(table, column, problems) * factor
    text = values.dropna().astype(str).str.strip()
    if text.empty or _NUMBER.fullmatch(text.iloc[0]):
        return numbers(table, column, problems) * factor
    parts = text.str.extract(r"^(?:(\d+):)?(\d{1,2}):(\d{1,2}(?:[.,]\d+)?)$")
    if not parts[1].isna().any():
        found = (
            parts[0].fillna("0").astype(float) * 3600
            + parts[1].astype(float) * 60
            + parts[2].str.replace(",", ".", regex=False).astype(float)
        ).to_numpy()
        found = np.unwrap(found, period=_HOUR if parts[0].isna().all() else _DAY)
    else:
        found = _dates(text, f"{table.attrs['file']}, {table.index.name} {text.index[0]}, column {column}")
    t = np.full(len(table), np.nan)
    t[values.notna().to_numpy()] = found
    return t


def _dates(text: pd.Series, place: str) -> np.ndarray:
    """Seconds since 1970 of dates with times; milliseconds may follow a colon, as some apps write them."""
    text = text.str.replace(r"[:,_](\d{3})$", r".\1", regex=True)
    try:
        try:
            stamps = pd.to_datetime(text, format="ISO8601", utc=True)
        except ValueError:
            numbered = re.match(r"\d{1,2}[-/.](\d{1,2})\D", text.iloc[0])
            with warnings.catch_warnings():
                # Where pandas finds no form in the first it warns, and would guess each by itself.
                warnings.simplefilter("error", UserWarning)
                stamps = pd.to_datetime(text, utc=True, dayfirst=numbered is not None and int(numbered[1]) <= 12)
    except (ValueError, OverflowError, UserWarning) as error:
        raise RecordingError(
            f"{place}: {text.iloc[0]!r} is not a time that is understood; write seconds, HH:MM:SS.sss or "
            "YYYY-MM-DDTHH:MM:SS.sss"
        ) from error
    return (stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy()


def _decoded(content: bytes) -> tuple[str, str]:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content[: len(content) // 2 * 2].decode("utf-16", errors="ignore"), "utf-16"
    try:
        # The last character may be cut.
        return content.decode("utf-8-sig"), "utf-8-sig"
    except UnicodeDecodeError as error:
        if error.start > len(content) - 4:
            return content[: error.start].decode("utf-8-sig"), "utf-8-sig"
        return content.decode("cp1252", errors="replace"), "cp1252"


def _fields(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _is_data(row: list[str]) -> bool:
    """At least two cells, and half of those that are filled, are numbers or times."""
    filled = [cell for cell in row if cell]
    good = sum(bool(_NUMBER.fullmatch(cell) or _CLOCK.fullmatch(cell)) for cell in filled)
    return good >= 2 and good >= len(filled) / 2


def _layout(lines: list[str], rows: list[list[str]], first: int, separator: str, encoding: str) -> Layout:
    width = max(len(row) for row in rows[first : first + 3])
    cells = [cell for row in rows[first : first + 50] for cell in row]
    comma = separator != "," and any(_NUMBER.fullmatch(cell) and "," in cell for cell in cells)
    group: list[int] = []
    for k in range(first - 1, -1, -1):
        filled = any(rows[k])
        # One empty line may part names and rows; another is above the names.
        if filled and len(rows[k]) >= min(width - 1, 2) and abs(len(rows[k]) - width) <= 1:
            group.insert(0, k)
        elif group or filled:
            break
    if not group:
        names = [str(k + 1) for k in range(width)]
        return Layout(
            names=tuple(names),
            above=tuple(lines[:first]),
            skipped=first,
            separator=separator,
            decimal="," if comma else ".",
            encoding=encoding,
        )
    header = max(group, key=lambda k: (sum(map(bool, rows[k])), -k))
    below = [rows[k] + [""] * width for k in group if k > header]
    plain = [re.sub(r"^[#%]\s*", "", name) for name in rows[header]] + [""] * width
    names = _unique(plain[:width])
    units, sources = {}, {}
    for k, name in enumerate(names):
        told = [row[k] for row in below if row[k]]
        bracketed = [text for text in re.findall(r"[\[(]\s*([^\[\]()]*?)\s*[\])]", name) if not text.isdigit()]
        unit = next((text for text in [*told, *bracketed] if unit_named(text)), bracketed[-1] if bracketed else None)
        if unit is not None:
            units[name] = unit
        sources[name] = " ".join(text for text in told if text != unit)
    return Layout(
        names=tuple(names),
        units=units,
        sources=sources,
        above=tuple(lines[:header]),
        skipped=first,
        separator=separator,
        decimal="," if comma else ".",
        encoding=encoding,
    )


def _unique(names: list[str]) -> list[str]:
    found: list[str] = []
    for k, name in enumerate(names):
        name = name or str(k + 1)
        others = sum(other == name for other in names[:k])
        found.append(f"{name} ({others + 1})" if others else name)
    return found
