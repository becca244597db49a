"""What all tests share: double precision, and the folder of real recordings."""

import os
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
