"""Where the named parts of a state lie in its vector: slices are made here and typed nowhere."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike


@dataclass(frozen=True)
class Layout:
    """Names and sizes of the parts of a state, in their order.

    Attributes
    ----------
    parts : tuple of (str, int)
        Name and number of entries of each part.
    """

    parts: tuple[tuple[str, int], ...]

    @property
    def size(self) -> int:
        """Number of entries of the whole state."""
        return sum(size for _, size in self.parts)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts."""
        return tuple(name for name, _ in self.parts)

    @property
    def sizes(self) -> dict[str, int]:
        """Number of entries by name."""
        return dict(self.parts)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def at(self, name: str) -> slice:
        """Where a part lies."""
        begin = sum(size for _, size in self.parts[: self.names.index(name)])
        return slice(begin, begin + self.sizes[name])

    def split(self, x: Any) -> dict[str, Any]:
        """The parts of states (..., states), of JAX or NumPy, by name; one entry has no axis of its own."""
        return {name: x[..., self.at(name).start] if size == 1 else x[..., self.at(name)] for name, size in self.parts}

    def joined(self, parts: Mapping[str, ArrayLike], shape: tuple[int, ...], dtype: jnp.dtype) -> jax.Array:
        """States (*shape, states) of their parts; what is not named is zero."""
        whole = [
            jnp.broadcast_to(jnp.reshape(parts[name], (*jnp.shape(parts[name])[: len(shape)], -1)), (*shape, size))
            if name in parts
            else jnp.zeros((*shape, size), dtype)
            for name, size in self.parts
        ]
        return jnp.concatenate(whole, -1)

    def matrix(
        self, blocks: Mapping[tuple[str, str], jax.Array], shape: tuple[int, ...], dtype: jnp.dtype
    ) -> jax.Array:
        """Matrices (*shape, states, states) of their blocks; what is not named is zero."""
        rows = []
        for row, height in self.parts:
            own = [(self.at(column).start, block) for (name, column), block in blocks.items() if name == row]
            parts, end = [], 0
            for begin, block in sorted(own, key=lambda pair: pair[0]):
                parts.append(jnp.zeros((*shape, height, begin - end), dtype))
                parts.append(jnp.broadcast_to(block, (*shape, *block.shape[-2:])))
                end = begin + block.shape[-1]
            parts.append(jnp.zeros((*shape, height, self.size - end), dtype))
            rows.append(jnp.concatenate(parts, -1) if len(parts) > 1 else parts[0])
        return jnp.concatenate(rows, -2)
