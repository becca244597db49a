"""How good an estimated motion is: against a reference, and against GNSS velocities that it did not see."""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation, Slerp

from altijax.motion_estimate.estimates import estimate_motion
from altijax.recordings import Recording

_ANGLES, _VELOCITY = ("roll", "pitch", "heading"), ("v_e", "v_n", "v_u")


def score_motion(estimate: pd.DataFrame, recording: Recording) -> pd.DataFrame:
    """Errors of an estimate against the recording's reference, where the estimate calls itself valid.

    Parameters
    ----------
    estimate : DataFrame
        As of `estimate_motion`.
    recording : Recording
        With a reference of attitude or velocity.

    Returns
    -------
    score : DataFrame
        One row a quantity that the reference has, and ``velocity`` for all three components together: rms and mean of
        the error (rad, m/s), the root mean square of the stated standard deviation, the share of errors within one and
        within two of them, and the number of reference samples.

    Raises
    ------
    ValueError
        If there is no reference or none of its samples is covered.
    """
    reference = recording.reference
    if reference is None:
        raise ValueError(f"recording {recording.name!r} has no reference to score against: add a reference.csv")
    reference = reference.loc[estimate.index[0] : estimate.index[-1]]
    t, t_estimate = reference.index.to_numpy(float), estimate.index.to_numpy(float)
    nearest = np.clip(np.searchsorted(t_estimate, t), 0, t_estimate.size - 1)
    reference, t = reference[estimate["valid"].to_numpy()[nearest]], t[estimate["valid"].to_numpy()[nearest]]
    names = [name for name in (*_ANGLES, *_VELOCITY) if name in reference and reference[name].notna().any()]
    if not names or t.size == 0:
        raise ValueError(f"recording {recording.name!r}: no valid sample of the estimate has a reference")
    at = estimate_at(estimate, t)
    rows, squares = {}, np.zeros(t.size)
    for name in names:
        error = at[name] - reference[name].to_numpy(float)
        if name in ("roll", "heading"):
            error = (error + np.pi) % (2 * np.pi) - np.pi
        there = np.isfinite(error)
        std = np.interp(t, t_estimate, estimate[f"{name}_std"])[there]
        rows[name] = _row(error[there], std)
        if name in _VELOCITY:
            squares += error**2
    if set(_VELOCITY) <= set(names):
        rows["velocity"] = {"rms": float(np.sqrt(np.nanmean(squares))), "samples": int(np.isfinite(squares).sum())}
    return pd.DataFrame(rows).T


def withheld_gnss_errors(recording: Recording, **options: object) -> pd.DataFrame:
    """Errors of predicting every other GNSS velocity from the rest: a measure that needs no reference.

    Parameters
    ----------
    recording : Recording
        With GNSS velocities.
    **options
        As of `estimate_motion`.

    Returns
    -------
    errors : DataFrame
        At each withheld epoch between two that were seen: v_e, v_n, v_u (m/s, estimate less measurement) and the
        standard deviations of the estimate; ``attrs["delay"]`` is the delay that was found.

    Raises
    ------
    ValueError
        As of `estimate_motion`.
    """
    gnss = recording.gnss
    if gnss is None:
        raise ValueError(f"recording {recording.name!r} has no GNSS velocities to withhold: add a gnss.csv")
    usable = gnss[gnss[["v_e", "v_n"]].notna().all(axis=1)]
    estimate = estimate_motion(replace(recording, gnss=usable.iloc[::2]), **options)  # type: ignore[arg-type]
    withheld = usable.iloc[1:-1:2]
    t = withheld.index.to_numpy(float) - estimate.attrs["delay"]
    inside = (t >= estimate.index[0]) & (t <= estimate.index[-1])
    withheld, t = withheld[inside], t[inside]
    errors = {}
    for name in _VELOCITY:
        at = t - estimate.attrs.get("climb_delay", 0.0) if name == "v_u" else t
        errors[name] = np.interp(at, estimate.index, estimate[name]) - withheld[name].to_numpy(float)
        errors[f"{name}_std"] = np.interp(at, estimate.index, estimate[f"{name}_std"])
    result = pd.DataFrame(errors, index=withheld.index)
    result.attrs = {"delay": estimate.attrs["delay"]}
    return result


def _row(error: np.ndarray, std: np.ndarray) -> dict[str, float]:
    return {
        "rms": float(np.sqrt(np.mean(error**2))),
        "mean": float(np.mean(error)),
        "stated_std": float(np.sqrt(np.mean(std**2))),
        "within_1_std": float(np.mean(np.abs(error) <= std)),
        "within_2_std": float(np.mean(np.abs(error) <= 2 * std)),
        "samples": error.size,
    }


def estimate_at(estimate: pd.DataFrame, t: np.ndarray) -> dict[str, np.ndarray]:
    """An estimate of the motion at other times: roll, pitch, heading and velocities; attitudes on the group."""
    # With y to the left the pitch of this convention is minus that of the rotation about y.
    angles = np.stack([np.pi / 2 - estimate["heading"], -estimate["pitch"], estimate["roll"]], -1)
    turned = Slerp(estimate.index.to_numpy(float), Rotation.from_euler("ZYX", angles))(t).as_euler("ZYX")
    at = {"roll": turned[:, 2], "pitch": -turned[:, 1], "heading": np.mod(np.pi / 2 - turned[:, 0], 2 * np.pi)}
    return at | {name: np.interp(t, estimate.index, estimate[name]) for name in _VELOCITY}
