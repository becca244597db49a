"""The most probable motion of a whole record, of any body that carries an IMU and a GNSS receiver: the vehicle's
smoother, whose course is used where a body x is to be held along it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from altijax.calibration.records import Calibration
from altijax.drives import gnss_velocities, imu_of, start_of
from altijax.recordings import Recording
from altijax.stages import Stages, stages
from altijax.vehicle.at_samples import MOTION_COLUMNS, as_table, at_samples
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.estimates import delays_of, summary, supported
from altijax.vehicle.search import Search, best_start, fit_of, likely, passed, said_between
from altijax.vehicle.sensors import Use, layout_of
from altijax.vehicle.smoother import Belief

# What no record tells: that the IMU's axes are the body's, to so many radians.
_AXES_STD = 0.01
# A wind must be worth so much of a log-likelihood and so many of its standard deviations, and be more than what a
# crooked mount looks like, m/s.
_BETTER, _CERTAIN, _LEAST_WIND = 10.0, 4.0, 1.0
# Courses tell a wind from a crooked mount where those flown faster than this, m/s, spread so far that the length of
# their mean direction is below this.
_FLYING, _SPREAD_OUT, _FEWEST = 3.0, 0.8, 10


def batch_estimate(
    recording: Recording,
    *,
    use_gyro: bool,
    wind: bool | str,
    delay: float | None,
    calibration: Calibration | None,
    stage: Stages,
) -> pd.DataFrame:
    """What `altijax.estimate_motion` says by "batch"; its arguments are described there."""
    search = _found(recording, use_gyro, wind, delay, calibration, stage)
    stage("between the instants")
    return _table(recording, search)


def batch_with_constants(recording: Recording) -> Callable[[Calibration], pd.DataFrame]:
    """The most probable motion as a function of constants, all else as it was found without them.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and GNSS velocities.

    Returns
    -------
    motion : callable
        From a `Calibration` to an estimate as that of `estimate_motion`; noise levels and outliers stay. Call it in
        double precision.
    """
    with stages(f"motion of {recording.name} by batch") as stage:
        found = _found(recording, "gx" in imu_of(recording), "auto", None, None, stage)

    def motion(calibration: Calibration) -> pd.DataFrame:
        return _table(recording, passed(replace(found, belief=belief_of(found.use, calibration)), 4))

    return motion


def _found(
    recording: Recording,
    use_gyro: bool,
    wind: bool | str,
    delay: float | None,
    calibration: Calibration | None,
    stage: Stages,
) -> Search:
    """The search at its end, with a wind where one is asked for, or shows without a gyro."""
    held = () if use_gyro and wind == "auto" else ("course",) if wind is False else ("course", "craft")
    use: Use = (*(("gyro",) if use_gyro else ()), "velocity", *held)
    delays = (delay,) if delay is not None else delays_of(recording, use, calibration, stage)

    def search(use: Use) -> Search:
        belief = _with_delay(belief_of(use, calibration), use, delay)
        stage("first trajectory")
        return likely(best_start(recording, use, delays, belief, []), stage)

    windy = (*use, "wind")
    if wind is True:
        return search(windy)
    calm = search(use)
    if wind is False or use_gyro or not _turns_around(recording, np.zeros(2)):
        return calm
    found = search(windy)
    return found if _shows_wind(recording, calm, found) else calm


def _with_delay(belief: Belief, use: Use, delay: float | None) -> Belief:
    """The belief with a delay that is known: nothing is as late as that but by it."""
    if delay is None:
        return belief
    layout = layout_of(use)
    mean, covariance = np.array(belief.mean), np.array(belief.covariance)
    mean[layout.at("gnss_delay")] = delay
    for name in ("gnss_delay", "climb_delay"):
        covariance[layout.at(name)] = 0
        covariance[:, layout.at(name)] = 0
    return Belief(mean=mean, covariance=covariance)  # type: ignore[arg-type]


def _shows_wind(recording: Recording, calm: Search, windy: Search) -> bool:
    fit = fit_of(windy)
    place = layout_of(windy.use).at("wind")
    vector = np.asarray(fit.trajectory.x)[-1, place]
    std = np.sqrt(np.diag(np.asarray(fit.covariance)[-1])[place])
    sure = np.hypot(*vector) > max(_LEAST_WIND, _CERTAIN * float(np.max(std)))
    # One in which all courses are the same would let body x point anywhere.
    return calm.objective - windy.objective > _BETTER and bool(sure) and _turns_around(recording, vector)


def _turns_around(recording: Recording, wind: np.ndarray) -> bool:
    """Whether the courses through the air spread enough to tell a wind from a crooked mount."""
    found = gnss_velocities(recording)
    if found is None:
        return False
    v = found[1][np.isfinite(found[2][:, 0]), :2] - wind
    speed = np.hypot(*v.T)
    moving = speed > _FLYING
    heading = v[moving] / speed[moving, None]
    return bool(moving.sum() > _FEWEST and np.linalg.norm(np.mean(heading, 0)) < _SPREAD_OUT)


def _table(recording: Recording, search: Search) -> pd.DataFrame:
    """Attitude and velocity at the samples, and what else the search has found."""
    fit, said = fit_of(search), said_between(search)
    samples = at_samples(recording, layout_of(search.use), fit.trajectory, fit.covariance, said, search.levels)
    P = samples.covariance.copy()
    P[:, range(3), range(3)] += _AXES_STD**2
    table = as_table(recording, replace(samples, covariance=P))
    estimate = table[list(MOTION_COLUMNS)].assign(valid=supported(recording, search.use))
    found = summary(search, start_of(recording))
    constants = found["constants"]
    wind = [constants[name][0] for name in ("wind_e", "wind_n")] if "wind" in search.use else None
    late = {"delay": search.delay, "climb_delay": constants["climb_delay"][0], "wind": wind}
    estimate.attrs.update(late | found)
    return estimate
