"""Calibration from ordinary driving: delays, wheel scale, biases and mounting from IMU, GNSS Doppler and wheels.

No reference is asked: the sensors are made to agree. The noise of each kind of observation is taken from its own
residuals, with neighbours counted as one as far as they are correlated, and the fit repeated; large residuals count
less (Huber). A parameter that the drive does not determine keeps its prior and is said to.
"""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.calibration.drive_model import DRIVE_PARAMETERS, GROUPS, STEP, Stretch, drive_residuals, own_states
from altijax.calibration.identifiability import Identification, identify_information
from altijax.calibration.serial_correlation import statistical_inefficiency
from altijax.calibration.shared_parameters import SharedFit, fit_shared
from altijax.drives import gravity_at, imu_of, start_of, wheel_pair
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix

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


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DriveCalibration:
    """Parameters of a drive's sensors, how well they are known, and whether they help where they were not fitted.

    Attributes
    ----------
    table : DataFrame
        One row a parameter: value, std, unit, prior (mean), prior_std, shift (from the prior, in its standard
        deviations), bits (information gained).
    identification : Identification
        What the drive determines; its text names what it does not.
    noise : Series
        Standard deviation of each kind of observation, as found, m/s; it includes their correlation.
    nis : float
        Normalised innovation squared per degree of freedom with that noise.
    converged : bool
        False where the steps were used up, as on a drive that leaves much open: then the bars say too little.
    held_out : DataFrame
        Root mean square of the weighted residuals of each kind with nominal and with fitted parameters, on the
        stretches that were held out, and whether the fit made it worse; empty where none were.
    """

    table: pd.DataFrame
    identification: Identification
    noise: pd.Series
    nis: float
    converged: bool
    held_out: pd.DataFrame

    def __repr__(self) -> str:
        parts = [self.table.round(5).to_string(), str(self.noise.round(4).to_dict()), f"NIS {self.nis:.2f}"]
        said = str(self.identification).splitlines()[1 + len(self.identification.names) :]
        if not self.converged:
            said = [NOT_CONVERGED, *said]
        held_out = [] if self.held_out.empty else [self.held_out.round(3).to_string()]
        return "\n".join([*parts, *said, *held_out])


def calibrate_drive(
    recordings: Recording | Iterable[Recording], parameters: Sequence[str] | None = None, *, until: float | None = None
) -> DriveCalibration:
    """Parameters of IMU, wheels and GNSS from ordinary driving, without a reference.

    Parameters
    ----------
    recordings : Recording or several
        Each with six-axis IMU and GNSS velocities (with climb, as far as there is one) of one car, and its wheel speeds
        if there are any, best one by one; what concerns wheels that were not recorded stays undetermined.
    parameters : sequence of str, optional
        Names out of `DRIVE_PARAMETERS`; the others stay nominal. All by default.
    until : float, optional
        Last time, on the recordings' time axis, used for the fit; the stretches after it are held out.

    Returns
    -------
    calibration : DriveCalibration
        Values, standard deviations, and what the drive does not determine.

    Raises
    ------
    ValueError
        If a stream is missing, a name is unknown or a drive is shorter than a stretch.
    """
    recordings = [recordings] if isinstance(recordings, Recording) else list(recordings)
    with jax.enable_x64(True):
        stretches, starts = zip(*(_of_recording(recording) for recording in recordings), strict=True)
        all_starts = np.concatenate(starts)
        fitted = all_starts + STRETCH <= (np.inf if until is None else until)
        return calibrate_stretches(_stacked(stretches), parameters, fitted=fitted)


def calibrate_stretches(
    stretches: Stretch, parameters: Sequence[str] | None = None, *, fitted: np.ndarray | None = None
) -> DriveCalibration:
    """The same from stretches of data, as `drive_stretches` makes them; call it in double precision.

    Parameters
    ----------
    stretches : Stretch
        Stacked stretches.
    parameters : sequence of str, optional
        Names out of `DRIVE_PARAMETERS`; all by default.
    fitted : ndarray, optional
        Which stretches to fit; the others are held out. All by default.

    Returns
    -------
    calibration : DriveCalibration
        Values, standard deviations, and what the drive does not determine.

    Raises
    ------
    ValueError
        If a name is unknown or nothing is to be fitted.
    """
    names = tuple(DRIVE_PARAMETERS) if parameters is None else tuple(parameters)
    unknown = sorted(set(names) - set(DRIVE_PARAMETERS))
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"parameters must be different names out of {', '.join(DRIVE_PARAMETERS)}, got {names}")
    fitted = np.ones(stretches.f.shape[0], bool) if fitted is None else fitted
    if not fitted.any():
        raise ValueError(f"no stretch of {STRETCH:g} s lies before the end of the fit")
    chosen = np.array([name in names for name in DRIVE_PARAMETERS])
    prior = np.array([row[0] for row in DRIVE_PARAMETERS.values()])
    prior_std = np.where(chosen, [row[1] for row in DRIVE_PARAMETERS.values()], 0.0)
    fit, noise = _fit_drive(_seen(stretches, fitted), prior, prior_std)
    rows = np.flatnonzero(chosen)
    found = identify_information(fit.information[rows][:, rows], jnp.asarray(prior_std[rows]), names=_ordered(names))
    values = np.asarray(fit.shared)[rows]
    table = pd.DataFrame(
        {
            "value": values,
            "std": np.asarray(found.std),
            "unit": [DRIVE_PARAMETERS[name][2] for name in found.names],
            "prior": prior[rows],
            "prior_std": prior_std[rows],
            "shift": (values - prior[rows]) / prior_std[rows],
            "bits": np.asarray(found.gained),
        },
        index=pd.Index(found.names, name="parameter"),
    )
    held_out = pd.DataFrame()
    if not fitted.all():
        rest = _with_noise(_seen(stretches, ~fitted), noise / np.asarray(_FIRST_STD))
        sizes = {}
        for name, at in (("nominal", prior), ("fitted", np.asarray(fit.shared))):
            own = _own0(rest)
            again = _solve(rest, at, 0 * prior_std, own, _own_std(rest), start=(at, own))
            sizes[name] = [float(jnp.sqrt(jnp.mean(r[r != 0] ** 2))) for r in _by_group(again.residuals, rest)]
        held_out = pd.DataFrame(sizes, index=pd.Index(GROUPS, name="residuals"))
        held_out["worse"] = held_out["fitted"] > held_out["nominal"]
    return DriveCalibration(
        table=table,
        identification=found,
        noise=pd.Series(noise, GROUPS, name="std"),
        nis=float(fit.nis),
        converged=bool(fit.converged),
        held_out=held_out,
    )


def _fit_drive(stretches: Stretch, prior: np.ndarray, prior_std: np.ndarray) -> tuple[SharedFit, np.ndarray]:
    """Fit, noise from its residuals, and fit with that noise; returns this fit and the noise."""
    noise = np.asarray(_FIRST_STD)
    own, own_std = _own0(stretches), _own_std(stretches)
    fit = _solve(stretches, prior, prior_std, own, own_std, start=(prior, own))
    for _ in range(2):
        factor = np.array([_group_factor(r) for r in _by_group(fit.residuals, stretches)])
        factor = np.maximum(factor, _LEAST_STD / noise)
        noise, stretches = noise * factor, _with_noise(stretches, factor)
        fit = _solve(stretches, prior, prior_std, own, own_std, start=(fit.shared, fit.own))
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
    f_mean, w_mean = (_means(t, x, edges) for x in (f, w))
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
        euler = [np.arctan2(f_first[1], f_first[2]), np.arctan2(f_first[0], np.hypot(*f_first[1:]))]
        euler.append(np.interp(start, t, heading))
        gnss_std = np.broadcast_to(_FIRST_STD[:2], (epochs.sum(), 2))
        pieces.append(
            Stretch(
                f=f_mean[k],
                w=w_mean[k],
                C_nb=euler_to_matrix(jnp.asarray(euler)),
                gravity=jnp.asarray(gravity),
                noise=jnp.asarray([noise["gyro"] / 2**0.5, noise["accelerometer"] / 2**0.5, noise["receiver"]]),
                t_gnss=t_gnss[epochs] - start,
                v_gnss=np.nan_to_num(v_gnss[epochs]),
                gnss_std=jnp.asarray(np.where(np.isfinite(v_gnss[epochs][:, 1:]), gnss_std, np.inf)),
                t_wheel=t_wheel[samples] - start,
                wheel=np.nan_to_num(wheel[samples]),
                apart=np.nan_to_num(apart[samples]),
                wheel_spread=spread[samples],
                wheel_std=jnp.asarray(wheel_std),
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


_solve = jax.jit(partial(fit_shared, drive_residuals, loss="huber"))


def _own0(stretches: Stretch) -> np.ndarray:
    """Own parameters to begin with: no turn, no kicks, the first velocity of the receiver."""
    own = np.zeros((stretches.f.shape[0], own_states(stretches.f.shape[1])))
    own[:, 3:6] = stretches.v_gnss[:, 0]
    return own


def _own_std(stretches: Stretch) -> np.ndarray:
    std = np.ones(own_states(stretches.f.shape[1]))
    std[:3], std[3:6] = _TURN_STD, _VELOCITY_STD
    return std


def _by_group(residuals: jax.Array, stretches: Stretch) -> list[np.ndarray]:
    """Residuals of each group (series, time)."""
    r = np.asarray(residuals)
    epochs, samples = stretches.t_gnss.shape[1], stretches.t_wheel.shape[1]
    gnss = r[:, : 3 * epochs].reshape(-1, 3, epochs)
    wheel = r[:, 3 * epochs :].reshape(-1, 4, samples)
    return [gnss[:, :2].reshape(-1, epochs), gnss[:, 2], *wheel.swapaxes(0, 1)]


def _group_factor(r: np.ndarray) -> float:
    """Root of the robust mean square of residuals times the number of neighbours that count as one."""
    known = r[r != 0]
    if known.size < 10:
        return 1.0
    size = 1.4826 * float(np.median(np.abs(known)))
    clipped = np.clip(r, -3 * size, 3 * size)
    together = np.average(np.asarray(statistical_inefficiency(clipped)), weights=np.sum(clipped**2, 1) + 1e-30)
    return float(np.sqrt(np.mean(clipped[r != 0] ** 2) * together))


def _with_noise(stretches: Stretch, factor: np.ndarray) -> Stretch:
    return replace(stretches, gnss_std=stretches.gnss_std * factor[:2], wheel_std=stretches.wheel_std * factor[2:])


def _seen(stretches: Stretch, which: np.ndarray) -> Stretch:
    """The observations of some stretches, the others' missing: cut out, each number of them would compile anew."""
    return replace(
        stretches,
        gnss_std=jnp.where(which[:, None, None], stretches.gnss_std, jnp.inf),
        wheel_std=jnp.where(which[:, None, None], stretches.wheel_std, jnp.inf),
    )


def _stacked(pieces: Iterable[Stretch]) -> Stretch:
    """Stretches stacked, observations filled up to one number with missing ones; or stacks joined."""
    pieces = [p if np.ndim(p.f) == 3 else jax.tree.map(lambda leaf: np.asarray(leaf)[None], p) for p in pieces]
    epochs, samples = (max(getattr(p, name).shape[1] for p in pieces) for name in ("t_gnss", "t_wheel"))
    room = {"t_gnss": epochs, "v_gnss": epochs, "gnss_std": epochs, "t_wheel": samples, "wheel": samples}
    room |= {"apart": samples, "wheel_spread": samples, "wheel_std": samples}

    def filled(name: str, values: np.ndarray) -> np.ndarray:
        if name not in room:
            return np.asarray(values)
        ends = [(0, 0), (0, room[name] - values.shape[1])] + [(0, 0)] * (values.ndim - 2)
        return np.pad(values, ends, constant_values=np.inf if name.endswith("_std") else 0.0)

    names = vars(pieces[0])
    return Stretch(
        **{name: jnp.asarray(np.concatenate([filled(name, getattr(p, name)) for p in pieces])) for name in names}
    )


def _ordered(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in DRIVE_PARAMETERS if name in names)


def _starts(t: np.ndarray) -> np.ndarray:
    """Starts of the stretches of a drive: end to end, the last one further back where there is no room for it."""
    room = t[-1] - t[0] - STRETCH - 2 * _MARGIN
    if room < 0:
        raise ValueError(f"a drive of {t[-1] - t[0]:.1f} s is shorter than a stretch of {STRETCH + 2 * _MARGIN:g} s")
    return t[0] + np.minimum(STRETCH * np.arange(np.ceil(room / STRETCH - 0.1) + 1), room)


def _inside(t: np.ndarray, start: float, used_to: float) -> np.ndarray:
    """Observations of a stretch, without its margins and without those of the stretch before."""
    return (t >= max(start + _MARGIN, used_to)) & (t < start + _MARGIN + STRETCH)


def _means(t: np.ndarray, x: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Means of series (time, 3) between edges (stretches, steps + 1)."""
    areas = np.concatenate([np.zeros((1, 3)), np.cumsum(np.diff(t)[:, None] * (x[1:] + x[:-1]) / 2, 0)])
    at = np.stack([np.interp(edges, t, area) for area in areas.T], -1)
    return np.diff(at, axis=1) / STEP


def _yaw(t: np.ndarray, w: np.ndarray, t_gnss: np.ndarray, v_gnss: np.ndarray) -> np.ndarray:
    """Yaw at the IMU's times: the course where the car moves, carried on by the gyro in between."""
    turned = np.concatenate([[0], np.cumsum(np.diff(t) * (w[1:, 2] + w[:-1, 2]) / 2)])
    moving = np.hypot(v_gnss[:, 0], v_gnss[:, 1]) > 2.0
    if not moving.any():
        return turned
    offset = np.arctan2(v_gnss[moving, 1], v_gnss[moving, 0]) - np.interp(t_gnss[moving], t, turned)
    nearest = np.clip(np.searchsorted(t_gnss[moving], t), 0, moving.sum() - 1)
    return turned + offset[nearest]
