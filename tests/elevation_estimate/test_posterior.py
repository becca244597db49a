"""Elevation given all that is known: on an exact drive with planted constants, and over simulated drives."""

from dataclasses import replace

import numpy as np
import pytest

from altijax.drives import Drive, drive_arrays, reference_heights
from altijax.elevation_estimate import model as model
from altijax.elevation_estimate.posterior import Posterior, elevation_posterior
from altijax.elevation_estimate.priors import prior_constants
from altijax.samples.hilly_drives import errors_and_bars, hilly_drive
from tests.exact import EXACT

T, HEIGHTS = reference_heights(EXACT)


@pytest.fixture(scope="module")
def drive() -> Drive:
    """With a forward bias of 0.2 m/s^2 and a car that squats by 6 %."""
    exact = drive_arrays(EXACT, turns=True)[0]
    return replace(exact, f=exact.f * np.array([1.06, 1.0, 1.0]) + np.array([0.2, 0.0, 0.0]))


def posterior(drive: Drive, method: str, known: np.ndarray | None) -> Posterior:
    heights = None if known is None else (T[known], HEIGHTS[known])
    return elevation_posterior(drive, prior_constants(drive, method), method, heights)


def errors(found: Posterior, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
    at = {name: np.interp(T, drive.t, found.series[name]) for name in ("elevation", "elevation_std")}
    return at["elevation"] - (HEIGHTS - HEIGHTS[0]), at["elevation_std"]


@pytest.mark.parametrize("method", ["slope", "shirai", "fused"])
def test_heights_of_the_ends_close_the_profile(drive: Drive, method: str) -> None:
    """There the error is the survey's; between it is within three of the bars, which are smaller than without."""
    free, bar = errors(posterior(drive, method, None), drive)
    closed, closed_bar = errors(posterior(drive, method, np.array([0, T.size - 1])), drive)
    assert abs(closed[-1]) < 0.1 and closed_bar[-1] < 0.1
    assert np.sqrt(np.mean(closed**2)) < np.sqrt(np.mean(free**2))
    assert (np.abs(closed) <= 3 * closed_bar + 0.02).mean() > 0.95
    assert closed_bar[1:].max() < bar[1:].max()


def test_fused_finds_the_constants(drive: Drive) -> None:
    """Half a drive of heights tells how the car squats and what the slope form is off by; it then holds."""
    found = posterior(drive, "fused", np.flatnonzero(T <= 30))
    values = dict(zip(found.constants.names, found.constants.mean, strict=True))
    assert values["weight_transfer"] + values["accelerometer_scale_x"] + values["accelerometer_scale"] - 2 == (
        pytest.approx(0.06, abs=0.02)
    )
    error, bar = errors(found, drive)
    assert np.sqrt(np.mean(error[T > 30] ** 2)) < 0.2
    assert (np.abs(error) <= 2 * bar + 0.02).mean() > 0.9


def test_a_common_height_changes_nothing(drive: Drive) -> None:
    known = (T[::100], HEIGHTS[::100])
    constants = prior_constants(drive, "slope")
    low = elevation_posterior(drive, constants, "slope", known)
    high = elevation_posterior(drive, constants, "slope", (known[0], known[1] + 3000.0))
    np.testing.assert_allclose(low.series["elevation"], high.series["elevation"], atol=1e-6)


@pytest.mark.parametrize(
    ("method", "known", "tolerance"),
    [("slope", None, 1e-12), ("shirai", [0, -1], 1e-9), ("fused", None, 1e-6), ("fused", [0, 99, -1], 1e-6)],
)
def test_filling_of_knots_changes_nothing(
    drive: Drive, method: str, known: list[int] | None, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sixty seconds have 31 knots, which the verbs fill up to 33.

    In the update, with variances from 1e-8 to 1e6 m^2, rounding grows: readings changed by 1e-15 move "fused" as much.
    """
    heights = None if known is None else np.arange(T.size)[known]
    filled = posterior(drive, method, heights)
    monkeypatch.setattr("altijax.elevation_estimate.posterior._LEAST_STEPS", 30)
    plain = posterior(drive, method, heights)
    for name, series in plain.series.items():
        scale = np.abs(series).max()
        np.testing.assert_allclose(filled.series[name], series, rtol=0, atol=tolerance * scale, err_msg=name)
    std = np.sqrt(np.diag(plain.constants.covariance))
    np.testing.assert_allclose(filled.constants.mean, plain.constants.mean, rtol=0, atol=10 * tolerance * std.max())
    scale = np.outer(std, std) + 1e-30
    between = (filled.constants.covariance - plain.constants.covariance) / scale
    np.testing.assert_allclose(between, 0, atol=100 * tolerance)


def test_the_error_bar_is_that_of_many_instruments(drive: Drive) -> None:
    """200 drives with constants drawn from what they may be off by: their spread is the stated one."""
    prior = prior_constants(drive, "slope")
    stated = elevation_posterior(drive, prior, "slope").series["elevation_std"]
    certain = replace(prior, covariance=0 * prior.covariance)
    road = elevation_posterior(drive, certain, "slope").series["elevation_std"]
    draws = np.random.default_rng(0).multivariate_normal(prior.mean, prior.covariance, 200)
    heights = [model.elevation(dict(zip(prior.names, x, strict=True)), drive, "slope")["elevation"] for x in draws]
    spread = np.std(heights, 0)
    # three standard deviations of a standard deviation from 200 draws are 15 %
    np.testing.assert_allclose(np.hypot(spread, road)[500::500], stated[500::500], rtol=0.15)


@pytest.mark.slow
def test_bars_cover_simulated_drives() -> None:
    """Nine drives of unknown constants; benchmarks/elevation.py does it with 210, and tighter."""
    known = ("none", "ends", "first third")
    found = [errors_and_bars(hilly_drive(seed), known[seed % 3]) for seed in range(9)]
    ratios = [np.abs(error) / std for error, std in found]
    within = np.concatenate(ratios)
    assert 0.4 < (within <= 1).mean() < 0.95
    assert (within <= 2).mean() > 0.75
