"""Signs of life: nothing for what is quick, what is being done for what is not, and the log."""

import io
import logging
import os
import subprocess
import sys
import time

import jax
import jax.numpy as jnp
import pytest

from altijax import stages as module
from altijax.stages import stages, tracked


def test_quick_work_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with stages("quick") as stage:
        stage("one")
    assert capsys.readouterr() == ("", "")


def test_long_work_says_what_it_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SILENT", 0.05)
    shown = io.StringIO()
    monkeypatch.setattr(sys, "stderr", shown)

    def slowly(items: list[int]) -> None:
        for _ in tracked(items, "outages"):
            time.sleep(0.1)

    with stages("calibration") as stage:
        stage("noise levels")
        time.sleep(0.5)
        slowly([1, 2, 3])
        jax.jit(lambda x: jnp.sin(x) + 17.0)(jnp.ones(13))
    text = shown.getvalue()
    assert "calibration: noise levels" in text and "outages 2/3" in text and "compiling" in text


def test_the_clock_ticks_while_nothing_else_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SILENT", 0.05)
    shown = io.StringIO()
    monkeypatch.setattr(sys, "stderr", shown)
    with stages("one long stage"):
        time.sleep(2.4)
    assert "[00:01]" in shown.getvalue() and "[00:02]" in shown.getvalue()


def test_the_log_tells_programs_and_seconds(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="altijax"), stages("work") as stage:
        stage("one")
        jax.jit(lambda x: jnp.cos(x) + 19.0)(jnp.ones(11))
    assert len(caplog.messages) == 1 and caplog.messages[0].startswith("work: ")
    assert "program(s) compiled" in caplog.messages[0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_says_why_it_cannot_go_on() -> None:
    code = """
import os, warnings
warnings.simplefilter("ignore")
from altijax.stages import stages
with stages("before"):
    pass
child = os.fork()
if child == 0:
    try:
        with stages("in the child"):
            pass
    except RuntimeError as error:
        os._exit(17 if "spawn" in str(error) else 1)
    os._exit(2)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 17


def test_what_fails_leaves_nothing_behind() -> None:
    with pytest.raises(RuntimeError), stages("fails"):
        raise RuntimeError
    with stages("next") as stage:
        stage("one")
    assert module._BAR.get() is None
