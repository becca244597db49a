"""Most probable noise levels, by the gradient of a likelihood, under a normal prior of their logarithms."""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.optimize import minimize

Levels = Mapping[str, float]

# Enough to come to the valley's floor; what is left is made up for by the next round about a better trajectory.
_STEPS, _TRIALS, _TOLERANCE = 12, 16, 1e-5


def likely_levels(
    log_likelihood: Callable[[dict[str, float]], tuple[float, Levels]],
    start: Levels,
    usual: Levels,
    spread: Levels,
    reach: float,
) -> tuple[dict[str, float], float]:
    """Levels of largest posterior probability, by L-BFGS on their logarithms.

    Parameters
    ----------
    log_likelihood : callable
        From levels by name to the logarithm of their likelihood and its derivative by each level.
    start : mapping of str to float
        Where to begin.
    usual : mapping of str to float
        The most probable levels beforehand.
    spread : mapping of str to float
        Standard deviation of the logarithm of each.
    reach : float
        How far logarithms may go from where they begin: a likelihood about a trajectory holds near the levels that
        it was found with.

    Returns
    -------
    levels : dict of str to float
        The levels.
    objective : float
        Minus the logarithm of the posterior probability there, less what does not depend on the levels.
    """
    names = list(start)
    centre = np.log([usual[name] for name in names])
    width = np.array([spread[name] for name in names])

    def misfit(x: np.ndarray) -> tuple[float, np.ndarray]:
        levels = dict(zip(names, np.exp(x).tolist(), strict=True))
        likelihood, slope = log_likelihood(levels)
        off = (x - centre) / width
        by_log = np.array([float(slope[name]) * levels[name] for name in names])
        return 0.5 * float(off @ off) - float(likelihood), off / width - by_log

    x0 = np.log([start[name] for name in names])
    found = minimize(
        misfit,
        x0,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(x0 - reach, x0 + reach, strict=True)),
        options={"maxiter": _STEPS, "maxfun": _TRIALS, "ftol": _TOLERANCE},
    )
    return dict(zip(names, np.exp(found.x).tolist(), strict=True)), float(found.fun)
