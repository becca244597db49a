"""Where Eq. (5) leads from initial values all around: whether a minimum is found, and how far it is from the truth."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from altijax.rotations import euler_to_matrix, matrix_to_rotvec
from papers_repro.chalko2010.strategies import left_over, levenberg_angles, marquardt_angles

# A cruising windsurfer's epoch: 1 m/s^2 forward, the helmet leaning; the truth, in degrees.
TRUTH = np.radians([8.0, 5.0, 30.0])
F_N = np.array([0.8, 0.5, 9.8])


@dataclass(frozen=True, kw_only=True)
class Basin:
    """Of one method, over initial errors (roll, yaw): the norm of Eq. (5) and the angle to the truth at its end."""

    norm: np.ndarray
    angle: np.ndarray


def initial_errors(count: int) -> np.ndarray:
    """Errors (count,) rad of one angle, all around without naming any twice."""
    return np.linspace(-np.pi, np.pi, count, endpoint=False) + np.pi / count


def basins(count: int) -> dict[str, Basin]:
    """All three makes of Levenberg-Marquardt from `count` x `count` initial values."""
    errors = initial_errors(count)
    roll, yaw = np.meshgrid(errors, errors, indexing="ij")
    starts = TRUTH + np.stack([roll, 0 * roll, yaw], -1).reshape(-1, 3)
    C_true = euler_to_matrix(jnp.asarray(TRUTH))
    f_n = jnp.asarray(F_N)
    f_b = C_true.T @ f_n
    found = {
        "MINPACK": np.array(
            [least_squares(left_over, s, args=(np.asarray(f_b), F_N), method="lm", x_scale="jac").x for s in starts]
        ),
        "Marquardt": jax.jit(jax.vmap(lambda s: marquardt_angles(f_b, f_n, s)))(starts),
        "Levenberg": jax.jit(jax.vmap(lambda s: levenberg_angles(f_b, f_n, s)))(starts),
    }

    @jax.jit
    def judged(angles: jax.Array) -> tuple[jax.Array, jax.Array]:
        C = euler_to_matrix(angles)
        angle = jnp.linalg.norm(matrix_to_rotvec(jnp.swapaxes(C_true, -1, -2) @ C), axis=-1)
        return jnp.linalg.norm(C @ f_b - f_n, axis=-1), angle

    shape = (count, count)
    result = {}
    for name, angles in found.items():
        norm, angle = judged(jnp.asarray(angles))
        result[name] = Basin(norm=np.asarray(norm).reshape(shape), angle=np.asarray(angle).reshape(shape))
    return result
