"""Correlation of two series over lags, with gaps, and how much of it chance would give."""

from dataclasses import dataclass

import numpy as np

MAX_LAG = 90.0
"""Largest offset between two clocks that is looked for, in s."""

_NEAR = 1.5
# An overlap that is shorter holds less than a manoeuvre or two.
_SHORTEST = 15.0
# Speeds and courses of vehicles forget themselves in less; beyond it chance would only be counted as memory.
_MEMORY = 15.0


@dataclass(frozen=True, kw_only=True)
class Match:
    """How a series follows others, at the lag that fits best.

    Attributes
    ----------
    lag, lag_std : float
        By how many seconds the series is late, and its standard deviation.
    coefficients, coefficient_std : (k,)
        The series is about this combination of the others; attenuated by their noise.
    scale : (2,)
        Size of the series in that of the others: no less than the first, which the noise of the others attenuates, nor
        more than the second, which it would be if all that is left were theirs.
    correlation : float
        Between the series and the combination.
    score : float
        The correlation in standard deviations of what chance gives, independent samples counted.
    lags : (windows, 3)
        Middle, lag and its standard deviation of those parts of the record that tell a lag by themselves.
    """

    lag: float
    lag_std: float
    coefficients: np.ndarray
    coefficient_std: np.ndarray
    scale: tuple[float, float]
    correlation: float
    score: float
    lags: np.ndarray


def match(others: np.ndarray, series: np.ndarray, step: float) -> Match | None:
    """The lag within 90 s at which a series follows others best; None where they share too little.

    Parameters
    ----------
    others : (k, n)
        Series on a uniform grid; NaN where there is none.
    series : (n,)
        The one that should be a combination of them.
    step : float
        Of the grid, in s.

    Returns
    -------
    found : Match or None
        A lag near zero is taken unless another is better beyond chance.
    """
    found = _over_lags(others, series, step)
    if found is None:
        return None
    best = _best(found, step)
    if best is None:
        return None
    n = series.size
    inside = np.flatnonzero(np.isfinite(others).all(0))
    parts = []
    # Parts of 2.5 to 5 minutes hold manoeuvres enough; a clock that drifts smears longer ones.
    count = int(np.clip(inside.size * step / 150, 2, 12)) if inside.size else 0
    for part in np.array_split(inside, count) if count else []:
        only = np.full_like(others, np.nan)
        only[:, part] = others[:, part]
        low, high = max(part[0] - _samples(step), 0), min(part[-1] + _samples(step) + 1, n)
        piece = _over_lags(only[:, low:high], series[low:high], step)
        at = None if piece is None else _best(piece, step, best.lag)
        if at is not None and at.score > 3 and at.correlation > 0.8:
            parts.append((part.mean() * step, at.lag, at.lag_std))
    return Match(**(vars(best) | {"lags": np.array(parts).reshape(-1, 3)}))


@dataclass(frozen=True, kw_only=True)
class _Lags:
    lags: np.ndarray
    fit: np.ndarray
    """Squared correlation."""
    coefficients: np.ndarray
    gram: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray
    rate: float
    """Mean angular frequency of the series, in rad/s."""


def _samples(step: float) -> int:
    return int(MAX_LAG / step)


def _over_lags(others: np.ndarray, series: np.ndarray, step: float) -> _Lags | None:
    known, there = np.isfinite(others).all(0), np.isfinite(series)
    if known.sum() * step < _SHORTEST or there.sum() * step < _SHORTEST:
        return None
    x, y = np.where(known, others, 0), np.where(there, series, 0)
    k, n = x.shape
    reach = min(_samples(step), n - 1)
    size = 1 << int(n + reach).bit_length()

    def transform(a: np.ndarray) -> np.ndarray:
        return np.fft.rfft(a, size)

    def sums(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Of a(t) b(t + lag) over t, for lags from -reach to reach."""
        c = np.fft.irfft(np.conj(a) * b, size)
        return np.concatenate([c[..., size - reach :], c[..., : reach + 1]], -1)

    X, Y, there_f = transform(x), transform(y), transform(there.astype(float))
    rows, columns = np.triu_indices(k)
    products = sums(transform(x[rows] * x[columns]), there_f)
    gram = np.empty((2 * reach + 1, k, k))
    gram[:, rows, columns] = gram[:, columns, rows] = products.T
    cross = sums(X, Y).T
    count = sums(transform(known.astype(float)), there_f)
    square = sums(transform(known.astype(float)), transform(y * y))
    lags = np.arange(-reach, reach + 1) * step
    longest = min(known.sum(), there.sum())
    usable = (count * step > _SHORTEST) & (count > 0.4 * longest) & (square > 1e-9 * square.max())
    if not usable.any() or not np.trace(gram[usable].mean(0)) > 0:
        return None
    lags, gram, cross, count, square = lags[usable], gram[usable], cross[usable], count[usable], square[usable]
    # An axis that never moves has nothing to give.
    ridge = 1e-6 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(k)
    coefficients = np.linalg.solve(gram + ridge, cross[..., None])[..., 0]
    fit = np.clip((coefficients * cross).sum(-1) / square, 0, 1 - 1e-9)
    own = np.fft.irfft(np.abs(Y) ** 2, size)[: min(n // 2, int(_MEMORY / step))]
    # Samples that a slow series repeats are not independent.
    repeats = max(1 + 2 * float(((own[1:] / own[0]) ** 2).sum()), 1.0)
    slope = np.diff(y)[there[1:] & there[:-1]]
    rate = float(np.sqrt((slope**2).mean() / (y[there] ** 2).mean())) / step
    return _Lags(
        lags=lags,
        fit=fit,
        coefficients=coefficients,
        gram=gram,
        variance=square * (1 - fit),
        freedom=count / repeats,
        rate=rate,
    )


def _best(found: _Lags, step: float, expected: float = 0.0) -> Match | None:
    k = found.coefficients.shape[1]
    spare = np.maximum(found.freedom - k - 1, 0.5)
    # What k series explain of noise is taken off.
    fair = np.clip(1 - (1 - found.fit) * found.freedom / np.maximum(found.freedom - k, 1), 0, None)
    strength = np.arctanh(np.sqrt(fair))
    score = strength * np.sqrt(spare)
    at = int(score.argmax())
    near = np.flatnonzero(np.abs(found.lags - expected) <= _NEAR)
    if near.size:
        closest = near[score[near].argmax()]
        # Two correlations differ beyond chance by three standard deviations of their difference.
        if strength[at] - strength[closest] < 3 / np.sqrt(spare[at]):
            at = int(closest)
    if fair[at] == 0:
        return None
    shift = 0.0
    if 0 < at < score.size - 1 and found.lags[at + 1] - found.lags[at - 1] < 3 * step:
        before, here, after = found.fit[at - 1 : at + 2]
        bend = before - 2 * here + after
        shift = float(np.clip((before - after) / (2 * bend), -1, 1)) if bend < 0 else 0.0
    fit, freedom = float(found.fit[at]), max(float(found.freedom[at]), 1.0)
    size = float(np.linalg.norm(found.coefficients[at]))
    variance = found.variance[at] / max(freedom - k, 1) * np.linalg.pinv(found.gram[at])
    return Match(
        lag=float(found.lags[at]) + shift * step,
        lag_std=float(np.sqrt((1 - fit) / fit / freedom) / found.rate) + 0.05,
        coefficients=found.coefficients[at],
        coefficient_std=np.sqrt(np.abs(np.diagonal(variance))),
        scale=(size, size / fit),
        correlation=float(np.sqrt(fit)),
        score=float(score[at]),
        lags=np.zeros((0, 3)),
    )
