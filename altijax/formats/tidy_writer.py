"""The tidy folder, written."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from altijax.formats import tidy_folder
from altijax.formats.tables import import_extra
from altijax.toml_lines import toml_line

FORMS = ("csv", "csv.gz", "parquet")


def write_tidy_folder(folder: Path, tables: Mapping[str, pd.DataFrame], sheet: Mapping[str, Any], form: str) -> None:
    """Write streams, indexed by t, and the sheet into a folder that holds no recording yet."""
    if form not in FORMS:
        raise ValueError(f"form must be one of {', '.join(FORMS)}, got {form!r}")
    if folder.exists() and tidy_folder.reads(folder):
        raise FileExistsError(f"{folder} holds a recording already; delete it, or save into another folder")
    folder.mkdir(parents=True, exist_ok=True)
    for stream, table in tables.items():
        write_table(table, folder / f"{stream}.{form}")
    write_sheet(folder, sheet)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a table indexed by t as CSV or Parquet, as the file's name ends."""
    if path.suffix == ".parquet":
        import_extra("pyarrow", path, doing="writing", extra="export")
        # Of a result's attrs there is no writing: they hold tables themselves.
        table.set_axis(table.index.rename("t")).pipe(_without_attrs).to_parquet(path)
    else:
        table.to_csv(path, index_label="t")


def write_sheet(folder: Path, sheet: Mapping[str, Any]) -> None:
    """Write recording.toml; entries that are None are left out."""
    tables = {key: value for key, value in sheet.items() if isinstance(value, Mapping)}
    lines = [toml_line(key, value) for key, value in sheet.items() if key not in tables]
    for title, entries in tables.items():
        known = [toml_line(key, value) for key, value in entries.items() if value is not None]
        lines += ["", f"[{title}]", *known] if known else []
    (folder / "recording.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _without_attrs(table: pd.DataFrame) -> pd.DataFrame:
    table = table.copy(deep=False)
    table.attrs = {}
    return table
