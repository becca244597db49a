"""The programs that JAX compiles: kept between processes, and counted.

Nearly all of a first call is compilation. `keep_programs` turns on JAX's persistent cache, so that the second process
loads what the first one compiled; `count_programs` tells what a piece of code compiled.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import jax
import platformdirs
from jax.experimental.compilation_cache import compilation_cache

KEPT_PROGRAMS = "ALTIJAX_KEEP_PROGRAMS"
"""Environment variable that keeps programs from the import on: 1 for the user's cache directory, or a folder."""

# JAX locks a cache of bounded size, so that processes do not spoil it for each other; one without a bound it does not.
# It looks at every program kept whenever it adds one, 0.2 s at 8,000 of them: there is room for hundreds of large ones.
_LARGEST = 256 * 2**20
COMPILATION = "/jax/core/compile/backend_compile_duration"
"""JAX's name of the event that a program is compiled, or loaded from the kept ones."""

_LOADED = "/jax/compilation_cache/cache_hits"


@dataclass
class Programs:
    """What was compiled.

    Attributes
    ----------
    names : list of str
        The compiled functions, in order; one that a kept program served is among them.
    seconds : float
        Time that the compiler took, loading included.
    loaded : int
        How many of them came from the kept programs.
    """

    names: list[str] = field(default_factory=list)
    seconds: float = 0.0
    loaded: int = 0

    @property
    def number(self) -> int:
        """How many programs."""
        return len(self.names)


def keep_programs(folder: str | os.PathLike[str] | None = None) -> Path:
    """Keep compiled programs on disk, for this and all later processes.

    Processes may share the folder, at the same time too. Those used longest ago give way beyond 256 MiB.

    Parameters
    ----------
    folder : path, optional
        Where, in its subfolder ``programs``; by default in AltiJAX's part of the user's cache directory.

    Returns
    -------
    folder : Path
        Where they are kept.
    """
    # Into a folder that JAX once filled without a bound it would write nothing more: programs have one of their own.
    path = (platformdirs.user_cache_path("altijax") if folder is None else Path(folder)) / "programs"
    path.mkdir(parents=True, exist_ok=True)
    for name, value in {
        "jax_compilation_cache_dir": str(path),
        "jax_compilation_cache_max_size": _LARGEST,
        "jax_persistent_cache_min_compile_time_secs": 0.0,
        "jax_persistent_cache_min_entry_size_bytes": -1,
        # XLA's own caches, of GPUs, would put the folder's path into each key: programs moved with their folder missed.
        "jax_persistent_cache_enable_xla_caches": "none",
    }.items():
        jax.config.update(name, value)
    # JAX asks once, at the first compilation, whether it has a cache.
    compilation_cache.reset_cache()
    return path


def keep_programs_as_told() -> None:
    """What the environment variable ``ALTIJAX_KEEP_PROGRAMS`` says; nothing where it is not set, empty or 0."""
    told = os.environ.get(KEPT_PROGRAMS, "")
    if told not in ("", "0"):
        keep_programs(None if told == "1" else told)


@contextmanager
def count_programs() -> Iterator[Programs]:
    """Count the programs compiled inside a ``with`` block.

    Yields
    ------
    programs : Programs
        Filled as they are compiled, by whatever thread.
    """
    found = Programs()

    def compiled(event: str, duration_secs: float, **kwargs: str | int) -> None:
        if event == COMPILATION:
            found.names.append(str(kwargs.get("fun_name", "")))
            found.seconds += duration_secs

    def loaded(event: str, **kwargs: str | int) -> None:
        found.loaded += event == _LOADED

    jax.monitoring.register_event_duration_secs_listener(compiled)
    jax.monitoring.register_event_listener(loaded)
    try:
        yield found
    finally:
        jax.monitoring.unregister_event_duration_listener(compiled)
        jax.monitoring.unregister_event_listener(loaded)
