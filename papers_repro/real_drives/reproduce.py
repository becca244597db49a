"""Elevation on real drives: each method raw, with constants fitted on a part, and with surveyed heights."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from altijax.datasets import DatasetNotFoundError, load_dataset
from altijax.estimates import calibrate, estimate_elevation, score_elevation
from altijax.plots import plot_elevation, plot_elevation_error
from altijax.recordings import Recording, RecordingWarning
from papers_repro.comparison import Comparison, Output, Report, compare_bound
from papers_repro.progress import stage

TABLE = "elevation"


@dataclass(frozen=True)
class Case:
    """One method on one drive.

    `fitted` is the share of the drive in s whose reference the constants may see; `known` the heights that the
    estimate itself is given: "ends", or those of the same first seconds, "first", when the bound is on the rest.
    """

    drive: str
    method: str
    constants: tuple[str, ...]
    fitted: float | None
    bound: str | None = None
    known: str | None = None


# The first third of each drive, which the pictures show.
_SHARES = (20.0, 110.0)
_NORM = ("accelerometer_bias_z", "initial_vertical_speed")
_CAR = ("accelerometer_bias_x", "weight_transfer")
CASES = [
    Case("comma2k19-example", "slope", (), None),
    Case("comma2k19-example", "slope", ("accelerometer_bias_x",), 20.0, bound="1.6"),
    Case("comma2k19-example", "slope", ("accelerometer_bias_x",), None),
    Case("comma2k19-example", "shirai", (), None),
    Case("comma2k19-example", "shirai", _NORM, 20.0),
    Case("comma2k19-example", "shirai", _NORM, None, bound="0.2"),
    Case("comma2k19-example", "fused", _CAR, 20.0),
    Case("rtk-drive", "slope", (), None),
    Case("rtk-drive", "slope", ("accelerometer_bias_x",), 110.0),
    Case("rtk-drive", "slope", ("accelerometer_bias_x",), None, bound="1"),
    Case("rtk-drive", "shirai", (), None),
    Case("rtk-drive", "shirai", _NORM, 110.0),
    Case("rtk-drive", "shirai", _NORM, None),
    Case("rtk-drive", "fused", _CAR, 110.0),
    *(
        Case(drive, method, (), fitted, known="first")
        for drive, fitted in (("comma2k19-example", 20.0), ("rtk-drive", 110.0))
        for method in ("shirai", "slope", "fused")
    ),
    Case("rtk-drive", "fused", (), None, known="ends", bound="0.25"),
    Case("rtk-drive", "fused", (), 60.0, known="first", bound="0.9"),
]


def reproduce(output: Path) -> Iterator[Report]:
    """Every case whose drive is here; elevation.csv and a picture a drive go to `output`."""
    title = "Elevation from accelerometer and speed sensor on real drives"
    rows = []
    for drive in dict.fromkeys(case.drive for case in CASES):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RecordingWarning)  # a damaged file that no method here reads
                recording = load_dataset(drive)
        except DatasetNotFoundError:
            yield Report(
                title=f"{title}: {drive}",
                remarks=[
                    f"{drive} was not run, as it is not here: altijax.load_dataset({drive!r}) says what to put where."
                ],
            )
            continue
        cases = [case for case in CASES if case.drive == drive]
        estimates, of_drive = {}, []
        with stage(drive, len(cases)) as advance:
            for case in cases:
                estimate, row = _tried(case, recording)
                of_drive.append(row)
                if case.fitted in _SHARES:
                    label = ", ".join(case.constants) or "given its heights"
                    estimates[f"{case.method}, {label}"] = estimate
                advance()
            _draw(estimates, recording, output / f"{drive}.png")
        rows += of_drive
        pd.DataFrame(rows).to_csv(output / "elevation.csv", index=False)
        yield Report(
            title=f"{title}: {drive}",
            comparisons=_comparisons(of_drive),
            tables={
                TABLE: "RMS over the whole drive, height offset removed; where heights are given, over the rest, from "
                "its first height; bounds set before the figures were "
                "known, the noise levels of 'fused' with an eye on these two drives"
            },
            remarks=_lines(pd.DataFrame(of_drive)),
            outputs=[
                Output(element=drive, file="elevation.csv", holds="errors of every method"),
                Output(element=drive, file=f"{drive}.png", holds="elevations and their errors"),
            ],
        )


def _tried(case: Case, recording: Recording) -> tuple[pd.DataFrame, dict]:
    """The estimate of a case, and its row of the table."""
    until = None if case.fitted is None else _start(recording) + case.fitted
    calibration = calibrate(recording, case.constants, method=case.method, until=until) if case.constants else None
    estimate = estimate_elevation(
        recording, method=case.method, calibration=calibration, known_heights=_known(recording, case)
    )
    score = score_elevation(estimate, recording)
    later = score if until is None else score_elevation(estimate, recording, after=until)
    return estimate, {
        "drive": case.drive,
        "method": case.method,
        "constants": ", ".join(case.constants) or "nominal" if case.known is None else "given heights",
        "fitted on": _seen(case),
        "RMS, all (m)": score["rms_without_offset"],
        "RMS, held out (m)": later["rms_without_offset"] if until is not None else float("nan"),
        "cover 1, 2 std": f"{later['within_1_std']:.2f}, {later['within_2_std']:.2f}",
        "end error (m)": score["end_error"],
        "relief (m)": score["relief"],
        "way (m)": score["way"],
        # of an estimate that was given heights nothing is free: what it errs by is its error
        "RMS bounded (m)": (later if case.known else score)["rms" if case.known else "rms_without_offset"],
        "bound": case.bound,
    }


def _known(recording: Recording, case: Case) -> pd.DataFrame | None:
    """The heights that a case is given, from the reference."""
    if case.known is None or recording.reference is None or recording.imu is None:
        return None
    heights = recording.reference[["alt"]].dropna().rename(columns={"alt": "height"})
    heights = heights[(heights.index >= recording.imu.index[0]) & (heights.index <= recording.imu.index[-1])]
    if case.known == "ends":
        return heights.iloc[[0, -1]]
    return heights[heights.index <= _start(recording) + (np.inf if case.fitted is None else case.fitted)]


def _seen(case: Case) -> str:
    if case.known == "ends":
        return "both ends"
    if not case.constants and case.known is None:
        return "-"
    return "all" if case.fitted is None else f"first {case.fitted:g} s"


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
            ours=row["RMS bounded (m)"],
        )
        for row in rows
        if row["bound"]
    ]


def _lines(table: pd.DataFrame) -> list[str]:
    shown = table.drop(columns=["bound", "way (m)", "relief (m)", "RMS bounded (m)"])
    shown = shown.replace(
        {"constants": {", ".join(_NORM): "bias_z, initial v_z", ", ".join(_CAR): "bias_x, weight tr."}}
    )
    shown["constants"] = shown["constants"].str.replace("accelerometer_", "")
    return shown.to_string(index=False, float_format="{:.2f}".format, na_rep="-").splitlines()


def _draw(estimates: dict[str, pd.DataFrame], recording: Recording, path: Path) -> None:
    figure, axes = plt.subplots(2, 1, figsize=(13, 7), layout="constrained")
    fitted = next(case.fitted for case in CASES if case.drive == recording.name and case.fitted in _SHARES)
    plot_elevation(estimates, recording, ax=axes[0])
    axes[0].set_title(f"{recording.name}: elevation, constants fitted on its first {fitted:g} s")
    plot_elevation_error(estimates, recording, fitted_until=_start(recording) + fitted, ax=axes[1])
    for ax in axes:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))  # beside the curves, which fill the axes
    figure.savefig(path, dpi=120)
    plt.close(figure)
