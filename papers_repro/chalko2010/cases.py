"""The recordings on which every way to an attitude is tried, and what each makes of them, in one table."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from altijax.datasets import DatasetNotFoundError, load_dataset
from altijax.recordings import Recording, RecordingWarning
from altijax.rotations import euler_to_matrix, heading_to_yaw, matrix_to_euler, yaw_to_heading
from papers_repro.chalko2010.epochs import (
    attitude_errors,
    epochs_of,
    full_rate_attitude,
    full_rate_velocity,
    interpolated_velocity,
    reference_attitude,
)
from papers_repro.chalko2010.experiments import MOTIONS, simulated_recording
from papers_repro.chalko2010.strategies import STRATEGIES

COLUMNS = ["roll (deg)", "pitch (deg)", "heading (deg)", "velocity (m/s)"]

# Roll, pitch and yaw in degrees of a device that was not mounted along its vehicle.
MOUNTING = (-15.0, 10.0, 40.0)


def simulations() -> Iterator[Recording]:
    """Every motion, and the vehicle with the device turned."""
    for seed, motion in enumerate(MOTIONS):
        recording = simulated_recording(motion, seed=seed)
        yield recording
        if motion == "vehicle":
            yield turned(recording)


def real_recordings() -> tuple[list[Recording], list[str]]:
    """Those that are here, and a line on each that is not.

    The receiver of comma2k19-example reports no climb and is late; there the reference's velocities, one a second,
    stand for the receiver's.
    """
    found, missing = [], []
    for name in ("comma2k19-example", "umn-thor75"):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RecordingWarning)  # a damaged file that no method here reads
                recording = load_dataset(name)
        except DatasetNotFoundError:
            missing.append(
                f"{name} was not run, as it is not here: altijax.load_dataset({name!r}) says what to put where."
            )
            continue
        if name == "comma2k19-example":
            recording = with_reference_velocities(recording)
            found += [recording, turned(recording)]
        else:
            found.append(recording)
    return found, missing


def with_reference_velocities(recording: Recording) -> Recording:
    """The reference's velocity once a second as the receiver's; position stays the receiver's, for gravity."""
    gnss, reference = recording.gnss, recording.reference
    if gnss is None or reference is None:
        raise ValueError(f"recording {recording.name!r} has no GNSS or no reference")
    t = reference.index.to_numpy(float)
    velocity = reference[["v_e", "v_n", "v_u"]].iloc[:: round(1 / float(np.median(np.diff(t))))]
    return replace(recording, gnss=velocity.assign(lat=gnss["lat"].mean(), alt=gnss["alt"].mean()))


def turned(recording: Recording) -> Recording:
    """The same recorded by a device that is turned by `MOUNTING` in its vehicle."""
    imu, reference = recording.imu, recording.reference
    if imu is None or reference is None:
        raise ValueError(f"recording {recording.name!r} has no IMU or no reference")
    C = euler_to_matrix(jnp.radians(jnp.array(MOUNTING)))
    imu, reference = imu.copy(), reference.copy()
    for columns in (["ax", "ay", "az"], ["gx", "gy", "gz"]):
        imu[columns] = imu[columns].to_numpy() @ np.asarray(C)
    roll, pitch, heading = reference[["roll", "pitch", "heading"]].to_numpy(float).T
    euler = matrix_to_euler(euler_to_matrix(jnp.stack([roll, pitch, heading_to_yaw(heading)], -1)) @ C)
    reference[["roll", "pitch"]] = np.asarray(euler[:, :2])
    reference["heading"] = np.asarray(yaw_to_heading(euler[:, 2]))
    return replace(recording, name=f"{recording.name}, turned", imu=imu, reference=reference)


def judge(recording: Recording) -> pd.DataFrame:
    """RMS errors of every strategy at mid-epoch, and of its velocity at full rate."""
    epochs = epochs_of(recording)
    t = np.asarray(epochs.t)
    true = reference_attitude(recording, epochs.t_middle)
    rows = {}
    for strategy in STRATEGIES:
        C_middle = strategy.attitudes(epochs)
        C_nb = full_rate_attitude(epochs, C_middle, carried=strategy.carried)
        velocity = full_rate_velocity(epochs, C_nb)
        errors = np.asarray(attitude_errors(C_middle, true))
        rows[strategy.name] = [*errors, velocity_error(recording, t, velocity)]
    straight = velocity_error(recording, t, interpolated_velocity(epochs, epochs.v_knots))
    rows["interpolated"] = [np.nan, np.nan, np.nan, straight]
    return pd.DataFrame.from_dict(
        {name: np.array(row, float) for name, row in rows.items()}, orient="index", columns=COLUMNS
    )


def velocity_error(recording: Recording, t: np.ndarray, velocity: jax.Array) -> float:
    """RMS length of the error against the reference, where epochs lie on both sides."""
    if recording.reference is None or recording.imu is None or recording.gnss is None:
        raise ValueError(f"recording {recording.name!r} has no reference, IMU or GNSS")
    start = float(recording.imu.index[0])
    true = recording.reference[["v_e", "v_n", "v_u"]].dropna()
    t_true = true.index.to_numpy(float) - start
    t_knots = recording.gnss.index.to_numpy(float) - start
    inside = (t_true >= max(t_knots[1], t[0])) & (t_true <= min(t_knots[-2], t[-1]))
    found = np.stack([np.interp(t_true, t, component) for component in np.asarray(velocity).T], -1)
    return float(np.sqrt(np.mean(np.sum((found - true.to_numpy(float))[inside] ** 2, -1))))
