"""The whole record's most probable motion: its errors against its bars, a delay that is known, constants held."""

from dataclasses import replace

import jax
import numpy as np
import pandas as pd
import pytest

from altijax.calibration.records import Calibration
from altijax.motion_estimate.batch import _turns_around as turns_around, batch_with_constants
from altijax.motion_estimate.estimates import estimate_motion
from altijax.recordings import Recording
from altijax.rotations import euler_to_matrix, matrix_to_rotvec
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.search import Search, begun, passed, said_between
from altijax.vehicle.sensors import layout_of
from tests.vehicle.made import short_drive

GRAVITY, RATE = 9.80665, 25.0
USE = ("gyro", "velocity")
# As the records are drawn; what is not drawn is next to nothing.
LEVELS = {"rotation": 0.01, "acceleration": 0.05, "gyro_walk": 1e-6, "accelerometer_walk": 1e-6, "force_error": 1e-5}
LEVELS |= {"lasting_horizontal": 1e-5, "lasting_vertical": 1e-5}


def truth(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Attitude, velocity, force and rate of a banked circle with a changing speed."""
    yaw_rate, bank = 0.5, 0.4
    speed, rise = 10 + 3 * np.sin(0.6 * t), 1.8 * np.cos(0.6 * t)
    yaw = yaw_rate * t + 1.0
    along, left = np.stack([np.cos(yaw), np.sin(yaw), 0 * t], -1), np.stack([-np.sin(yaw), np.cos(yaw), 0 * t], -1)
    a = rise[:, None] * along + (speed * yaw_rate)[:, None] * left
    C = np.asarray(euler_to_matrix(np.stack([np.full_like(t, bank), 0 * t, yaw], -1)))
    f = np.einsum("tji,tj->ti", C, a + np.array([0, 0, GRAVITY]))
    w = np.tile([0.0, yaw_rate * np.sin(bank), yaw_rate * np.cos(bank)], (t.size, 1))
    return C, speed[:, None] * along, f, w


def simulated(seed: int) -> tuple[Search, np.ndarray]:
    """A search at the truth, of readings with noise and constants drawn from what is believed."""
    rng = np.random.default_rng(seed)
    t, epochs = np.arange(0, 20, 1 / RATE), np.arange(0.5, 19.5, 1.0)
    _, _, f, w = truth(t)
    bias = np.r_[0.15 * rng.normal(size=3), 0.07 * rng.normal(size=3)]
    f = f + bias[:3] + 0.05 * np.sqrt(RATE) * rng.normal(size=f.shape)
    w = w + bias[3:] + 0.01 * np.sqrt(RATE) * rng.normal(size=w.shape)
    imu = pd.DataFrame(np.c_[f, w], columns=["ax", "ay", "az", "gx", "gy", "gz"], index=t)
    v = truth(epochs)[1] + 0.1 * rng.normal(size=(epochs.size, 3))
    gnss = pd.DataFrame(v, columns=["v_e", "v_n", "v_u"], index=epochs).assign(sd_e=0.1, sd_n=0.1, sd_u=0.1)
    layout, belief = layout_of(USE), belief_of(USE)
    keep = ("attitude", "velocity", "accelerometer_bias", "gyro_bias", "force_error", "velocity_error")
    for name in layout.names:
        if name not in keep:
            belief.covariance[layout.at(name)] = 0
            belief.mean[layout.at(name)] = 0
    search = begun(Recording(imu=imu, gnss=gnss, site_latitude=0.8), USE, 0.0, belief, [])
    search = replace(search, levels=search.levels | LEVELS)
    C, v, _, _ = truth(np.asarray(said_between(search).instants))
    x = np.array(search.trajectory.x)
    x[:, layout.at("velocity")] = v
    readings = replace(search.readings, gravity=jax.device_put(GRAVITY))
    return replace(search, trajectory=replace(search.trajectory, C_nb=C, x=x), readings=readings), bias


@pytest.mark.slow
def test_errors_have_the_size_of_their_bars() -> None:
    """Normalised errors squared of attitude, velocity and biases in mid-record, over simulated records: 12 each."""
    squares, layout = [], layout_of(USE)
    names = ("attitude", "velocity", "accelerometer_bias", "gyro_bias")
    places = np.concatenate([np.arange(layout.size)[layout.at(name)] for name in names])
    for seed in range(8):
        with jax.enable_x64(True):
            search, bias = simulated(seed)
            found = passed(search, 12)
        k = 10
        C, v, _, _ = truth(np.asarray(said_between(found).instants))
        x = layout.split(np.asarray(found.trajectory.x)[k])
        error = np.r_[
            matrix_to_rotvec(C[k] @ np.asarray(found.trajectory.C_nb)[k].T),
            v[k] - x["velocity"],
            bias[:3] - x["accelerometer_bias"],
            bias[3:] - x["gyro_bias"],
        ]
        P = np.asarray(found.fit.covariance)[k][np.ix_(places, places)]
        squares.append(error @ np.linalg.solve(P, error))
    # The mean of 8 chi-squares of 12 degrees has a standard deviation of 1.7.
    assert 6.9 < np.mean(squares) < 17.1, squares


@pytest.mark.slow
def test_a_delay_that_is_known_stays() -> None:
    estimate = estimate_motion(short_drive(), delay=0.05)
    assert estimate.attrs["delay"] == pytest.approx(0.05, abs=1e-12)
    assert estimate.attrs["climb_delay"] == 0.0


@pytest.mark.slow
def test_constants_that_are_held_are_those_of_the_estimate() -> None:
    with jax.enable_x64(True):
        motion = batch_with_constants(short_drive())
        found = motion(known(gyro_bias_z=0.01)).attrs["constants"]["gyro_bias_z"]
    # It is held where the record begins, and may walk from there.
    assert found[0] == pytest.approx(0.01, abs=1e-3)


def known(**values: float) -> Calibration:
    table = pd.DataFrame({"value": values, "std": 1e-5, "unit": "", "prior": 0.0, "prior_std": 1.0})
    names = list(values)
    return Calibration(
        method="trial",
        table=table,
        correlation=pd.DataFrame(np.eye(len(names)), names, names),
        absorbed=pd.DataFrame(index=names),
        undetermined=(),
        held_out=pd.DataFrame(),
    )


def test_courses_tell_of_a_wind_where_they_spread() -> None:
    angle = np.linspace(0, 2 * np.pi, 40)
    around = pd.DataFrame({"v_e": 10 * np.cos(angle) + 5, "v_n": 10 * np.sin(angle), "v_u": 0.0}, index=angle)
    recording = replace(short_drive(), gnss=around)
    assert turns_around(recording, np.array([5.0, 0.0]))
    assert not turns_around(recording, np.array([50.0, 0.0]))
