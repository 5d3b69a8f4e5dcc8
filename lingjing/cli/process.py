"""The command's own process: its standard streams, the signals that end it, and how it leaves.

Loaded by every verb, so it imports next to nothing.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from lingjing.errors import ExitCode, LingjingError
from lingjing.terminal import Visible, guard_streams, write_styled

_ENDING = ("SIGTERM", "SIGHUP")

SECOND_S = 0.5
"""An interrupt that comes later than that after the first one is another: `timeout` sends one signal twice."""


def open_streams() -> None:
    """Give closed standard streams (`>&-`) a null device, lest a trace is opened as descriptor 1; print as an escape
    whatever the encoding lacks or a terminal would follow."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            descriptor = os.open(os.devnull, os.O_RDWR)  # the lowest one free, so this very one
            setattr(sys, name, open(descriptor, "w" if number else "r", encoding="utf-8"))  # noqa: PTH123, SIM115
    guard_streams()


@contextmanager
def interrupted_by_termination() -> Iterator[None]:
    """Meet SIGTERM and SIGHUP as Ctrl-C is met: with a closed partial trace and no worker left.

    A signal that whoever started us had ignored (`nohup`) stays ignored. Only the main thread can set handlers.
    """
    before = {}
    for name in _ENDING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            with suppress(ValueError):  # not the main thread
                before[number] = signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def ending_at_second_interrupt() -> Iterator[None]:
    """End everything at the second interrupt: every process below this one, and this one, whatever it waits for.

    The first one is a `KeyboardInterrupt`, with a closed trace and a report. A thread reads what the system's own
    handlers write to a descriptor (`signal.set_wakeup_fd`), so it learns of a signal that Python is kept from handling.
    """
    if sys.platform != "linux" or threading.current_thread() is not threading.main_thread():
        yield
        return
    reading, writing = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_count_interrupts, args=(reading,), name="lingjing-interrupts", daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)


def _count_interrupts(reading: int) -> None:
    """End everything at the second interrupt; return when the other end of the pipe is closed."""
    ending = {signal.SIGINT, *(getattr(signal, name) for name in _ENDING)}
    first_s: float | None = None
    with suppress(OSError):  # without the pipe the second interrupt is met as the first one is
        while numbers := os.read(reading, 64):
            if ending.isdisjoint(numbers):
                continue
            if first_s is None:
                first_s = time.monotonic()
            elif time.monotonic() - first_s >= SECOND_S:
                end_everything()
    os.close(reading)


def end_everything() -> NoReturn:
    """Kill every process below this one, in whatever session, and leave."""
    from lingjing.processes.descendants import end_children
    from lingjing.processes.linux import adopt_orphans

    adopt_orphans()
    end_children(set())
    with suppress(OSError, ValueError):
        restore_terminal()
        say("interrupted twice: everything was ended at once")
    os._exit(ExitCode.INTERRUPTED)


def ignore_interrupts() -> None:
    """Ignore what would interrupt the last few milliseconds, when the answer is known and printed."""
    for name in ("SIGINT", *_ENDING):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def end_despite_threads(code: int) -> int:
    """Return `code`; where threads are left that could keep the interpreter from ending, end the process with it."""
    threads = sys.modules.get("threading")
    if threads is None or threads.active_count() == 1:
        return code
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def say(line: str) -> None:
    """One line on standard error."""
    with suppress(OSError, ValueError):  # closed, full or failing: the exit code still says it
        print(line, file=sys.stderr, flush=True)


def say_error(error: LingjingError) -> None:
    """What is wrong, and the way out."""
    say(f"error: {error}")
    if error.hint:
        say(f"hint: {error.hint}")


@contextmanager
def results_alone() -> Iterator[None]:
    """Keep standard output for the result: what policies, libraries and their children print goes to standard error.

    Both the stream and the descriptor are turned, and turned back at the end. A policy that closes the stream it is
    given closes nothing of ours.
    """
    stdout = sys.stdout
    stdout.flush()
    kept = _turn_descriptor(stdout)
    raw = open(os.dup(2), "wb")  # noqa: PTH123, SIM115 - the stream around it closes it
    with Visible(raw, encoding="utf-8", errors="backslashreplace", line_buffering=True) as aside:
        sys.stdout = aside
        try:
            yield
        finally:
            sys.stdout = stdout
            if kept is not None:
                os.dup2(kept, 1)
                os.close(kept)


def _turn_descriptor(stdout: object) -> int | None:
    """Point descriptor 1 to standard error and return a copy of what it was; None if `stdout` is not written to it."""
    try:
        if stdout.fileno() != 1:  # type: ignore[attr-defined]
            return None
    except (OSError, ValueError, AttributeError):  # a stream without a descriptor, as under a test runner
        return None
    kept = os.dup(1)
    os.dup2(2, 1)
    return kept


def restore_terminal() -> None:
    """Give a terminal its cursor and its own screen back, which a process that was killed had taken."""
    if sys.stderr.isatty() and os.environ.get("TERM", "dumb") not in ("dumb", "unknown", ""):
        write_styled(sys.stderr, "\x1b[?1049l\x1b[?25h\r\x1b[K")
        sys.stderr.flush()


def silence_stdout() -> None:
    """Keep the interpreter from complaining when it flushes a closed or full output at exit."""
    with suppress(OSError, ValueError):
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, sys.stdout.fileno())
        os.close(devnull)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
