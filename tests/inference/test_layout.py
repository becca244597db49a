"""Slices made from names hold what they should."""

import jax.numpy as jnp
import numpy as np
import pytest

from altijax.inference.layout import Layout

LAYOUT = Layout((("attitude", 3), ("bias", 2), ("delay", 1)))


def test_parts_lie_one_after_the_other() -> None:
    assert LAYOUT.size == 6
    assert LAYOUT.names == ("attitude", "bias", "delay")
    assert (LAYOUT.at("bias"), LAYOUT.at("delay")) == (slice(3, 5), slice(5, 6))
    assert "bias" in LAYOUT and "wind" not in LAYOUT
    with pytest.raises(ValueError, match="not in tuple"):
        LAYOUT.at("wind")


def test_joined_undoes_split() -> None:
    x = np.random.default_rng(0).normal(size=(4, 6))
    parts = LAYOUT.split(x)
    assert parts["delay"].shape == (4,)
    np.testing.assert_array_equal(LAYOUT.joined(parts, (4,), x.dtype), x)


def test_what_is_not_named_is_zero() -> None:
    x = LAYOUT.joined({"delay": jnp.array([1.0, 2.0])}, (2,), jnp.float64)
    np.testing.assert_array_equal(x, [[0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 2]])
    block = jnp.arange(6.0).reshape(3, 2)
    matrix = LAYOUT.matrix({("attitude", "bias"): block, ("delay", "delay"): jnp.ones((1, 1))}, (5,), jnp.float64)
    expected = np.zeros((5, 6, 6))
    expected[:, :3, 3:5], expected[:, 5, 5] = block, 1
    np.testing.assert_array_equal(matrix, expected)
