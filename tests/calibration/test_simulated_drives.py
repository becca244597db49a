"""A simulated drive is what it says: stops, turns and hills, and readings that the parameters explain."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive
from altijax.doppler import DopplerReceiver
from altijax.rotations import euler_to_matrix
from altijax.sensors import Accelerometer, Gyro
from tests.calibration.planted import planted

T = jnp.arange(1301) * 0.1
READINGS = jax.jit(lambda t: town_drive(Manoeuvres(), t, 9.81, legs=2))(T)


def test_drive_stops_turns_and_climbs() -> None:
    still = np.asarray(READINGS.speed) < 1e-9
    assert still[:55].all() and still[601:655].all() and not still[200:500].any()
    assert 10 < READINGS.speed.max() < 20
    assert np.ptp(np.asarray(READINGS.w_b[:, 2])) > 0.2
    assert np.ptp(np.asarray(READINGS.position[:, 2])) > 3


def test_recorded_readings_are_the_ideal_ones_through_the_parameters() -> None:
    truth = planted(
        wheel_scale=1.02,
        wheel_delay=0.1,
        gnss_delay=0.2,
        weight_transfer=0,
        wheel_slip=0,
        lever_arm=0,
        antenna_lever_arm=0,
    )
    recorded = recorded_drive(
        READINGS,
        truth,
        accelerometer=Accelerometer(),
        gyro=Gyro(),
        receiver=DopplerReceiver(rate=1.0),
        wheel_noise=0.0,
        epochs=130,
        key=jax.random.key(0),
    )
    p = dict(zip(DRIVE_PARAMETERS, truth, strict=True))
    mounting = euler_to_matrix(jnp.array([0.0, p["mounting_pitch"], p["mounting_yaw"]]))
    f_vehicle = (recorded["f"] / 1.005 - jnp.array([0.1, -0.2, 0.05])) @ mounting.T
    np.testing.assert_allclose(f_vehicle, READINGS.f_b, atol=1e-9)
    np.testing.assert_allclose(
        (recorded["w"] / np.array([1, 1, 1.004]) - truth[7:10]) @ mounting.T, READINGS.w_b, atol=1e-9
    )
    np.testing.assert_allclose(recorded["v_gnss"][30], READINGS.velocity[298], atol=1e-9)
    assert np.isnan(recorded["v_gnss"][0]).all()  # it would report what was before the drive
    np.testing.assert_allclose(recorded["wheel"][200] * 1.02, READINGS.speed[401], atol=1e-9)
    apart = 1.6 * READINGS.w_b[401, 2] - 0.01 * READINGS.speed[401]
    np.testing.assert_allclose(recorded["apart"][200] * 1.02, apart, atol=1e-9)
