"""Ways to the minimum of `_epoch_cost`: a guarded one that arrives, and a fast one that knows whether it has.

`descend` is Levenberg-Marquardt: a step that raises the cost is taken back and tried shorter, as often as it takes.

`stride` takes a fixed number of steps for thousands of epochs at once, Gauss-Newton steps in single precision to come
near and Newton steps in the precision of the data to finish. The decrement of the last, which must be nothing against
the cost, tells of each epoch whether it has arrived. It is written for what XLA makes of it on a CPU: whole-array
arithmetic of components without a call of a library's sine, matrices unrolled, no branch, and loops, whose carried
arrays are the only ones that must be stored.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from altijax._epoch_fit import cost as _epoch_cost
from altijax._epoch_fit.cost import Symmetric, Turned, Vector
from altijax._epoch_fit.trigonometry import cosine, short_turn, sine
from altijax.rotations import wrap_angle

GAUSS_NEWTON_STEPS, NEWTON_STEPS, MOST_STEPS = 4, 2, 100


def descend(f_b: Vector, f_n: Vector, euler0: Vector, start: Vector, ratio: Vector) -> tuple[Vector, jax.Array]:
    """Change of the initial angles downhill from `start` to the minimum, and where it has converged."""
    eps = float(jnp.finfo(f_b[0].dtype).eps)
    size = _epoch_cost.sum_of_squares([*f_b, *f_n])

    def cost_of(x: Vector) -> jax.Array:
        within = _epoch_cost.each(wrap_angle, x)
        return _epoch_cost.sum_of_squares(
            _epoch_cost.residuals(_epoch_cost.turned_by(f_b, f_n, euler0, x), within, ratio)
        )

    def proceed(state: tuple) -> jax.Array:
        *_, done, steps = state
        return ~done.all() & (steps < MOST_STEPS)

    def step(state: tuple) -> tuple:
        x, cost, damping, done, steps = state
        forces = _epoch_cost.turned_by(f_b, f_n, euler0, x)
        gradient = _epoch_cost.gradient(forces, _epoch_cost.each(wrap_angle, x), ratio)
        # Far from the minimum the Hessian may lead to another one.
        exact, safe = _epoch_cost.hessian(forces, ratio), _epoch_cost.gauss_newton(forces, ratio)
        near = (steps >= GAUSS_NEWTON_STEPS) & _epoch_cost.is_positive_definite(exact)
        matrix = _epoch_cost.choose(near, exact, safe)
        damped = matrix._replace(xx=matrix.xx + damping, yy=matrix.yy + damping, zz=matrix.zz + damping)
        ahead = _epoch_cost.solve(damped, gradient)
        trial = tuple(a - d for a, d in zip(x, ahead, strict=True))
        new_cost = cost_of(trial)
        expected = sum(d * (g + damping * d) for d, g in zip(ahead, gradient, strict=True))
        accepted = ~done & (new_cost <= cost)
        # Below this, the cost is rounding: its terms are squares of differences of numbers of the size of the forces.
        done = done | (expected <= 4 * eps * (cost + jnp.sqrt(cost * size) + eps * size))
        x = tuple(jnp.where(accepted, t, a) for t, a in zip(trial, x, strict=True))
        first = 1e-2 * (safe.xx + safe.yy + safe.zz)
        damping = jnp.where(accepted, damping / 8, jnp.maximum(8 * damping, first))
        return x, jnp.where(accepted, new_cost, cost), damping, done, steps + 1

    cost = cost_of(start)
    state = start, cost, jnp.zeros_like(cost), jnp.zeros(cost.shape, bool), 0
    x, _, _, done, _ = jax.lax.while_loop(proceed, step, state)
    # It ends where the cost stays the same to rounding, the angles to its square root; one more step mends that.
    forces = _epoch_cost.turned_by(f_b, f_n, euler0, x)
    last = _epoch_cost.newton_step(forces, ratio, _epoch_cost.gradient(forces, _epoch_cost.each(wrap_angle, x), ratio))
    roll, pitch, yaw = (jnp.where(done, a - d, a) for a, d in zip(x, last, strict=True))
    return (roll, pitch, yaw), done


def stride(f_b: Vector, f_n: Vector, euler0: Vector, ratio: Vector) -> tuple[Vector, jax.Array]:
    """Change of the initial angles that minimises the cost, and where that is certain."""
    dtype = f_b[0].dtype
    zero = jnp.zeros_like(f_b[0])
    short = [_cast(v, jnp.dtype("float32")) for v in (f_b, f_n, euler0, (zero, zero, zero), ratio)]
    near, _, _ = _steps(GAUSS_NEWTON_STEPS, _epoch_cost.gauss_newton, 1.0, *short)
    start = _cast(near, dtype)
    change, decrement, cost = _steps(NEWTON_STEPS, _epoch_cost.hessian, 0.1, f_b, f_n, euler0, start, ratio)
    # False for NaN, and beyond half a turn, where the prior's cost would fall again
    within = (jnp.abs(change[0]) < jnp.pi) & (jnp.abs(change[1]) < jnp.pi) & (jnp.abs(change[2]) < jnp.pi)
    return change, (decrement <= float(jnp.finfo(dtype).eps) ** 0.7 * cost) & within


def _steps(
    count: int,
    matrix_of: Callable[[Turned, Vector], Symmetric],
    longest: float,
    f_b: Vector,
    f_n: Vector,
    euler0: Vector,
    start: Vector,
    ratio: Vector,
) -> tuple[Vector, jax.Array, jax.Array]:
    """Change after `count` steps from `start`, the last one's decrement, and the cost before it."""

    def step(_: int, carry: tuple) -> tuple:
        (a_x, a_y, n_y, n_z, sp, cp), turns, x, a_z, n_x, _, _ = carry
        (sin_roll, cos_roll), (sin_pitch, cos_pitch), (sin_yaw, cos_yaw) = turns
        # What is turned is turned on, instead of anew from the data: 6 numbers a step.
        a_x, a_y = cos_yaw * a_x + sin_yaw * a_y, cos_yaw * a_y - sin_yaw * a_x
        n_y, n_z = cos_roll * n_y - sin_roll * n_z, cos_roll * n_z + sin_roll * n_y
        sp, cp = sp * cos_pitch + cp * sin_pitch, cp * cos_pitch - sp * sin_pitch
        forces = Turned(
            a=(a_x, a_y, a_z),
            b=(cp * a_x + sp * a_z, a_y, cp * a_z - sp * a_x),
            n=(n_x, n_y, n_z),
            k=(cp * n_x - sp * n_z, n_y, sp * n_x + cp * n_z),
            sin_pitch=sp,
        )
        gradient = _epoch_cost.gradient(forces, x, ratio)
        matrix = matrix_of(forces, ratio)
        towards = [jnp.clip(-d, -longest, longest) for d in _epoch_cost.solve(matrix, gradient)]
        decrement = -sum(d * g for d, g in zip(towards, gradient, strict=True))
        decrement = jnp.where(_epoch_cost.is_positive_definite(matrix), decrement, jnp.inf)
        cost = _epoch_cost.sum_of_squares(_epoch_cost.residuals(forces, x, ratio))
        x = tuple(a + d for a, d in zip(x, towards, strict=True))
        return (a_x, a_y, n_y, n_z, sp, cp), tuple(map(short_turn, towards)), x, a_z, n_x, decrement, cost

    zero = jnp.zeros_like(f_b[0])
    angles = [e + x for e, x in zip(euler0, start, strict=True)]
    turns = tuple((sine(angle), cosine(angle)) for angle in angles)
    unturned = f_n[0], f_n[1], f_b[1], f_b[2], zero, jnp.ones_like(zero)
    # f_n[2] and f_b[0] are carried to have them stored in one piece
    carry = unturned, turns, start, f_n[2], f_b[0], zero, zero
    _, _, change, _, _, decrement, cost = jax.lax.fori_loop(0, count, step, carry)
    return change, decrement, cost


def _cast(vector: Vector, dtype: jnp.dtype) -> Vector:
    x, y, z = (v.astype(dtype) for v in vector)
    return x, y, z
