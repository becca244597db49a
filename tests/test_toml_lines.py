"""Lines of TOML are read back by Python's own reader, to the last bit."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given, strategies as st

from altijax.toml_lines import toml_line


@given(st.text(st.characters(exclude_categories=["Cs"])), st.floats(allow_nan=False))
def test_any_text_and_number_comes_back(text, number):
    found = tomllib.loads("\n".join([toml_line("a", text), toml_line("b", [number, number]), toml_line("c d", number)]))
    assert found == {"a": text, "b": [number, number], "c d": number}
    assert math.copysign(1, found["c d"]) == math.copysign(1, number)


@pytest.mark.parametrize(("value", "text"), [(True, "true"), (np.False_, "false"), ((), "[]"), (np.float64(1), "1.0")])
def test_what_else_there_is(value, text):
    assert toml_line("key", value) == f"key = {text}"
