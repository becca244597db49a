"""Programs are counted, and kept for the next process, whoever writes at the same time."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

from altijax.programs import KEPT_PROGRAMS, count_programs

CODE = """
import jax, jax.numpy as jnp
import altijax as aj
with aj.count_programs() as programs:
    for k in range({number}):
        jax.jit({function})(jnp.ones(5 + k)).block_until_ready()
print(programs.number, programs.loaded)
"""
FUNCTION = "lambda x: jnp.cumsum(jnp.sin(x)) @ x"


def started(folder: Path, number: int = 1, before: str = "") -> subprocess.Popen:
    env = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")} | {KEPT_PROGRAMS: str(folder)}
    code = before + CODE.format(number=number, function=FUNCTION)
    return subprocess.Popen([sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, text=True)


def counted(process: subprocess.Popen) -> tuple[int, int]:
    out, _ = process.communicate()
    assert process.returncode == 0
    number, loaded = map(int, out.split())
    return number, loaded


def test_only_what_is_new_counts() -> None:
    f = jax.jit(lambda x: x * 23.0 + 1)
    x = jnp.ones(9)
    with count_programs() as first:
        f(x)
    with count_programs() as again:
        f(x)
    assert (first.number, again.number) == (1, 0)
    assert first.seconds > 0 and len(first.names) == 1


@pytest.mark.parametrize("before", ["", "\n\n\n"], ids=["the same", "other lines"])
def test_the_second_process_loads_what_the_first_one_kept(tmp_path: Path, before: str) -> None:
    number, loaded = counted(started(tmp_path))
    assert number > loaded
    assert counted(started(tmp_path, before=before)) == (number, number)


def test_a_folder_may_be_moved(tmp_path: Path) -> None:
    number, _ = counted(started(tmp_path / "here"))
    (tmp_path / "here").rename(tmp_path / "there")
    assert counted(started(tmp_path / "there")) == (number, number)


def test_two_processes_write_at_the_same_time(tmp_path: Path) -> None:
    both = [started(tmp_path, number=8) for _ in range(2)]
    numbers = [counted(process)[0] for process in both]
    assert counted(started(tmp_path, number=8)) == (numbers[0], numbers[0])
