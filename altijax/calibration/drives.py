"""Calibration from ordinary driving: delays, wheel scale, biases and mounting from IMU, GNSS Doppler and wheels.

No reference is asked: the sensors are made to agree. The noise of each kind of observation is taken from its own
residuals, with neighbours counted as one as far as they are correlated, and the fit repeated; large residuals count
less (Huber). A parameter that the drive does not determine keeps its prior and is said to.
"""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import jax
import numpy as np
import pandas as pd
from jax.typing import ArrayLike
from scipy.spatial.transform import Rotation

from altijax.calibration.drive_model import DRIVE_PARAMETERS, GROUPS, STEP, Stretch, drive_residuals, own_states
from altijax.calibration.identifiability import describe_undetermined, identify_information
from altijax.calibration.parameters import require_parameters
from altijax.calibration.records import Calibration, constants_table, held_out_row, held_out_table, noise_levels
from altijax.calibration.serial_correlation import statistical_inefficiency
from altijax.calibration.shared_parameters import SharedFit, fit_shared
from altijax.drives import gravity_at, imu_of, start_of, wheel_pair
from altijax.padding import bucket, padded
from altijax.recordings import Recording
from altijax.series import means_between
from altijax.stages import stages

STRETCH = 20.0
"""Length of a stretch, s: long enough for a turn, short enough for the kicks of the IMU's noise to stay few."""

NOT_CONVERGED = "The fit did not converge: values and bars are not to be trusted."

NOISE = {"gyro": 2e-4, "accelerometer": 5e-3, "receiver": 0.02}
"""Assumed noise densities of the IMU on the road, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz), one-sided: consumer MEMS twice
over, as vibration adds to it; and the error of the receiver's velocity that lasts as long as a stretch, m/s."""

# First guesses of the observations' noise, m/s, in the order of GROUPS; the fit replaces them. No less than the last.
_FIRST_STD, _LEAST_STD = (0.1, 0.2, 0.05, 0.1, 0.1, 0.1), 0.005
# Margin of a stretch and bin of the wheel speeds, s.
_MARGIN, _BIN = 0.5, 0.1
_TURN_STD, _VELOCITY_STD = 0.5, 5.0
# What stretches, and epochs and wheel speeds of each, are filled up to, or doubles of it: 192 stretches for an hour,
# 104 epochs for a receiver of 5 Hz; the wheels' bins are never more.
_LEAST_STRETCHES, _LEAST_EPOCHS, _LEAST_SAMPLES = 3, 26, round(STRETCH / _BIN) + 1


def calibrate_driving(
    recordings: Sequence[Recording], names: Sequence[str], *, method: str, until: float | None = None
) -> Calibration:
    """Constants of IMU, wheels and GNSS from ordinary driving, without a reference.

    Parameters
    ----------
    recordings : sequence of Recording
        Each with six-axis IMU and GNSS velocities (with climb, as far as there is one) of one car, and its wheel speeds
        if there are any, best one by one; what concerns wheels that were not recorded stays undetermined.
    names : sequence of str
        Names out of `DRIVE_PARAMETERS`; the others stay nominal.
    method : {"drive"}
        Name of the method.
    until : float, optional
        Last time, on the recordings' time axis, used for the fit; the stretches after it are held out.

    Returns
    -------
    calibration : Calibration
        ``held_out`` has the residuals of each kind of observation on the stretches that were held out, in units of the
        noise that was found.

    Raises
    ------
    ValueError
        If a stream is missing, or a drive is shorter than a stretch.
    """
    stretches, starts = zip(*(_of_recording(recording) for recording in recordings), strict=True)
    fitted = np.concatenate(starts) + STRETCH <= (np.inf if until is None else until)
    calibration, sizes = _calibrated(_stacked(stretches), names, fitted)
    together = ", ".join(recording.name for recording in recordings)
    end = max(float(imu_of(recording).index[-1]) for recording in recordings)
    interval = min(start_of(recording) for recording in recordings), end if until is None else until, end
    rows = [held_out_row(together, kind, "1", interval, [np.nan, np.nan], pair) for kind, pair in sizes.items()]
    return replace(calibration, method=method, held_out=held_out_table(rows))


def calibrate_stretches(stretches: Stretch, parameters: Sequence[str] | None = None) -> Calibration:
    """The same from stretches of data, as `drive_stretches` makes them.

    Parameters
    ----------
    stretches : Stretch
        Stacked stretches.
    parameters : sequence of str, optional
        Names out of `DRIVE_PARAMETERS`; all by default.

    Returns
    -------
    calibration : Calibration
        Nothing is held out.

    Raises
    ------
    ValueError
        If a name is unknown or nothing is to be fitted.
    """
    names = require_parameters(DRIVE_PARAMETERS if parameters is None else parameters, "drive")
    return _calibrated(stretches, names, np.ones(stretches.f.shape[0], bool))[0]


def _calibrated(
    stretches: Stretch, names: Sequence[str], fitted: np.ndarray
) -> tuple[Calibration, dict[str, list[float]]]:
    """The fit to some stretches, and the residuals of each kind on the others with nominal and with fitted values."""
    if not fitted.any():
        raise ValueError(f"no stretch of {STRETCH:g} s lies before the end of the fit")
    names = list(names)
    prior = np.array([constant.nominal for constant in DRIVE_PARAMETERS.values()])
    prior_std = np.array([name in names and constant.spread for name, constant in DRIVE_PARAMETERS.items()], float)
    with jax.enable_x64(True), stages("calibration by driving") as stage:
        fit, noise = _fit_drive(_seen(stretches, fitted), prior, prior_std, stage)
        stage("what the drive determines")
        rows = np.flatnonzero(prior_std)
        order = tuple(np.array(list(DRIVE_PARAMETERS))[rows].tolist())
        found = identify_information(fit.information[np.ix_(rows, rows)], prior_std[rows], names=order)
        undetermined = describe_undetermined(found)
        sizes: dict[str, list[float]] = {}
        if not fitted.all():
            rest = _with_noise(_seen(stretches, ~fitted), noise / np.asarray(_FIRST_STD))
            for name, at in (("nominal", prior), ("fitted", fit.shared)):
                stage(f"stretches that were held out, with {name} values")
                again = _solve(rest, at, 0 * prior_std, (at, _own0(rest)))
                for kind, r in zip(GROUPS, _by_group(again.residuals, rest), strict=True):
                    sizes.setdefault(kind, []).append(float(np.sqrt(np.mean(r[r != 0] ** 2))) if r.any() else np.nan)
    table = pd.DataFrame(
        {
            "value": fit.shared[rows],
            "std": np.asarray(found.std),
            "unit": [DRIVE_PARAMETERS[name].unit for name in order],
            "prior": prior[rows],
            "prior_std": prior_std[rows],
        },
        index=pd.Index(order),
    )
    covariance, std = np.asarray(found.covariance), np.asarray(found.std)
    calibration = Calibration(
        method="drive",
        table=constants_table(table).loc[names],
        correlation=pd.DataFrame(covariance / np.outer(std, std), order, order).loc[names, names],
        absorbed=pd.DataFrame(index=names),
        undetermined=(*([] if fit.converged else [NOT_CONVERGED]), *undetermined),
        held_out=pd.DataFrame(),
        noise=noise_levels(dict(zip(GROUPS, noise, strict=True))),
        nis=float(fit.nis),
        converged=bool(fit.converged),
    )
    return calibration, sizes


def _fit_drive(
    stretches: Stretch, prior: np.ndarray, prior_std: np.ndarray, stage: Callable[[str], None]
) -> tuple[SharedFit, np.ndarray]:
    """Fit, noise from its residuals, and fit with that noise; returns this fit and the noise."""
    noise = np.asarray(_FIRST_STD)
    stage("first fit")
    fit = _solve(stretches, prior, prior_std, (prior, _own0(stretches)))
    for number in ("second", "third"):
        stage(f"noise from what is left, {number} fit")
        factor = np.maximum(_group_factors(_by_group(fit.residuals, stretches)), _LEAST_STD / noise)
        noise, stretches = noise * factor, _with_noise(stretches, factor)
        fit = _solve(stretches, prior, prior_std, (fit.shared, fit.own))
    return fit, noise


def drive_stretches(recorded: Mapping[str, np.ndarray], gravity: float, noise: Mapping[str, float] = NOISE) -> Stretch:
    """A drive cut into stretches, times in s from the same zero.

    Parameters
    ----------
    recorded : mapping
        t, f, w (IMU); t_gnss, v_gnss; t_wheel, wheel, apart (right less left wheel); of velocities and speeds NaN
        where missing.
    gravity : float
        Magnitude of gravity, m/s^2.
    noise : mapping, optional
        Noise densities of ``gyro`` and ``accelerometer``, one-sided, and the slow error of the ``receiver``, m/s.

    Returns
    -------
    stretches : Stretch
        Stacked along the first axis of each array.

    Raises
    ------
    ValueError
        If the drive is shorter than a stretch.
    """
    t, f, w, t_gnss, v_gnss, t_wheel, wheel, apart = (
        np.asarray(recorded[name], float) for name in ("t", "f", "w", "t_gnss", "v_gnss", "t_wheel", "wheel", "apart")
    )
    steps = round((STRETCH + 2 * _MARGIN) / STEP)
    starts = _starts(t)
    # Means over steps, exact for readings that run straight between samples.
    edges = starts[:, None] + STEP * np.arange(steps + 1)
    f_mean, w_mean = (means_between(edges, t, x) for x in (f, w))
    bins = np.unique(np.floor(t_wheel / _BIN), return_inverse=True)[1]
    count = np.bincount(bins)
    t_each, (t_wheel, wheel, apart) = t_wheel, (np.bincount(bins, x) / count for x in (t_wheel, wheel, apart))
    spread = np.sqrt(np.bincount(bins, (t_each - t_wheel[bins]) ** 2) / count)
    heading = _yaw(t, w, t_gnss, v_gnss)
    pieces = []
    used_to = -np.inf
    for k, start in enumerate(starts):
        epochs = _inside(t_gnss, start, used_to) & np.isfinite(v_gnss[:, :2]).all(1)
        samples = _inside(t_wheel, start, used_to)
        used_to = start + _MARGIN + STRETCH
        wheel_std = np.tile(_FIRST_STD[2:], (samples.sum(), 1))
        for column, shown in ((0, wheel), (3, apart)):
            wheel_std[~np.isfinite(shown[samples]), column] = np.inf
        f_first = f_mean[k, : round(2 / STEP)].mean(0)
        roll, pitch = np.arctan2(f_first[1], f_first[2]), np.arctan2(f_first[0], np.hypot(*f_first[1:]))
        yaw = float(np.interp(start, t, heading))
        gnss_std = np.broadcast_to(_FIRST_STD[:2], (epochs.sum(), 2))
        pieces.append(
            Stretch(
                f=f_mean[k],
                w=w_mean[k],
                C_nb=Rotation.from_euler("ZYX", [yaw, -pitch, roll]).as_matrix(),
                gravity=np.asarray(gravity),
                noise=np.asarray([noise["gyro"] / 2**0.5, noise["accelerometer"] / 2**0.5, noise["receiver"]]),
                t_gnss=t_gnss[epochs] - start,
                v_gnss=np.nan_to_num(v_gnss[epochs]),
                gnss_std=np.where(np.isfinite(v_gnss[epochs][:, 1:]), gnss_std, np.inf),
                t_wheel=t_wheel[samples] - start,
                wheel=np.nan_to_num(wheel[samples]),
                apart=np.nan_to_num(apart[samples]),
                wheel_spread=spread[samples],
                wheel_std=wheel_std,
            )
        )
    return _stacked(pieces)


def _of_recording(recording: Recording) -> tuple[Stretch, np.ndarray]:
    """Stretches of a recording and their starts on its time axis; those with gaps in the IMU are left out."""
    imu, start = imu_of(recording), start_of(recording)
    if recording.gnss is None or not {"gx", "gy", "gz"} <= set(imu):
        raise ValueError(
            f"recording {recording.name!r} lacks a stream: a drive's calibration needs a gyro (gx, gy, gz in the IMU) "
            "and GNSS velocities; wheel speeds help"
        )
    t = imu.index.to_numpy(float) - start
    t_wheel = np.arange(t[0], t[-1], _BIN)
    wheel = apart = np.full(t_wheel.size, np.nan)
    if recording.wheel is not None:
        t_wheel = recording.wheel.index.to_numpy(float) - start
        wheel = recording.wheel["speed"].to_numpy(float)
        apart = np.full(t_wheel.size, np.nan)
        pair = wheel_pair(recording)
        if pair is not None:
            left, right = recording.wheel[list(pair)].to_numpy(float).T
            apart = right - left
    recorded = {
        "t": t,
        "f": imu[["ax", "ay", "az"]].to_numpy(float),
        "w": imu[["gx", "gy", "gz"]].to_numpy(float),
        "t_gnss": recording.gnss.index.to_numpy(float) - start,
        "v_gnss": recording.gnss[["v_e", "v_n", "v_u"]].to_numpy(float),
        "t_wheel": t_wheel,
        "wheel": wheel,
        "apart": apart,
    }
    stretches = drive_stretches(recorded, gravity_at(recording))
    starts = _starts(t)
    longest = [float(np.max(np.diff(t[(t >= s) & (t <= s + STRETCH + 2 * _MARGIN)]), initial=0)) for s in starts]
    whole = np.array(longest) < 5 * STEP
    if not whole.all():
        warnings.warn(
            f"recording {recording.name!r}: {int((~whole).sum())} stretch(es) left out for gaps in the IMU",
            stacklevel=3,
        )
    return jax.tree.map(lambda leaf: leaf[whole], stretches), starts[whole] + start


# One program for all that is fitted and held out.
_fit = jax.jit(partial(fit_shared, drive_residuals, loss="huber"))
_together = jax.jit(statistical_inefficiency)


def _solve(
    stretches: Stretch, prior: ArrayLike, prior_std: np.ndarray, start: tuple[ArrayLike, ArrayLike]
) -> SharedFit:
    """The fit in NumPy. It runs on stretches filled up with missing observations, and with stretches of them."""
    count, own = stretches.f.shape[0], _own0(stretches)
    size = bucket(count, _LEAST_STRETCHES)

    def filled(leaf: ArrayLike) -> np.ndarray:
        return padded(np.asarray(leaf), size)

    roomy = _with_room(
        stretches, bucket(stretches.t_gnss.shape[1], _LEAST_EPOCHS), bucket(stretches.t_wheel.shape[1], _LEAST_SAMPLES)
    )
    roomy = _seen(jax.tree.map(filled, roomy), np.arange(size) < count)
    own_std = np.ones(own.shape[1])
    own_std[:3], own_std[3:6] = _TURN_STD, _VELOCITY_STD
    found = _fit(roomy, prior, prior_std, filled(own), own_std, start=(start[0], filled(start[1])))
    fit = jax.tree.map(np.asarray, found)
    kept = np.concatenate(
        [
            np.tile(np.arange(leaf.shape[1]) < there, kinds)
            for leaf, there, kinds in (
                (roomy.t_gnss, stretches.t_gnss.shape[1], 3),
                (roomy.t_wheel, stretches.t_wheel.shape[1], 4),
            )
        ]
    )
    return replace(fit, own=fit.own[:count], residuals=fit.residuals[:count, kept], weights=fit.weights[:count, kept])


def _own0(stretches: Stretch) -> np.ndarray:
    """Own parameters to begin with: no turn, no kicks, the first velocity of the receiver."""
    own = np.zeros((stretches.f.shape[0], own_states(stretches.f.shape[1])))
    own[:, 3:6] = stretches.v_gnss[:, 0]
    return own


def _by_group(residuals: ArrayLike, stretches: Stretch) -> list[np.ndarray]:
    """Residuals of each group (series, time)."""
    r = np.asarray(residuals)
    epochs, samples = stretches.t_gnss.shape[1], stretches.t_wheel.shape[1]
    gnss = r[:, : 3 * epochs].reshape(-1, 3, epochs)
    wheel = r[:, 3 * epochs :].reshape(-1, 4, samples)
    return [gnss[:, :2].reshape(-1, epochs), gnss[:, 2], *wheel.swapaxes(0, 1)]


def _group_factors(groups: list[np.ndarray]) -> np.ndarray:
    """Root of the robust mean square of residuals times the number of neighbours that count as one, of each group."""
    # Residuals are at most 3 of their group's robust standard deviations.
    clipped = []
    for r in groups:
        size = 1.4826 * float(np.median(np.abs(r[r != 0]))) if r.any() else 0.0
        clipped.append(np.clip(r, -3 * size, 3 * size))
    # All groups in one call, each about its mean and filled up with zeros, which add nothing to products of neighbours.
    longest = bucket(max(r.shape[1] for r in groups), _LEAST_SAMPLES)
    rows = np.concatenate([padded(r - r.mean(1, keepdims=True), longest, 0.0, axis=1) for r in clipped])
    together = np.asarray(_together(padded(rows, bucket(rows.shape[0], 7 * _LEAST_STRETCHES), 0.0)))[: rows.shape[0]]
    factors = []
    for raw, r, each in zip(groups, clipped, np.split(together, np.cumsum([len(r) for r in groups])[:-1]), strict=True):
        known = raw != 0
        mean = np.average(each, weights=np.sum(r**2, 1) + 1e-30)
        factors.append(np.sqrt(np.mean(r[known] ** 2) * mean) if known.sum() >= 10 else 1.0)
    return np.array(factors)


def _with_noise(stretches: Stretch, factor: np.ndarray) -> Stretch:
    return replace(stretches, gnss_std=stretches.gnss_std * factor[:2], wheel_std=stretches.wheel_std * factor[2:])


def _seen(stretches: Stretch, which: np.ndarray) -> Stretch:
    """The observations of some stretches, the others' missing."""
    return replace(
        stretches,
        gnss_std=np.where(which[:, None, None], stretches.gnss_std, np.inf),
        wheel_std=np.where(which[:, None, None], stretches.wheel_std, np.inf),
    )


def _stacked(pieces: Iterable[Stretch]) -> Stretch:
    """Stretches stacked, observations filled up to one number with missing ones; or stacks joined."""
    pieces = [p if np.ndim(p.f) == 3 else jax.tree.map(lambda leaf: np.asarray(leaf)[None], p) for p in pieces]
    epochs, samples = (max(getattr(p, name).shape[1] for p in pieces) for name in ("t_gnss", "t_wheel"))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *(_with_room(p, epochs, samples) for p in pieces))


def _with_room(stretches: Stretch, epochs: int, samples: int) -> Stretch:
    """The same with so many epochs and wheel speeds in each stretch, those that are new missing."""
    room = dict.fromkeys(("t_gnss", "v_gnss", "gnss_std"), epochs)
    room |= dict.fromkeys(("t_wheel", "wheel", "apart", "wheel_spread", "wheel_std"), samples)
    return replace(
        stretches,
        **{
            name: padded(getattr(stretches, name), size, np.inf if name.endswith("_std") else 0.0, axis=1)
            for name, size in room.items()
        },
    )


def _starts(t: np.ndarray) -> np.ndarray:
    """Starts of the stretches of a drive: end to end, the last one further back where there is no room for it."""
    room = t[-1] - t[0] - STRETCH - 2 * _MARGIN
    if room < 0:
        raise ValueError(f"a drive of {t[-1] - t[0]:.1f} s is shorter than a stretch of {STRETCH + 2 * _MARGIN:g} s")
    return t[0] + np.minimum(STRETCH * np.arange(np.ceil(room / STRETCH - 0.1) + 1), room)


def _inside(t: np.ndarray, start: float, used_to: float) -> np.ndarray:
    """Observations of a stretch, without its margins and without those of the stretch before."""
    return (t >= max(start + _MARGIN, used_to)) & (t < start + _MARGIN + STRETCH)


def _yaw(t: np.ndarray, w: np.ndarray, t_gnss: np.ndarray, v_gnss: np.ndarray) -> np.ndarray:
    """Yaw at the IMU's times: the course where the car moves, carried on by the gyro in between."""
    turned = np.concatenate([[0], np.cumsum(np.diff(t) * (w[1:, 2] + w[:-1, 2]) / 2)])
    moving = np.hypot(v_gnss[:, 0], v_gnss[:, 1]) > 2.0
    if not moving.any():
        return turned
    offset = np.arctan2(v_gnss[moving, 1], v_gnss[moving, 0]) - np.interp(t_gnss[moving], t, turned)
    nearest = np.clip(np.searchsorted(t_gnss[moving], t), 0, moving.sum() - 1)
    return turned + offset[nearest]
