"""The simulated experiments of shirai2000 in small: chains against closed forms, inference against known answers."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from papers_repro.shirai2000 import inference
from papers_repro.shirai2000.bands import cells, uniformity
from papers_repro.shirai2000.budget import SOURCES, VIBRATION, Moments, elevation_errors, rectified
from papers_repro.shirai2000.claims import claims, repeated_errors, verdict
from papers_repro.shirai2000.experiments import CHAINS, GRAVITY, Course, Sensors, at_fractions, sample_count
from papers_repro.shirai2000.reproduce import FOLDER
from papers_repro.shirai2000.tables import read_tables

ROWS = read_tables(FOLDER / "tables.csv")
PASSAGE = Course(duration=jnp.array(20.0), way=jnp.array(10.0), horizontal=jnp.array(10.0), rise=jnp.array(0.0))
PERFECT = Sensors(**{name: jnp.zeros(()) for name in SOURCES})
KEYS = jax.random.split(jax.random.key(0), 16)


@pytest.fixture(scope="module")
def runs():
    """Arrivals (runs, chains, outputs) on the passage for given sensors."""
    one = partial(at_fractions, samples=sample_count(20.0), points=2)
    many = jax.jit(jax.vmap(one, (None, None, 0)))
    return lambda sensors: np.asarray(many(sensors, PASSAGE, KEYS))[:, -1]


@pytest.mark.slow
def test_perfect_gyros_find_the_passage_and_the_wheels_count_to_a_pulse(runs):
    found = runs(PERFECT)
    # The accelerometer's own noise, 5 ug/sqrt(Hz), leaves millimetres.
    np.testing.assert_allclose(found[:, :2], np.broadcast_to([10.0, 10.0, 0.0], (16, 2, 3)), atol=0.02)
    assert np.abs(found[:, 2, 0] - 10).max() < 1.04
    assert found[:, 2, 0].std() > 0.1


@pytest.mark.slow
def test_a_bias_stays_in_the_gyro_chains_alone(runs):
    sensors = replace(PERFECT, accelerometer_bias=jnp.array(1e-2))
    moved = runs(sensors) - runs(PERFECT)
    z = moved[:, :2, 2] / (1e-2 * 20.0**2 / 2)
    np.testing.assert_allclose(z[:, 0], z[:, 1], atol=1e-3)
    assert 0.5 < z.std() < 1.7 and np.abs(moved[:, :2, 1]).max() < 0.1
    assert np.abs(moved[:, 2, 2]).max() < 0.02 * np.abs(moved[:, 0, 2]).max()


@pytest.mark.slow
def test_vibration_is_rectified_by_the_closed_form(runs):
    moved = runs(replace(PERFECT, vibration=jnp.array(0.1))) - runs(PERFECT)
    # The shaking is as large as the pace is fast, so the ramps have less of it.
    np.testing.assert_allclose(moved[:, 2, 2].mean(), rectified(0.1, 20.0), rtol=0.15)
    assert np.abs(moved[:, :2, 2]).max() < 0.1 * moved[:, 2, 2].mean()


@pytest.mark.slow
def test_wheel_scale_lengthens_the_way_and_nothing_else(runs):
    moved = runs(replace(PERFECT, wheel_scale=jnp.array(0.01)))
    np.testing.assert_allclose(moved[:, 2, 0], 1.01 * runs(PERFECT)[:, 2, 0], rtol=1e-5)
    np.testing.assert_array_equal(moved[:, :2], runs(PERFECT)[:, :2])


def test_ways_of_gyros_spread_as_integrated_noise():
    """Small noise of density N moves the end by g N / sqrt(2) sqrt(T^5 / 20); none gives the way."""
    course = Course(duration=100.0, way=160.0, horizontal=160.0, rise=0.0)
    draws = jnp.asarray(np.random.default_rng(0).standard_normal((4000, inference.STEPS + 1, 2)))
    ways = inference.gyro_ways(course, jnp.array(0.0), jnp.array(1e-6), draws)
    expected = GRAVITY * 1e-6 / 2**0.5 * (100.0**5 / 20) ** 0.5
    # three standard deviations of a standard deviation from 4000 draws; steps counted in full would be 7 % too large
    np.testing.assert_allclose(ways.std(), expected, rtol=0.034)
    np.testing.assert_allclose(ways.mean(), 160.0, rtol=1e-3)


def test_density_of_elevations_leaves_out_what_was_not_printed():
    root = np.random.default_rng(1).standard_normal((3, 3))
    covariance = root @ root.T + np.eye(3)
    error = np.array([0.5, np.nan, -1.0])
    kept = np.ix_([0, 2], [0, 2])
    expected = multivariate_normal.logpdf(error[[0, 2]], cov=covariance[kept])
    ours = inference._normal(jnp.asarray(error), jnp.asarray(covariance))
    np.testing.assert_allclose(ours, expected, rtol=1e-5)
    slope = jax.grad(lambda c: inference._normal(jnp.asarray(error), c))(jnp.asarray(covariance))
    assert np.isfinite(slope).all()


def test_maximum_of_a_normal_density_and_without_an_experiment():
    """For linear data y_e = a_e x + noise of 1 and a prior of 1 the posterior is known."""
    a, y = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 2.0]]), np.array([1.0, -0.5, 0.7])

    def slopes_and_curvatures(x):
        return a * (y - a @ x)[:, None], -a[:, :, None] * a[:, None, :]

    for kept in (np.ones(3), np.array([1.0, 0.0, 1.0])):
        found = inference._maximum(slopes_and_curvatures, kept, np.zeros(2))
        precision = np.eye(2) + (a * kept[:, None]).T @ a
        np.testing.assert_allclose(found.covariance, np.linalg.inv(precision))
        # It stops within a tenth of a standard deviation.
        error = found.mode - np.linalg.solve(precision, (a * kept[:, None]).T @ y)
        assert error @ precision @ error < 0.01


def test_errors_of_sources_are_those_of_drawn_ones():
    rng = np.random.default_rng(2)
    z, n = rng.standard_normal((2, 400_000))
    linear, quadratic = z, np.full(z.size, 3.0)
    shape = (len(SOURCES), 3)
    of_source = np.arange(len(SOURCES))[:, None] == VIBRATION
    moments = Moments(
        linear=np.zeros(shape),
        quadratic=np.broadcast_to(of_source * quadratic.mean(), shape),
        linear_pairs=np.broadcast_to((of_source * np.mean(linear**2))[..., None], (*shape, 3)),
        quadratic_pairs=np.broadcast_to((of_source * np.mean(quadratic**2))[..., None], (*shape, 3)),
        at_zero=np.zeros(3),
        covariance_at_zero=np.zeros((3, 3)),
    )
    sensors = replace(PERFECT, vibration=jnp.array(0.3), vibration_spread=jnp.array(0.2))
    mean, covariance = elevation_errors(moments, sensors)
    level = 0.3 * np.exp(0.2 * n)
    drawn = level * linear + level**2 * quadratic
    np.testing.assert_allclose(mean.sum(0), drawn.mean(), rtol=0.01)
    np.testing.assert_allclose(jnp.einsum("saa->a", covariance), drawn.var(), rtol=0.02)


def test_experiments_hold_each_printed_number_once():
    names, experiments = inference.experiments_of(ROWS)
    assert len(names) == 20 and experiments.indoors.sum() == 5
    assert np.isfinite(experiments.way).sum() == np.isfinite(experiments.elevation).sum() == 33
    eighth = names.index(("slope", "8"))
    np.testing.assert_array_equal(experiments.elevation[eighth], [np.nan, -5.811, 3.683])
    assert experiments.course.rise[eighth] == -5.459 and experiments.course.duration[eighth] == 124.4


def test_percentiles_count_smaller_runs_and_half_of_equal_ones():
    names, _ = inference.experiments_of(ROWS)
    arrivals = np.zeros((20, 40, 3, 3))
    first = names.index(("level", "1"))
    arrivals[first, :10, CHAINS.index("vibration_gyro"), 0] = 10.384
    arrivals[first, 10:, CHAINS.index("vibration_gyro"), 0] = 11.0
    found = cells(ROWS, names, arrivals)
    assert len(found) == 33 * 3
    assert found[0].percentile == pytest.approx(0.125) and found[0].inside
    assert found[1].percentile == 1.0 and not found[1].inside
    even = [replace(found[0], percentile=(i + 0.5) / 50) for i in range(50)]
    assert uniformity(even) > 0.99
    assert uniformity([replace(cell, percentile=0.5) for cell in even]) < 1e-3


def test_claims_of_certain_errors_are_certain():
    _, experiments = inference.experiments_of(ROWS)
    course = experiments.course
    true = np.stack([course.way, course.horizontal, course.rise], -1)[:, None, None]
    # Errors in all quantities: speed sensor 1, fibre-optic gyro 2, vibration gyro 3 m.
    arrivals = true + np.array([3.0, 2.0, 1.0])[:, None] * np.ones((20, 5, 1, 3))
    paper = {
        "orders": [
            {"where": "a", "places": ["outdoors"], "quantities": ["way"], "best_first": [[c] for c in CHAINS[::-1]]},
            {"where": "b", "places": ["outdoors"], "quantities": ["way"], "best_first": [[c] for c in CHAINS]},
        ],
        "ratios": [
            {"where": "c", "place": "indoors", "better": "vehicle_speed", "worse": "vibration_gyro", "ratio": "2"}
        ],
    }
    found = claims(repeated_errors(experiments, arrivals), paper)
    assert [f.expected for f in found[:2]] == ["almost certain", "almost excluded"]
    # Three times is not about two.
    assert {f.expected for f in found[2:5]} == {"almost excluded"}
    assert all(f.expected == "speed sensor best: almost certain; worst: almost excluded" for f in found[5:])


@pytest.mark.parametrize(
    ("probability", "words"),
    [(0.95, "almost certain"), (0.8, "likely"), (0.5, "open"), (0.1, "unlikely"), (0.0, "almost excluded")],
)
def test_probabilities_in_words(probability: float, words: str) -> None:
    assert verdict(probability) == words
