"""Delays against simulation, where the truth is known, and a real drive."""

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.delays import estimate_delay
from altijax.recordings import read_recording

TRUE = 0.16


def simulated(runs, rate, duration, seed, delay=TRUE, gnss_std=0.03, noise=0.05):
    """Accelerations of 1 m/s^2 RMS below 2 Hz, a slope that walks, white noise; velocities of white noise, late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 0.02)
    f = np.fft.rfftfreq(t.size, 0.02)
    amplitude = np.where((f > 0.01) & (f < 2), 1 / (1 + (f / 0.3) ** 2), 0)
    spectrum = amplitude * (rng.standard_normal((2, runs, f.size)) * np.array([1, 1j])[:, None, None]).sum(0)
    spectrum /= np.fft.irfft(spectrum, t.size).std()
    w = 2j * np.pi * np.where(f > 0, f, 1)
    step = round(50 / rate)
    v = np.fft.irfft(spectrum / w * np.exp(-w * delay), t.size)[:, ::step]
    v = v + gnss_std * rng.standard_normal(v.shape)
    slope = np.cumsum(0.02 * np.sqrt(0.02) * rng.standard_normal((runs, t.size)), -1)
    a = np.fft.irfft(spectrum, t.size) + slope + noise / np.sqrt(0.02) * rng.standard_normal((runs, t.size))
    return t, a[:, None], t[::step], v[:, None]


estimate = jax.jit(jax.vmap(estimate_delay, in_axes=(None, 0, None, 0)))


@pytest.mark.parametrize(("rate", "rms"), [(1, 0.015), (10, 0.008)])
def test_delay_is_found_within_its_error_bar(rate, rms):
    found = estimate(*simulated(60, rate, 60, 0))
    error = np.asarray(found.delay) - TRUE
    assert np.sqrt(np.mean(error**2)) < rms
    assert abs(error.mean()) < 0.3 * rms
    # 95 % would be 57; a minute of 1 Hz tells the correlation of the misfit only roughly, and 89 % were found over 100
    assert np.mean(np.abs(error) < 1.96 * np.asarray(found.std)) > 0.8
    assert np.median(found.std) > 0.5 * np.std(error)
    assert not found.ambiguous.any()


def test_what_does_not_tell_the_delay_is_flagged():
    """No relation at all, and a wave whose period fits into the range twice."""
    t, a, t_gnss, v = simulated(20, 1, 60, 1)
    assert np.mean(estimate(t, a, t_gnss, np.roll(v, 1, axis=0)).ambiguous) > 0.9
    wave = 2 * np.pi / 0.8
    found = estimate_delay(t, np.cos(wave * t)[None], t[::5], np.sin(wave * (t[::5] - TRUE))[None] / wave)
    assert found.ambiguous
    still = estimate_delay(t, 0 * a[0], t_gnss, 0 * v[0])
    assert still.ambiguous and np.isfinite(still.delay) and still.std > 0.5


def test_missing_velocities_and_wrong_scale_do_not_matter_much():
    t, a, t_gnss, v = simulated(1, 10, 60, 2)
    v = 1.1 * v
    v[0, 0, 100:140] = np.nan
    found = estimate_delay(t, a[0], t_gnss, v[0])
    assert found.delay == pytest.approx(TRUE, abs=0.03)
    assert found.correlation > 0.98


def test_a_real_receiver_is_late(data_dir):
    """By 0.16 s, as another method found with gravity taken off; here only its part below 0.1 Hz is."""
    with pytest.warns(Warning, match="cut short"):
        recording = read_recording(data_dir / "comma2k19-example")
    imu, gnss = recording.imu, recording.gnss
    assert isinstance(gnss, pd.DataFrame)
    speed = np.hypot(gnss["v_e"], gnss["v_n"]).to_numpy()
    found = estimate_delay(imu.index.to_numpy(), imu["ax"].to_numpy()[None], gnss.index.to_numpy(), speed[None])
    assert found.delay == pytest.approx(0.16, abs=0.05)
    assert not found.ambiguous
    assert abs(found.delay - 0.16) < 2 * found.std
