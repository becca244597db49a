"""The motion at every IMU sample from that at the instants: led there by the readings, with its errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation, Slerp

from altijax.drives import imu_of, start_of
from altijax.inference.layout import Layout
from altijax.recordings import Recording
from altijax.vehicle.between import Between
from altijax.vehicle.inertial import MOVING, ROTATION, Trajectory

_VELOCITY, _POSITION = ("v_e", "v_n", "v_u"), ("east", "north", "height")
MOTION_COLUMNS = tuple(
    f"{name}{end}" for end in ("", "_std") for name in ("roll", "pitch", "heading", "v_e", "v_n", "v_u")
)
"""Columns of attitude and velocity of `as_table`, and their standard deviations."""

# Where the pitch is steeper than this cosine, roll and heading are one angle.
_UPRIGHT = 0.05


@dataclass(frozen=True, kw_only=True)
class Samples:
    """The motion at the IMU's samples.

    Attributes
    ----------
    t : (samples,) s
        Times from the first.
    C_nb : (samples, 3, 3)
        Attitude.
    v_n, p_n : (samples, 3) m/s, m
        Velocity and position, East, North and up, of the antenna where there is one, else of the IMU.
    way : (samples,) m
        Way of the IMU.
    covariance : (samples, 10, 10)
        Of the errors of attitude (a rotation vector in navigation axes, rad), velocity, position and way.
    """

    t: np.ndarray
    C_nb: np.ndarray
    v_n: np.ndarray
    p_n: np.ndarray
    way: np.ndarray
    covariance: np.ndarray


def at_samples(
    recording: Recording,
    layout: Layout,
    trajectory: Trajectory,
    covariance: Any,
    between: Between,
    levels: Mapping[str, float],
) -> Samples:
    """The motion at every IMU sample.

    Parameters
    ----------
    recording : Recording
        With an IMU.
    layout : Layout
        Of the states.
    trajectory : Trajectory
        States at the instants.
    covariance : (time, states, states)
        Of their errors.
    between : Between
        What the readings say between them, about the same trajectory.
    levels : mapping of str to float
        Noise levels.

    Returns
    -------
    samples : Samples
        Times beyond the instants have the motion of the nearest one.
    """
    t = imu_of(recording).index.to_numpy(float) - start_of(recording)
    x = layout.split(np.asarray(trajectory.x))
    knots = np.append(between.instants[0], between.t.ravel())
    kept = np.append(True, np.diff(np.maximum.accumulate(knots)) > 1e-9)
    knots = knots[kept]

    def along(first: Any, later: Any) -> np.ndarray:
        return np.concatenate([first[:1], later.reshape(-1, *first.shape[1:])])[kept]

    inside = np.clip(t, knots[0], knots[-1])
    C_nb = Slerp(knots, Rotation.from_matrix(along(trajectory.C_nb, between.C_nb)))(inside).as_matrix()
    series = {"velocity": between.v_n, "position": between.p_n}
    v_n, p_n = (
        np.stack([np.interp(inside, knots, column) for column in along(np.asarray(x[name]), fine).T], -1)
        for name, fine in series.items()
    )
    way = np.interp(inside, knots, along(np.asarray(x["way"]), between.way))
    turning = np.gradient(C_nb, t, axis=0) @ np.swapaxes(C_nb, -1, -2)
    rate = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], -1)
    P = _covariance(inside, layout, np.asarray(covariance), between, levels)
    if "antenna" in layout:
        arm = np.einsum("tij,j->ti", C_nb, np.asarray(x["antenna"])[-1])
        around = np.cross(rate, arm)
        # Of attitude, velocity, position and way at the antenna by the same at the IMU and the lever.
        J = np.zeros((t.size, 10, 13))
        J[:, range(10), range(10)] = 1
        J[:, 3:6, :3], J[:, 6:9, :3] = -_skew(around), -_skew(arm)
        J[:, 3:6, 10:], J[:, 6:9, 10:] = _skew(rate) @ C_nb, C_nb - C_nb[:1]
        P = J @ P @ np.swapaxes(J, -1, -2)
        v_n, p_n = v_n + around, p_n + arm - arm[:1]
    # A reading is of its stamp, or the mean since the one before, behind a filter: all may be late by about a sample.
    late = np.median(np.diff(t))
    shift = late * np.concatenate([rate, np.gradient(v_n, t, axis=0), np.zeros((t.size, 4))], -1)
    P += shift[:, :, None] * shift[:, None, :]
    return Samples(t=t, C_nb=C_nb, v_n=v_n, p_n=p_n, way=way, covariance=P)


def _covariance(
    t: np.ndarray, layout: Layout, covariance: np.ndarray, between: Between, levels: Mapping[str, float]
) -> np.ndarray:
    named = (*MOVING, "antenna") if "antenna" in layout else MOVING
    moving = np.concatenate([np.arange(layout.size)[layout.at(name)] for name in named])
    distinct = np.append(True, np.diff(between.instants) > 1e-9)
    nodes, P = between.instants[distinct], covariance[distinct][:, moving[:, None], moving]
    k = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, nodes.size - 2)
    dt = nodes[k + 1] - nodes[k]
    s = (t - nodes[k]) / dt
    P = (1 - s)[:, None, None] * P[k] + s[:, None, None] * P[k + 1]
    # Between two known ends a random walk has the variance s (1 - s) dt.
    bridge = s * (1 - s) * dt
    turned = max(levels[name] for name in ROTATION if name in levels) ** 2 * bridge
    force = np.linalg.norm(between.gained[np.flatnonzero(distinct)[k], 3:6], axis=-1)
    shaken = levels["acceleration"] ** 2 * bridge + turned * force**2 / 12
    P[:, range(3), range(3)] += turned[:, None]
    P[:, range(3, 6), range(3, 6)] += shaken[:, None]
    return P


def _skew(v: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    zero = np.zeros_like(v[..., 0])
    x, y, z = np.moveaxis(v, -1, 0)
    rows = [np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, -2)


def angle_columns(C_nb: np.ndarray, covariance: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Roll, pitch and heading of attitudes, and the standard deviation of each.

    Parameters
    ----------
    C_nb : (samples, 3, 3)
        Attitudes.
    covariance : (samples, 3, 3) rad^2
        Of their errors, rotation vectors in navigation axes.

    Returns
    -------
    angles, bars : dict of str to (samples,) rad
        By name of the column, that of a bar with ``_std``.
    """
    pitch = np.arcsin(np.clip(C_nb[:, 2, 0], -1, 1))
    yaw = np.arctan2(C_nb[:, 1, 0], C_nb[:, 0, 0])
    angles = {
        "roll": np.arctan2(C_nb[:, 2, 1], C_nb[:, 2, 2]),
        "pitch": pitch,
        "heading": np.mod(np.pi / 2 - yaw, 2 * np.pi),
    }
    # Small turns in axes that yaw with the body, to roll, pitch and yaw: upright poles have a roll of any size.
    sin, cos = np.sin(yaw), np.cos(yaw)
    cos_pitch, tan_pitch = np.maximum(np.cos(pitch), _UPRIGHT), np.tan(np.clip(pitch, -1.5, 1.5))
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    rows = ([cos / cos_pitch, sin / cos_pitch, zero], [sin, -cos, zero], [-tan_pitch * cos, -tan_pitch * sin, one])
    bars = {}
    for name, row in zip(angles, rows, strict=True):
        slope = np.stack(row, -1)
        variance = np.einsum("ti,tij,tj->t", slope, covariance, slope)
        # No angle is less certain than one of which nothing is known.
        bars[f"{name}_std"] = np.minimum(np.sqrt(np.maximum(variance, 0)), np.pi / np.sqrt(3))
    return angles, bars


def as_table(recording: Recording, samples: Samples) -> pd.DataFrame:
    """The motion as columns: angles, velocity and position, each with its standard deviation, and the way."""
    P = samples.covariance
    columns, bars = angle_columns(samples.C_nb, P[:, :3, :3])
    columns |= dict(zip(_VELOCITY, samples.v_n.T, strict=True)) | dict(zip(_POSITION, samples.p_n.T, strict=True))
    columns["distance"] = samples.way
    columns |= bars
    std = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0))
    columns |= {f"{name}_std": std[:, 3 + i] for i, name in enumerate((*_VELOCITY, *_POSITION, "distance"))}
    speed = np.linalg.norm(samples.v_n, axis=1)
    along = samples.v_n / np.maximum(speed, 1e-6)[:, None]
    columns["speed"] = speed
    columns["speed_std"] = np.sqrt(np.maximum(np.einsum("ti,tij,tj->t", along, P[:, 3:6, 3:6], along), 0))
    return pd.DataFrame(columns, index=imu_of(recording).index)
