"""Lines of TOML, since Python's own `tomllib` only reads it."""

import json
import re
from collections.abc import Sequence

import numpy as np


def toml_line(key: str, value: object) -> str:
    """A key and its value: a text, a number, a truth value, or a list of these.

    Python writes a float by the fewest digits that give it back.
    """
    return f"{toml_key(key)} = {_toml(value)}"


def toml_key(key: str) -> str:
    """A key, in quotes where it needs them."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _toml(key)


def _toml(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return repr(float(value))  # type: ignore[arg-type]
