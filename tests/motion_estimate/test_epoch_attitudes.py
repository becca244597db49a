"""Attitudes of single epochs: as far from the truth as they say, held where one tells nothing; and the delay."""

from collections.abc import Iterator
from dataclasses import replace

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.epoch_attitudes import delay_by_epochs, epoch_attitudes, epoch_estimate
from altijax.motion_estimate.epochs import joined_epochs
from altijax.recordings import Recording

GRAVITY = 9.80665
PRESUMED = (0.0, 0.1)
TILT = np.radians(3.0)


@pytest.fixture(scope="module", autouse=True)
def double_precision() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def drive() -> Recording:
    return car(delay=0.15)


def car(*, delay: float, lean: float = 0.0) -> Recording:
    """Bends at a changing speed on a level road, the IMU pitched by 3 degrees; `lean` 1 has no lateral force."""
    t = np.arange(0, 90, 0.02)
    speed = 12 + 4 * np.sin(0.4 * t) + np.sin(1.3 * t)
    gained, rate = 1.6 * np.cos(0.4 * t) + 1.3 * np.cos(1.3 * t), 0.25 * np.cos(0.5 * t)
    yaw = 0.5 * np.sin(0.5 * t)
    roll = lean * np.arctan2(-speed * rate, GRAVITY)
    across = speed * rate
    f = np.stack(
        [gained, across * np.cos(roll) + GRAVITY * np.sin(roll), GRAVITY * np.cos(roll) - across * np.sin(roll)], -1
    )
    # nose up: gravity pushes forward
    x, z = f[:, 0] * np.cos(TILT) + f[:, 2] * np.sin(TILT), f[:, 2] * np.cos(TILT) - f[:, 0] * np.sin(TILT)
    rng = np.random.default_rng(5)
    f = np.stack([x, f[:, 1], z], -1) + 0.2 * rng.normal(size=f.shape)
    index = pd.Index(t + 3.0, name="t")
    velocity = {"v_e": speed * np.cos(yaw), "v_n": speed * np.sin(yaw), "v_u": 0 * t}
    reference = pd.DataFrame(
        {"roll": roll, "pitch": TILT, "heading": np.mod(np.pi / 2 - yaw, 2 * np.pi)} | velocity, index=index
    )
    epochs = np.arange(0.4, 89.0, 1.0)
    gnss = {name: np.interp(epochs, t, series) for name, series in velocity.items()}
    gnss = pd.DataFrame(gnss, index=pd.Index(epochs + 3.0 + delay, name="t")) + 0.05 * rng.normal(size=(epochs.size, 3))
    return Recording(
        name="car",
        imu=pd.DataFrame(dict(zip(("ax", "ay", "az"), f.T, strict=True)), index=index),
        gnss=gnss,
        reference=reference,
    )


def errors(estimate: pd.DataFrame, recording: Recording, name: str) -> pd.Series:
    error = estimate[name] - recording.reference[name]
    return ((error + np.pi) % (2 * np.pi) - np.pi)[estimate["valid"]] if name in ("roll", "pitch", "heading") else error


def test_attitudes_and_velocities_are_as_far_off_as_they_say(drive: Recording) -> None:
    estimate = epoch_estimate(drive, None, PRESUMED)
    for name, most in {"roll": 0.02, "pitch": 0.02, "heading": 0.05, "v_e": 0.15, "v_n": 0.15}.items():
        error = errors(estimate, drive, name)
        stated = np.sqrt(np.mean(estimate[f"{name}_std"] ** 2))
        assert np.sqrt(np.mean(error**2)) < min(most, 1.5 * stated), name
    assert np.isfinite(estimate.to_numpy(float)).all()


def test_the_delay_is_found_where_the_body_keeps_level(drive: Recording) -> None:
    delay, std = delay_by_epochs(drive, PRESUMED)
    assert abs(delay - 0.15) < 3 * std < 0.1


def test_the_delay_is_presumed_where_it_cannot_be_told(drive: Recording) -> None:
    few = replace(drive, gnss=drive.gnss.iloc[:8])
    assert delay_by_epochs(few, PRESUMED) == PRESUMED
    steady = replace(drive, gnss=drive.gnss * 0 + 10.0, imu=drive.imu * 0 + [0.0, 0.0, GRAVITY])
    assert delay_by_epochs(steady, PRESUMED) == PRESUMED


def test_an_unknown_delay_widens_the_bars(drive: Recording) -> None:
    epochs = joined_epochs(drive, 0.15)
    known, unknown = epoch_attitudes(epochs, 0.0), epoch_attitudes(epochs, 0.2)
    np.testing.assert_allclose(known.C_nb, unknown.C_nb, atol=1e-9)
    assert np.mean(unknown.variance[:, 1]) > 2 * np.mean(known.variance[:, 1])


def test_an_epoch_that_lacks_something_has_the_attitude_before_it(drive: Recording) -> None:
    epochs = joined_epochs(drive, 0.15)
    whole = epochs.whole.copy()
    whole[[20, 21]] = False
    held = epoch_attitudes(replace(epochs, whole=whole), 0.0)
    np.testing.assert_allclose(held.C_nb[20:22], held.C_nb[[19, 19]], atol=1e-12)
    assert (np.diff(held.variance[19:22], axis=0) > 0).all()


def test_the_course_is_held_where_the_vehicle_stands_and_grows_uncertain(drive: Recording) -> None:
    gnss = drive.gnss.copy()
    gnss.iloc[40:60] = 0.0
    epochs = joined_epochs(replace(drive, gnss=gnss), 0.15)
    assert (epochs.course_of[42:58] == epochs.course_of[42]).all()
    variance = epoch_attitudes(epochs, 0.0).variance[:, 2]
    assert variance[57] > variance[45] > variance[30]


def test_a_velocity_that_was_never_measured_is_unknown(drive: Recording) -> None:
    estimate = epoch_estimate(replace(drive, gnss=drive.gnss.assign(v_u=np.nan)), (0.15, 0.0), PRESUMED)
    assert (estimate["v_u_std"] >= 100).all() and (estimate["v_e_std"] < 1).all()
