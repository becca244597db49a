"""What all tests share: double precision, the programs kept between runs, and the folder of real recordings."""

import os
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest

from altijax.programs import KEPT_PROGRAMS, keep_programs_as_told

jax.config.update("jax_enable_x64", True)

# What one worker, notebook or run has compiled, all later ones load; but for the thousands of small programs of tests,
# as JAX looks at every program in the folder whenever it adds one.
os.environ.setdefault(KEPT_PROGRAMS, "1")
keep_programs_as_told()
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)

MAPS = Path("/proc/self/maps")
MANY_MAPS = 40_000


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
def _forget_compiled_functions_when_maps_run_out() -> Iterator[None]:
    """Every compiled function holds memory maps, and a process that uses up the 65,530 that Linux grants it crashes."""
    yield
    if MAPS.exists() and len(MAPS.read_text().splitlines()) > MANY_MAPS:
        jax.clear_caches()
