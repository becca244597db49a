"""Elevation on a simulated drive whose truth is exact, and on damaged copies of it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax import estimates
from altijax.constants import STANDARD_GRAVITY
from altijax.elevation_estimate.model import ELEVATION_METHODS
from altijax.programs import count_programs
from tests.exact import EXACT, exact_drive

COLUMNS = ["elevation", "elevation_std", "way", "horizontal", "vertical_speed", "valid"]


@pytest.mark.parametrize("method", ELEVATION_METHODS)
def test_ideal_sensors_find_the_elevation(method: str) -> None:
    """Within what the 1 Hz low pass leaves of starts and stops in 5 s; Shirai's with its remainder (v w_y)^2 / 2g.

    Fused does not know that they are ideal: it finds constants that make the road more level, as roads are.
    """
    estimate = estimates.estimate_elevation(EXACT, method=method)
    score = estimates.score_elevation(estimate, EXACT)
    assert score["relief"] > 5
    assert score["rms"] < {"slope": 0.001, "shirai": 1.0, "fused": 2.0}[method]
    assert list(estimate.columns) == COLUMNS
    assert estimate.index.equals(EXACT.imu.index)
    assert np.isfinite(estimate.drop(columns="valid").to_numpy()).all()
    assert estimate["valid"].all() and estimate["elevation"].iloc[0] == 0
    if method != "fused":  # which looks back from the end
        assert (estimate["elevation_std"].diff().dropna() > -0.05).all()
    assert (estimate["horizontal"] <= estimate["way"] + 1e-9).all()


def test_shirai_errs_by_its_remainder_and_by_nothing_else() -> None:
    """On curved hills Eq. (1) is too large by (v w_y)^2 / 2g: twice integrated, that is its whole error."""
    estimate = estimates.estimate_elevation(EXACT, method="shirai")
    imu, speed = EXACT.imu, np.interp(EXACT.imu.index, EXACT.wheel.index, EXACT.wheel["speed"])
    dt = 0.02
    remainder = (speed * imu["gy"]) ** 2 / (2 * STANDARD_GRAVITY)
    predicted = np.cumsum(np.cumsum(remainder)) * dt**2
    truth = np.interp(imu.index, EXACT.reference.index, EXACT.reference["alt"] - EXACT.reference["alt"].iloc[0])
    np.testing.assert_allclose(estimate["elevation"] - truth, predicted, atol=0.1)
    assert predicted.iloc[-1] > 0.5


def test_estimates_do_not_look_at_the_reference_or_at_gnss_heights() -> None:
    wrong = EXACT.reference * np.nan
    gnss = EXACT.gnss.assign(alt=np.linspace(-500, 500, len(EXACT.gnss)), lat=40.0)
    for method in ELEVATION_METHODS:
        with_heights = estimates.estimate_elevation(dataclasses.replace(EXACT, gnss=gnss), method=method)
        other = dataclasses.replace(EXACT, reference=wrong, gnss=gnss.assign(alt=gnss["alt"].to_numpy()[::-1]))
        pd.testing.assert_frame_equal(estimates.estimate_elevation(other, method=method), with_heights)
        none = dataclasses.replace(EXACT, reference=None, gnss=gnss)
        pd.testing.assert_frame_equal(estimates.estimate_elevation(none, method=method), with_heights)


def test_coverage_is_of_heights_above_the_start_whatever_part_is_scored() -> None:
    """A metre off from the first second on, with bars of 0.8 m, is within two of them, and its later RMS is none."""
    truth = np.interp(EXACT.imu.index, EXACT.reference.index, EXACT.reference["alt"])
    moved = np.clip(EXACT.imu.index.to_numpy(), 0.0, 1.0)
    estimate = pd.DataFrame(
        {"elevation": truth - truth[0] + moved, "elevation_std": 0.8 * moved, "way": truth}, index=EXACT.imu.index
    )
    for after in (None, 30.0):
        score = estimates.score_elevation(estimate, EXACT, after=after)
        assert (score["within_1_std"], score["within_2_std"]) == (0.0, 1.0)
    assert score["rms"] < 0.01


def test_gnss_speed_serves_where_there_is_no_wheel() -> None:
    """Ground speed is less than the way's by the cosine of the slope: 0.2 % at 6 %."""
    without = dataclasses.replace(EXACT, wheel=None)
    score = estimates.score_elevation(estimates.estimate_elevation(without, method="slope"), without)
    assert score["rms"] < 0.1


def test_epoch_times_lose_no_digits() -> None:
    for method in ELEVATION_METHODS:
        now = estimates.estimate_elevation(EXACT, method=method)
        epoch = estimates.estimate_elevation(exact_drive(start=1_700_000_000.0), method=method)
        np.testing.assert_allclose(epoch["elevation"], now["elevation"], atol=1e-4)
        assert epoch.index[0] == 1_700_000_000.0


def test_double_precision_whatever_the_flag_says() -> None:
    expected = estimates.estimate_elevation(EXACT, method="shirai")
    with jax.enable_x64(False):
        single = estimates.estimate_elevation(EXACT, method="shirai")
        assert jnp.asarray(1.0).dtype == np.float32
    pd.testing.assert_frame_equal(single, expected)


@pytest.mark.parametrize("method", ELEVATION_METHODS)
def test_recordings_of_half_a_minute_to_a_minute_and_a_half_share_their_programs(method: str) -> None:
    estimates.estimate_elevation(EXACT, method=method)
    with count_programs() as programs:
        for last in (30.0, 41.7, 59.3):
            cut = {name: getattr(EXACT, name).loc[:last] for name in ("imu", "wheel", "gnss", "reference")}
            estimates.estimate_elevation(dataclasses.replace(EXACT, **cut), method=method)
    assert programs.names == []


def test_gaps_are_bridged_and_flagged() -> None:
    holes = dataclasses.replace(
        EXACT,
        imu=EXACT.imu[(EXACT.imu.index < 40) | (EXACT.imu.index > 42)],
        wheel=EXACT.wheel[(EXACT.wheel.index > 2) & ((EXACT.wheel.index < 15) | (EXACT.wheel.index > 20))],
    )
    estimate = estimates.estimate_elevation(holes, method="slope")
    assert np.isfinite(estimate.drop(columns="valid").to_numpy()).all()
    valid = estimate["valid"]
    assert not valid[valid.index < 1.9].any() and not valid[(valid.index > 15.1) & (valid.index < 19.9)].any()
    assert valid[(valid.index > 2.1) & (valid.index < 14.9)].all() and valid[valid.index > 42.1].all()
    # 5 s at 12 m/s of a slope that could be 5 %
    full = estimates.estimate_elevation(EXACT, method="slope")["elevation_std"]
    added = np.sqrt((estimate["elevation_std"] ** 2 - full**2).clip(lower=0))
    assert added.loc[14.0] < 0.3 and added.loc[21.0] == pytest.approx(0.05 * 12 * 5, rel=0.3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: estimates.estimate_elevation(EXACT, method="shiray"),
            "method must be one of shirai, slope, fused, got 'shiray'",
        ),
        (
            lambda: estimates.estimate_elevation(dataclasses.replace(EXACT, wheel=None, gnss=None)),
            "'exact' has neither wheel speeds nor GNSS velocities",
        ),
        (lambda: estimates.estimate_elevation(dataclasses.replace(EXACT, imu=None)), "'exact' has no IMU stream"),
        (
            lambda: estimates.score_elevation(estimates.estimate_elevation(EXACT), EXACT, after=99.0),
            "no reference heights after 99.0 s",
        ),
    ],
)
def test_what_cannot_be_done_is_said(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
