"""Signs of life: a line when a stage of a paper begins, while it goes on, and when it ends."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_PATIENCE = 10.0  # s without a line

_PAPER: ContextVar[str] = ContextVar("paper", default="")


@contextmanager
def paper_at_work(name: str) -> Iterator[None]:
    """Put the name of a paper before the lines of its stages, as several papers may share a screen."""
    token = _PAPER.set(f"{name}: ")
    try:
        yield
    finally:
        _PAPER.reset(token)


@contextmanager
def stage(title: str, total: int | None = None) -> Iterator[Callable[[], None]]:
    """Say that a piece of work begins, that it goes on, and that it ended; call what is yielded for each part done."""
    heading, began, done, ended = f"{_PAPER.get()}{title}", time.perf_counter(), 0, threading.Event()

    def advance() -> None:
        nonlocal done
        done += 1

    def say(what: str) -> None:
        print(f"{heading}: {what}", flush=True)

    def keep_saying() -> None:
        while not ended.wait(_PATIENCE):
            parts = "" if total is None else f", {done} of {total} done"
            say(f"{time.perf_counter() - began:.0f} s so far{parts}")

    say("begins")
    speaker = threading.Thread(target=keep_saying, daemon=True)
    speaker.start()
    try:
        yield advance
    finally:
        ended.set()
        speaker.join()
    say(f"done in {time.perf_counter() - began:.0f} s")
