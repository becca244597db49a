"""Constants of the motion methods, fitted to a reference of attitude and velocity.

The estimates pass through tables, so their derivatives by the few constants are central differences, taken anew once
about the first solution; the estimate is nearly linear in them. "batch" finds biases by itself: here those asked for
are held at what is tried, and its noise levels, outliers and start as it found them without.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import jax
import numpy as np
import pandas as pd

from altijax.calibration.priors import PARAMETERS
from altijax.calibration.records import Calibration, constants_table, held_out_row, held_out_table
from altijax.calibration.reference_fit import Found, ReferenceFit, calibration_from, fit_to_reference, weighted_fit
from altijax.drives import imu_of
from altijax.motion_estimate.batch import batch_with_constants
from altijax.motion_estimate.estimates import estimate_motion
from altijax.motion_estimate.scores import estimate_at
from altijax.recordings import Recording

_ANGLES, _VELOCITY = ("roll", "pitch", "heading"), ("v_e", "v_n", "v_u")
_UNITS = dict.fromkeys(_ANGLES, "rad") | dict.fromkeys(_VELOCITY, "m/s")
# Of a difference, in prior standard deviations, and how exactly a constant that is tried counts as known.
_DIFFERENCE, _HELD = 0.1, 1e-4
_LINEARISATIONS = 2

Motion = Callable[[Calibration], pd.DataFrame]


def calibrate_motion(
    recordings: Sequence[Recording], names: Sequence[str], *, method: str, until: float | None = None
) -> Calibration:
    """Constants that bring a method's attitude, and with "batch" its velocity, closest to a reference.

    Parameters
    ----------
    recordings : sequence of Recording
        With any of roll, pitch, heading in their reference, for "batch" velocities too; the constants are common to
        them.
    names : sequence of str
        Constants to find; the others keep their nominal values, but that "batch" always finds its own.
    method : {"epoch", "window", "batch"}
        Method of `estimate_motion`.
    until : float, optional
        Last time whose reference may be used. GNSS velocities count to the end of the recording: the estimate is of
        the whole record.

    Returns
    -------
    calibration : Calibration
        ``held_out`` has the errors of `estimate_motion` without and with it.

    Raises
    ------
    ValueError
        If a constant changes nothing, or the reference is missing or too short.
    """
    names = list(names)
    end = np.inf if until is None else until
    with jax.enable_x64(True):
        references = [_reference(recording, method) for recording in recordings]
        fitted = [reference.loc[:end] for reference in references]
        if min(len(part) for part in fitted) < 3:
            raise ValueError(f"method {method!r} needs 3 samples of the reference or more up to until={until}")
        motions = [_motion(recording, method) for recording in recordings]
        fit = _fit(motions, fitted, names)
        calibration = calibration_from(method, names, fit.x, fit.covariance, pd.DataFrame())
    rows = []
    for recording, reference in zip(recordings, references, strict=True):
        pair = [
            _errors(estimate_motion(recording, method=method, calibration=c), reference) for c in (None, calibration)
        ]
        times = reference.index.to_numpy(float)
        before = times <= end
        for name in pair[0]:
            halves = [[_rms(error[name][part]) for error in pair] for part in (before, ~before)]
            interval = times[0], times[before][-1], times[-1]
            rows.append(held_out_row(recording.name, name, _UNITS[name], interval, *halves))
    return replace(calibration, held_out=held_out_table(rows))


def _reference(recording: Recording, method: str) -> pd.DataFrame:
    """Columns that the method is judged by, within the IMU's span."""
    wanted = (*_ANGLES, *(_VELOCITY if method == "batch" else ()))
    reference = recording.reference
    columns = [n for n in wanted if reference is not None and n in reference and reference[n].notna().any()]
    if reference is None or not columns:
        raise ValueError(
            f"recording {recording.name!r} has no reference of the motion: a reference.csv with any of "
            f"{', '.join(wanted)}"
        )
    index = imu_of(recording).index
    return reference.loc[index[0] : index[-1], columns]


def _motion(recording: Recording, method: str) -> Motion:
    """The estimate as a function of its constants; what the method searches for itself stays."""
    if method == "batch":
        return batch_with_constants(recording)
    delay = estimate_motion(recording, method=method).attrs["delay"]

    def motion(calibration: Calibration) -> pd.DataFrame:
        fixed = None if "gnss_delay" in calibration.values else delay
        return estimate_motion(recording, method=method, calibration=calibration, delay=fixed)

    return motion


def _fit(motions: Sequence[Motion], references: Sequence[pd.DataFrame], names: list[str]) -> ReferenceFit:
    known = PARAMETERS.loc[names]

    def errors(x: np.ndarray) -> list[np.ndarray]:
        """Error of each quantity of each recording, with constants by their deviation in prior deviations."""
        table = pd.DataFrame(
            {
                "value": known["nominal"] + known["uncertainty"] * x,
                "std": _HELD * known["uncertainty"],
                "unit": known["unit"],
                "prior": known["nominal"],
                "prior_std": known["uncertainty"],
            }
        )
        trial = Calibration(
            method="trial",
            table=constants_table(table),
            correlation=pd.DataFrame(np.eye(len(names)), names, names),
            absorbed=pd.DataFrame(index=names),
            undetermined=(),
            held_out=pd.DataFrame(),
        )
        return [
            error[None]
            for motion, reference in zip(motions, references, strict=True)
            for error in _errors(motion(trial), reference).values()
        ]

    at = np.zeros(len(names))
    first = errors(at)
    for _ in range(_LINEARISATIONS):
        here = errors(at)
        pairs = [(errors(at + step), errors(at - step)) for step in _DIFFERENCE * np.eye(len(names))]
        slopes = [
            np.stack([(plus[k] - minus[k]) / (2 * _DIFFERENCE) for plus, minus in pairs], -1) for k in range(len(here))
        ]
        data = [(r - slope @ at, slope) for r, slope in zip(here, slopes, strict=True)]
        fit = fit_to_reference(partial(_solve, data=data), len(names), first)
        at = fit.x
    return fit


@jax.jit
def _solve(x0: jax.Array, noise: jax.Array, data: list[tuple[np.ndarray, np.ndarray]]) -> Found:
    return weighted_fit(lambda x: tuple(constant + slope @ x for constant, slope in data), x0, noise)


def _errors(estimate: pd.DataFrame, reference: pd.DataFrame) -> dict[str, np.ndarray]:
    """Estimate less reference at its times; zero where either is missing."""
    t = reference.index.to_numpy(float)
    nearest = np.clip(np.searchsorted(estimate.index.to_numpy(float), t), 0, len(estimate) - 1)
    valid = estimate["valid"].to_numpy()[nearest]
    at = estimate_at(estimate, t)
    found = {}
    for name in map(str, reference):
        error = at[name] - reference[name].to_numpy(float)
        if name in _ANGLES:
            error = (error + np.pi) % (2 * np.pi) - np.pi
        found[name] = np.where(valid & np.isfinite(error), error, 0.0)
    return found


def _rms(error: np.ndarray) -> float:
    there = error[error != 0]
    return float(np.sqrt(np.mean(there**2))) if there.size else np.nan
