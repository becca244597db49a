"""The unknowns of the sensors inferred from the printed rows: maximum of the posterior density by Newton's method.

The results of a run are taken as normal: elevations of its chains together, the logarithm of a gyro's way, the way of
the wheels. Their means and variances are differentiable functions of the unknowns,

- of the elevations by the responses of the simulation (`budget`), which grow with the duration of a run as the power
  in `GROWTH`;
- of the gyros' ways by the error equations of levelled inertial navigation, integrated in `STEPS` steps with a fixed
  set of draws: the tilt theta grows by the gyro's drift and noise and makes an acceleration of g theta. What an error
  of speed as large as the speed does to the length of the path is far from linear.

The horizontal distances are not used: those of the gyros repeat their ways, those of Eq. (1) are left to be predicted.
Unknowns are positive and have a log-normal prior about the value of a data sheet or an assumption, wide where that is
worth little; the wheel's scale alone may have either sign and has a normal one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from altijax.instruments import FIBRE_OPTIC_GYRO, JA_5V, VIBRATION_GYRO
from papers_repro.shirai2000.budget import SOURCES, Moments, Responses, elevation_errors, elevation_moments
from papers_repro.shirai2000.experiments import CHAINS, GRAVITY, RAMP, Course, Sensors
from papers_repro.shirai2000.tables import Row, number

STEPS = 40
DRAWS = 64
# Standing for a minute leaves this share of a gyro's noise density as drift: 1 / sqrt(2 * 60 s).
MINUTE = 120**-0.5

# Centre, and standard deviation of the logarithm; of the scale itself.
PRIORS = {
    "vibration_indoors": (0.03, 1.5),
    "vibration_outdoors": (0.1, 1.5),
    "vibration_spread": (0.5, 0.5),
    "accelerometer_bias": (1e-3, 1.5),
    "bias_walk": (JA_5V.bias_random_walk, 1.5),
    "vibration_gyro_drift": (MINUTE * VIBRATION_GYRO.noise_density, 1.5),
    "vibration_gyro_noise": (VIBRATION_GYRO.noise_density, 1.0),
    "fiber_optic_gyro_drift": (MINUTE * FIBRE_OPTIC_GYRO.noise_density, 1.5),
    "fiber_optic_gyro_noise": (FIBRE_OPTIC_GYRO.noise_density, 1.0),
    "wheel_scale": (0.0, 0.01),
    "wheel_spread": (0.005, 1.0),
    "magnet_error": (0.015, 1.0),
}
NAMES = tuple(PRIORS)
SCALE = NAMES.index("wheel_scale")
# Power of the duration with which the elevation error of a source grows; 2, as a constant error of h makes it, where
# nothing is said.
GROWTH = {
    "bias_walk": 2.5,
    "vibration_gyro_drift": 4.0,
    "vibration_gyro_noise": 3.0,
    "fiber_optic_gyro_drift": 4.0,
    "fiber_optic_gyro_noise": 3.0,
}


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Experiments:
    """Courses of all experiments, whether indoors, and printed way and elevation by chain, NaN where there is none."""

    course: Course
    indoors: jax.Array | np.ndarray
    way: jax.Array | np.ndarray
    elevation: jax.Array | np.ndarray


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Site:
    """What the simulation says of one place: elevations, and error of the way of the wheels, of a reference run."""

    duration: jax.Array
    elevations: Moments
    way_error: jax.Array
    way_variance: jax.Array


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Normal approximation about the maximum, of standardised unknowns: 0 is the prior's centre, 1 its spread."""

    mode: np.ndarray
    covariance: np.ndarray


def experiments_of(rows: Sequence[Row]) -> tuple[list[tuple[str, str]], Experiments]:
    """Place and number of every experiment, and its numbers. The floor indoors is level, its horizontal is its way."""
    names = [("level" if row["course"] == "level" else "slope", row["experiment"]) for row in rows]
    keys = [key for key in dict.fromkeys(names) if key[1] != "average"]
    courses, ways, elevations = [], [], []
    for key in keys:
        of = {row["sensor"]: row for row, name in zip(rows, names, strict=True) if name == key}
        first = next(iter(of.values()))
        way = float(number(first, "actual_way_m"))
        level = key[0] == "level"
        horizontal = way if level else float(number(first, "actual_horizontal_m"))
        rise = 0.0 if level else float(number(first, "actual_elevation_m"))
        courses.append((float(number(first, "time_s")), way, horizontal, rise))
        nan = float("nan")
        ways.append([float(number(of[chain], "way_m")) if chain in of else nan for chain in CHAINS])
        elevations.append([float(number(of[chain], "elevation_m")) if chain in of else nan for chain in CHAINS])
    duration, way, horizontal, rise = np.array(courses).T
    return keys, Experiments(
        course=Course(duration=duration, way=way, horizontal=horizontal, rise=rise),
        indoors=np.array([key[0] == "level" for key in keys]),
        way=np.array(ways),
        elevation=np.array(elevations),
    )


def sensors_of(unknowns: jax.Array, indoors: jax.Array | np.ndarray) -> Sensors:
    """The sensors that standardised unknowns (12,) stand for."""
    centre, spread = jnp.asarray([PRIORS[name] for name in NAMES], unknowns.dtype).T
    values = jnp.where(jnp.arange(len(NAMES)) == SCALE, centre + spread * unknowns, centre * jnp.exp(spread * unknowns))
    named = dict(zip(NAMES, values, strict=True))
    vibration = jnp.where(indoors, named.pop("vibration_indoors"), named.pop("vibration_outdoors"))
    return Sensors(vibration=vibration, **named)


def site_of(course: Course, found: Responses) -> Site:
    """The reference run's numbers that the likelihood needs."""
    error = found.at_zero[:, 2, 0] - course.way
    return Site(
        duration=course.duration,
        elevations=elevation_moments(found, course.rise),
        way_error=error.mean(),
        way_variance=error.var(),
    )


def log_likelihood(
    unknowns: jax.Array, experiment: Experiments, sites: tuple[Site, Site], draws: jax.Array
) -> jax.Array:
    """Logarithm of the density of one experiment's printed results; sites are outdoors and indoors."""
    course, indoors = experiment.course, experiment.indoors
    sensors = sensors_of(unknowns, indoors)
    site = jax.tree.map(lambda outside, inside: jnp.where(indoors, inside, outside), *sites)
    mean, covariance = _elevations(sensors, course, site)
    total = _normal(experiment.elevation - course.rise - mean, covariance)
    way = experiment.way
    mean_way = course.way * (1 + sensors.wheel_scale) + site.way_error
    variance = (course.way * sensors.wheel_spread) ** 2 + site.way_variance
    total += _normal(way[2:] - mean_way, variance[None, None])
    for i, chain in enumerate(CHAINS[:2]):
        drift, noise = getattr(sensors, f"{chain}_drift"), getattr(sensors, f"{chain}_noise")
        log_way = jnp.log(gyro_ways(course, drift, noise, draws))
        total += _normal(jnp.log(way[i : i + 1]) - log_way.mean(), log_way.var()[None, None])
    return total


def gyro_ways(course: Course, drift: jax.Array, noise: jax.Array, draws: jax.Array) -> jax.Array:
    """Ways (draws,) of an accelerometer and gyro; `draws` (draws, STEPS + 1, 2) are normal, two axes' drift first."""
    dt = course.duration / STEPS
    t = dt * (jnp.arange(STEPS) + 0.5)
    pace = course.way / (course.duration - RAMP)
    speed = pace * jnp.clip(jnp.minimum(t, course.duration - t) / RAMP, 0, 1)
    walk = noise / 2**0.5 * jnp.sqrt(dt) * _to_middle(draws[:, 1:])
    tilt = drift * draws[:, :1] * t[:, None] + walk
    error = GRAVITY * dt * _to_middle(tilt)
    return dt * jnp.sum(jnp.hypot(speed + error[..., 0], error[..., 1]), -1)


def _to_middle(steps: jax.Array) -> jax.Array:
    """Sums along the second axis up to the middle of each step, where the speed is taken too."""
    return jnp.cumsum(steps, 1) - steps / 2


def infer(experiments: Experiments, sites: tuple[Site, Site], key: jax.Array) -> tuple[Posterior, list[Posterior]]:
    """The posterior by all experiments, and for each experiment that by all others."""
    draws = jax.random.normal(key, (DRAWS // 2, STEPS + 1, 2))
    draws = jnp.concatenate([draws, -draws])

    def of_one(x: jax.Array, experiment: Experiments) -> jax.Array:
        return log_likelihood(x, experiment, sites, draws)

    @jax.jit
    def slopes_and_curvatures(x: jax.Array) -> tuple[jax.Array, jax.Array]:
        slopes = jax.vmap(jax.grad(of_one), (None, 0))(x, experiments)
        return slopes, jax.vmap(jax.hessian(of_one), (None, 0))(x, experiments)

    every = np.ones(experiments.indoors.size)
    of_all = _maximum(slopes_and_curvatures, every, np.zeros(len(NAMES)))
    without = every - np.eye(every.size)
    return of_all, [_maximum(slopes_and_curvatures, kept, of_all.mode) for kept in without]


def _maximum(
    slopes_and_curvatures: Callable[[np.ndarray], tuple[jax.Array, jax.Array]], kept: np.ndarray, start: np.ndarray
) -> Posterior:
    """Newton's method with curvatures made positive and no step longer than 1, to a tenth of a standard deviation."""
    x = start
    for _ in range(50):
        slopes, curvatures = slopes_and_curvatures(x)
        values, vectors = np.linalg.eigh(np.eye(x.size) - np.tensordot(kept, curvatures, 1))
        covariance = (vectors / np.maximum(values, 0.1)) @ vectors.T
        slope = kept @ np.asarray(slopes) - x
        move = covariance @ slope
        if move @ slope < 0.01:
            return Posterior(mode=x, covariance=covariance)
        x = x + move / max(np.linalg.norm(move), 1.0)
    raise RuntimeError(f"Newton's method has not converged from {start}: at {x} it would still move by {move}")


def _elevations(sensors: Sensors, course: Course, site: Site) -> tuple[jax.Array, jax.Array]:
    """Mean error (chains,) and covariance of the elevations of a run of this duration."""
    mean, covariance = elevation_errors(site.elevations, sensors)
    longer = course.duration / site.duration
    growth = longer ** jnp.array([GROWTH.get(name, 2.0) for name in SOURCES])
    return (
        growth @ mean + longer**2 * site.elevations.at_zero,
        jnp.einsum("s,sab->ab", growth**2, covariance) + longer**4 * site.elevations.covariance_at_zero,
    )


def _normal(error: jax.Array | np.ndarray, covariance: jax.Array) -> jax.Array:
    """Logarithm of a normal density of those elements that are finite."""
    known = jnp.isfinite(error)
    error = jnp.where(known, error, 0)
    both = known[:, None] & known[None, :]
    covariance = jnp.where(both, covariance, jnp.eye(error.size))
    lower = jnp.linalg.cholesky(covariance)
    scaled = jax.scipy.linalg.solve_triangular(lower, error, lower=True)
    return -scaled @ scaled / 2 - jnp.sum(jnp.log(jnp.diagonal(lower))) - known.sum() * jnp.log(2 * jnp.pi) / 2
