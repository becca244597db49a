"""The most probable motion and noise levels of a recording, from a start by windows of epochs or by wheels."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from altijax.inference.levels import likely_levels
from altijax.motion_estimate.intervals import MotionReadings
from altijax.motion_estimate.start import quick_jit
from altijax.recordings import Recording
from altijax.stages import Stages
from altijax.vehicle.between import Between
from altijax.vehicle.inertial import Trajectory
from altijax.vehicle.measurements import known_height
from altijax.vehicle.parts import Rows
from altijax.vehicle.readings import instants_of, readings_of
from altijax.vehicle.sensors import Use, kinds_of, layout_of, levels_of
from altijax.vehicle.smoother import Belief, Fit, between, vehicle_pass
from altijax.vehicle.start import first_trajectory

between_readings = quick_jit(between, static_argnums=0)
_pass = quick_jit(vehicle_pass, static_argnums=0)

# Intervals between instants are about as long as this at most, s: what the gyro tells of a turn lasts for longer than
# an even turn is what a vehicle does, and wheels' means over an interval are about its middle.
_LONGEST, _LONGEST_EVEN = 1.0, 0.5
# Epochs that come faster are averaged: velocities of a vehicle run straight for this long, s, those of a hand for that.
_SHORTEST, _SHORTEST_FREE = 0.4, 0.1
# Factor on the variances of wheels and the course while a first attitude may be off by a right angle.
_EASED = 1e8
_ROUNDS_OF_DOUBT = 3
# How far, s, instants may move for a delay before what is measured on the IMU's clock is at other instants.
_MOVED = 0.05
# How far, as a logarithm, a round may move noise levels: the likelihood is that about the trajectory of the last ones.
_REACH = 2.0
# A start must be better than the one before by this much of a log-likelihood.
_BETTER = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """What a search works on, and what it has found.

    Attributes
    ----------
    use : tuple of str
        The set of sensors.
    readings : MotionReadings
        IMU readings and instants.
    rows : dict of str to Rows
        Measurements by kind.
    belief : Belief
        Of the first instant and the constants.
    measured : callable
        From a delay to the measurements at the instants that it makes.
    rows_at : float
        The delay that `rows` were made at, s.
    delay : float
        By how much the instants are moved for the receiver's delay, s.
    trajectory : Trajectory
        The most probable one so far.
    levels : dict of str to float
        Noise levels.
    doubt : dict of str to (time, rows)
        Factors on the variances of outliers.
    objective : float
        Minus the logarithm of the posterior probability of the levels.
    fit : Fit or None
        The last pass.
    """

    use: Use
    readings: MotionReadings
    rows: dict[str, Rows]
    belief: Belief
    measured: Callable[[float], dict[str, Rows]]
    rows_at: float
    delay: float
    trajectory: Trajectory
    levels: dict[str, float]
    doubt: dict[str, np.ndarray]
    objective: float = np.inf
    fit: Fit | None = None


def rows_at(
    recording: Recording, use: Use, readings: MotionReadings, heights: list[tuple[float, float]], delay: float
) -> dict[str, Rows]:
    """Measurements by kind at the instants; nothing at those that only fill up."""
    stamped = np.asarray(readings.instant)
    on_imu = instants_of(readings, delay)
    receiver = stamped + delay * (1 - np.asarray(readings.delayed))
    distinct = np.append(True, np.diff(on_imu) > 1e-9)
    size, found = stamped.size, {}
    for name, kind in kinds_of(use).items():
        t = (receiver if kind.by_receiver else on_imu)[distinct]
        rows = known_height.rows_of(heights, t) if name == "height" else kind.measured(recording, t)
        assert rows is not None, name
        spread = {"value": 0.0, "std": np.inf, "stamp": 0.0}
        whole = {}
        for key, fill in spread.items():
            values = getattr(rows, key)
            whole[key] = np.full((size, *values.shape[1:]), fill)
            whole[key][distinct] = values
        whole["stamp"][~distinct] = (receiver if kind.by_receiver else on_imu)[~distinct]
        found[name] = Rows(**whole)
    return found


def begun(recording: Recording, use: Use, delay: float, belief: Belief, heights: list[tuple[float, float]]) -> Search:
    """A search at its start, at a delay."""
    gyro = "gyro" in use
    longest = _LONGEST_EVEN if not gyro or "wheel" in use else _LONGEST
    shortest = _SHORTEST if "course" in use else _SHORTEST_FREE
    readings = readings_of(recording, use_gyro=gyro, delay=delay, shortest=shortest, longest=longest)
    measured = partial(rows_at, recording, use, readings, heights)
    rows = measured(delay)
    layout = layout_of(use)
    start = first_trajectory(recording, use, readings, rows, delay)
    x = start.x + belief.mean * (np.abs(start.x).max(0) == 0)
    x[:, layout.at("attitude")] = 0
    if "gnss_delay" in layout:
        x[:, layout.at("gnss_delay")] = delay
    return Search(
        use=use,
        readings=jax.device_put(readings),
        rows=rows,
        belief=belief,
        measured=measured,
        rows_at=delay,
        delay=delay,
        trajectory=replace(start, x=x),
        levels={name: level.usual for name, level in levels_of(use).items()},
        doubt={name: np.ones_like(row.std) for name, row in rows.items()},
    )


def best_start(
    recording: Recording, use: Use, delays: Sequence[float], belief: Belief, heights: list[tuple[float, float]]
) -> Search:
    """The best of several starts after some passes: by several delays, and turned about the vertical where nothing
    tells the course.

    Parameters
    ----------
    recording : Recording
        The recording.
    use : tuple of str
        The set of sensors.
    delays : sequence of float
        How late the receiver's stamps may be, s.
    belief : Belief
        What is believed beforehand.
    heights : list of (float, float)
        Times from the first IMU sample (s) and heights (m).

    Returns
    -------
    search : Search
        At its start.
    """
    free = "velocity" in use and "gyro" in use and "course" not in use
    best, least = None, np.inf
    for trial in delays:
        start = begun(recording, use, trial, belief, heights)
        for turn in (0.0, 0.5, 1.0, 1.5) if free else (0.0,):
            found = passed(eased(turned(start, turn * np.pi)), 5)
            found = passed(replace(found, doubt=start.doubt), 5)
            objective = objective_of(found)
            if best is None or objective < least - _BETTER:
                best, least = found, objective
    assert best is not None
    return best


def eased(search: Search) -> Search:
    """The search with little trust in what is linear near the truth alone, where velocities lead there without it."""
    if "velocity" not in search.rows:
        return search
    doubt = {name: x if name == "velocity" else _EASED * x for name, x in search.doubt.items()}
    return replace(search, doubt=doubt)


def turned(search: Search, angle: float) -> Search:
    """The search with its trajectory's attitudes turned about the vertical (rad)."""
    C = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix() @ search.trajectory.C_nb
    return replace(search, trajectory=replace(search.trajectory, C_nb=C))


def passed(search: Search, passes: int, *, robust: bool = False) -> Search:
    """The search after some passes, its instants moved by the delay found."""
    trajectory, delay = search.trajectory, search.delay
    layout = layout_of(search.use)
    for _ in range(passes):
        if abs(delay - search.rows_at) > _MOVED:
            search = replace(search, rows=search.measured(delay), rows_at=delay)
        said = between_readings(search.use, search.readings, trajectory, np.float64(delay))
        fit = jax.device_get(_one(search, trajectory, delay, said, search.levels))
        trajectory = fit.trajectory
        change = 0.0
        if "gnss_delay" in layout:
            found = float(trajectory.x[-1, layout.at("gnss_delay")][0])
            change, delay = found - delay, found
        if float(fit.step) < 1e-4 and abs(change) < 1e-4:
            break
    doubt = fit.doubt if robust else search.doubt
    return replace(search, trajectory=trajectory, delay=delay, fit=fit, doubt=doubt)


def _one(search: Search, trajectory: Trajectory, delay: float, said: Between, levels: Mapping[str, float]) -> Fit:
    return _pass(
        search.use,
        search.readings,
        trajectory,
        np.float64(delay),
        said,
        search.rows,
        search.belief,
        search.doubt,
        {name: np.float64(level) for name, level in levels.items()},
    )


def said_between(search: Search) -> Between:
    """What the readings say between the instants of a search's trajectory."""
    return jax.device_get(between_readings(search.use, search.readings, search.trajectory, np.float64(search.delay)))


def fit_of(search: Search) -> Fit:
    """The last pass of a search that has had one."""
    assert search.fit is not None
    return search.fit


def objective_of(search: Search) -> float:
    """Minus the logarithm of the posterior probability of the levels, about the last trajectory."""
    usual = levels_of(search.use)
    off = [np.log(search.levels[name] / level.usual) / level.spread for name, level in usual.items() if level.spread]
    return 0.5 * float(np.square(off).sum()) - float(fit_of(search).log_likelihood)


def likely(search: Search, stage: Stages, rounds: int = 6) -> Search:
    """Noise levels and trajectory in turns, until the levels stay."""
    known = {name: level for name, level in levels_of(search.use).items() if level.spread}
    usual = {name: level.usual for name, level in known.items()}
    spread = {name: level.spread for name, level in known.items()}
    # What all others contradict must not make the levels so large that it no longer stands out.
    for _ in range(_ROUNDS_OF_DOUBT):
        search = passed(search, 4, robust=True)
    for turn in range(rounds):
        stage(f"noise levels, round {turn + 1}")
        likelihood = partial(_likelihood, search, said_between(search))
        start = {name: search.levels[name] for name in known}
        levels, objective = likely_levels(likelihood, start, usual, spread, _REACH)
        settled = turn > 1 and abs(objective - search.objective) < _BETTER
        search = passed(replace(search, levels=search.levels | levels, objective=objective), 8, robust=True)
        if settled:
            break
    return passed(search, 8)


def _likelihood(search: Search, said: Between, levels: Mapping[str, float]) -> tuple[float, Mapping[str, float]]:
    """Logarithm of the likelihood of levels about the trajectory of a search, and its derivative by each."""
    fit = _one(search, search.trajectory, search.delay, said, {**search.levels, **levels})
    return float(fit.log_likelihood), {name: float(slope) for name, slope in fit.by_level.items()}
