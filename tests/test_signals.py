"""Series in time against numpy, scipy and closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, signal

from altijax import signals as s

RNG = np.random.default_rng(0)
UNIFORM = 3.0 + np.arange(400) * 0.01
JITTERED = np.cumsum(0.005 + 0.01 * RNG.random(400))
WALK = np.cumsum(RNG.normal(size=(2, 400)), -1)


def test_derivative_is_numpys() -> None:
    np.testing.assert_allclose(
        s.derivative(JITTERED, WALK), np.gradient(WALK, JITTERED, axis=-1, edge_order=2), rtol=1e-9, atol=1e-9
    )


def test_integral_is_scipys_and_undone_by_nothing_lost() -> None:
    expected = integrate.cumulative_trapezoid(WALK, JITTERED, initial=0)
    np.testing.assert_allclose(s.cumulative_integral(JITTERED, WALK), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("cutoff", [0.3, 1.0, 5.0, 20.0])
def test_low_pass_is_filtfilt(cutoff: float) -> None:
    """The same poles, run forward and backward over the same odd reflection; far from its pad's end to rounding."""
    b, a = signal.butter(2, cutoff, fs=100)
    expected = signal.filtfilt(b, a, WALK, padlen=399)
    # scipy's pad is one reflection long, and what it starts from has decayed by exp(-sqrt(2) pi cutoff T) over it
    tolerance = 1e-9 + 30 * np.exp(-np.sqrt(2) * np.pi * cutoff * 3.99)
    np.testing.assert_allclose(s.low_pass(UNIFORM, WALK, cutoff), expected, rtol=0, atol=tolerance)


def test_low_pass_keeps_lines_and_halves_the_cutoff() -> None:
    line = 2.0 - 0.5 * UNIFORM
    np.testing.assert_allclose(s.low_pass(UNIFORM, line, 0.1), line, atol=1e-13)
    t = np.arange(2001) * 0.01
    wave = np.sin(2 * np.pi * 2.0 * t)
    np.testing.assert_allclose(s.low_pass(t, wave, 2.0), 0.5 * wave, atol=1e-10)


@pytest.mark.parametrize("cutoff", [50.0, 1e6, np.inf])
def test_low_pass_above_the_nyquist_frequency_does_nothing(cutoff: float) -> None:
    np.testing.assert_allclose(s.low_pass(UNIFORM, WALK, cutoff), WALK, atol=1e-11)
    assert np.isfinite(jax.grad(lambda c: s.low_pass(UNIFORM, WALK, c).sum())(cutoff))


def test_low_pass_commutes_with_constants() -> None:
    """A bias may be taken off before or after: calibration relies on it."""
    shifted = s.low_pass(UNIFORM, WALK + 5.0, 1.0)
    np.testing.assert_allclose(shifted, s.low_pass(UNIFORM, WALK, 1.0) + 5.0, atol=1e-11)


def test_axis_of_time() -> None:
    vectors = RNG.normal(size=(5, 400, 3))
    for function in (s.derivative, s.cumulative_integral, lambda t, x, axis: s.low_pass(t, x, 1.0, axis)):
        expected = np.moveaxis(np.asarray(function(UNIFORM, np.moveaxis(vectors, 1, -1), -1)), -1, 1)
        np.testing.assert_allclose(function(UNIFORM, vectors, -2), expected, atol=1e-12)


def test_resampling_is_linear_interpolation_with_a_mask() -> None:
    t_samples = np.array([0.0, 0.1, 0.2, 0.7, 0.8])
    values = np.array([1.0, 2.0, 0.0, 5.0, 6.0])
    t = np.array([-0.1, 0.0, 0.05, 0.2, 0.3, 0.69, 0.7, 0.75, 0.8, 0.9])
    resampled, valid = s.resample(t, t_samples, values, 0.2)
    np.testing.assert_allclose(resampled, np.interp(t, t_samples, values), atol=1e-15)
    assert valid.tolist() == [False, True, True, True, False, False, True, True, True, False]


def test_resampling_survives_repeated_stamps_and_one_sample() -> None:
    resampled, valid = s.resample([0.0, 0.5, 1.0], [0.0, 0.5, 0.5, 1.0], [0.0, 1.0, 3.0, 4.0], 1.0)
    assert np.isfinite(resampled).all() and valid.all()
    held, valid = s.resample([0.0, 1.0], [0.0], [7.0], 1.0)
    assert held.tolist() == [7.0, 7.0] and valid.tolist() == [True, False]
    slope = jax.grad(lambda shift: s.resample(jnp.array([0.55]) + shift, UNIFORM - 3, WALK[0], 0.1)[0].sum())(0.003)
    np.testing.assert_allclose(slope, (WALK[0, 56] - WALK[0, 55]) / 0.01, rtol=1e-9)


def test_resampling_on_the_samples_still_has_a_slope() -> None:
    """A delay is fitted from zero, where every time asked for lies on a sample: the slope of the interval before it."""
    t = np.arange(7.0)
    slopes = jax.jacfwd(lambda delay: s.resample(t + delay, t, t**2, 2.0)[0])(0.0)
    np.testing.assert_allclose(slopes[1:], np.diff(t**2), atol=1e-12)
    assert s.resample(t, t, t**2, 0.5)[1].all()


@pytest.mark.parametrize("n", [8, 9, 200, 201])
def test_fourier_reconstruction_is_exact_for_harmonics(n: int) -> None:
    """A trigonometric polynomial below half the sampling rate is found again, value and mean."""
    t = 5.0 + 0.02 * np.arange(n)
    period = 0.02 * n
    rng = np.random.default_rng(n)
    k = np.arange(1, (n - 1) // 2 + 1)
    a, b = rng.normal(size=(2, k.size)) / k
    w = 2 * np.pi * k / period

    def value(x: np.ndarray) -> np.ndarray:
        x = np.asarray(x)[..., None] - 5.0
        return 0.7 + np.sum(a * np.cos(w * x) + b * np.sin(w * x), -1)

    def integral(x: np.ndarray) -> np.ndarray:
        x = np.asarray(x)[..., None] - 5.0
        return 0.7 * x[..., 0] + np.sum((a * np.sin(w * x) - b * np.cos(w * x)) / w, -1)

    new = 5.0 + period * rng.uniform(-0.5, 1.5, 40)
    np.testing.assert_allclose(s.fourier_reconstruction(t, value(t), new), value(new), atol=1e-12)
    edges = np.sort(new)
    means = s.fourier_interval_means(t, value(t), edges)
    np.testing.assert_allclose(means, np.diff(integral(edges)) / np.diff(edges), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("n", [50, 51])
def test_fourier_reconstruction_passes_through_any_samples(n: int) -> None:
    t, values = np.arange(n) * 0.02, np.random.default_rng(1).normal(size=n)
    np.testing.assert_allclose(s.fourier_reconstruction(t, values, t), values, atol=1e-13)


def test_fourier_means_are_those_of_scipys_dense_resampling() -> None:
    """scipy resamples by the same polynomial; the midpoint rule on 256 points a sample is the oracle."""
    n, dense = 100, 256
    t, values = np.arange(n) * 0.02, np.random.default_rng(2).normal(size=n)
    fine = signal.resample(values, n * dense)
    # trapezoid over [0.5 s, 1.5 s] on the dense grid
    span = fine[25 * dense : 75 * dense + 1]
    expected = np.trapezoid(span) / (span.size - 1)
    np.testing.assert_allclose(s.fourier_interval_means(t, values, [0.5, 1.5]), [expected], rtol=0, atol=1e-6)


def test_fourier_mean_over_the_period_is_the_mean_and_over_nothing_the_value() -> None:
    t, values = np.arange(60) * 0.02, np.random.default_rng(3).normal(size=60)
    np.testing.assert_allclose(s.fourier_interval_means(t, values, [0.3, 1.5]), [values.mean()], atol=1e-14)
    np.testing.assert_allclose(s.fourier_interval_means(t, values, [0.4, 0.4]), [values[20]], atol=1e-13)


def test_fourier_means_of_an_hour_fit_in_memory() -> None:
    """64 intervals at a time: 3600 x 90001 harmonics at once would be 2.6 GB a table."""
    lowered = jax.jit(s.fourier_interval_means).lower(
        jax.ShapeDtypeStruct((180_000,), float),
        jax.ShapeDtypeStruct((180_000,), float),
        jax.ShapeDtypeStruct((3601,), float),
    )
    assert lowered.compile().memory_analysis().temp_size_in_bytes < 400e6


def test_interval_means_are_integrals_of_straight_lines() -> None:
    edges = np.sort(np.r_[JITTERED[0], RNG.uniform(JITTERED[0], JITTERED[-1], 30), JITTERED[50], JITTERED[51]])
    merged = np.sort(np.r_[JITTERED, edges])
    area = integrate.cumulative_trapezoid(np.interp(merged, JITTERED, WALK[0]), merged, initial=0)
    expected = np.diff(np.interp(edges, merged, area)) / np.diff(edges)
    np.testing.assert_allclose(s.interval_means(JITTERED, WALK[0], edges), expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(s.interval_means(JITTERED, WALK, [-9.0, -8.0, -8.0]), WALK[:, :1] + np.zeros(2))


def test_extended_ends_do_not_ring() -> None:
    """A ramp and a wave: repeated as it is it jumps at the ends. Means of the wave alone are the truth."""
    t = np.arange(501) * 0.02
    edges = np.arange(0.0, 10.01, 1.0)
    values = 3.0 + 0.4 * t + np.sin(1.7 * t)
    truth = 3.0 + 0.2 * (edges[1:] + edges[:-1]) - np.diff(np.cos(1.7 * edges)) / 1.7
    t_long, long, line = s.periodic_extension(t, values)
    assert t_long.size == 1000
    np.testing.assert_allclose(long[:501] + line, values, atol=1e-13)
    mended = s.fourier_interval_means(t_long, long, edges) + np.interp((edges[1:] + edges[:-1]) / 2, t, line)
    np.testing.assert_allclose(mended, truth, atol=2e-4)
    between = t[:-1] + 0.01
    wave = 3.0 + 0.4 * between + np.sin(1.7 * between)
    assert np.abs(s.fourier_reconstruction(t, values, between) - wave).max() > 0.1
    rest = s.fourier_reconstruction(t_long, long, between) + np.interp(between, t, line)
    np.testing.assert_allclose(rest, wave, atol=1e-3)
    np.testing.assert_allclose(s.interval_means(t, values, edges), truth, atol=2e-4)


def test_plain_and_fourier_means_differ_little_on_what_is_band_limited() -> None:
    """By a hundredth of a degree of 9.8 m/s^2 over a second at 50 Hz; Fourier's are exact."""
    n = 1000
    t = np.arange(n) * 0.02
    k = np.arange(1, 60)
    phase = RNG.uniform(0, 2 * np.pi, k.size)
    w = 2 * np.pi * k / (0.02 * n)
    values = np.sum(np.cos(w * t[:, None] + phase), -1) / np.sqrt(k.size / 2)
    edges = np.arange(0.0, 19.5, 1.0) + 0.007
    area = np.sum(np.sin(w * edges[:, None] + phase) / w, -1) / np.sqrt(k.size / 2)
    np.testing.assert_allclose(s.fourier_interval_means(t, values, edges), np.diff(area), atol=1e-12)
    difference = np.abs(s.interval_means(t, values, edges) - np.diff(area)).max()
    assert 1e-9 < difference < np.radians(0.01) * 9.8


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: s.derivative([0.0, 1.0], [0.0, 1.0]), "t must have at least 3 samples, got 2"),
        (lambda: s.low_pass([0.0], [0.0], 1.0), "t must have at least 2 samples, got 1"),
        (lambda: s.cumulative_integral([0.0, 1.0], [0.0, 1.0, 2.0]), r"values must have shape \(\.\.\., 2\)"),
        (lambda: s.resample([0.0], [0.0, 1.0], [0.0], 1.0), "as t_samples has"),
        (lambda: s.fourier_interval_means([0.0], [0.0], [0.0, 1.0]), "at least 2 samples"),
    ],
)
def test_what_does_not_fit_is_named(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
