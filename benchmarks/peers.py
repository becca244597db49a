"""AltiJAX beside other libraries on the same recordings: how far each is off, how long it takes, and what it does less.

    pip install gtsam vqf imufusion ahrs
    python benchmarks/peers.py [a part of a recording's name ...]

Needs the recordings (ALTIJAX_DATA_DIR). A peer that is not installed is left out, and it is said why. Every method gets
the same arrays, which is asserted before and after it ran: the IMU as recorded, velocities as stamped at about 1 Hz
(hand-motion: 5), and no reference. Of the reference each is judged at all times within the span of the velocities:

    incl       angle between the verticals, deg RMS, which needs no heading
    roll, pitch, heading   deg RMS, and the share of errors within one stated standard deviation, %
    velocity   3-D, m/s RMS
    CPU        seconds of all threads: once everything was compiled, without reading

The reference of rtk-drive is the receiver's own velocity, of which one in four is given; that of umn-thor75 an on-board
filter of the same sensors, that of comma2k19-example a fusion that used the same IMU. hand-motion's is optical.

python-ins 1.0.1 is not among them: with pandas 3 its feedback filter came to no end of 40 s of readings within 100 s.
"""

import importlib
import os
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation, Slerp

from altijax.datasets import load_dataset
from altijax.drives import gnss_velocities, gravity_at, imu_of, start_of
from altijax.motion_estimate.estimates import estimate_motion
from altijax.recordings import Recording, read_recording
from altijax.vehicle.estimates import estimate_drive

ANGLES, VELOCITY = ("roll", "pitch", "heading"), ("v_e", "v_n", "v_u")
# What a consumer's IMU is presumed to be by those that must be told: noise and walk of readings and their biases, and
# the biases at first; accelerometer m/s^2, gyro rad/s. A receiver's velocity that states no error has 0.1 m/s.
NOISE, WALK, BIAS = (0.03, 0.002), (0.003, 0.0003), (0.3, 0.02)
# Attitudes at the start: level as far as cars and hands keep still, and a heading of which nothing is known, rad.
LEVEL_STD, HEADING_STD = 0.1, 2.0


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What every method gets: times (s) from the first sample, readings (m/s^2, rad/s), velocities and their errors."""

    t: np.ndarray
    f_b: np.ndarray
    w_b: np.ndarray
    epochs: np.ndarray
    v_n: np.ndarray
    std: np.ndarray
    gravity: float

    def digest(self) -> bytes:
        return b"".join(np.ascontiguousarray(values).tobytes() for values in vars(self).values() if np.ndim(values))


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a method found: attitudes at times, velocities where it has them, and standard deviations of the angles."""

    t: np.ndarray
    C_nb: np.ndarray
    v_n: np.ndarray | None = None
    std: np.ndarray | None = None


def inputs_of(recording: Recording) -> Inputs:
    imu = imu_of(recording)
    found = gnss_velocities(recording)
    assert found is not None
    t = imu.index.to_numpy(float) - start_of(recording)
    inside = (found[0] >= 0) & (found[0] <= t[-1])
    readings = imu[["ax", "ay", "az", "gx", "gy", "gz"]].to_numpy(float)
    epochs, v_n, std = (values[inside] for values in found)
    return Inputs(
        t=t, f_b=readings[:, :3], w_b=readings[:, 3:], epochs=epochs, v_n=v_n, std=std, gravity=gravity_at(recording)
    )


def matrices(angles: np.ndarray) -> np.ndarray:
    """C_nb (samples, 3, 3) of roll, pitch and heading, rad."""
    roll, pitch, heading = angles.T
    return Rotation.from_euler("ZYX", np.stack([np.pi / 2 - heading, -pitch, roll], -1)).as_matrix()


def angles_of(C_nb: np.ndarray) -> np.ndarray:
    yaw, pitch, roll = Rotation.from_matrix(C_nb).as_euler("ZYX").T
    return np.stack([roll, -pitch, np.mod(np.pi / 2 - yaw, 2 * np.pi)], -1)


def first_attitude(inputs: Inputs) -> np.ndarray:
    """By the mean force of the first second, and the first course that is one."""
    f = inputs.f_b[inputs.t < 1.0].mean(0)
    roll, pitch = np.arctan2(f[1], f[2]), np.arctan2(f[0], np.hypot(f[1], f[2]))
    fast = inputs.v_n[np.argmax(np.hypot(*inputs.v_n[:, :2].T) > 1.0)]
    return matrices(np.array([[roll, pitch, np.arctan2(fast[0], fast[1])]]))[0]


def altijax_motion(method: str) -> Callable[[Inputs, Recording], Found]:
    def run(inputs: Inputs, recording: Recording) -> Found:
        return of_table(estimate_motion(recording, method=method), inputs)

    return run


def altijax_drive(inputs: Inputs, recording: Recording) -> Found:
    return of_table(estimate_drive(replace(recording, wheel=None)), inputs)


def of_table(estimate: pd.DataFrame, inputs: Inputs) -> Found:
    return Found(
        t=inputs.t,
        C_nb=matrices(estimate[list(ANGLES)].to_numpy(float)),
        v_n=estimate[list(VELOCITY)].to_numpy(float),
        std=estimate[[f"{name}_std" for name in ANGLES]].to_numpy(float),
    )


def gtsam_batch(inputs: Inputs, _: Recording) -> Found:
    """Levenberg-Marquardt over poses, velocities and biases at the epochs, from four headings; the best of them."""
    import gtsam
    from gtsam.symbol_shorthand import B, V, X

    params = gtsam.PreintegrationCombinedParams.MakeSharedU(inputs.gravity)
    params.setAccelerometerCovariance(NOISE[0] ** 2 * np.eye(3))
    params.setGyroscopeCovariance(NOISE[1] ** 2 * np.eye(3))
    params.setBiasAccCovariance(WALK[0] ** 2 * np.eye(3))
    params.setBiasOmegaCovariance(WALK[1] ** 2 * np.eye(3))
    params.setIntegrationCovariance(1e-8 * np.eye(3))
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    zero = gtsam.imuBias.ConstantBias()
    first = np.searchsorted(inputs.t, inputs.epochs)
    first = np.clip(first, 0, inputs.t.size - 1)
    graph = gtsam.NonlinearFactorGraph()
    preintegrated = []
    for k, (begin, end) in enumerate(pairwise(first)):
        pim = gtsam.PreintegratedCombinedMeasurements(params, zero)
        for i in range(begin, end):
            f, w = 0.5 * (inputs.f_b[i] + inputs.f_b[i + 1]), 0.5 * (inputs.w_b[i] + inputs.w_b[i + 1])
            pim.integrateMeasurement(f, w, inputs.t[i + 1] - inputs.t[i])
        graph.add(gtsam.CombinedImuFactor(X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1), pim))
        preintegrated.append(pim)
    for k, (v, std) in enumerate(zip(inputs.v_n, inputs.std, strict=True)):
        graph.add(gtsam.PriorFactorVector(V(k), v, sigmas(np.where(np.isfinite(std), std, 100.0))))
    C0 = first_attitude(inputs)
    begin = gtsam.Pose3(gtsam.Rot3(C0), np.zeros(3))
    body = C0.T @ np.diag([LEVEL_STD, LEVEL_STD, HEADING_STD]) ** 2 @ C0
    attitude_and_place = np.zeros((6, 6))
    attitude_and_place[:3, :3], attitude_and_place[3:, 3:] = body, 0.01 * np.eye(3)
    graph.add(gtsam.PriorFactorPose3(X(0), begin, gtsam.noiseModel.Gaussian.Covariance(attitude_and_place)))
    biases = np.repeat(BIAS, 3)
    graph.add(gtsam.PriorFactorConstantBias(B(0), zero, sigmas(biases)))
    best = None
    for turn in (0.0, 0.5, 1.0, 1.5):
        turned = gtsam.Rot3(Rotation.from_rotvec([0, 0, turn * np.pi]).as_matrix() @ C0)
        state = gtsam.NavState(gtsam.Pose3(turned, np.zeros(3)), inputs.v_n[0])
        start = gtsam.Values()
        for k, v in enumerate(inputs.v_n):
            if k:
                state = preintegrated[k - 1].predict(gtsam.NavState(state.pose(), inputs.v_n[k - 1]), zero)
            start.insert(X(k), state.pose())
            start.insert(V(k), v)
            start.insert(B(k), zero)
        found = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
        error = graph.error(found)
        if best is None or error < best[0]:
            best = error, found
    assert best is not None
    values = best[1]
    nodes = range(inputs.epochs.size)
    C = np.array([values.atPose3(X(k)).rotation().matrix() for k in nodes])
    v = np.array([values.atVector(V(k)) for k in nodes])
    bias = np.array([values.atConstantBias(B(k)).vector() for k in nodes])
    marginals = gtsam.Marginals(graph, values)
    P = np.array([marginals.marginalCovariance(X(k))[:3, :3] for k in nodes])
    return between_nodes(inputs, first, C, v, bias, P)


def between_nodes(
    inputs: Inputs, first: np.ndarray, C: np.ndarray, v: np.ndarray, bias: np.ndarray, P: np.ndarray
) -> Found:
    """From the nodes to the samples between them: the readings integrated, and bent to meet the next node."""
    t, all_C, all_v = [], [], []
    for k, (begin, end) in enumerate(pairwise(first)):
        times = inputs.t[begin : end + 1]
        dt = np.diff(times)[:, None]
        f, w = inputs.f_b[begin : end + 1] - bias[k, :3], inputs.w_b[begin : end + 1] - bias[k, 3:]
        attitude = [Rotation.from_matrix(C[k])]
        for turn in Rotation.from_rotvec(0.5 * (w[1:] + w[:-1]) * dt):
            attitude.append(attitude[-1] * turn)
        turned = Rotation.concatenate(attitude)
        share = (times - times[0]) / (times[-1] - times[0])
        turned = turned * Rotation.from_rotvec(
            np.outer(share, (turned[-1].inv() * Rotation.from_matrix(C[k + 1])).as_rotvec())
        )
        a = turned.apply(f) - [0, 0, inputs.gravity]
        gained = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (a[1:] + a[:-1]) * dt, 0)])
        speed = v[k] + gained + np.outer(share, v[k + 1] - v[k] - gained[-1])
        t.append(times[:-1])
        all_C.append(turned.as_matrix()[:-1])
        all_v.append(speed[:-1])
    times = np.concatenate(t)
    std = angle_std(C, C @ P @ np.swapaxes(C, -1, -2))
    nodes = inputs.t[first]
    return Found(
        t=times,
        C_nb=np.concatenate(all_C),
        v_n=np.concatenate(all_v),
        std=np.stack([np.interp(times, nodes, column) for column in std.T], -1),
    )


def angle_std(C_nb: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Standard deviations of roll, pitch and heading by the covariance of rotation vectors in navigation axes."""
    steps = 1e-6 * np.eye(3)
    base = angles_of(C_nb)
    slopes = [
        ((angles_of(Rotation.from_rotvec(step).as_matrix() @ C_nb) - base + np.pi) % (2 * np.pi) - np.pi) / 1e-6
        for step in steps
    ]
    J = np.stack(slopes, -1)
    return np.sqrt(np.einsum("kij,kjl,kil->ki", J, P, J))


def vqf_offline(inputs: Inputs, _: Recording) -> Found:
    from vqf import offlineVQF

    step = float(np.median(np.diff(inputs.t)))
    quaternions = offlineVQF(np.ascontiguousarray(inputs.w_b), np.ascontiguousarray(inputs.f_b), None, step)["quat6D"]
    return Found(t=inputs.t, C_nb=Rotation.from_quat(quaternions, scalar_first=True).as_matrix())


def imufusion_ahrs(inputs: Inputs, _: Recording) -> Found:
    import imufusion

    ahrs, quaternions = imufusion.Ahrs(), []
    usual = float(np.median(np.diff(inputs.t)))
    steps = np.diff(inputs.t, prepend=-usual)
    for f, w, dt in zip(inputs.f_b / inputs.gravity, np.degrees(inputs.w_b), steps, strict=True):
        ahrs.set_sample_period(dt)
        ahrs.update_no_magnetometer(w, f)
        quaternions.append(ahrs.get_quaternion())
    return Found(t=inputs.t, C_nb=Rotation.from_quat(np.array(quaternions), scalar_first=True).as_matrix())


def ahrs_madgwick(inputs: Inputs, _: Recording) -> Found:
    from ahrs.filters import Madgwick

    step = float(np.median(np.diff(inputs.t)))
    quaternions = Madgwick(gyr=inputs.w_b, acc=inputs.f_b, Dt=step).Q
    return Found(t=inputs.t, C_nb=Rotation.from_quat(quaternions, scalar_first=True).as_matrix())


@dataclass(frozen=True)
class Peer:
    """A method: what it needs installed, what does it, and what it does less than estimate_drive."""

    name: str
    needs: str | None
    run: Callable[[Inputs, Recording], Found]
    less: str


NO_GNSS = "no velocities: no heading, no speed, no place; no bars, biases or delay"
PEERS = [
    Peer("estimate_drive", None, altijax_drive, "cars and what moves like them"),
    Peer("estimate_motion batch", None, altijax_motion("batch"), "no place"),
    Peer("estimate_motion window", None, altijax_motion("window"), "no place, biases or noise levels"),
    Peer("estimate_motion epoch", None, altijax_motion("epoch"), "no gyro, place or biases"),
    Peer("gtsam batch", "gtsam", gtsam_batch, "noise, start and delay are told; no scales, lever or outliers"),
    Peer("vqf offline", "vqf", vqf_offline, NO_GNSS + " (gyro bias alone)"),
    Peer("imufusion", "imufusion", imufusion_ahrs, NO_GNSS),
    Peer("ahrs Madgwick", "ahrs", ahrs_madgwick, NO_GNSS),
]


def recordings() -> dict[str, Callable[[], Recording]]:
    def comma() -> Recording:
        recording = load_dataset("comma2k19-example")
        velocities = recording.reference[list(VELOCITY)].iloc[::20]
        place = recording.gnss[["lat", "lon", "alt"]].mean()
        return replace(recording, gnss=velocities[velocities.index >= 0].assign(**place))

    def rtk() -> Recording:
        """The yardstick of CPU time: 190 s at 100 Hz with a velocity a second."""
        recording = load_dataset("rtk-drive")
        begin = recording.imu.index[0]
        return replace(recording, imu=recording.imu[: begin + 190.0], gnss=recording.gnss[: begin + 190.0].iloc[::4])

    def hand() -> Recording:
        return read_recording(Path(os.environ["ALTIJAX_DATA_DIR"]) / "hand-motion", units={"gyro": "rad/s"})

    return {
        "rtk-drive, 190 s": rtk,
        "comma2k19-example": comma,
        "umn-thor75": lambda: load_dataset("umn-thor75"),
        "hand-motion": hand,
    }


def scored(found: Found, inputs: Inputs, recording: Recording) -> dict[str, float]:
    """Errors against the reference, by the names of columns."""
    reference = recording.reference
    t = reference.index.to_numpy(float) - start_of(recording)
    begin, end = max(inputs.epochs[0], found.t[0]), min(inputs.epochs[-1], found.t[-1])
    inside = (t >= begin) & (t <= end)
    t, reference = t[inside], reference[inside]
    score = {}
    if set(ANGLES) <= set(reference):
        true = matrices(reference[list(ANGLES)].to_numpy(float))
        C_nb = Slerp(found.t, Rotation.from_matrix(found.C_nb))(t).as_matrix()
        score["incl"] = np.degrees(rms(np.arccos(np.clip(np.sum(true[:, 2] * C_nb[:, 2], -1), -1, 1))))
        if found.v_n is not None:
            error = (angles_of(C_nb) - angles_of(true) + np.pi) % (2 * np.pi) - np.pi
            std = np.stack([np.interp(t, found.t, column) for column in found.std.T], -1)
            for i, name in enumerate(ANGLES):
                score[name] = np.degrees(rms(error[:, i]))
                score[f"{name} in 1"] = 100 * float(np.mean(np.abs(error[:, i]) <= std[:, i]))
    if found.v_n is not None:
        v = np.stack([np.interp(t, found.t, column) for column in found.v_n.T], -1)
        score["velocity"] = rms(np.linalg.norm(v - reference[list(VELOCITY)].to_numpy(float), axis=1))
    return score


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(x))))


def missing(peer: Peer) -> str | None:
    """Why a peer cannot be run, if so."""
    try:
        importlib.import_module(peer.needs or "altijax")
    except ImportError as error:
        return f"{peer.name}: left out, {error}"
    return None


def compared(recording: Recording, peers: list[Peer]) -> pd.DataFrame:
    rows = {}
    for peer in peers:
        inputs = inputs_of(recording)
        given = inputs.digest()
        # Once before, for what is compiled.
        if peer.needs is None:
            peer.run(inputs, recording)
        began = time.process_time()
        found = peer.run(inputs, recording)
        took = time.process_time() - began
        assert inputs.digest() == given == inputs_of(recording).digest(), f"{peer.name} changed what all are given"
        rows[peer.name] = scored(found, inputs, recording) | {"CPU": took}
        print(
            f"  {peer.name:24} " + "  ".join(f"{name} {value:.3g}" for name, value in rows[peer.name].items()),
            flush=True,
        )
    return pd.DataFrame(rows).T


def main() -> None:
    chosen = sys.argv[1:]
    reasons = {peer.name: missing(peer) for peer in PEERS}
    for reason in filter(None, reasons.values()):
        print(reason)
    peers = [peer for peer in PEERS if reasons[peer.name] is None]
    for name, load in recordings().items():
        if not chosen or any(part in name for part in chosen):
            print(name)
            compared(load(), peers)
    print("\nwhat each does less")
    for peer in peers:
        print(f"  {peer.name:24} {peer.less}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
