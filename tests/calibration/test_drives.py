"""A drive's calibration recovers what was simulated, says what a straight road hides, and agrees with real delays."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.calibration.drive_model import DRIVE_PARAMETERS, GROUPS
from altijax.calibration.drives import calibrate_driving, calibrate_stretches, drive_stretches
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive
from altijax.doppler import DopplerReceiver
from altijax.instruments import MEMS_ACCELEROMETER, MEMS_GYRO
from altijax.recordings import read_recording
from altijax.sensors import Accelerometer, Gyro
from tests.calibration.planted import planted

TRUTH = planted(
    **{"wheel_scale": 1.013, "accelerometer_scale": 0.996, "mounting_pitch": 0.06, "mounting_yaw": -0.03},
    **{"accelerometer_bias_x": 0.2, "accelerometer_bias_y": -0.15, "accelerometer_bias_z": 0.1},
    **{"gyro_bias_x": 0.004, "gyro_bias_y": -0.006, "gyro_bias_z": 0.005},
)
EVERYTHING = list(DRIVE_PARAMETERS)
DENSITY = {"gyro": float(MEMS_GYRO.noise_density), "accelerometer": float(MEMS_ACCELEROMETER.noise_density)}
DENSITY["receiver"] = 0.0
record = jax.jit(
    lambda readings, key: recorded_drive(
        readings,
        TRUTH,
        accelerometer=Accelerometer(noise_density=MEMS_ACCELEROMETER.noise_density),
        gyro=Gyro(noise_density=MEMS_GYRO.noise_density),
        receiver=DopplerReceiver(rate=10.0, horizontal_noise=0.05, vertical_noise=0.1),
        wheel_noise=0.03,
        epochs=3000,
        key=key,
    )
)
drive = jax.jit(lambda manoeuvres: town_drive(manoeuvres, jnp.arange(30001) / 100, 9.80665))


@pytest.mark.slow
def test_five_minutes_with_turns() -> None:
    calibration = calibrate_stretches(drive_stretches(record(drive(Manoeuvres()), jax.random.key(1)), 9.80665, DENSITY))
    table = calibration.table
    assert calibration.converged
    error = np.abs(table["value"] - TRUTH)
    limits = {"wheel_scale": 1e-3, "gnss_delay": 5e-3, "wheel_delay": 5e-3}
    limits |= {f"accelerometer_bias_{axis}": 5e-3 for axis in "xy"}
    limits |= {"mounting_pitch": np.radians(0.2), "mounting_yaw": np.radians(0.2)}
    for name, limit in limits.items():
        assert error[name] < limit, (name, error[name])
    assert np.all(error < 4 * table["std"])
    assert calibration.noise["GNSS horizontal"] == pytest.approx(0.05, rel=0.15)
    # the same drive on a straight road without hills: a tilt looks like a bias
    straight = drive(replace(Manoeuvres(), turning=0.0, slope=0.0))
    hidden = calibrate_stretches(drive_stretches(record(straight, jax.random.key(1)), 9.80665, DENSITY))
    assert hidden.table["std"]["accelerometer_bias_y"] > 20 * table["std"]["accelerometer_bias_y"]
    assert hidden.converged and "accelerometer_bias_y" in str(hidden)
    assert np.all(np.abs(hidden.table["value"] - TRUTH) < 4 * hidden.table["std"])


@pytest.mark.slow
def test_delays_and_wheel_scale_of_a_real_drive(data_dir: Path) -> None:
    with pytest.warns(UserWarning, match="magnetometer"):
        recording = read_recording(data_dir / "comma2k19-example")
    calibration = calibrate_driving([recording], EVERYTHING, method="drive")
    value, std = calibration.table["value"], calibration.table["std"]
    assert value["gnss_delay"] == pytest.approx(0.16, abs=0.04)
    assert value["wheel_delay"] == pytest.approx(-0.03, abs=0.04)
    assert value["wheel_scale"] == pytest.approx(1.0087, abs=1e-3)  # of the reference over the whole path
    for name, true in {"wheel_delay": -0.03, "wheel_scale": 1.0087}.items():
        assert abs(value[name] - true) < 2 * std[name]
    assert std["wheel_scale"] < 1e-3
    # the rear wheels one by one: alike, and as far apart as on cars of that size
    assert abs(value["wheel_difference"]) < 2e-3 and abs(value["track_width"] - 1.55) < 2 * std["track_width"] < 0.2
    part = calibrate_driving([recording], EVERYTHING, method="drive", until=41.0).held_out.set_index("quantity")
    assert list(part.index) == list(GROUPS) and part["fitted"].isna().all()
    assert part.loc["wheel", "held_out"] < part.loc["wheel", "held_out_nominal"]


@pytest.mark.slow
def test_without_wheels_the_others_are_found_and_theirs_are_named(data_dir: Path) -> None:
    calibration = calibrate_driving([read_recording(data_dir / "rtk-drive")], EVERYTHING, method="drive")
    table = calibration.table
    wheels = ["wheel_scale", "wheel_delay", "wheel_slip", "wheel_difference", "track_width"]
    np.testing.assert_allclose(table.loc[wheels, "std"], table.loc[wheels, "prior_std"], rtol=1e-6)
    assert all(f"less of {name} than" in str(calibration) for name in wheels)
    # a town's corners tell where axle and antenna are
    assert table["bits"][["lever_arm", "antenna_lever_arm", "mounting_pitch", "mounting_yaw"]].min() > 3
    assert table["std"]["gnss_delay"] < 0.02 and 0 <= table["value"]["gnss_delay"] < 0.12


def test_mistakes_are_named(data_dir: Path) -> None:
    with pytest.raises(ValueError, match="shorter than a stretch of 21 s"):
        zeros = np.zeros((50, 3))
        t = np.arange(50) / 10
        drive_stretches(
            {"t": t, "f": zeros, "w": zeros, "t_gnss": t, "v_gnss": zeros, "t_wheel": t, "wheel": t, "apart": t}, 9.8
        )
    with pytest.raises(ValueError, match="lacks a stream"):
        recording = replace(read_recording(data_dir / "umn-thor75"), gnss=None)
        calibrate_driving([recording], EVERYTHING, method="drive")
    stretches = drive_stretches(record(drive(Manoeuvres()), jax.random.key(1)), 9.80665)
    with pytest.raises(ValueError, match="must be different names out of wheel_scale"):
        calibrate_stretches(stretches, ["wheel_size"])
