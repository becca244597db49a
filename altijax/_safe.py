"""Elementary functions that keep finite values and finite gradients at their edges.

``jnp.where`` alone does not help: reverse mode multiplies the untaken branch's infinite derivative by zero, which is
NaN. So the argument is replaced before the function sees it (the double `where`), and the gradient at the edge is zero.
"""

import jax
import jax.numpy as jnp


def sqrt(x: jax.Array) -> jax.Array:
    """Square root; zero with zero gradient where `x` is not positive."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)


def norm(v: jax.Array) -> jax.Array:
    """Euclidean norm along the last axis, with zero gradient at the zero vector."""
    return sqrt(jnp.sum(v * v, axis=-1))


def arctan2(y: jax.Array, x: jax.Array) -> jax.Array:
    """Angle of (x, y); zero with zero gradient at the origin, where no angle is defined."""
    # Its derivative divides by x^2 + y^2, which underflows long before x and y do.
    defined = x * x + y * y > jnp.finfo(jnp.result_type(x, y)).tiny
    return jnp.where(defined, jnp.arctan2(jnp.where(defined, y, 0), jnp.where(defined, x, 1)), 0)


def arcsin(x: jax.Array) -> jax.Array:
    """Angle of a sine; at and beyond -1 and 1 the nearest of -pi/2 and pi/2, with zero gradient."""
    inside = jnp.abs(x) < 1
    return jnp.where(inside, jnp.arcsin(jnp.where(inside, x, 0)), jnp.sign(x) * (jnp.pi / 2))
