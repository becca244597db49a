"""Constants of the elevation methods, fitted to reference heights."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.records import Calibration, prior_constants
from altijax.drives import Drive, drive_arrays, reference_heights, start_of
from altijax.elevation_estimate.estimates import require_method
from altijax.elevation_estimate.model import NOMINAL, PARAMETERS, UNCERTAINTY, elevation, uncertain_constants
from altijax.elevation_estimate.posterior import Posterior, elevation_posterior
from altijax.least_squares import Fit, levenberg_marquardt
from altijax.recordings import Recording

# A direction of the parameters that the data see a hundred times less well than another.
_BLIND = 1e-2


def calibrate(
    recordings: Recording | Iterable[Recording],
    parameters: str | Iterable[str],
    *,
    method: str,
    until: float | None = None,
) -> Calibration:
    """Constants that bring a method's estimate closest to the reference, in least squares.

    Parameters
    ----------
    recordings : Recording or several
        With a reference of the quantity estimated (``alt``); the constants are common to them, a height offset is free
        in each.
    parameters : str or several
        Names of `PARAMETERS`; the others keep their nominal values.
    method : {"slope", "shirai", "fused"}
        Method to calibrate. With "fused" the constants begin at their priors, and the noise of the drive is found
        beside them.
    until : float, optional
        Last time, on the recordings' time axis, whose reference may be used; all of it by default. Afterwards the
        reference only measures what the calibration is worth there (``held_out``).

    Returns
    -------
    calibration : Calibration
        Values, standard deviations and correlations, and the misfit before and after. The standard deviations count
        neighbouring residuals as one observation as far as they are correlated; drift slower than what was fitted is
        not in them.

    Raises
    ------
    ValueError
        If a name is unknown, a parameter changes nothing in this method, or the reference is missing or too short.

    Warns
    -----
    UserWarning
        If the data cannot tell some of the parameters apart.
    """
    require_method(method)
    recordings = [recordings] if isinstance(recordings, Recording) else list(recordings)
    names = [parameters] if isinstance(parameters, str) else list(parameters)
    unknown = sorted(set(names) - set(PARAMETERS.index))
    if unknown or not names or not recordings or len(set(names)) < len(names):
        raise ValueError(
            f"parameters must be different names out of {', '.join(PARAMETERS.index)}, for one recording or more; "
            f"got {', '.join(names) or 'none'} for {len(recordings)} recording(s)"
        )
    if "initial_vertical_speed" in names and len(recordings) > 1:
        raise ValueError("initial_vertical_speed belongs to one recording: calibrate it on one alone")
    with jax.enable_x64(True):
        drives = [drive_arrays(recording, turns=method != "slope")[0] for recording in recordings]
        references = [reference_heights(recording) for recording in recordings]
        end = np.inf if until is None else until
        fitted = [t[t <= end - start_of(r)].size for r, (t, _) in zip(recordings, references, strict=True)]
        if min(fitted) < 3 or sum(fitted) < len(names) + len(recordings) + 1:
            raise ValueError(
                f"{len(names)} parameter(s) need more reference than {sum(fitted)} height(s) up to until={until}"
            )
        if method == "fused":
            return _calibrate_fused(recordings, drives, references, fitted, names)
        targets = [(t[:n], heights[:n]) for (t, heights), n in zip(references, fitted, strict=True)]
        others = [name for name in uncertain_constants(drives[0], method) if name not in names]
        if len(drives) > 1:
            others = [name for name in others if name != "initial_vertical_speed"]  # each recording has its own
        fit, residuals, full_jacobian = _fit(drives, targets, tuple(names), tuple(others), method)
        jacobian = np.asarray(full_jacobian)[:, : len(names)]
        _require_effect(names, jacobian, method)
        _warn_of_what_cannot_be_told_apart(names, jacobian)
        covariance = np.asarray(fit.covariance) * _residual_variance(np.asarray(residuals), fitted)
        constants = _named(fit.x, tuple(names))
        errors = [
            [np.asarray(_error(of, drive, target, method)) for of in ({}, constants)]
            for drive, target in zip(drives, references, strict=True)
        ]
        held_out = _held_out(recordings, references, fitted, errors)
    deviation = np.sqrt(np.diag(covariance))
    absorbed = -np.linalg.lstsq(jacobian, np.asarray(full_jacobian)[:, len(names) :])[0]
    units = PARAMETERS["uncertainty"]
    return Calibration(
        method=method,
        values=pd.Series({name: float(value) for name, value in constants.items()}, name="value"),
        std=units[names].rename("std") * deviation,
        correlation=pd.DataFrame(covariance / np.outer(deviation, deviation), index=names, columns=names),
        absorbed=pd.DataFrame(absorbed, names, others).mul(units[names], axis=0).div(units[others], axis=1),
        held_out=held_out,
    )


def _calibrate_fused(
    recordings: list[Recording],
    drives: list[Drive],
    references: list[tuple[np.ndarray, np.ndarray]],
    fitted: list[int],
    names: list[str],
) -> Calibration:
    """One drive after the other, each beginning with what the ones before have left."""
    idle = [name for name in names if name not in uncertain_constants(drives[0], "fused")]
    if idle:
        raise ValueError(f"{', '.join(idle)}: not a constant of method 'fused' on these recordings; leave it out")

    def after(drive: Drive, calibration: Calibration | None, known: tuple | None) -> Posterior:
        return elevation_posterior(drive, prior_constants(drive, "fused", calibration), "fused", known)

    calibration = None
    for drive, (t, heights), n in zip(drives, references, fitted, strict=True):
        constants = after(drive, calibration, (t[:n], heights[:n])).constants
        # Each drive has its own vertical speed at the start; the other constants are nominal in the calibration.
        others = [x for x in constants.names if x not in (*names, "initial_vertical_speed")]
        pick, rest = ([constants.names.index(x) for x in group] for group in (names, others))
        across = constants.covariance[np.ix_(rest, pick)]
        absorbed = np.linalg.solve(constants.covariance[np.ix_(rest, rest)], across).T
        nominal = np.array([NOMINAL[name] for name in others])
        covariance = constants.covariance[np.ix_(pick, pick)] - absorbed @ across
        std = np.sqrt(np.diag(covariance))
        calibration = Calibration(
            method="fused",
            values=pd.Series(constants.mean[pick] + absorbed @ (nominal - constants.mean[rest]), names, name="value"),
            std=pd.Series(std, names, name="std"),
            correlation=pd.DataFrame(covariance / np.outer(std, std), names, names),
            absorbed=pd.DataFrame(absorbed, names, others),
            held_out=pd.DataFrame(),
        )
    assert calibration is not None  # there is at least one drive
    errors = [
        [np.interp(t, drive.t, after(drive, of, None).series["elevation"]) - heights for of in (None, calibration)]
        for drive, (t, heights) in zip(drives, references, strict=True)
    ]
    return replace(calibration, held_out=_held_out(recordings, references, fitted, errors))


def _held_out(
    recordings: list[Recording],
    references: list[tuple[np.ndarray, np.ndarray]],
    fitted: list[int],
    errors: list[list[np.ndarray]],
) -> pd.DataFrame:
    """Misfit on what was fitted and on the rest, for errors with nominal and with fitted constants."""
    rows = []
    for recording, (t, _), n, (nominal, best) in zip(recordings, references, fitted, errors, strict=True):
        rest = n < nominal.size
        rows.append(
            {
                "recording": recording.name,
                "until": t[n - 1] + start_of(recording),
                "fitted_nominal": np.std(nominal[:n]),
                "fitted": np.std(best[:n]),
                "held_out_nominal": np.std(nominal[n:]) if rest else np.nan,
                "held_out": np.std(best[n:]) if rest else np.nan,
            }
        )
    return pd.DataFrame.from_records(rows, index="recording")


def _named(x: jax.Array, names: tuple[str, ...]) -> dict[str, jax.Array]:
    """Constants by name, from their deviations from nominal in units of their uncertainty."""
    return {name: NOMINAL.get(name, 0.0) + UNCERTAINTY[name] * x[i] for i, name in enumerate(names)}


@partial(jax.jit, static_argnames=("names", "others", "method"))
def _fit(
    drives: list[Drive],
    targets: list[tuple[jax.Array, jax.Array]],
    names: tuple[str, ...],
    others: tuple[str, ...],
    method: str,
) -> tuple[Fit, jax.Array, jax.Array]:
    """Least squares over all drives, with residuals and Jacobian (by `names`, then `others`) at the minimum."""

    def residuals(values: dict[str, jax.Array]) -> jax.Array:
        errors = [_error(values, drive, target, method) for drive, target in zip(drives, targets, strict=True)]
        return jnp.concatenate([error - jnp.mean(error) for error in errors])

    fit = levenberg_marquardt(lambda x: residuals(_named(x, names)), jnp.zeros(len(names)))
    best = _named(fit.x, names)
    if "initial_vertical_speed" in others:
        best["initial_vertical_speed"] = elevation(best, drives[0], method)["vertical_speed"][0]
    start = NOMINAL | best
    both = names + others

    def around_best(y: jax.Array) -> jax.Array:
        return residuals({name: start[name] + UNCERTAINTY[name] * y[i] for i, name in enumerate(both)})

    return fit, residuals(best), jax.jacfwd(around_best)(jnp.zeros(len(both)))


@partial(jax.jit, static_argnames="method")
def _error(values: dict[str, jax.Array], drive: Drive, target: tuple[jax.Array, jax.Array], method: str) -> jax.Array:
    """Estimate less reference at the reference's times."""
    t, heights = target
    return jnp.interp(t, drive.t, elevation(values, drive, method)["elevation"]) - heights


def _residual_variance(residuals: np.ndarray, counts: Sequence[int]) -> float:
    """Variance of the residuals, times the number of neighbours that count as one for their correlation."""
    together = 0.0
    for part in np.split(residuals, np.cumsum(counts)[:-1]):
        n = part.size
        spectrum = np.abs(np.fft.rfft(part, 2 * n)) ** 2
        correlation = np.fft.irfft(spectrum)[:n] / max(float(part @ part), np.finfo(float).tiny)
        first_zero = int(np.argmax(correlation <= 0)) or n
        together += n * (2 * correlation[:first_zero].sum() - 1)
    return float(residuals @ residuals) / residuals.size * together / residuals.size


def _require_effect(names: list[str], jacobian: np.ndarray, method: str) -> None:
    idle = [name for name, column in zip(names, jacobian.T, strict=True) if not column.any()]
    if idle:
        raise ValueError(f"{', '.join(idle)}: changes nothing in method {method!r} on these recordings; leave it out")


def _warn_of_what_cannot_be_told_apart(names: list[str], jacobian: np.ndarray) -> None:
    """Name the parameters that a nearly blind direction mixes."""
    _, singular, directions = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), full_matrices=False)
    for value, direction in zip(singular, directions, strict=True):
        if value < _BLIND * singular[0]:
            mixed = [name for name, part in zip(names, direction, strict=True) if abs(part) > 0.3]
            warnings.warn(
                f"these data hardly tell {' and '.join(mixed)} apart: a combination of them is determined, the single "
                "values are not; leave one out",
                stacklevel=3,
            )
