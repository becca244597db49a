"""The one array check: every public function states the shape it needs and says what it got instead."""

from types import EllipsisType

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

Shape = tuple[int | EllipsisType | None, ...]


def require_shape(name: str, value: ArrayLike, shape: Shape) -> jax.Array:
    """`value` as a floating-point array of the given `shape`.

    Parameters
    ----------
    name : str
        What the caller's user calls the argument; it opens the error message.
    value : array_like
        Numbers; integers become floating point, floating point keeps its precision.
    shape : tuple
        Sizes; None stands for any size and a leading ``...`` for any batch axes.

    Returns
    -------
    array
        `value`, ready for arithmetic.

    Raises
    ------
    ValueError
        If the shape differs.
    """
    array = jnp.asarray(value)
    if not jnp.issubdtype(array.dtype, jnp.inexact):
        array = array.astype(jnp.result_type(float))
    batched = shape[:1] == (...,)
    sizes = shape[1:] if batched else shape
    ends = array.shape[array.ndim - len(sizes) :] if array.ndim >= len(sizes) else None
    if (
        ends is None
        or (not batched and array.ndim != len(sizes))
        or any(want is not None and want != got for want, got in zip(sizes, ends, strict=True))
    ):
        words = ["..." if size is ... else "any" if size is None else str(size) for size in shape]
        wanted = "(" + ", ".join(words) + ("," if len(words) == 1 else "") + ")"
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
    return array


def record_field(record: object, name: str, shape: tuple[int, ...], dtype: jnp.dtype) -> jax.Array:
    """Field of a record of parameters, where one number stands for all elements.

    Parameters
    ----------
    record : object
        Record of parameters.
    name : str
        Name of its field.
    shape : tuple
        Sizes of the whole array.
    dtype : dtype
        Precision of the series that the record meets.

    Returns
    -------
    array
        The field, of the given shape and precision.

    Raises
    ------
    ValueError
        If the field is neither one number nor of that shape.
    """
    value = jnp.asarray(getattr(record, name), dtype)
    return jnp.full(shape, value) if value.ndim == 0 else require_shape(name, value, shape)
