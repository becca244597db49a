"""What all tests share: double precision, and the folder of real recordings."""

import os
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest

jax.config.update("jax_enable_x64", True)


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
