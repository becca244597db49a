"""Outages on a real drive: the patent's method and the conventional one beside the filter, from the same constants."""

import warnings
from pathlib import Path

import pandas as pd

from altijax.datasets import DatasetNotFoundError, load_dataset
from altijax.recordings import RecordingWarning
from altijax.speed_estimate.outages import outage_table

DRIVE = "rtk-drive"
METHODS = {
    "conventional:2+2": "without roll",
    "roll:2+2": "with roll",
    "filter:2+2": "filter, the same four sensors",
    "filter:2+3": "filter, with a roll gyro",
}


def real_outages(output: Path) -> list[str]:
    """The table as lines of text, and by range of turning in outages.csv; a remark where there is no drive."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RecordingWarning)
            recording = load_dataset(DRIVE)
    except DatasetNotFoundError:
        return [f"No real outages: {DRIVE} is not here; altijax.load_dataset({DRIVE!r}) says what to put where."]
    table = outage_table(recording, tuple(METHODS))
    table.round(4).to_csv(output / "outages.csv")
    return [
        f"Outages of the GNSS speed on {DRIVE}, from the same constants, learned before each; RMS error (m/s), in",
        "brackets the share of errors within one standard deviation:",
        *_lines(table[table.index.get_level_values("turning") == "all"].droplevel("turning")),
    ]


def _lines(table: pd.DataFrame) -> list[str]:
    groups = {method: rows for method, rows in table.reset_index().groupby("method")}
    first = groups[next(iter(METHODS))]
    heads = [
        f"{duration:g} s ({windows})" for duration, windows in zip(first["duration"], first["windows"], strict=True)
    ]
    lines = [f"  {'after (outages)':<30}" + "".join(f"{head:>14}" for head in heads)]
    for method, name in METHODS.items():
        rows = groups[method]
        cells = [f"{rms:.2f} [{share:.2f}]" for rms, share in zip(rows["rms"], rows["within_1_std"], strict=True)]
        lines.append(f"  {name:<30}" + "".join(f"{cell:>14}" for cell in cells))
    return lines
