"""The stretch model explains exactly what ideal sensors on a known motion record."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from altijax.calibration.drive_model import (
    DRIVE_PARAMETERS,
    STEP,
    STEPS_OF_INTERVAL,
    Stretch,
    _at,
    drive_residuals,
    own_states,
)
from altijax.calibration.simulated_drives import Manoeuvres, recorded_drive, town_drive
from altijax.doppler import DopplerReceiver
from altijax.rotations import euler_to_matrix
from altijax.sensors import Accelerometer, Gyro
from tests.calibration.planted import planted

GRAVITY, STEPS, FINE = 9.80665, 200, 10
TRUTH = planted()
P = dict(zip(DRIVE_PARAMETERS, TRUTH, strict=True))
START = 8.0  # under way, so that the first velocity is not zero
solve = jax.jit(drive_residuals)


@jax.jit
def recorded() -> tuple:
    t = START + STEP / FINE * jnp.arange(-FINE * 20, FINE * (STEPS + 20) + 1)
    readings = town_drive(Manoeuvres(), t, GRAVITY, legs=1)
    drive = recorded_drive(
        readings,
        TRUTH,
        accelerometer=Accelerometer(),
        gyro=Gyro(),
        receiver=DopplerReceiver(rate=2.0),
        wheel_noise=0.0,
        epochs=24,
        key=jax.random.key(0),
    )
    return readings, drive


def stretch_and_own() -> tuple[Stretch, jax.Array]:
    readings, drive = recorded()
    first = FINE * 20
    mounting = euler_to_matrix(jnp.array([0.0, P["mounting_pitch"], P["mounting_yaw"]]))
    acceleration = (readings.speed[first + 1] - readings.speed[first - 1]) / (2 * STEP / FINE)
    squat = euler_to_matrix(jnp.array([0.0, P["weight_transfer"] / GRAVITY * acceleration, 0.0]))
    ahead = jnp.array([P["lever_arm"], 0.0, 0.0])
    true_rate = drive["w"][first] / jnp.array([1, 1, P["gyro_scale_z"]]) - TRUTH[7:10]
    at_imu = jnp.cross(mounting @ true_rate, ahead)
    velocity = readings.velocity[first] + readings.C_nb[first] @ squat @ at_imu

    def means(x: jax.Array) -> jax.Array:
        fine = x[first : first + FINE * STEPS + 1]
        return ((fine[1:] + fine[:-1]) / 2).reshape(STEPS, FINE, 3).mean(1)

    epochs, samples = slice(2, 21), slice(100, 1100, 10)
    t_gnss, t_wheel = drive["t_gnss"][epochs] - START, drive["t_wheel"][samples] - START
    stretch = Stretch(
        f=means(drive["f"]),
        w=means(drive["w"]),
        C_nb=readings.C_nb[first] @ squat @ mounting,
        gravity=jnp.asarray(GRAVITY),
        noise=jnp.array([1e-4, 1e-3, 0.02]),
        t_gnss=t_gnss,
        v_gnss=drive["v_gnss"][epochs],
        gnss_std=jnp.ones((t_gnss.size, 2)),
        t_wheel=t_wheel,
        wheel=drive["wheel"][samples],
        apart=drive["apart"][samples],
        wheel_spread=jnp.zeros(t_wheel.size),
        wheel_std=jnp.ones((t_wheel.size, 4)),
    )
    return stretch, jnp.zeros(own_states(STEPS)).at[3:6].set(velocity)


def test_ideal_data_leave_no_residual() -> None:
    stretch, own = stretch_and_own()
    inside = (stretch.t_gnss > 0.5) & (stretch.t_gnss < 9.5), (stretch.t_wheel > 0.5) & (stretch.t_wheel < 9.5)
    residuals = solve(jnp.asarray(TRUTH), own, stretch)
    kept = np.concatenate([np.tile(part, kinds) for part, kinds in zip(inside, (3, 4), strict=True)])
    assert residuals.size == kept.size
    assert np.abs(residuals[kept]).max() < 5e-3  # m/s; second order in the step
    # and each parameter matters: a tenth of its prior shows
    jacobian = jax.jit(jax.jacfwd(drive_residuals))(jnp.asarray(TRUTH), own, stretch)
    unit = np.array([constant.spread for constant in DRIVE_PARAMETERS.values()])
    assert np.all(np.abs(jacobian * unit)[kept].max(0) > 0.015)


def test_a_mean_of_speeds_is_not_the_speed_in_its_middle() -> None:
    """Where the speed bends: a model of the middle alone reads as a scale of the accelerometers."""
    stretch, own = stretch_and_own()
    _, drive = recorded()
    around = np.arange(-5, 6)
    means = drive["wheel"][100 + 10 * np.arange(stretch.t_wheel.size)[:, None] + around].mean(1)
    spread = float(jnp.std(drive["t_wheel"][:11]))
    averaged = replace(stretch, wheel=means, wheel_spread=jnp.full(means.size, spread))
    inside = np.flatnonzero((stretch.t_wheel > 0.5) & (stretch.t_wheel < 9.5)) + 3 * stretch.t_gnss.size
    moved = (solve(jnp.asarray(TRUTH), own, averaged) - solve(jnp.asarray(TRUTH), own, stretch))[inside]
    assert np.abs(means - stretch.wheel)[inside - 3 * stretch.t_gnss.size].max() > 1e-4
    assert np.abs(moved).max() < 1e-5


def test_a_drift_is_an_even_change_of_attitude_or_velocity_in_its_interval() -> None:
    stretch, own = stretch_and_own()
    base = solve(jnp.asarray(TRUTH), own, stretch)
    epochs, length = stretch.t_gnss.size, STEPS_OF_INTERVAL * STEP
    moved = np.clip(stretch.t_gnss - P["gnss_delay"], 0, STEPS * STEP)
    into = np.clip(moved - length, 0, length)
    drifted = solve(jnp.asarray(TRUTH), own.at[15].set(1.0), stretch) - base  # East velocity in the second interval
    np.testing.assert_allclose(drifted[:epochs], -1e-3 * into / length**0.5, atol=1e-4)
    np.testing.assert_allclose(drifted[epochs : 2 * epochs], 0, atol=1e-12)
    # a tilt that grows evenly about North: up leans East, the more the longer
    tilted = solve(jnp.asarray(TRUTH), own.at[13].set(1.0), stretch) - base
    long = (into**2 / 2 + into * np.clip(moved - 2 * length, 0, None))[-1]
    expected = -1e-4 / length**0.5 * GRAVITY * long
    np.testing.assert_allclose(tilted[epochs - 1], expected, rtol=0.1)
    slow = solve(jnp.asarray(TRUTH), own.at[-1].set(1.0), stretch) - base
    np.testing.assert_allclose(slow[2 * epochs : 3 * epochs], -0.02, rtol=1e-9)


def test_interpolation_is_smooth_where_neighbours_change() -> None:
    values = jnp.asarray(np.random.default_rng(0).normal(size=(12, 1)))
    value = jax.jit(lambda t: _at(t[None], values.T)[0, 0])
    slope = jax.jit(jax.grad(value))
    for node in (0.5, 1.0, 1.5):
        t = node / 1.5 * 6 * STEP
        np.testing.assert_allclose(value(t - 1e-7), value(t + 1e-7), atol=1e-4)
        np.testing.assert_allclose(slope(t - 1e-7), slope(t + 1e-7), atol=1e-2)
    t = STEP * jnp.linspace(1.2, 8.7, 5)
    np.testing.assert_allclose(_at(t, (STEP * jnp.arange(12.0)[None]) ** 2)[0], t**2, atol=1e-9)


def test_missing_observations_leave_nothing() -> None:
    stretch, own = stretch_and_own()
    epochs, samples = stretch.t_gnss.size, stretch.t_wheel.size
    blind = replace(stretch, gnss_std=jnp.full((epochs, 2), jnp.inf), wheel_std=jnp.full((samples, 4), jnp.inf))
    value, slope = jax.jit(jax.value_and_grad(lambda p: jnp.sum(drive_residuals(p, own, blind) ** 2)))(
        jnp.asarray(TRUTH)
    )
    assert value == 0 and np.all(slope == 0)
