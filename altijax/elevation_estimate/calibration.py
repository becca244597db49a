"""Constants of the elevation methods, fitted to reference heights."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import jax
import numpy as np
import pandas as pd

from altijax.calibration.priors import PARAMETERS
from altijax.calibration.records import Calibration, held_out_row, held_out_table
from altijax.calibration.reference_fit import ReferenceFit, calibration_from, fit_to_reference, stepwise_fit
from altijax.drives import Drive, drive_arrays, reference_heights, start_of
from altijax.elevation_estimate.model import (
    NOMINAL,
    UNCERTAINTY,
    elevation_and_sensitivity,
    uncertain_constants,
    vertical_speed_at_start,
)
from altijax.elevation_estimate.posterior import Constants, Posterior, elevation_posterior
from altijax.elevation_estimate.priors import prior_constants
from altijax.recordings import Recording
from altijax.series import interpolated
from altijax.stages import stages

Heights = tuple[np.ndarray, np.ndarray]


def calibrate_elevation(
    recordings: Sequence[Recording], names: Sequence[str], *, method: str, until: float | None = None
) -> Calibration:
    """Constants that bring a method's elevations closest to reference heights, in least squares.

    Parameters
    ----------
    recordings : sequence of Recording
        With ``alt`` in their reference; the constants are common to them, a height offset is free in each.
    names : sequence of str
        Constants to find; the others keep their nominal values.
    method : {"slope", "shirai", "fused"}
        With "fused" the noise of the drive is found beside the constants.
    until : float, optional
        Last time whose reference may be used.

    Returns
    -------
    calibration : Calibration
        Drift slower than what was fitted is not in its standard deviations.

    Raises
    ------
    ValueError
        If a constant changes nothing, or the reference is missing or too short.
    """
    names = list(names)
    if "initial_vertical_speed" in names and len(recordings) > 1:
        raise ValueError("initial_vertical_speed belongs to one recording: calibrate it on one alone")
    with jax.enable_x64(True), stages(f"calibration of {method!r}") as stage:
        stage("readings")
        drives = [drive_arrays(recording, turns=method != "slope")[0] for recording in recordings]
        references = [reference_heights(recording) for recording in recordings]
        end = np.inf if until is None else until
        fitted = [t[t <= end - start_of(r)].size for r, (t, _) in zip(recordings, references, strict=True)]
        if min(fitted) < 3 or sum(fitted) < len(names) + len(recordings) + 1:
            raise ValueError(
                f"{len(names)} parameter(s) need more reference than {sum(fitted)} height(s) up to until={until}"
            )
        if method == "fused":
            return _calibrate_fused(recordings, drives, references, fitted, names)
        stage("fit")
        prior = _prior(drives[0], names)
        mean, unit = (prior.loc[names, column].to_numpy(float) for column in ("nominal", "uncertainty"))
        targets = [(t[:n], heights[:n]) for (t, heights), n in zip(references, fitted, strict=True)]
        fit = _fit(drives, targets, names, mean, unit, method)
        constants = dict(zip(names, mean + unit * fit.x, strict=True))
        stage("what the constants absorb")
        absorbed = _absorbed(drives, targets, constants, method, unit, fit)
        stage("errors")
        nominal = dict(zip(names, mean, strict=True))
        errors = [
            [_linearised(values, drive, whole, names, method)[0] for values in (nominal, constants)]
            for drive, whole in zip(drives, references, strict=True)
        ]
        held_out = _held_out(recordings, references, fitted, errors)
        return calibration_from(method, names, fit.x, fit.covariance, held_out, prior=prior, absorbed=absorbed)


def _prior(drive: Drive, names: Sequence[str]) -> pd.DataFrame:
    """`PARAMETERS`, with what the drive itself says of its vertical speed at the start."""
    if "initial_vertical_speed" not in names:
        return PARAMETERS
    climb = vertical_speed_at_start({}, drive, names, "shirai")
    slope = uncertain_constants(drive, "shirai")["initial_vertical_speed"]
    prior = PARAMETERS.copy()
    std = np.hypot(slope, UNCERTAINTY["initial_vertical_speed"])
    prior.loc["initial_vertical_speed", ["nominal", "uncertainty"]] = climb, std
    return prior


def _linearised(
    values: dict[str, float], drive: Drive, target: Heights, names: Sequence[str], method: str
) -> tuple[np.ndarray, np.ndarray]:
    """Estimate less reference at the reference's times, and its derivatives (time, names), both without their means."""
    found, sensitivity = elevation_and_sensitivity(values, drive, names, method)
    t, heights = target
    grid = np.asarray(drive.t)
    error, slope = np.interp(t, grid, found["elevation"]) - heights, interpolated(t, grid, sensitivity)
    return error - error.mean(), slope - slope.mean(0)


def _fit(
    drives: list[Drive],
    targets: list[Heights],
    names: list[str],
    mean: np.ndarray,
    unit: np.ndarray,
    method: str,
) -> ReferenceFit:
    """The constants in units of their priors; a group of residuals a recording."""

    def linearised(x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        values = dict(zip(names, mean + unit * x, strict=True))
        pairs = zip(drives, targets, strict=True)
        found = [_linearised(values, drive, target, names, method) for drive, target in pairs]
        return [(error[None], (slope * unit)[None]) for error, slope in found]

    first = [error for error, _ in linearised(np.zeros(len(names)))]
    return fit_to_reference(partial(stepwise_fit, linearised), len(names), first)


def _absorbed(
    drives: list[Drive],
    targets: list[Heights],
    constants: dict[str, float],
    method: str,
    unit: np.ndarray,
    fit: ReferenceFit,
) -> pd.DataFrame:
    """By how much each constant moves for one unit of those left at nominal."""
    names = list(constants)
    others = [name for name in uncertain_constants(drives[0], method) if name not in names]
    if len(drives) > 1:
        others = [name for name in others if name != "initial_vertical_speed"]  # each recording has its own
    units = np.append(unit, [UNCERTAINTY[name] for name in others])
    J = np.concatenate(
        [
            _linearised(constants, drive, target, [*names, *others], method)[1] * units / std
            for drive, target, std in zip(drives, targets, fit.noise, strict=True)
        ]
    )
    mine, theirs = J[:, : len(names)], J[:, len(names) :]
    moved = -fit.covariance @ mine.T @ theirs
    return pd.DataFrame(moved * units[: len(names), None] / units[len(names) :], names, others)


def _calibrate_fused(
    recordings: Sequence[Recording],
    drives: list[Drive],
    references: list[tuple[np.ndarray, np.ndarray]],
    fitted: list[int],
    names: list[str],
) -> Calibration:
    """One drive after the other, each beginning with what the ones before have left."""
    first = prior_constants(drives[0], "fused")
    idle = [name for name in names if name not in first.names]
    if idle:
        raise ValueError(f"{', '.join(idle)}: not a constant of method 'fused' on these recordings; leave it out")
    prior = PARAMETERS.copy()
    rows = [first.names.index(name) for name in names]
    prior.loc[names, "nominal"] = first.mean[rows]
    prior.loc[names, "uncertainty"] = np.sqrt(np.diag(first.covariance))[rows]

    def after(drive: Drive, calibration: Calibration | None, known: tuple | None) -> Posterior:
        return elevation_posterior(drive, prior_constants(drive, "fused", calibration), "fused", known)

    calibration = None
    for drive, (t, heights), n in zip(drives, references, fitted, strict=True):
        constants = after(drive, calibration, (t[:n], heights[:n])).constants
        calibration = _with_others_nominal(constants, names, prior)
    assert calibration is not None  # there is at least one drive
    errors = [
        [np.interp(t, drive.t, after(drive, of, None).series["elevation"]) - heights for of in (None, calibration)]
        for drive, (t, heights) in zip(drives, references, strict=True)
    ]
    return replace(calibration, held_out=_held_out(recordings, references, fitted, errors))


def _with_others_nominal(constants: Constants, names: list[str], prior: pd.DataFrame) -> Calibration:
    """The constants named, if those left out are nominal; what they absorb of these says the rest."""
    # Each drive has its own vertical speed at the start.
    others = [x for x in constants.names if x not in (*names, "initial_vertical_speed")]
    pick, rest = ([constants.names.index(x) for x in group] for group in (names, others))
    across = constants.covariance[np.ix_(rest, pick)]
    absorbed = np.linalg.solve(constants.covariance[np.ix_(rest, rest)], across).T
    nominal = np.array([NOMINAL[name] for name in others])
    covariance = constants.covariance[np.ix_(pick, pick)] - absorbed @ across
    mean = constants.mean[pick] + absorbed @ (nominal - constants.mean[rest])
    units = prior.loc[names, "uncertainty"].to_numpy(float)
    return calibration_from(
        "fused",
        names,
        (mean - prior.loc[names, "nominal"].to_numpy(float)) / units,
        covariance / np.outer(units, units),
        pd.DataFrame(),
        prior=prior,
        absorbed=pd.DataFrame(absorbed, names, others),
    )


def _held_out(
    recordings: Sequence[Recording],
    references: list[tuple[np.ndarray, np.ndarray]],
    fitted: list[int],
    errors: list[list[np.ndarray]],
) -> pd.DataFrame:
    """Misfit, its mean removed, on what was fitted and on the rest, with nominal and with fitted constants."""
    rows = []
    for recording, (t, _), n, pair in zip(recordings, references, fitted, errors, strict=True):
        before, after = (
            (np.std(nominal), np.std(best)) if nominal.size else (np.nan, np.nan)
            for nominal, best in ([e[:n] for e in pair], [e[n:] for e in pair])
        )
        interval = np.array([t[0], t[n - 1], t[-1]]) + start_of(recording)
        rows.append(held_out_row(recording.name, "elevation", "m", interval.tolist(), before, after))
    return held_out_table(rows)
