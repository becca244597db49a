"""From a recording to arrays: which stream serves for what, and what is said when one is missing."""

import dataclasses

import boule
import jax
import numpy as np
import pandas as pd
import pytest

from altijax import drives
from altijax.constants import STANDARD_GRAVITY
from tests.exact import EXACT


def test_gravity_comes_from_gnss_then_site_then_the_standard() -> None:
    gnss = EXACT.gnss.assign(lat=np.degrees(0.7), alt=100.0)
    site = dataclasses.replace(EXACT, site_latitude=0.5, site_height=300.0)
    assert drives.gravity_at(EXACT) == STANDARD_GRAVITY
    of = boule.WGS84.normal_gravity
    by_gnss = drives.gravity_at(dataclasses.replace(site, gnss=gnss))
    assert by_gnss == pytest.approx(of((0, np.degrees(0.7), 100.0), si_units=True), abs=1e-6)
    assert drives.gravity_at(site) == pytest.approx(of((0, np.degrees(0.5), 300.0), si_units=True), abs=1e-6)


def rate(**changes: object) -> np.ndarray:
    with jax.enable_x64(True):
        return np.asarray(drives.drive_arrays(dataclasses.replace(EXACT, **changes), turns=True)[0].yaw_rate)


def test_rate_of_turn_is_the_wheels_else_the_gyros() -> None:
    truth = EXACT.imu["gz"].to_numpy()
    np.testing.assert_allclose(rate(), truth, atol=1e-3)
    np.testing.assert_allclose(rate(track_width=None), truth, atol=1e-15)
    # the wheels go first: half the track width, twice the rate
    np.testing.assert_allclose(rate(track_width=EXACT.track_width / 2), 2 * truth, atol=2e-3)
    rear = EXACT.wheel.rename(columns={"left": "rear_left", "right": "rear_right"})
    np.testing.assert_array_equal(rate(wheel=rear), rate())


def test_turns_without_a_rate_are_warned_of() -> None:
    with pytest.warns(UserWarning, match="'exact' has no rate of turn"):
        none = rate(imu=EXACT.imu[["ax", "ay", "az"]], wheel=EXACT.wheel[["speed"]], track_width=None)
    assert not none.any()
    drive, _ = drives.drive_arrays(dataclasses.replace(EXACT, imu=EXACT.imu[["ax", "ay", "az"]]), turns=False)
    assert not drive.yaw_rate.any()


def test_arrays_are_uniform_and_count_from_the_first_sample() -> None:
    with jax.enable_x64(True):
        drive, t = drives.drive_arrays(EXACT, turns=False)
    np.testing.assert_allclose(np.diff(drive.t), 0.02, rtol=1e-9)
    np.testing.assert_array_equal(t, EXACT.imu.index)
    np.testing.assert_allclose(drive.f, EXACT.imu[["ax", "ay", "az"]], atol=1e-9)
    assert drive.from_wheel and drive.supported.all()


K = np.arange(6000)
EVERY_10_MS = (K + 1) * 0.01
AT_ONCE = (K // 20 + 1) * 0.2 + (K % 20) * 1e-4


def test_bursts_are_spread_over_the_time_since_the_one_before() -> None:
    """Rows that carry the time they arrived, 20 within 2 ms, then 0.2 s of nothing."""
    assert drives.usual_step(AT_ONCE) == pytest.approx(0.01, rel=0.01)
    np.testing.assert_allclose(drives.without_bursts(AT_ONCE), EVERY_10_MS, atol=0.005)
    # across a gap neither the rows before nor those behind it are moved into it
    gapped = AT_ONCE + 30.0 * (K >= 3000)
    np.testing.assert_allclose(drives.without_bursts(gapped), EVERY_10_MS + 30.0 * (K >= 3000), atol=0.005)
    assert drives.usual_step(gapped) == pytest.approx(0.01, rel=0.01)


def test_ordinary_times_are_as_they_are() -> None:
    """Jitter, lost rows and gaps are no bursts: the median interval counts."""
    rng = np.random.default_rng(0)
    jittered = EVERY_10_MS + 0.004 * rng.uniform(-1, 1, K.size)
    for t in (EVERY_10_MS, jittered, jittered[rng.random(K.size) > 0.4], jittered + 900.0 * (K >= 3000)):
        assert drives.without_bursts(t) is t
        assert drives.usual_step(t) == np.median(np.diff(t))


def test_elevation_of_bursts_is_that_of_even_rows() -> None:
    last = np.append(np.arange(20, len(EXACT.imu), 20), len(EXACT.imu)) - 1
    arrived = EXACT.imu.index.to_numpy()[last[np.searchsorted(last, np.arange(len(EXACT.imu)))]]
    late = EXACT.imu.set_index(pd.Index(arrived + 1e-5 * (np.arange(len(EXACT.imu)) % 20), name="t"))
    burst, _ = drives.drive_arrays(dataclasses.replace(EXACT, imu=late), turns=False)
    even, _ = drives.drive_arrays(EXACT, turns=False)
    shift = late.index[0] - EXACT.imu.index[0]
    inside = (burst.t + shift < 59.5) & (burst.t > 0.5)
    expected = np.interp(burst.t + shift, even.t, even.f[:, 0])
    np.testing.assert_allclose(burst.f[inside, 0], expected[inside], atol=0.02)


def test_a_grid_too_long_is_refused() -> None:
    imu = EXACT.imu.copy()
    imu.index = np.append(imu.index[:-1], 1e6)
    with pytest.raises(ValueError, match="'exact' is 1e\\+06 s long with 50 IMU samples a second"):
        drives.drive_arrays(dataclasses.replace(EXACT, imu=imu), turns=False)


def test_wheel_speed_goes_before_gnss_speed() -> None:
    np.testing.assert_array_equal(drives.speed_readings(EXACT)[1], EXACT.wheel["speed"])
    _, ground = drives.speed_readings(dataclasses.replace(EXACT, wheel=None))
    np.testing.assert_array_equal(ground, np.hypot(EXACT.gnss["v_e"], EXACT.gnss["v_n"]))


def test_missing_streams_are_named() -> None:
    with pytest.raises(ValueError, match="'exact' has neither wheel speeds nor GNSS velocities"):
        drives.speed_readings(dataclasses.replace(EXACT, wheel=None, gnss=None))
    for imu in (None, EXACT.imu.iloc[:2]):
        with pytest.raises(ValueError, match="'exact' has no IMU stream of at least 3 samples"):
            drives.imu_of(dataclasses.replace(EXACT, imu=imu))
    with pytest.raises(ValueError, match="'exact' has no reference heights"):
        drives.reference_heights(dataclasses.replace(EXACT, reference=None))


def test_reference_heights_are_those_within_the_imus_span() -> None:
    longer = EXACT.reference.copy()
    longer.index = longer.index * 1.5 - 10.0
    t, heights = drives.reference_heights(dataclasses.replace(EXACT, reference=longer))
    assert t.min() >= 0 and t.max() <= 60 and t.size == heights.size < len(longer)
