"""Signs of life: what a long piece of work is doing, shown once it has taken two seconds, and written to the log."""

import logging
import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

import jax

from altijax.programs import COMPILATION, count_programs

Item = TypeVar("Item")

logger = logging.getLogger("altijax")

_TRACED = (jax.errors.TracerArrayConversionError, jax.errors.ConcretizationTypeError)
# Until the first word, and between two ticks of the clock, s.
_SILENT, _TICK = 2.0, 1.0


class Stages:
    """What is going on inside one piece of work: the stage it is at, and how many of its items are done."""

    def __init__(self, title: str, total: int | None, bar: "_Bar") -> None:
        self._title, self._total, self._bar = title, total, bar
        self._done = 0

    def __call__(self, stage: str) -> None:
        """Say that a stage begins."""
        logger.debug("%s: %s", self._title, stage)
        self._bar.show(f"{self._title}: {stage}")

    def advance(self, items: int = 1) -> None:
        """Say that so many of the items are done."""
        self._done += items
        of = "" if self._total is None else f" {self._done}/{self._total}"
        self._bar.show(self._title + of)


class _Bar:
    """A line of tqdm that comes into being when the work has taken a while, and whose clock then ticks."""

    def __init__(self) -> None:
        self._stage, self._compiling = "", ""
        self._began = time.time()
        self._shown: Any = None
        self._lock, self._closed = threading.Lock(), threading.Event()
        threading.Thread(target=self._appear, daemon=True).start()

    def show(self, stage: str) -> None:
        self._stage = stage
        self._refresh()

    def compiling(self, what: str) -> None:
        """Name of the program that is being compiled; empty when it is done."""
        self._compiling = f", compiling {what}" if what else ""
        self._refresh()

    def close(self) -> None:
        self._closed.set()
        with self._lock:
            if self._shown is not None:
                self._shown.close()

    def _appear(self) -> None:
        if self._closed.wait(_SILENT):
            return
        from tqdm.auto import tqdm  # importing it takes as long as a short estimate

        with self._lock:
            if self._closed.is_set():
                return
            self._shown = tqdm(bar_format="{desc} [{elapsed}]", leave=False)
            self._shown.start_t = self._began
        self._refresh()
        while not self._closed.wait(_TICK):
            self._refresh()

    def _refresh(self) -> None:
        with self._lock:
            if self._shown is not None and not self._closed.is_set():
                self._shown.set_description_str(self._stage + self._compiling)


class _Forks:
    """Whether this process was forked from one in which JAX ran, whose threads it lacks."""

    def __init__(self) -> None:
        self._watched, self.happened = False, False

    def watch(self) -> None:
        """From now on JAX runs, and a process forked from this one is lost to it."""
        if not self._watched and hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._note)
        self._watched = True

    def _note(self) -> None:
        self.happened = True


_FORKS = _Forks()
_BAR: ContextVar[_Bar | None] = ContextVar("altijax_bar", default=None)


@contextmanager
def stages(title: str, total: int | None = None) -> Iterator[Stages]:
    """Show what a piece of work is doing from two seconds on, compiling included; work inside it shows there too.

    Parameters
    ----------
    title : str
        What is being done, as "slope of comma2k19".
    total : int, optional
        Number of items, as rounds or recordings.

    Yields
    ------
    stage : callable
        ``stage("noise levels")`` says which stage begins, ``stage.advance()`` that one of the items is done.

    Raises
    ------
    RuntimeError
        In a process that was forked after JAX had run: it would wait for ever.
    TypeError
        If the work inside meets a tracer, as where somebody differentiates a verb.
    """
    if _FORKS.happened:
        raise RuntimeError(
            "this process was forked after an estimate had run, and JAX cannot go on in it: start worker processes by "
            'multiprocessing.get_context("spawn"), or use threads'
        )
    _FORKS.watch()
    outer = _BAR.get()
    if outer is not None:
        yield Stages(title, total, outer)
        return
    bar = _Bar()
    bar.show(title)

    def begins(event: str, value: float, **kwargs: str | int) -> None:
        if event == COMPILATION:
            bar.compiling(str(kwargs.get("fun_name", "")).removeprefix("jit(").removesuffix(")").strip("_"))

    def ends(event: str, duration_secs: float, **kwargs: str | int) -> None:
        if event == COMPILATION:
            bar.compiling("")

    jax.monitoring.register_scalar_listener(begins)
    jax.monitoring.register_event_duration_secs_listener(ends)
    token, began = _BAR.set(bar), time.perf_counter()
    try:
        with count_programs() as programs:
            yield Stages(title, total, bar)
    except (*_TRACED, ValueError) as error:
        # NumPy says no more than that it cannot take one into an array.
        if not isinstance(error, _TRACED) and not isinstance(error.__cause__, _TRACED):
            raise
        raise TypeError(
            f"{title}: this works on numbers, in NumPy and pandas, and JAX can neither differentiate, batch nor "
            "compile it; altijax.differentiable(recording, method) returns a function that it can"
        ) from error
    else:
        logger.info(
            "%s: %.1f s; %d program(s) compiled in %.1f s, %d of them kept ones loaded",
            *(title, time.perf_counter() - began, programs.number, programs.seconds, programs.loaded),
        )
    finally:
        _BAR.reset(token)
        jax.monitoring.unregister_scalar_listener(begins)
        jax.monitoring.unregister_event_duration_listener(ends)
        bar.close()


def tracked(items: Sequence[Item], title: str) -> Iterator[Item]:
    """The items one by one, with the number of those done shown while they are worked on.

    Parameters
    ----------
    items : sequence
        Such as outages or recordings.
    title : str
        What is being done with them.

    Yields
    ------
    item
        Each of them.
    """
    with stages(title, len(items)) as stage:
        for item in items:
            yield item
            stage.advance()
