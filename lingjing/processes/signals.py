"""Signals of a process: blocked, deferred, ignored, or handled as an interrupt; and the end at the second interrupt.

Only the main thread can set handlers, because Python runs them there. In other threads these functions do nothing,
except `blocked_signals`. Every verb loads this module, so it imports little.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

_TERMINATING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a process from outside. Windows has no SIGHUP."""

_INTERRUPTING = (signal.SIGINT, *_TERMINATING)

SECOND_S = 0.5
"""The time after the first interrupt from which another one counts as the second, seconds (chosen: coreutils' `timeout`
sends one signal twice, to the process and to its group)."""


@contextmanager
def blocked_signals() -> Iterator[None]:
    """Block SIGINT, SIGTERM and SIGHUP in this thread. A pending signal is delivered at the end of the block.

    Threads that are started within the block inherit its mask for good, so signals go to the main thread. A main thread
    that sleeps would otherwise sleep on when another thread takes the signal.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def deferring_signals() -> Iterator[None]:
    """Defer signals with a Python handler to the end of the block. Handlers then run in order, until one raises.

    For a step that must not be interrupted, such as a boundary and its record.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pending: list[tuple[int, FrameType | None]] = []
    handled = [(number, handler) for number in _INTERRUPTING if callable(handler := signal.getsignal(number))]
    for number, _ in handled:
        signal.signal(number, lambda number, frame: pending.append((number, frame)))
    try:
        yield
    finally:
        for number, handler in handled:
            signal.signal(number, handler)
    for number, frame in pending:
        dict(handled)[number](number, frame)


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """Handle SIGTERM and SIGHUP as Ctrl-C within the block: they raise `KeyboardInterrupt`.

    A signal that the starting process ignores (`nohup`) stays ignored.
    """
    before = {}
    for number in _TERMINATING:
        if signal.getsignal(number) == signal.SIG_DFL:
            with suppress(ValueError):  # not the main thread
                before[number] = signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def ending_at_second_interrupt(exit_code: int, before_exit: Callable[[], None]) -> Iterator[None]:
    """End this process and all its descendants at the second interrupt, with `exit_code`.

    The first interrupt raises `KeyboardInterrupt`. A thread reads the signal numbers that the system's handlers write
    to a descriptor (`signal.set_wakeup_fd`), so it also receives a signal that Python cannot handle at the time.
    `before_exit` is called in that thread, after the end of the other processes. Linux only; elsewhere it does nothing.
    """
    if sys.platform != "linux" or threading.current_thread() is not threading.main_thread():
        yield
        return
    reading, writing = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    counting = threading.Thread(
        target=_count_interrupts, args=(reading, exit_code, before_exit), name="lingjing-interrupts", daemon=True
    )
    counting.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)


def ignore_interrupts() -> None:
    """Ignore SIGINT, SIGTERM and SIGHUP from now on: for the last milliseconds, after the result was printed."""
    for number in _INTERRUPTING:
        signal.signal(number, signal.SIG_IGN)


def leave_interrupts_to_parent() -> None:
    """Ignore SIGINT in a worker, and unblock it, because the parent blocks it for its children. The parent ends the
    worker.

    Ctrl-C reaches all processes of a terminal, and a worker that it ended would look like a failed engine.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


# -- private


def _count_interrupts(reading: int, exit_code: int, before_exit: Callable[[], None]) -> None:
    """End everything at the second interrupt; return when the other end of the pipe is closed."""
    first_s: float | None = None
    with suppress(OSError):  # without the pipe, the second interrupt is handled as the first one
        while numbers := os.read(reading, 64):
            if set(_INTERRUPTING).isdisjoint(numbers):
                continue
            if first_s is None:
                first_s = time.monotonic()
            elif time.monotonic() - first_s >= SECOND_S:
                _end_everything(exit_code, before_exit)
    os.close(reading)


def _end_everything(exit_code: int, before_exit: Callable[[], None]) -> NoReturn:
    """Kill every process below this one, in whatever session, and exit."""
    from lingjing.processes.descendants import end_children
    from lingjing.processes.linux import adopt_orphans

    adopt_orphans()
    end_children(set())
    with suppress(OSError, ValueError):
        before_exit()
    os._exit(exit_code)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
