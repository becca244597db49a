"""How a speed holds out while there is no aid: outages spread over a recording, scored against what came after."""

from collections.abc import Sequence
from itertools import pairwise, product

import jax
import numpy as np
import pandas as pd

from altijax.drives import start_of
from altijax.recordings import Recording
from altijax.speed_estimate.estimates import (
    AUTO_SENSORS,
    NOMINAL_NOISE,
    dead_reckon,
    fit_noise,
    known_at,
    on_imu,
    require_options,
    run_filter,
    samples_between,
)
from altijax.speed_estimate.steps import STEP, SpeedDrive, drive_in_steps, from_first_aid, initial_state, speed_of
from altijax.stages import tracked

# The noise levels are fitted again each time the aid has gone on for half as long again.
_FIT_GROWTH = 1.5
_HEADING_BINS = (0.0, 1.0, 3.0, np.inf)


def outage_table(
    recording: Recording,
    methods: Sequence[str] = ("conventional", "roll", "aided", "filter"),
    durations: Sequence[float] = (10.0, 30.0, 60.0),
    every: float = 10.0,
    *,
    first: float = 60.0,
) -> pd.DataFrame:
    """Errors of the speed after outages of the aid, whose starts are spread over the recording.

    Parameters
    ----------
    recording : Recording
        With an aid all along.
    methods : sequence of str
        Of `estimate_speed`; sensors may follow a colon, as in "filter:2+2".
    durations : sequence of float
        For how long there is no aid, in s.
    every : float
        Time between the starts of outages, in s.
    first : float, optional
        Time before the first one, in s, in which the constants can be learned; counted from the first aid where that
        comes later than a second.

    Returns
    -------
    table : DataFrame
        One row a method, duration and range of turning (the accumulated change of heading in rad, "all" for all):
        windows, rms, median and max of the error's size (m/s), and the fraction of errors within one and two standard
        deviations. The truth is the reference's speed where there is one, else that of the aid.

    Raises
    ------
    ValueError
        If a method is unknown or the recording is shorter than the shortest outage.
    """
    errors = outage_errors(recording, methods, durations, every, first=first)
    labels = [f"{low:g}-{high:g}" if np.isfinite(high) else f">{low:g}" for low, high in pairwise(_HEADING_BINS)]
    turning = pd.cut(errors["turning"], list(_HEADING_BINS), labels=labels, include_lowest=True).astype(str)
    both = pd.concat([errors.assign(turning="all"), errors.assign(turning=turning)])
    rows = []
    for (method, duration, turning_range), group in both.groupby(["method", "duration", "turning"], sort=False):
        size, std = group["error"].abs(), group["std"]
        rows.append(
            {
                "method": method,
                "duration": duration,
                "turning": turning_range,
                "windows": len(group),
                "rms": float(np.sqrt(np.mean(size**2))),
                "median": size.median(),
                "max": size.max(),
                "within_1_std": float(np.mean(size <= std)),
                "within_2_std": float(np.mean(size <= 2 * std)),
            }
        )
    return pd.DataFrame(rows).set_index(["method", "duration", "turning"]).sort_index()


def outage_errors(
    recording: Recording,
    methods: Sequence[str] = ("conventional", "roll", "aided", "filter"),
    durations: Sequence[float] = (10.0, 30.0, 60.0),
    every: float = 10.0,
    *,
    first: float = 60.0,
) -> pd.DataFrame:
    """The single errors behind `outage_table`.

    Parameters
    ----------
    recording, methods, durations, every, first
        As in `outage_table`.

    Returns
    -------
    errors : DataFrame
        One row a method, start and duration: method, start (s, on the recording's time axis), duration (s), error and
        std (m/s), turning (rad).

    Raises
    ------
    ValueError
        If a method is unknown or the recording is shorter than the shortest outage.
    """
    split = [(name, *name.partition(":")[::2]) for name in methods]
    for _, method, sensors in split:
        require_options(method, sensors or "auto")
    recording = from_first_aid(recording)
    with jax.enable_x64(True):
        drive = drive_in_steps(recording, None, first)
        t_truth, truth = _truth(recording, drive)
        last = min(drive.ends[-1], t_truth[-1])
        starts = np.arange(first, last - min(durations), every)
        if not starts.size:
            raise ValueError(f"recording {recording.name!r} has no outage of {min(durations)} s after {first} s")
        rows = []
        sensors_used = dict.fromkeys(sensors or AUTO_SENSORS for _, _, sensors in split)
        for sensors, start in tracked(list(product(sensors_used, starts)), f"outages of {recording.name}"):
            if start == starts[0]:
                initial = initial_state(drive, start, None, None)
                run, noise, fitted_until = None, NOMINAL_NOISE, 0.0
            if start >= _FIT_GROWTH * fitted_until:
                noise, fitted_until = fit_noise(drive, start, sensors, initial, noise), start
            samples = samples_between(drive, start, min(start + max(durations), last))
            run = run_filter(drive, start, sensors, initial, noise, drive.t[samples.stop - 1], run)
            filtered = on_imu(drive, run, samples)
            for name, method, own in split:
                if (own or AUTO_SENSORS) != sensors:
                    continue
                estimate = filtered
                if method != "filter":
                    estimate = filtered.copy()
                    dead_reckon(estimate, drive, known_at(drive, run, start), method)
                for duration in durations:
                    end = start + duration
                    if end <= last:
                        rate = np.abs(drive.w_steps[(drive.ends > start) & (drive.ends <= end), 2])
                        error = np.interp(end, estimate.index, estimate["speed"]) - np.interp(end, t_truth, truth)
                        std = np.interp(end, estimate.index, estimate["speed_std"])
                        rows.append((name, start + start_of(recording), duration, error, std, rate.sum() * STEP))
    return pd.DataFrame(rows, columns=["method", "start", "duration", "error", "std", "turning"])


def _truth(recording: Recording, drive: SpeedDrive) -> tuple[np.ndarray, np.ndarray]:
    reference = recording.reference
    if reference is not None and {"v_e", "v_n"} <= set(reference) and reference["v_e"].notna().any():
        t, speed = speed_of(reference)
        return t - start_of(recording), speed
    return drive.t_aid, drive.aid
