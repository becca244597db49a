"""What all tests share: double precision, and the folder of real recordings."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)


# What one module or notebook compiles, the next loads. Each worker has a folder of its own, as processes that write to
# the same one spoil it; a worker waits for the kernels of its notebooks, so these may have it too.
_COMPILED = tempfile.TemporaryDirectory(prefix="altijax-compiled-")
for _name, _value in {
    "jax_compilation_cache_dir": _COMPILED.name,
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": -1,
}.items():
    jax.config.update(_name, _value)
    os.environ[_name.upper()] = str(_value)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the real recordings, which are not part of the project."""
    folder = os.environ.get("ALTIJAX_DATA_DIR")
    if not folder:
        pytest.skip("ALTIJAX_DATA_DIR is not set: the real recordings are not here")
    if not Path(folder).is_dir():
        pytest.fail(f"ALTIJAX_DATA_DIR is not a folder: {folder}")
    return Path(folder)


@pytest.fixture(scope="module", autouse=True)
def _forget_compiled_functions() -> Iterator[None]:
    """Every compiled function holds memory maps, and a process that uses up the 65,530 that Linux grants it crashes."""
    yield
    jax.clear_caches()
