"""Allan deviation against allantools, its scatter against theory, and noise levels against simulations."""

from functools import partial

import allantools
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.calibration.allan import allan_covariance, allan_deviation, averaging_factors, fit_allan

SAMPLES, DT = 2**13, 0.01
FACTORS = averaging_factors(SAMPLES, per_decade=6)


def noise(level: tuple[float, float, float], repetitions: int) -> np.ndarray:
    """White noise, flicker shaped in the frequency domain, and a random walk."""
    rng = np.random.default_rng(0)
    shape = (repetitions, SAMPLES)
    series = level[0] / np.sqrt(2 * DT) * rng.normal(size=shape)
    series += level[2] * np.sqrt(DT) * np.cumsum(rng.normal(size=shape), 1)
    if level[1]:
        long = 4 * SAMPLES
        f = np.fft.rfftfreq(long, DT)
        f[0] = np.inf
        size = np.sqrt(level[1] ** 2 / (np.pi * f) * long / DT / 4)
        z = rng.normal(size=(repetitions, f.size)) + 1j * rng.normal(size=(repetitions, f.size))
        series += np.fft.irfft(size * z, long)[:, :SAMPLES]
    return series


deviations = jax.jit(lambda series: allan_deviation(series, DT, factors=FACTORS)[1])
fits = jax.jit(jax.vmap(partial(fit_allan, dt=DT, factors=FACTORS, samples=SAMPLES)))


def test_deviation_is_that_of_allantools() -> None:
    series = noise((1.0, 0.5, 0.3), 5) + 7.0
    tau, deviation = jnp.asarray(FACTORS) * DT, deviations(series)
    for i in range(5):
        _, expected, _, _ = allantools.oadev(series[i], rate=1 / DT, data_type="freq", taus=np.asarray(tau))
        np.testing.assert_allclose(deviation[i], expected, rtol=1e-9)


@pytest.mark.parametrize(("power", "level"), [(0, (1.0, 0.0, 0.0)), (-1, (0.0, 1.0, 0.0)), (-2, (0.0, 0.0, 1.0))])
def test_degrees_of_freedom_are_greenhalls(power: int, level: tuple[float, float, float]) -> None:
    covariance = allan_covariance(jnp.array(level), DT, factors=FACTORS, samples=SAMPLES)
    tau = jnp.asarray(FACTORS) * DT
    variance = jnp.stack([0.5 / tau, jnp.full_like(tau, 2 * np.log(2) / np.pi), tau / 3], -1) @ jnp.square(
        jnp.array(level)
    )
    freedom = 2 * variance**2 / jnp.diag(covariance)
    for i in range(8, len(FACTORS), 3):  # short averages differ: he counts continuous noise
        expected = allantools.edf_greenhall(power, 2, FACTORS[i], SAMPLES + 1, overlapping=True, modified=False)
        assert freedom[i] == pytest.approx(expected, rel=0.06)


def test_covariance_is_the_scatter_of_simulations() -> None:
    level = (1.0, 1.0, 0.5)
    variances = np.asarray(deviations(noise(level, 300))) ** 2
    expected = allan_covariance(jnp.array(level), DT, factors=FACTORS, samples=SAMPLES)
    pairs = [4, 8, 12, 14]
    seen = np.cov(variances[:, pairs].T)
    sizes = np.sqrt(np.outer(*[np.diag(np.asarray(expected))[pairs]] * 2))
    np.testing.assert_allclose(seen / sizes, np.asarray(expected)[np.ix_(pairs, pairs)] / sizes, atol=0.25)


@pytest.mark.parametrize(("level", "known"), [((1.0, 2.0, 0.0), (0, 1)), ((1.0, 0.0, 2.0), (0, 2))])
def test_intervals_hold_the_levels(level: tuple[float, float, float], known: tuple[int, int]) -> None:
    fit = fits(deviations(noise(level, 200)))
    inside = np.abs(np.asarray(fit.level) - level) < 1.96 * np.asarray(fit.std)
    for i in known:
        assert np.mean(fit.determined[:, i]) > 0.97
        assert 0.91 <= inside[:, i].mean() <= 0.985, i
    assert np.all(np.mean(np.asarray(fit.upper) >= level, 0) > 0.93)


def test_too_short_a_record_says_so() -> None:
    fit = fits(deviations(noise((1.0, 0.0, 0.01), 5)))
    assert fit.determined[:, 0].all() and not fit.determined[:, 2].any()
    assert np.all(fit.level - 1.96 * fit.std < 1e-9, where=~np.asarray(fit.determined))


def test_averaging_factors() -> None:
    assert averaging_factors(1000, per_decade=1) == (1, 10, 100)
    assert averaging_factors(5) == (1,)
    with pytest.raises(ValueError, match="factors must be from 1 to 4, half of the 9 samples"):
        allan_deviation(jnp.zeros(9), 0.1, factors=(1, 5))
