"""Checks of what arrays hold, made where it is known: not while a function is being traced."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp

P = ParamSpec("P")
R = TypeVar("R")
Condition = Callable[[str, Any], None]


def checked(**conditions: Condition) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator: arguments are held to conditions before the function, which may be compiled, is called."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @wraps(function)
        def with_checks(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs).arguments
            for name, condition in conditions.items():
                if name in given:
                    array = given[name] if hasattr(given[name], "ndim") else jnp.asarray(given[name])
                    # Within a trace jnp.asarray makes a tracer of numbers, too.
                    if not isinstance(array, jax.core.Tracer):
                        condition(name, jax.device_get(array))
            return function(*args, **kwargs)

        return with_checks

    return decorate


def increasing(name: str, values: Any) -> None:
    """Raise unless each time is after the one before; infinity may stand for none at the end."""
    _require_order(name, values, lambda one, after: after > one, "increase", "sort it, and keep one of equal times")


def not_decreasing(name: str, values: Any) -> None:
    """Raise where a time is before the one before it."""
    _require_order(name, values, lambda one, after: after >= one, "not decrease", "sort it")


def positive(name: str, value: Any) -> None:
    """Raise unless every number is above zero."""
    if not (value > 0).all():
        raise ValueError(f"{name} must be positive, got {value.min()}")


def samples(least: int, axis: int = -1) -> Condition:
    """Raise where there are fewer samples than that along an axis."""

    def enough(name: str, values: Any) -> None:
        if values.ndim >= -axis and values.shape[axis] < least:
            raise ValueError(f"{name} must have at least {least} sample{'s' * (least > 1)}, got {values.shape[axis]}")

    return enough


def varying(name: str, values: Any) -> None:
    """Raise where one component of vectors (time, 3) is the same all the time: its noise would be zero."""
    samples(2, axis=-2)(name, values)
    still = (values == values[:1]).all(0) if values.ndim == 2 else values != values
    if still.any():
        k = int(still.argmax())
        raise ValueError(
            f"{name} is {values[0, k]} throughout in column {k}, so its noise cannot be told: the sensor is stuck or "
            "its steps are too coarse; leave these samples out"
        )


def _require_order(name: str, values: Any, follows: Callable[[Any, Any], Any], rule: str, remedy: str) -> None:
    if not values.ndim:
        return
    one, after = values[..., :-1], values[..., 1:]
    wrong = ~(follows(one, after) | (after == float("inf")))
    if wrong.any():
        k = int(wrong.reshape(-1, wrong.shape[-1]).any(0).argmax())
        row = wrong.reshape(-1, wrong.shape[-1])[:, k].argmax()
        pair = values.reshape(-1, values.shape[-1])[row, k : k + 2].tolist()
        raise ValueError(f"{name} must {rule}, got {pair[1]} after {pair[0]} at index {k + 1}; {remedy}")
