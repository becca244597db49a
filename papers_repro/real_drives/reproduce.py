"""Elevation on real drives: Shirai's way and the slope way, raw, and with constants fitted on part or all of it."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from altijax.datasets import DatasetNotFoundError, load_dataset
from altijax.estimates import calibrate, estimate_elevation, score_elevation
from altijax.plots import plot_elevation, plot_elevation_error
from altijax.recordings import Recording, RecordingWarning
from papers_repro.comparison import Comparison, Report, compare_bound

TABLE = "elevation"


@dataclass(frozen=True)
class Case:
    """One method on one drive; `fitted` is the share of the drive in s whose reference the constants may see."""

    drive: str
    method: str
    constants: tuple[str, ...]
    fitted: float | None
    bound: str | None = None


_NORM = ("accelerometer_bias_z", "initial_vertical_speed")
CASES = [
    Case("comma2k19-example", "slope", (), None),
    Case("comma2k19-example", "slope", ("accelerometer_bias_x",), 20.0, bound="1.6"),
    Case("comma2k19-example", "slope", ("accelerometer_bias_x",), None),
    Case("comma2k19-example", "shirai", (), None),
    Case("comma2k19-example", "shirai", _NORM, 20.0),
    Case("comma2k19-example", "shirai", _NORM, None, bound="0.2"),
    Case("rtk-drive", "slope", (), None),
    Case("rtk-drive", "slope", ("accelerometer_bias_x",), 110.0),
    Case("rtk-drive", "slope", ("accelerometer_bias_x",), None, bound="1"),
    Case("rtk-drive", "shirai", (), None),
    Case("rtk-drive", "shirai", _NORM, 110.0),
    Case("rtk-drive", "shirai", _NORM, None),
]


def reproduce(output: Path) -> Report:
    """Every case whose drive is here; elevation.csv and a picture a drive go to `output`."""
    rows, missing = [], []
    for drive in dict.fromkeys(case.drive for case in CASES):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RecordingWarning)  # a damaged file that no method here reads
                recording = load_dataset(drive)
        except DatasetNotFoundError:
            missing.append(
                f"{drive} was not run, as it is not here: altijax.load_dataset({drive!r}) says what to put where."
            )
            continue
        estimates = {}
        for case in (case for case in CASES if case.drive == drive):
            until = None if case.fitted is None else _start(recording) + case.fitted
            calibration = (
                calibrate(recording, case.constants, method=case.method, until=until) if case.constants else None
            )
            estimate = estimate_elevation(recording, method=case.method, calibration=calibration)
            score = score_elevation(estimate, recording)
            later = score if until is None else score_elevation(estimate, recording, after=until)
            rows.append(
                {
                    "drive": drive,
                    "method": case.method,
                    "constants": ", ".join(case.constants) or "nominal",
                    "fitted on": "-" if not case.constants else "all" if until is None else f"first {case.fitted:g} s",
                    "RMS, all (m)": score["rms_without_offset"],
                    "RMS, held out (m)": later["rms_without_offset"] if until is not None else float("nan"),
                    "end error (m)": score["end_error"],
                    "relief (m)": score["relief"],
                    "way (m)": score["way"],
                    "bound": case.bound,
                }
            )
            if until is not None:
                estimates[f"{case.method}, {', '.join(case.constants)}"] = estimate
        _draw(estimates, recording, output / f"{drive}.png")
    table = pd.DataFrame(rows)
    table.to_csv(output / "elevation.csv", index=False)
    return Report(
        title="Elevation from accelerometer and speed sensor on real drives",
        comparisons=_comparisons(rows),
        tables={TABLE: "RMS over the whole drive, height offset removed; bounds set before the figures were known"},
        remarks=[*missing, *_lines(table)],
    )


def _start(recording: Recording) -> float:
    if recording.imu is None:
        raise ValueError(f"{recording.name} has no IMU")
    return float(recording.imu.index[0])


def _comparisons(rows: list[dict]) -> list[Comparison]:
    return [
        compare_bound(
            table=TABLE,
            row=f"{row['drive']}, {row['method']}, {row['constants']}",
            column=f"fitted on {row['fitted on']}",
            unit="m",
            bound=row["bound"],
            ours=row["RMS, all (m)"],
        )
        for row in rows
        if row["bound"]
    ]


def _lines(table: pd.DataFrame) -> list[str]:
    if table.empty:
        return []
    shown = table.drop(columns=["bound", "way (m)"]).replace({"constants": {", ".join(_NORM): "bias_z, initial v_z"}})
    shown["constants"] = shown["constants"].str.replace("accelerometer_", "")
    return shown.to_string(index=False, float_format="{:.2f}".format, na_rep="-").splitlines()


def _draw(estimates: dict[str, pd.DataFrame], recording: Recording, path: Path) -> None:
    figure, axes = plt.subplots(2, 1, figsize=(8, 7), layout="constrained")
    fitted = next(case.fitted for case in CASES if case.drive == recording.name and case.fitted)
    plot_elevation(estimates, recording, ax=axes[0])
    axes[0].set_title(f"{recording.name}: elevation, constants fitted on its first {fitted:g} s")
    plot_elevation_error(estimates, recording, fitted_until=_start(recording) + fitted, ax=axes[1])
    figure.savefig(path, dpi=120)
    plt.close(figure)
