"""Everything that is computed once: responses, what the rows say of the sensors, and the runs of all experiments."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from papers_repro.progress import stage
from papers_repro.shirai2000.bands import drawn_sensors, simulate
from papers_repro.shirai2000.budget import Responses, responses
from papers_repro.shirai2000.experiments import Course, Sensors, sample_count
from papers_repro.shirai2000.inference import (
    NAMES,
    Experiments,
    Posterior,
    Site,
    experiments_of,
    infer,
    sensors_of,
    site_of,
)
from papers_repro.shirai2000.tables import Row

RUNS = 200
# Runs of the responses, outdoors and indoors. What misplaced magnets do goes by the square of something drawn: the RMS
# that 96 runs predict of the speed sensor outdoors is off by 15 % (standard deviation), that of 384 by half as much.
RESPONSES = {"outdoors": 384, "indoors": 32}
# Experiments whose courses serve as references, at about the mean duration of their place.
REFERENCES = {"outdoors": ("slope", "10"), "indoors": ("level", "3")}
# Times RUNS runs with the sensors found, to judge the budget by.
REPEATS = {"outdoors": 3, "indoors": 1}


@dataclass(frozen=True, kw_only=True)
class Study:
    """All that was simulated and inferred.

    Attributes
    ----------
    names, experiments
        Place and number of every experiment, and its printed numbers.
    posterior
        Of the unknowns, by all experiments.
    courses, sites
        Reference courses by place, and what their responses say of elevations.
    profiles
        (experiments, runs, points, chains, outputs) of the experiments, each with sensors inferred without it.
    at_mode
        The same by place, of its reference course with the sensors at the maximum: (runs, points, chains, outputs).
    """

    names: list[tuple[str, str]]
    experiments: Experiments
    posterior: Posterior
    courses: dict[str, Course]
    sites: dict[str, Site]
    profiles: np.ndarray
    at_mode: dict[str, np.ndarray]


def study(rows: Sequence[Row], runs: int = RUNS, response_runs: dict[str, int] = RESPONSES) -> Study:
    """Responses, inference with and without each experiment, and all runs."""
    names, experiments = experiments_of(rows)
    samples = sample_count(float(np.max(experiments.course.duration)))
    index = {place: names.index(name) for place, name in REFERENCES.items()}
    of_all = jax.tree.map(partial(jnp.asarray, dtype=jnp.float32), experiments.course)
    courses = {place: jax.tree.map(lambda x, i=i: x[i], of_all) for place, i in index.items()}
    found = jax.jit(partial(responses, samples=samples))
    key = jax.random.key(1, impl="rbg")
    with jax.enable_x64(True):
        exact = partial(jnp.asarray, dtype=jnp.float64)
        sites = {}
        for place, course in courses.items():
            part = _in_parts(found, course, jax.random.split(key, response_runs[place]), place)
            sites[place] = site_of(jax.tree.map(exact, course), jax.tree.map(exact, part))
        with stage("sensors inferred from the printed rows"):
            posterior, without = infer(
                jax.tree.map(jnp.asarray, experiments), (sites["outdoors"], sites["indoors"]), jax.random.key(0)
            )
    at_mode = [place for place, times in REPEATS.items() for _ in range(times)]
    certain = Posterior(mode=posterior.mode, covariance=1e-12 * np.eye(len(NAMES)))
    sensors = drawn_sensors(
        [*without, *(certain for _ in at_mode)],
        np.concatenate([experiments.indoors, [place == "indoors" for place in at_mode]]),
        runs,
    )
    everything = jax.tree.map(lambda x: jnp.concatenate([x, x[jnp.array([index[p] for p in at_mode])]]), of_all)
    keys = jax.random.split(jax.random.key(2, impl="rbg"), (len(names) + len(at_mode)) * runs)
    with stage("runs of every experiment"):
        profiles = np.asarray(
            simulate(sensors, everything, keys.reshape(len(names) + len(at_mode), runs), samples=samples)
        )
    return Study(
        names=names,
        experiments=experiments,
        posterior=posterior,
        courses=courses,
        sites=sites,
        profiles=profiles[: len(names)],
        at_mode={
            place: np.concatenate([profiles[len(names) + i] for i, p in enumerate(at_mode) if p == place])
            for place in REPEATS
        },
    )


def mode_sensors(found: Study, place: str) -> Sensors:
    """The sensors at the maximum of the posterior."""
    return sensors_of(jnp.asarray(found.posterior.mode), jnp.asarray(place == "indoors"))


def _in_parts(
    function: Callable[[Course, jax.Array], Responses], course: Course, keys: jax.Array, place: str, size: int = 16
) -> Responses:
    """Over keys in parts of one size, as memory and a single compilation ask for."""
    starts = range(0, keys.shape[0], size)
    parts = []
    with stage(f"derivatives of runs, {place}", len(starts)) as advance:
        for start in starts:
            parts.append(jax.tree.map(np.asarray, function(course, keys[start : start + size])))
            advance()
    return jax.tree.map(lambda *x: np.concatenate(x), *parts)
