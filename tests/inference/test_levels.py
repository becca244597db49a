"""Noise levels against the posterior of a normal sample, whose maximum is known."""

import numpy as np
import pytest
from scipy.optimize import brentq

from altijax.inference.levels import likely_levels

SQUARES, COUNT = 90.0, 10


def likelihood(levels: dict[str, float]) -> tuple[float, dict[str, float]]:
    """Of `COUNT` samples whose squares sum up to `SQUARES`; a second level that nothing tells of."""
    sigma = levels["sigma"]
    value = -COUNT * np.log(sigma) - 0.5 * SQUARES / sigma**2
    return value, {"sigma": -COUNT / sigma + SQUARES / sigma**3, "idle": 0.0}


def found(spread: float, reach: float = 5.0) -> dict[str, float]:
    usual, spreads = {"sigma": 1.0, "idle": 2.0}, {"sigma": spread, "idle": 1.0}
    return likely_levels(likelihood, {"sigma": 1.0, "idle": 3.0}, usual, spreads, reach)[0]


@pytest.mark.parametrize("spread", [0.1, 1.0, 100.0])
def test_the_maximum_of_the_posterior_is_found(spread: float) -> None:
    log = brentq(lambda x: -COUNT + SQUARES * np.exp(-2 * x) - x / spread**2, -5, 5)
    levels = found(spread)
    assert levels["sigma"] == pytest.approx(np.exp(log), rel=1e-2)
    assert levels["idle"] == pytest.approx(2.0, rel=1e-2)


def test_a_round_goes_no_farther_than_it_may() -> None:
    assert found(100.0, reach=0.5)["sigma"] == pytest.approx(np.exp(0.5))
