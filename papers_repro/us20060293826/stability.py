"""The patent's loop without any sensor error: how a small error of the speed grows, and what stepping alone does."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp

from altijax.motions import Readings
from altijax.rotations import matrix_to_euler
from altijax.speed import speed_error_growth, speed_with_roll
from papers_repro.us20060293826.experiments import DT, Drive, G, readings_of, turning_of, winding_drive


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Growth:
    """Errors on error-free readings (time,): per initial error by simulation and by the loop's derivative, as the
    linearised equation has it, as a constant yaw rate would have it; and the errors of both steppings by themselves."""

    turning: jax.Array
    simulated: jax.Array
    derivative: jax.Array
    linearised: jax.Array
    constant_rate: jax.Array
    second_order: jax.Array
    literal: jax.Array


def curvy_drive() -> Drive:
    """About 10 rad of turning in a minute, nearly level."""
    drive = winding_drive((0.56, 0.30), 500.0, (130.0, 83.0))
    return replace(drive, road=replace(drive.road, cant=drive.road.cant / 3))


@jax.jit
def error_growth(drive: Drive) -> Growth:
    readings = readings_of(drive)
    turning = turning_of(readings)
    small = 1e-6

    def found(initial_error: jax.Array) -> jax.Array:
        return _speed(readings, initial_error, "second_order")

    exact, derivative = jax.jvp(found, (0.0,), (1.0,))
    return Growth(
        turning=turning,
        simulated=(found(jnp.asarray(small)) - exact) / small,
        derivative=derivative,
        linearised=speed_error_growth(readings.w_b[:, 2], DT)[0],
        constant_rate=jnp.cosh(turning),
        second_order=exact - readings.speed,
        literal=_speed(readings, jnp.asarray(0.0), "literal") - readings.speed,
    )


def _speed(readings: Readings, initial_error: jax.Array, stepping: str) -> jax.Array:
    (f_x, f_y), (w_y, w_z) = readings.f_b[:, :2].T, readings.w_b[:, 1:].T
    pitch0 = matrix_to_euler(readings.C_nb[0])[1]
    return speed_with_roll(f_x, f_y, w_y, w_z, readings.speed[0] + initial_error, pitch0, G, DT, stepping)[0]
