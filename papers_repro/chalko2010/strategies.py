"""Ways to an attitude at every epoch: the paper's, by three makes of Levenberg-Marquardt, and the remedies.

The three differ in what they add to J^T J: More's and Marquardt's a multiple of its own diagonal, by which an angle
that the data do not tell is hardly held; Levenberg's a multiple of the identity, which holds it where it began.

Eq. (5) leaves a circle of attitudes at every epoch, and what is found on it is decided by how the method gets there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from altijax.attitude import fit_attitude
from altijax.least_squares import levenberg_marquardt
from altijax.rotations import euler_to_matrix
from altijax.wahba import fit_windows
from papers_repro.chalko2010.epochs import Epochs

# Of a mean acceleration between two velocities with the noise of 0.05 m/s, and some for the device's turning.
MEASUREMENT_STD = 0.1
# How far a head or a device may be from (0, 0, COG): 11 degrees.
PRIOR_STD = 0.2
# Epochs of a window: long enough for curves, short enough for a gyro bias of 0.1 deg/s.
WINDOW = 15
# Prior of a window, which is to find the attitude of any mounting.
FREE = 10.0


@dataclass(frozen=True)
class Strategy:
    """A way to C_nb at mid-epoch, by name; `carried` where it uses a gyro."""

    name: str
    attitudes: Callable[[Epochs], jax.Array]
    carried: bool = False


def left_over(angles: np.ndarray, f_b: np.ndarray, f_n: np.ndarray) -> np.ndarray:
    """What is left of Eq. (4); written in NumPy, for MINPACK calls it one at a time."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    x, y, z = f_b
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x - sp * z, sp * x + cp * z
    return np.array([cy * x - sy * y - f_n[0], sy * x + cy * y - f_n[1], z - f_n[2]])


@jax.jit
def initial_values(epochs: Epochs) -> jax.Array:
    return euler_to_matrix(epochs.euler0)


_matrices = jax.jit(euler_to_matrix)


def minpack(epochs: Epochs) -> jax.Array:
    """More's algorithm, the paper's reference [2], in its own code: scaled by the columns of the Jacobian."""
    found = []
    for f_b, f_n, start in zip(*(np.asarray(x) for x in (epochs.f_b_mean, epochs.f_n, epochs.euler0)), strict=True):
        found.append(least_squares(left_over, start, args=(f_b, f_n), method="lm", x_scale="jac").x)
    return _matrices(np.array(found))


@jax.jit
def marquardt(epochs: Epochs) -> jax.Array:
    """The textbook's: damping by the diagonal of J^T J, from 1e-3, times or over ten."""
    return euler_to_matrix(jax.vmap(marquardt_angles)(epochs.f_b_mean, epochs.f_n, epochs.euler0))


@jax.jit
def levenberg(epochs: Epochs) -> jax.Array:
    """Damping by a multiple of the identity."""
    return euler_to_matrix(jax.vmap(levenberg_angles)(epochs.f_b_mean, epochs.f_n, epochs.euler0))


@jax.jit
def prior(epochs: Epochs) -> jax.Array:
    """The initial values as a measurement of their own."""
    fit = partial(fit_attitude, prior_std=PRIOR_STD, measurement_std=MEASUREMENT_STD)
    return jax.vmap(fit)(epochs.f_b_mean, epochs.f_n, epochs.euler0).C_nb


@jax.jit
def previous_epoch(epochs: Epochs) -> jax.Array:
    """The attitude found last as a measurement, from the initial values at the first epoch."""

    def step(before: jax.Array, pair: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        fit = fit_attitude(*pair, before, prior_std=PRIOR_STD, measurement_std=MEASUREMENT_STD)
        return fit.euler, fit.C_nb

    return jax.lax.scan(step, epochs.euler0[0], (epochs.f_b_mean, epochs.f_n))[1]


def windows(epochs: Epochs) -> jax.Array:
    """Neighbouring epochs share an attitude."""
    return _windows(epochs, epochs.f_b_mean, np.broadcast_to(np.eye(3), epochs.turned_middle.shape))


def gyro_windows(epochs: Epochs) -> jax.Array:
    """Neighbouring epochs share an attitude but for the gyro's turns."""
    return _windows(epochs, epochs.f_b_carried, epochs.turned_middle)


def _windows(epochs: Epochs, f_b: jax.Array, C_gyro: jax.Array | np.ndarray) -> jax.Array:
    count = f_b.shape[:1]
    prior_std, measurement_std = np.full(count, FREE), np.full(count, MEASUREMENT_STD)
    return fit_windows(f_b, epochs.f_n, initial_values(epochs), prior_std, measurement_std, WINDOW, C_gyro).C_nb


STRATEGIES = [
    Strategy("(0, 0, COG) alone", initial_values),
    Strategy("MINPACK", minpack),
    Strategy("Marquardt", marquardt),
    Strategy("Levenberg", levenberg),
    Strategy("prior (0, 0, COG)", prior),
    Strategy("prior: previous", previous_epoch),
    Strategy("windows", windows),
    Strategy("windows, gyro", gyro_windows, carried=True),
]


def marquardt_angles(f_b: jax.Array, f_n: jax.Array, start: jax.Array) -> jax.Array:
    """Angles (3,) of one epoch after at most 60 trials."""

    def residual(angles: jax.Array) -> jax.Array:
        return euler_to_matrix(angles) @ f_b - f_n

    def trial(_: int, state: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        angles, damping = state
        rest, J = residual(angles), jax.jacfwd(residual)(angles)
        normal = J.T @ J
        scaled = normal + damping * jnp.diag(jnp.maximum(jnp.diag(normal), 1e-12))
        step = -jnp.linalg.solve(scaled, J.T @ rest)
        after = residual(angles + step)
        better = jnp.sum(after * after) < jnp.sum(rest * rest)
        return jnp.where(better, angles + step, angles), jnp.clip(damping * jnp.where(better, 0.1, 10), 1e-12, 1e9)

    return jax.lax.fori_loop(0, 60, trial, (start, jnp.asarray(1e-3)))[0]


def levenberg_angles(f_b: jax.Array, f_n: jax.Array, start: jax.Array) -> jax.Array:
    """Angles (3,) of one epoch."""
    return levenberg_marquardt(lambda angles: euler_to_matrix(angles) @ f_b - f_n, start).x
