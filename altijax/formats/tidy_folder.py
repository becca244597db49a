"""The recording folder, our own format: recording.toml and one table a stream, read as they stand and scaled to SI."""

import gzip
import io
import math
import tomllib
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.formats.quantities import COLUMNS, QUANTITIES, WHEELS, check_units
from altijax.formats.stamps import steady
from altijax.formats.stream_checks import RecordingError, check_overlap, clean_rows
from altijax.formats.tables import Log
from altijax.formats.text_tables import is_clock, layout_of, read_columns, seconds
from altijax.padding import bucket, padded
from altijax.wheels import speed_from_pulses, standstill_from_pulses

_ENDINGS = (".csv", ".csv.gz", ".parquet")
# Sizes that pulses and times of one wheel are filled up to: a town drive of ten minutes has some 10,000 pulses.
_PULSES, _SPEEDS = 16384, 16384
_SHEET: dict[str, dict[str, Any]] = {
    "": {
        "name": str,
        "description": str,
        "axes": str,
        **dict.fromkeys(("wheel", "site", "units", "clock", "source", "saved"), dict),
    },
    "wheel": {"pulses_per_turn": float, "radius": float, "track_width": float},
    "site": {"latitude": float, "height": float},
    "units": dict.fromkeys(QUANTITIES, str),
    "clock": dict.fromkeys(COLUMNS, float),
    "source": {"origin": str, "licence": str},
    "saved": {"notes": list, "known": list},
}


def reads(path: Path) -> bool:
    """Whether a path is a folder that holds a recording.toml or one of the streams' files."""
    return (path / "recording.toml").is_file() or any(_files(path, stream) for stream in COLUMNS)


def read(folder: Path, problems: list[str], notes: list[str]) -> Log:
    """Tables of the streams in the units of the files and in sensor axes, and what recording.toml says."""
    sheet = _read_sheet(folder, problems)
    tables = {}
    for stream in COLUMNS:
        files = _files(folder, stream)
        if len(files) > 1:
            names = ", ".join(file.name for file in files)
            raise RecordingError(f"{folder.name}: {names} all hold the stream {stream!r}; keep one of them")
        if files:
            table = _read_table(files[0], stream, problems)
            if len(table):
                tables[stream] = table
            elif stream != "imu":
                problems.append(f"{files[0].name}: has no rows; the stream is left out")
            else:
                raise RecordingError(
                    f"{files[0].name}: has no rows, and without it nothing can be estimated; record it again"
                )
    if "imu" not in tables:
        found = ", ".join(sorted(file.name for file in folder.iterdir())) or "nothing"
        raise RecordingError(f"{folder}: imu.csv (or .csv.gz, .parquet) is missing; found {found}")
    if "pulses" in tables and "wheel" in tables:
        file = tables.pop("pulses").attrs["file"]
        problems.append(f"{file}: left out, because {tables['wheel'].attrs['file']} is there too")
    return tables, sheet


def wheel_from_pulses(
    pulses: pd.DataFrame, sensor: Mapping[str, float], imu: pd.DataFrame, problems: list[str]
) -> pd.DataFrame | None:
    """Wheel speeds every 0.02 s as long as the IMU ran, since no pulse says that the wheel stands.

    A wheel stands still where no pulse is within 1 s on either side.
    """
    file, line = pulses.attrs["file"], pulses.index.name
    missing = [key for key in ("pulses_per_turn", "radius") if key not in sensor]
    if missing:
        raise RecordingError(f"{file}: needs {' and '.join(missing)} under [wheel] in recording.toml")
    if "wheel" not in pulses.columns:
        raise RecordingError(f"{file}: needs the column wheel besides t; write there which wheel gave the pulse")
    names = pulses["wheel"].astype(str).str.strip()
    wrong = ~names.isin(WHEELS)
    if wrong.any():
        first, seen = pulses.index[wrong][0], names[wrong].iloc[0]
        raise RecordingError(f"{file}, {line} {first}, column wheel: {seen!r} is not a wheel; use {', '.join(WHEELS)}")
    apart = list(check_overlap(pulses.set_index("t").sort_index(), imu))
    if apart:
        problems += apart
        return None
    times = {}
    for name in [name for name in WHEELS if (names == name).any()]:
        of_wheel = steady(clean_rows(pulses.loc[names == name, ["t"]], ("t",), problems), problems)
        t_pulses = _without_bounces(of_wheel, name, problems)["t"].to_numpy(float)
        if t_pulses.size < 2:
            problems.append(f"{file}, column wheel: {name} has {t_pulses.size} pulse, too few for a speed; left out")
        else:
            times[name] = t_pulses
    if not times:
        return None
    t = np.arange(imu.index[0], imu.index[-1], 0.02)
    # The only program that reading compiles: wheels and lengths are filled up, so that it serves other recordings too.
    pulses_at = np.full((len(WHEELS), bucket(max(map(len, times.values())), _PULSES)), np.inf)
    for row, values in zip(pulses_at, times.values(), strict=False):
        row[: len(values)] = values - t[0]
    distance = 2 * np.pi * sensor["radius"] / sensor["pulses_per_turn"]
    with jax.enable_x64(True):
        found = _pulse_speeds(pulses_at, padded(t - t[0], bucket(t.size, _SPEEDS)), np.float64(distance))
    speeds = np.asarray(found)[: len(times), : t.size]
    table = pd.DataFrame({"t": t} | dict(zip(times, speeds, strict=True)))
    table.index = pd.RangeIndex(1, 1 + len(table), name="row")
    table.attrs["file"] = file
    return table


def _without_bounces(pulses: pd.DataFrame, wheel: str, problems: list[str]) -> pd.DataFrame:
    """The pulses less those that follow another far sooner than the pulses around them do."""
    steps = pulses["t"].diff()
    bounces = (steps < 0.2 * steps.rolling(9, center=True, min_periods=3).median()) | (steps == 0)
    if bounces.any():
        problems.append(
            f"{pulses.attrs['file']}, {pulses.index.name} {pulses.index[bounces][0]}, column t: a pulse of {wheel} "
            f"{1e3 * steps[bounces].iloc[0]:.3g} ms after another, as a contact that bounces gives; pulses like it: "
            f"{bounces.sum()} of {len(pulses)}, left out"
        )
    return pulses[~bounces]


@jax.jit
def _pulse_speeds(t_pulses: jax.Array, t: jax.Array, distance: float) -> jax.Array:
    speed, _ = speed_from_pulses(t_pulses, t, distance)
    return jnp.where(standstill_from_pulses(t_pulses, t, 1.0), 0, speed)


def _files(folder: Path, stream: str) -> list[Path]:
    return [folder / f"{stream}{ending}" for ending in _ENDINGS if (folder / f"{stream}{ending}").is_file()]


def _read_sheet(folder: Path, problems: list[str]) -> dict[str, Any]:
    path = folder / "recording.toml"
    if not path.is_file():
        return {}
    try:
        sheet = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecordingError(f"recording.toml: {error}; correct that line") from error
    check_sheet(sheet, "recording.toml", problems)
    return sheet


def check_sheet(sheet: Mapping[str, Any], origin: str, problems: list[str]) -> None:
    """Raise for what a recording.toml cannot say, or whatever else stands for one; unknown entries are told."""
    for table, kinds in _SHEET.items():
        entries = sheet.get(table, {}) if table else sheet
        unknown = [key for key in entries if key not in kinds]
        if unknown:
            where = f" [{table}]" if table else ""
            problems.append(f"{origin}{where}: {', '.join(unknown)} ignored; known are {', '.join(kinds)}")
        for key in entries.keys() & kinds.keys():
            _check_entry(f"{origin}, {table + '.' if table else ''}{key}", entries[key], kinds[key])
    for key, value in sheet.get("wheel", {}).items():
        if key in _SHEET["wheel"] and value <= 0:
            raise RecordingError(f"{origin}, wheel.{key}: {value!r} is not positive; write what was measured")
    if abs(sheet.get("site", {}).get("latitude", 0)) > 90:
        raise RecordingError(
            f"{origin}, site.latitude: {sheet['site']['latitude']!r} is not a latitude in degrees, -90 to 90"
        )
    try:
        check_units({key: unit for key, unit in sheet.get("units", {}).items() if key in QUANTITIES})
    except ValueError as error:
        raise RecordingError(f"{origin}, {error}") from error


def _check_entry(place: str, value: Any, wanted: Any) -> None:
    if wanted is not float:
        if not isinstance(value, wanted):
            kind = {str: "a text", dict: "a table", list: "a list"}[wanted]
            raise RecordingError(f"{place}: {value!r} is not {kind}; write one")
    elif not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise RecordingError(f"{place}: {value!r} is not a number; write one, or leave out what is not known")


def _read_table(path: Path, stream: str, problems: list[str]) -> pd.DataFrame:
    if path.suffix == ".parquet":
        table = _read_parquet(path)
    else:
        table = _read_csv(path)
    if "t" not in table.columns:
        seen = ", ".join(map(str, table.columns)) or "nothing"
        hint = "separate columns by commas" if len(table.columns) == 1 else "the first line must name the columns"
        raise RecordingError(f"{path.name}, line 1: there is no column t among {seen}; {hint}")
    return known_columns(table, path.name, stream, problems)


def known_columns(table: pd.DataFrame, file: str, stream: str, problems: list[str]) -> pd.DataFrame:
    """The columns that a stream may have, as numbers; others are told, and what is no number raises."""
    table.attrs["file"] = file
    known = COLUMNS[stream]
    unknown = [str(column) for column in table.columns if column not in known]
    if unknown:
        problems.append(f"{file}: unknown columns {', '.join(unknown)} ignored; known are {', '.join(known)}")
    table = table[[column for column in known if column in table.columns]]
    if is_clock(table["t"]):
        table = table.assign(t=seconds(table, "t", 1.0, problems))
    return table.assign(**{column: _numbers(table, column) for column in table.columns if column != "wheel"})


def _read_csv(path: Path) -> pd.DataFrame:
    try:
        content = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise RecordingError(f"{path.name}: damaged or cut short ({error}); copy it again from its source") from error
    layout = layout_of(path)
    if layout is not None and layout.separator != "," and "t" in layout.names:
        return read_columns(path, layout, layout.names)
    try:
        with warnings.catch_warnings():
            # Without an index column pandas only warns of a row that is longer than the header.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(
                io.BytesIO(content),
                encoding="utf-8-sig",
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame({"t": []})
    except pd.errors.ParserWarning as error:
        raise RecordingError(
            f"{path.name}: its rows have more values than line 1 has names; name every column"
        ) from error
    except pd.errors.ParserError as error:
        reason = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise RecordingError(f"{path.name}: {reason}; give every row as many values as line 1 has names") from error
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path.name}: not UTF-8 text ({error.reason}); save it as CSV in UTF-8") from error
    table.columns = [str(column).strip() for column in table.columns]
    table.index = pd.RangeIndex(2, 2 + len(table), name="line")
    # A blank line holds nothing that could be lost.
    return table.dropna(how="all")


def _read_parquet(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_parquet(path)
    except ImportError as error:
        raise RecordingError(
            f"{path.name}: reading Parquet needs pyarrow (pip install pyarrow), or save it as CSV"
        ) from error
    except (ValueError, OSError) as error:
        raise RecordingError(f"{path.name}: not a Parquet file ({error}); copy it again from its source") from error
    if table.index.name == "t":
        table = table.reset_index()
    table.index = pd.RangeIndex(1, 1 + len(table), name="row")
    return table


def _numbers(table: pd.DataFrame, column: str) -> pd.Series:
    values = table[column]
    if column == "t" and values.dtype.kind == "u":
        # A counter of 64 bits about to start again, as a signed number: it goes on through zero, to the last digit.
        values = values.astype(np.int64)
    if values.dtype.kind in "iuf":
        return values.astype(float)
    text = values.astype(str).str.strip().mask(values.isna(), "")
    numbers = pd.to_numeric(text, errors="coerce")
    bad = numbers.isna() & (text != "") & (text.str.lower() != "nan")
    if bad.any():
        line, seen = table.index[bad][0], text[bad].iloc[0]
        raise RecordingError(
            f"{table.attrs['file']}, {table.index.name} {line}, column {column}: {seen!r} is not a number; "
            "write a plain number with a point, or leave the cell empty"
        )
    return numbers.astype(float)
