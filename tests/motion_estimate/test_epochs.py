"""Mean forces of epochs: equal to integrals, joined where that helps, and marked where something is missing."""

from collections.abc import Iterator
from dataclasses import replace

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.epochs import joined_epochs, uniform_forces
from altijax.recordings import Recording
from altijax.series import after_gap

GRAVITY = 9.80665


@pytest.fixture(scope="module", autouse=True)
def double_precision() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


def driven(*, seconds: float, rate: float, gnss_step: float, noise: float = 0.0, turning: float = 0.0) -> Recording:
    """Along East on level ground with a speed of 10 + 3 sin(t / 2) m/s, the body turning about its z."""
    t = np.arange(0, seconds, 1 / rate)
    a, angle = 1.5 * np.cos(0.5 * t), turning * t
    force = {"ax": a * np.cos(angle), "ay": -a * np.sin(angle), "az": np.full(t.size, GRAVITY)}
    epochs = np.arange(0.3, seconds - 0.3, gnss_step)
    rng = np.random.default_rng(3)
    v = {"v_e": 10 + 3 * np.sin(0.5 * epochs), "v_n": 0 * epochs, "v_u": 0 * epochs}
    gnss = pd.DataFrame(v, index=pd.Index(epochs + 2.0, name="t"))
    gnss += noise * rng.normal(size=gnss.shape)
    return Recording(name="driven", imu=pd.DataFrame(force, index=pd.Index(t + 2.0, name="t")), gnss=gnss)


def test_forces_are_means_over_the_epochs_across_blocks() -> None:
    epochs = joined_epochs(driven(seconds=200.0, rate=50.0, gnss_step=1.0), 0.0)
    ends = 3 * np.sin(0.5 * epochs.knots)
    exact = np.stack([np.diff(ends), 0 * ends[1:], np.full(ends.size - 1, GRAVITY)], -1)
    np.testing.assert_allclose(epochs.f_n, exact, atol=1e-12)
    np.testing.assert_allclose(epochs.f_b[10:-10], exact[10:-10], atol=1e-5)
    # The ends of a record do not meet.
    np.testing.assert_allclose(epochs.f_b, exact, atol=0.01)
    assert epochs.whole.all()


def test_a_delay_moves_the_epochs() -> None:
    recording = driven(seconds=60.0, rate=50.0, gnss_step=1.0)
    late = replace(recording, gnss=recording.gnss.set_index(recording.gnss.index + 0.2))
    np.testing.assert_allclose(joined_epochs(late, 0.2).f_b, joined_epochs(recording, 0.0).f_b, atol=1e-9)


def test_noisy_epochs_are_joined_and_those_in_which_the_body_turns_are_not() -> None:
    still = joined_epochs(driven(seconds=60.0, rate=50.0, gnss_step=0.1, noise=0.1), 0.0)
    assert np.median(np.diff(still.knots)) == pytest.approx(0.8)
    turning = joined_epochs(driven(seconds=60.0, rate=50.0, gnss_step=0.25, turning=6.0), 0.0)
    assert np.median(np.diff(turning.knots)) == pytest.approx(0.25)


def test_epochs_with_gaps_are_not_whole() -> None:
    recording = driven(seconds=60.0, rate=50.0, gnss_step=1.0)
    without = recording.imu[(recording.imu.index < 22.4) | (recording.imu.index > 22.7)]
    assert list(np.flatnonzero(~joined_epochs(replace(recording, imu=without), 0.0).whole)) == [20]
    without = recording.gnss[(recording.gnss.index < 30) | (recording.gnss.index > 33)]
    assert list(np.flatnonzero(~joined_epochs(replace(recording, gnss=without), 0.0).whole)) == [27]
    t = np.delete(np.arange(0, 1, 0.02), np.arange(10, 17))
    assert list(np.flatnonzero(after_gap(t, 0.02))) == [10]


def test_the_grid_has_the_usual_rate() -> None:
    recording = driven(seconds=10.0, rate=50.0, gnss_step=1.0)
    jitter = np.random.default_rng(0).uniform(-0.004, 0.004, len(recording.imu))
    t, f_b = uniform_forces(replace(recording, imu=recording.imu.set_index(recording.imu.index + jitter)))
    assert t.size == pytest.approx(500, rel=0.02) and f_b.shape == (t.size, 3)
    np.testing.assert_allclose(np.diff(t), 0.02, rtol=0.02)
