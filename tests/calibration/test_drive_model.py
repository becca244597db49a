"""The stretch model explains exactly what ideal sensors on a known motion record."""

import jax
import jax.numpy as jnp
import numpy as np

from altijax.calibration.drive_model import DRIVE_PARAMETERS, STEP, Stretch, drive_residuals, own_states
from altijax.calibration.simulated_drives import Manoeuvres, town_drive
from altijax.rotations import euler_to_matrix

GRAVITY, STEPS = 9.81, 200
TRUTH = np.array([1.01, -0.03, 0.16, 0.1, -0.2, 0.05, 1.005, 0.002, -0.003, 0.004, 0.05, -0.02])
P = dict(zip(DRIVE_PARAMETERS, TRUTH, strict=True))
START = 8.0  # under way, so that the first velocity is not zero


@jax.jit
def motion(t: jax.Array) -> dict[str, jax.Array]:
    readings = town_drive(Manoeuvres(), START + t, GRAVITY, legs=1)
    return {name: getattr(readings, name) for name in ("f_b", "w_b", "velocity", "speed", "C_nb")}


def stretch_and_own() -> tuple[Stretch, jax.Array]:
    node, middle = motion(STEP * jnp.arange(STEPS)), motion(STEP * (jnp.arange(STEPS) + 0.5))
    mounting = euler_to_matrix(jnp.array([0.0, P["mounting_pitch"], P["mounting_yaw"]]))
    bias, rate_bias = (jnp.array([P[f"{kind}_bias_{a}"] for a in "xyz"]) for kind in ("accelerometer", "gyro"))
    t_gnss, t_wheel = 0.4 + jnp.arange(9.0), 0.3 + 0.1 * jnp.arange(94)

    # the stamps' times of motion, as steps of `motion` so that one compilation serves all
    def pad(t: jax.Array) -> jax.Array:
        return jnp.resize(t, STEPS)

    v_gnss = motion(pad(t_gnss - P["gnss_delay"]))["velocity"][: t_gnss.size]
    speed = motion(pad(t_wheel - P["wheel_delay"]))["speed"][: t_wheel.size]
    stretch = Stretch(
        f=(middle["f_b"] @ mounting + bias) * P["accelerometer_scale"],
        w=middle["w_b"] @ mounting + rate_bias,
        C_nb=node["C_nb"][0] @ mounting,
        gravity=jnp.asarray(GRAVITY),
        noise=jnp.array([1e-4, 1e-3]),
        t_gnss=t_gnss,
        v_gnss=v_gnss,
        gnss_std=jnp.ones((t_gnss.size, 2)),
        t_wheel=t_wheel,
        wheel=speed / P["wheel_scale"],
        wheel_std=jnp.ones((t_wheel.size, 3)),
    )
    return stretch, jnp.zeros(own_states(STEPS)).at[3:6].set(node["velocity"][0])


def test_ideal_data_leave_no_residual() -> None:
    stretch, own = stretch_and_own()
    residuals = jax.jit(drive_residuals)(jnp.asarray(TRUTH), own, stretch)
    assert residuals.size == 3 * (9 + 94)
    assert np.abs(residuals).max() < 5e-3  # m/s; second order in the step
    # and each parameter matters: a tenth of its prior shows
    jacobian = jax.jit(jax.jacfwd(drive_residuals))(jnp.asarray(TRUTH), own, stretch)
    unit = np.array([row[1] for row in DRIVE_PARAMETERS.values()])
    assert np.all(np.abs(jacobian * unit).max(0) > 0.05)


def test_a_kick_is_a_change_of_attitude_or_velocity_from_its_time_on() -> None:
    stretch, own = stretch_and_own()
    solve = jax.jit(drive_residuals)
    base = solve(jnp.asarray(TRUTH), own, stretch)
    size = 1e-3 * (100 * STEP) ** 0.5
    kicked = solve(jnp.asarray(TRUTH), own.at[9].set(1.0), stretch) - base  # East velocity at 5 s
    east, north = kicked[:9], kicked[9:18]
    before = np.asarray(stretch.t_gnss) - P["gnss_delay"] < 5.0
    np.testing.assert_allclose(east[before], 0, atol=1e-12)
    np.testing.assert_allclose(east[~before], -size, rtol=1e-6)
    np.testing.assert_allclose(north, 0, atol=1e-12)
    tilted = solve(jnp.asarray(TRUTH), own.at[7].set(1.0), stretch) - base  # turned about North: up leans East
    late = float(stretch.t_gnss[8]) - P["gnss_delay"] - 5.0
    angle = 1e-4 * (100 * STEP) ** 0.5
    change = motion(jnp.resize(jnp.array([5.0, 5.0 + late]), STEPS))["velocity"][:2]
    lifted = GRAVITY * late + float(change[1, 2] - change[0, 2])
    np.testing.assert_allclose(tilted[8], -angle * lifted, rtol=0.01)


def test_missing_observations_leave_nothing() -> None:
    stretch, own = stretch_and_own()
    blind = Stretch(**{**vars(stretch), "gnss_std": jnp.full((9, 2), jnp.inf), "wheel_std": jnp.full((94, 3), jnp.inf)})
    value, slope = jax.jit(jax.value_and_grad(lambda p: jnp.sum(drive_residuals(p, own, blind) ** 2)))(
        jnp.asarray(TRUTH)
    )
    assert value == 0 and np.all(slope == 0)
