"""The process of the command: its standard streams, its messages and its exit.

Every verb loads this module, so it imports little.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from lingjing.errors import ExitCode, LingjingError, hint_of
from lingjing.processes import signals
from lingjing.terminal import Visible, guard_streams, write_styled


def open_streams() -> None:
    """Open closed standard streams (`>&-`) on the null device. Otherwise a trace would be opened as descriptor 1.

    Characters that the encoding lacks, and those that control a terminal, are printed as escapes.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            descriptor = os.open(os.devnull, os.O_RDWR)  # the lowest free descriptor is the closed one
            setattr(sys, name, open(descriptor, "w" if number else "r", encoding="utf-8"))  # noqa: PTH123, SIM115
    guard_streams()


@contextmanager
def ending_at_second_interrupt() -> Iterator[None]:
    """End every process of this command at the second interrupt, with a message.

    The first interrupt is a `KeyboardInterrupt`: the command closes its trace and prints its report.
    """
    with signals.ending_at_second_interrupt(ExitCode.INTERRUPTED, _report_second_interrupt):
        yield


def _report_second_interrupt() -> None:
    restore_terminal()
    say("interrupted twice: everything was ended at once")


def end_despite_threads(code: int, *, at_once: bool = False) -> int:
    """Return `code`. If other threads run, which could delay the interpreter's end, end the process with it.

    `at_once`: end it in any case, unless something waits for the interpreter's end. To take its modules apart costs a
    twentieth of a cold `lingjing validate`.
    """
    threads = sys.modules.get("threading")
    is_awaited = atexit._ncallbacks() or sys.getprofile() or sys.gettrace()
    if (threads is None or threads.active_count() == 1) and (is_awaited or not at_once):
        return code
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def say(line: str) -> None:
    """Print one line on standard error."""
    with suppress(OSError, ValueError):  # closed, full or failing: the exit code remains
        print(line, file=sys.stderr, flush=True)


def say_error(error: LingjingError) -> None:
    """Print an error and its hint."""
    say(f"error: {error}")
    if hint_of(error):
        say(f"hint: {hint_of(error)}")


@contextmanager
def results_alone() -> Iterator[None]:
    """Keep standard output for the result: output of policies, libraries and children goes to standard error.

    The stream and the descriptor are redirected, and restored at the end. A policy that closes its stream does not
    close descriptor 2.
    """
    stdout = sys.stdout
    stdout.flush()
    kept = _redirect_descriptor(stdout)
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


def _redirect_descriptor(stdout: object) -> int | None:
    """Redirect descriptor 1 to standard error and return a copy of it; None if `stdout` does not write to it."""
    try:
        if stdout.fileno() != 1:  # type: ignore[attr-defined]
            return None
    except (OSError, ValueError, AttributeError):  # a stream without a descriptor, as under a test runner
        return None
    kept = os.dup(1)
    os.dup2(2, 1)
    return kept


def restore_terminal() -> None:
    """Restore the cursor and the main screen of a terminal after a killed process."""
    if sys.stderr.isatty() and os.environ.get("TERM", "dumb") not in ("dumb", "unknown", ""):
        write_styled(sys.stderr, "\x1b[?1049l\x1b[?25h\r\x1b[K")
        sys.stderr.flush()


def silence_stdout() -> None:
    """Prevent an error of the interpreter when it flushes a closed or full output at exit."""
    with suppress(OSError, ValueError):
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, sys.stdout.fileno())
        os.close(devnull)
