"""Elevation along a recorded drive, and its errors against a reference: a recording in, a row an IMU sample out."""

from collections.abc import Iterable

import jax
import numpy as np
import pandas as pd

from altijax import metrics
from altijax.calibration.records import Calibration
from altijax.drives import drive_arrays, imu_of, reference_heights, start_of
from altijax.elevation_estimate.model import ELEVATION_METHODS
from altijax.elevation_estimate.posterior import elevation_posterior
from altijax.elevation_estimate.priors import prior_constants, with_corrected_turns
from altijax.recordings import Recording
from altijax.stages import stages


def estimate_elevation(
    recording: Recording,
    *,
    method: str = "slope",
    calibration: Calibration | None = None,
    initial_vertical_speed: float | None = None,
    known_heights: pd.DataFrame | Iterable[tuple[float, float]] | None = None,
) -> pd.DataFrame:
    """Elevation along a drive from accelerometer and speed sensor.

    Parameters
    ----------
    recording : Recording
        With an IMU and wheel speeds, or else GNSS velocities, whose ground speed then serves; GNSS heights never do.
    method : {"slope", "shirai", "fused"}
        "shirai" integrates Eq. (1) of [shirai2000]_ twice; it takes the rate of turn from the wheels where left and
        right are recorded and the track width is known, else from the gyro. "slope" integrates the road's slope once.
        "fused" takes both by their errors, with what roads are like, and finds the constants of sensors, mounting and
        car (how it pitches under load) by itself, as far as the drive shows them.
    calibration : Calibration, optional
        Constants from `calibrate`; nominal ones otherwise.
    initial_vertical_speed : float, optional
        In m/s, for "shirai" and "fused"; it goes before the calibration's. By default the calibration's, else the
        slope's of the first second, which is zero at standstill.
    known_heights : DataFrame or pairs (t, height), optional
        Surveyed heights in m above anything, on the recording's time axis: of start and end, of points on the way, of
        one place passed twice, or of the first seconds. A DataFrame has t as its index and a column height. The
        constants and the profile are what they are likely to be given these heights.

    Returns
    -------
    estimate : DataFrame
        Indexed as ``recording.imu``: elevation (m, zero at the first sample), elevation_std (m), way (m), horizontal
        (m), vertical_speed (m/s), and valid, False where the IMU or the speed has a gap or had not begun. Without a
        calibration of the constants the standard deviation is that of an uncalibrated consumer's instrument; where
        heights are known or the method is "fused", it is over the levels of the noise as likely as this drive makes
        them. It is too small for a car whose errors last longer than the model's 5 s.

    Raises
    ------
    ValueError
        If the method is unknown, the recording lacks a stream that it needs, or known heights are not numbers at times
        of the recording.
    """
    require_method(method)
    with jax.enable_x64(True), stages(f"elevation of {recording.name} by {method!r}") as stage:
        known = None if known_heights is None else _known_heights(known_heights, recording)
        fixed = {} if initial_vertical_speed is None else {"initial_vertical_speed": float(initial_vertical_speed)}
        stage("readings")
        drive, grid = drive_arrays(with_corrected_turns(recording, calibration), turns=method != "slope")
        stage("constants")
        prior = prior_constants(drive, method, calibration, fixed)
        stage("elevation")
        found = elevation_posterior(drive, prior, method, known, fixed).series
    imu_index = imu_of(recording).index
    t = imu_index.to_numpy(float)
    columns = ("elevation", "elevation_std", "way", "horizontal", "vertical_speed")
    estimate = pd.DataFrame({name: np.interp(t, grid, found[name]) for name in columns}, index=imu_index)
    estimate["valid"] = found["valid"][np.clip(np.searchsorted(grid, t), 0, grid.size - 1)]
    return estimate


def score_elevation(estimate: pd.DataFrame, recording: Recording, *, after: float | None = None) -> pd.Series:
    """Errors of an elevation estimate against the recording's reference.

    Parameters
    ----------
    estimate : DataFrame
        From `estimate_elevation`.
    recording : Recording
        The same recording, with ``alt`` in its reference.
    after : float, optional
        Score only what comes after this time, such as the end of what was calibrated on.

    Returns
    -------
    score : Series
        rms (m) with the first reference height in common, rms_without_offset (m), end_error (m), relief (m, highest
        less lowest reference), way (m), way_per_error (the n of an accuracy 1/n of the end error), and coverage within
        one and two standard deviations of heights above the recording's first, whatever ``after`` is.

    Raises
    ------
    ValueError
        If the recording has no reference heights in the interval.
    """
    t, heights = reference_heights(recording)
    t = t + start_of(recording)
    keep = t > (-np.inf if after is None else after)
    if not keep.any():
        raise ValueError(f"recording {recording.name!r} has no reference heights after {after} s")
    elevation, std, ways = (
        np.interp(t, estimate.index, estimate[name]) for name in ("elevation", "elevation_std", "way")
    )
    # Bars are of heights above the start, so what they are held against is too, whatever part of the drive is scored.
    above_start = elevation - elevation[0] - (heights - heights[0])
    std = np.sqrt(np.maximum(std**2 - std[0] ** 2, 0))
    barred = keep & (np.arange(t.size) > 0)
    error, heights, ways = above_start[keep], heights[keep], ways[keep]
    error = error - error[0]
    way = ways[-1] - ways[0]
    with jax.enable_x64(True):
        score = {
            "rms": metrics.rms(error),
            "rms_without_offset": metrics.rms_without_offset(error),
            "end_error": error[-1],
            "relief": np.ptp(heights),
            "way": way,
            "way_per_error": metrics.accuracy_denominator(way, error[-1]),
            "within_1_std": metrics.coverage(above_start[barred], std[barred], 1.0),
            "within_2_std": metrics.coverage(above_start[barred], std[barred], 2.0),
        }
        return pd.Series({name: float(value) for name, value in score.items()})


def require_method(method: str) -> None:
    if method not in ELEVATION_METHODS:
        raise ValueError(f"method must be one of {', '.join(ELEVATION_METHODS)}, got {method!r}")


def _known_heights(
    known: pd.DataFrame | Iterable[tuple[float, float]], recording: Recording
) -> tuple[np.ndarray, np.ndarray]:
    """Times from the first IMU sample, and heights, in order."""
    if isinstance(known, pd.DataFrame):
        if "height" not in known:
            raise ValueError(
                f"known_heights must have a column height, and times as its index; got {', '.join(map(str, known))}"
            )
        pairs = np.column_stack([known.index.to_numpy(float), known["height"].to_numpy(float)])
    else:
        pairs = np.asarray(list(known), float)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not pairs.size or not np.isfinite(pairs).all():
        raise ValueError(f"known_heights must be finite pairs (t, height), at least one; got shape {pairs.shape}")
    first, last = start_of(recording), float(imu_of(recording).index[-1])
    outside = (pairs[:, 0] < first) | (pairs[:, 0] > last)
    if outside.any():
        raise ValueError(
            f"known_heights has a time of {pairs[outside][0, 0]:g} s, outside the IMU's {first:g} to {last:g} s"
        )
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    return pairs[:, 0] - first, pairs[:, 1]
