"""The motion of a vehicle from all that a recording has: the verb over the one smoother."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pandas as pd
import pymap3d
from scipy.spatial.transform import Rotation

from altijax.calibration.records import Calibration
from altijax.drives import gnss_velocities, imu_of, speed_readings, start_of, usual_step
from altijax.recordings import Recording
from altijax.series import after_gap, flanked
from altijax.stages import Stages, stages
from altijax.vehicle.at_samples import Samples, as_table, at_samples
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.between import Between
from altijax.vehicle.inertial import MOVING
from altijax.vehicle.measurements import standstill
from altijax.vehicle.measurements.doppler_velocity import USUAL_DELAY
from altijax.vehicle.measurements.gnss_position import origin_of
from altijax.vehicle.mounting import mounting_of
from altijax.vehicle.search import Search, best_start, fit_of, likely, said_between
from altijax.vehicle.sensors import Use, kinds_of, layout_of, parts_of
from altijax.vehicle.start import receiver_delay

SOURCES = ("gyro", "wheel", "velocity", "position", "course", "standstill")
"""What `estimate_drive` can use beside the accelerometer: the gyro; speeds of wheels; velocities of GNSS and, by wish,
its places; that a vehicle goes where it points; that it stands where the IMU is still."""

CONSISTENT = "consistent: measurements miss the estimate by as much as their errors allow"
"""The verdict of an estimate whose error bars are to be trusted."""

# Means of squared surprises beyond which the errors that are stated are not to be believed.
_MOST_SURPRISING = 2.0
# Delays of receivers to start from without a gyro, s, and how far from the usual one that which windows of epochs find
# may be before that one is tried as well.
_DELAYS = (0.05, 0.35, 0.65)
_DOUBTFUL = 0.15


def estimate_drive(
    recording: Recording,
    *,
    use: Iterable[str] | None = None,
    calibration: Calibration | None = None,
    known_heights: Sequence[tuple[float, float]] | None = None,
) -> pd.DataFrame:
    """The most probable motion of a vehicle on the ground, from all of its sensors together, with error bars.

    One smoother over the whole record: attitude, velocity, position, and the sensors' constants (biases, scales, axes,
    delays, where the antenna and the axle are, the mounting) are found together, with noise levels that suit the record
    best. Measurements that all others contradict are trusted less, and listed.

    Parameters
    ----------
    recording : Recording
        With an accelerometer and wheel speeds or GNSS velocities; a gyro helps a lot.
    use : several of `SOURCES`, optional
        What is used; by default all that the recording has but "position".
    calibration : Calibration, optional
        Constants known beforehand, with their errors; any others are found from those of usual sensors.
    known_heights : sequence of (float, float), optional
        Times, on the recording's time axis, and surveyed heights there, m.

    Returns
    -------
    estimate : DataFrame
        Indexed as ``recording.imu``: east, north and height from the start (m), elevation (m; above the datum of the
        known heights, else from the start), distance (m), speed, v_e, v_n, v_u (m/s), roll, pitch, heading (rad), each
        with its standard deviation (``height_std`` ...); lat and lon (deg) where the receiver had places; and valid,
        False where the IMU has a gap or no speed is near. Without GNSS the drive starts to the East. ``attrs`` has

        ``use``         what was used
        ``constants``   value and standard deviation of each constant by name
        ``noise``       the noise levels
        ``nis``         mean square of what the measurements miss, in units of what they may: 1 where bars are right
        ``nis_by_kind`` the same of each kind of measurement
        ``verdict``     in words, whether the error bars are to be trusted
        ``rejected``    measurements that were trusted less: time (s), what it is, and size in standard deviations;
                        ``outliers`` is their number

    Raises
    ------
    ValueError
        If a source is unknown or not in the recording, or there is neither a wheel speed nor a GNSS velocity.

    Warns
    -----
    UserWarning
        If measurements contradict each other by more than their errors allow.
    """
    sources = use_of(recording, use)
    start = start_of(recording)
    heights = [(time - start, height) for time, height in known_heights or ()]
    with jax.enable_x64(True), stages(f"drive of {recording.name}") as stage:
        stage("mounting")
        mounting = _mounting(recording, sources)
        turned = _turned(recording, mounting)
        search = smoothed(turned, sources, calibration, heights, stage)
        stage("between the instants")
        said = said_between(search)
        fit = fit_of(search)
        layout = layout_of(search.use)
        samples = at_samples(turned, layout, fit.trajectory, fit.covariance, said, search.levels)
    samples = replace(samples, C_nb=samples.C_nb @ mounting.as_matrix())
    estimate = as_table(recording, samples).assign(
        **_elevation(search, said, samples), **_places(recording, search, samples)
    )
    estimate["valid"] = supported(recording, sources)
    estimate.attrs.update(summary(search, start))
    warn_of(recording, estimate)
    return estimate


def warn_of(recording: Recording, estimate: pd.DataFrame) -> None:
    """Warn where measurements contradict each other, at the line that called the verb which calls this."""
    if estimate.attrs["verdict"] != CONSISTENT:
        warnings.warn(f"recording {recording.name!r}: {estimate.attrs['verdict']}", stacklevel=3)


def use_of(recording: Recording, use: Iterable[str] | None) -> Use:
    """The sources that are used, in their order: those asked for, or all but places.

    Raises
    ------
    ValueError
        If one is unknown or not in the recording, or none tells a speed.
    """
    there = _there(recording)
    if use is None:
        wanted = [name for name in SOURCES if there[name] and name != "position"]
    else:
        wanted = list(use)
        for name in wanted:
            if name not in SOURCES:
                raise ValueError(f"use must be several of {', '.join(SOURCES)}; got {name!r}")
            if not there[name] and name != "standstill":
                raise ValueError(f"recording {recording.name!r} has nothing for use={name!r}")
    if not {"wheel", "velocity"} & set(wanted):
        raise ValueError(
            f"recording {recording.name!r}: a motion needs wheel speeds or GNSS velocities, and neither is "
            f"{'there: add a wheel.csv, pulses.csv or gnss.csv' if use is None else 'in use'}"
        )
    # A vehicle that never stands has no standstill to be used.
    return tuple(name for name in SOURCES if name in wanted and there[name])


def _there(recording: Recording) -> dict[str, bool]:
    imu = imu_of(recording)
    end = float(imu.index[-1]) - start_of(recording)
    found = gnss_velocities(recording)
    return {
        "gyro": "gx" in imu,
        "wheel": recording.wheel is not None,
        "velocity": found is not None and found[0].size > 0,
        "position": origin_of(recording) is not None,
        "course": True,
        "standstill": "gx" in imu and bool(standstill.still(recording, np.arange(0.0, end, 1.0)).any()),
    }


def smoothed(
    recording: Recording,
    sources: Use,
    calibration: Calibration | None,
    heights: list[tuple[float, float]],
    stage: Stages,
) -> Search:
    """The most probable motion and noise levels of a recording, its axes the vehicle's."""
    use = (*sources, *(("height",) if heights else ()))
    belief = belief_of(use, calibration)
    if heights:
        belief.mean[layout_of(use).at("datum")] = heights[0][1]
    delays = delays_of(recording, use, calibration, stage)
    stage("first trajectory")
    return likely(best_start(recording, use, delays, belief, heights), stage)


def delays_of(recording: Recording, use: Use, calibration: Calibration | None, stage: Stages) -> tuple[float, ...]:
    """Delays of the receiver to start from, s."""
    if calibration is not None and "gnss_delay" in calibration.values:
        return (float(calibration.values["gnss_delay"]),)
    if "velocity" not in use:
        return (0.0,)
    if "gyro" not in use:
        return _DELAYS
    stage("delay of the GNSS velocities")
    found = receiver_delay(recording)
    return (found, USUAL_DELAY) if abs(found - USUAL_DELAY) > _DOUBTFUL else (found,)


def _mounting(recording: Recording, sources: Use) -> Rotation:
    """Rotation from the IMU's axes to the vehicle's, where a direction of travel is used."""
    if "course" not in sources:
        return Rotation.identity()
    t, speed = speed_readings(recording)
    return mounting_of(recording, pd.Series(speed, t).dropna())


def _turned(recording: Recording, mounting: Rotation) -> Recording:
    """The recording with its IMU's axes turned to those of the vehicle."""
    if mounting.magnitude() == 0:
        return recording
    imu = imu_of(recording).copy()
    for triad in (["ax", "ay", "az"], ["gx", "gy", "gz"]):
        if triad[0] in imu:
            imu[triad] = mounting.apply(imu[triad].to_numpy(float, copy=True))
    return replace(recording, imu=imu)


def _elevation(search: Search, said: Between, samples: Samples) -> dict[str, np.ndarray]:
    """Elevation above the datum of known heights, and its standard deviation; without any, of the height itself."""
    layout = layout_of(search.use)
    up = samples.p_n[:, 2]
    std = np.sqrt(np.maximum(samples.covariance[:, 8, 8], 0))
    if "datum" not in layout:
        return {"elevation": up, "elevation_std": std}
    fit = fit_of(search)
    datum = float(fit.trajectory.x[-1, layout.at("datum")][0])
    both = [layout.at("position").start + 2, layout.at("datum").start]
    variance = np.asarray(fit.covariance)[:, both][:, :, both].sum((1, 2))
    at_all = np.interp(samples.t, said.instants, variance)
    return {
        "elevation": up + datum,
        "elevation_std": np.sqrt(np.maximum(at_all, 0)),
    }


def _places(recording: Recording, search: Search, samples: Samples) -> dict[str, np.ndarray]:
    """Latitude and longitude where the receiver had places: its first one is the origin."""
    origin = origin_of(recording)
    if origin is None:
        return {}
    layout = layout_of(search.use)
    east, north = samples.p_n[:, 0], samples.p_n[:, 1]
    if "place" in layout:
        offset = np.asarray(fit_of(search).trajectory.x[-1, layout.at("place")])
    else:
        gnss = recording.gnss
        assert gnss is not None
        first = float(gnss[["lat", "lon"]].dropna().index[0]) - start_of(recording) - search.delay
        offset = -np.array([np.interp(first, samples.t, series) for series in (east, north)])
    lat, lon, _ = pymap3d.enu2geodetic(east + offset[0], north + offset[1], np.zeros_like(east), *origin)
    return {"lat": np.asarray(lat), "lon": np.asarray(lon)}


def supported(recording: Recording, sources: Use) -> np.ndarray:
    """Where the IMU has no gap and a speed is near, on one side at least at the ends and on both between."""
    t = imu_of(recording).index.to_numpy(float)
    near = np.zeros(t.size, bool)
    streams = []
    if "wheel" in sources and recording.wheel is not None:
        streams.append(recording.wheel["speed"].dropna().index.to_numpy(float))
    found = gnss_velocities(recording)
    if "velocity" in sources and found is not None:
        streams.append(found[0] + start_of(recording))
    for stamps in streams:
        near |= flanked(t, stamps, usual_step(stamps) if stamps.size > 1 else 1.0)
    return near & ~after_gap(t, usual_step(t - t[0]))


def summary(search: Search, start: float) -> dict[str, Any]:
    """What a search has found beside the motion."""
    fit = fit_of(search)
    layout, parts = layout_of(search.use), parts_of(search.use)
    value = np.asarray(fit.trajectory.x).mean(0)
    std = np.sqrt(np.maximum(np.diagonal(fit.covariance[-1]), 0))
    constants: dict[str, tuple[float, float]] = {}
    for name, part in parts.items():
        if name in MOVING or part.time:
            continue
        for entry, place in enumerate(range(*layout.at(name).indices(layout.size))):
            label = name if part.size == 1 else f"{name}_{part.entries[entry]}"
            constants[label] = float(value[place]), float(std[place])
    squares, rejected = {}, []
    for name, kind in kinds_of(search.use).items():
        there = np.isfinite(search.rows[name].std)
        surprise, doubt = np.asarray(fit.surprise[name]), search.doubt[name]
        if kind.factor and there.any():
            squares[name] = surprise[there] ** 2
        for k, row in np.argwhere(there & (doubt > 1)):
            stamp = float(search.rows[name].stamp[k]) + start
            rejected.append((stamp, f"{name} {kind.rows[row]}", float(surprise[k, row])))
    nis = {name: float(np.mean(each)) for name, each in squares.items()}
    return {
        "use": search.use,
        "constants": constants,
        "noise": dict(search.levels),
        "nis": float(np.mean(np.concatenate(list(squares.values())))),
        "nis_by_kind": nis,
        "outliers": len(rejected),
        "verdict": _verdict(nis),
        "rejected": sorted(rejected),
    }


def _verdict(nis: dict[str, float]) -> str:
    off = [f"{name} {value:.1f}" for name, value in nis.items() if value > _MOST_SURPRISING]
    if not off:
        return CONSISTENT
    return (
        "not to be trusted: measurements miss the estimate by more than their errors allow (mean square "
        f"{', '.join(off)} instead of 1); error bars are too small, look at attrs['rejected']"
    )
