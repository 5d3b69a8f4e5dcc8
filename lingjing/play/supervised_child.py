"""A child process that plays episodes, from its first instruction to its last: `serve` never returns.

It tells its parent which episode begins and what came of it (`child_messages`), is stopped by the parent alone, and
says what the policies of an episode have left it without.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import NoReturn

from lingjing.errors import ExitCode, LingjingError
from lingjing.play.child_messages import (
    INTERRUPT,
    ChildFailed,
    ChildRefused,
    ChildSpoilt,
    EpisodeBegan,
    EpisodePlayed,
    tell,
)
from lingjing.play.descendants import adopt, be_told_of_the_end_of, end_children
from lingjing.play.report import ABORTED, EpisodeReport
from lingjing.trace.signals import STOP, deferring_signals

ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
"""What ends a command from outside."""

_AGAIN_S = 0.5
"""How long an interrupt has to be heard before it is sent again."""

_SPOILT = {errno.EBADF, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""What a process meets whose descriptors were closed or used up, or that has no memory left."""

SeedFolder = tuple[int, Path | None]
Play = Callable[[Iterator[SeedFolder]], Iterator[EpisodeReport]]
"""Plays (seed, folder) pairs as it takes them, as `play_here` does."""


def serve(parent: int, pipe: int, seeds: Sequence[int], claim: Callable[[int], Path | None], play: Play) -> NoReturn:
    """Play, tell, end what is left, and leave without a word to the parent's own exit handlers."""
    code = 1
    try:
        atexit._clear()
        adopt()
        _listen()
        if be_told_of_the_end_of(parent, INTERRUPT):
            _play(pipe, seeds, claim, play)
        code = 0
    except KeyboardInterrupt:
        code = int(ExitCode.INTERRUPTED)
    except BaseException as error:  # noqa: BLE001 - whatever it is, the parent is told
        sys.setrecursionlimit(max(10_000, sys.getrecursionlimit()))  # a policy may have left too little to tell it
        with contextlib.suppress(OSError):
            tell(pipe, _failure(error))
    finally:
        try:
            _leave(code)
        finally:
            os._exit(code)  # whatever is left of the interpreter, the parent's code below is not ours to run


def _play(pipe: int, seeds: Sequence[int], claim: Callable[[int], Path | None], play: Play) -> None:
    def places() -> Iterator[SeedFolder]:
        for seed in seeds:
            folder = claim(seed)
            tell(pipe, EpisodeBegan(seed, "" if folder is None else str(folder)))
            yield seed, folder

    episodes = play(places())
    for report in episodes:
        with deferring_signals():
            tell(pipe, EpisodePlayed(report))
        if report.reason == ABORTED:  # nobody knows what is left of this process: a new one plays the next
            break
    close = getattr(episodes, "close", None)
    if close is not None:
        close()


class _Stop:
    """The parent's interrupt, in the child: a `KeyboardInterrupt` in the main thread, once.

    A thread takes the parent's signal and sends another one to the main thread. The system hands a signal that is meant
    for a process to any of its threads, to another than the main one while that has one pending, and a main thread that
    waits for a lock is not woken by what another thread got. It is sent again until it is heard: the interpreter does
    not look for signals between its last instruction and a call that waits, nor can it raise anything in the finaliser
    of an object.
    """

    def __init__(self) -> None:
        self._main = threading.get_ident()
        self._raised: SimpleQueue[bool] = SimpleQueue()  # which a signal's handler may write to at any moment
        self._has_raised = self._is_noting = False
        sys.unraisablehook = self._note
        signal.signal(STOP, self._raise)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})
        threading.Thread(target=self._pass_on, name="lingjing-interrupts", daemon=True).start()

    def _pass_on(self) -> None:
        signal.sigwait({INTERRUPT})
        while True:
            signal.pthread_kill(self._main, STOP)
            with contextlib.suppress(Empty):
                if self._raised.get(timeout=_AGAIN_S):
                    self._raised.get()  # in vain

    def _raise(self, number: int, frame: FrameType | None) -> None:
        if self._is_noting:
            self._raised.put(False)
        elif not self._has_raised:
            self._has_raised = True
            self._raised.put(True)
            raise KeyboardInterrupt

    def _note(self, ignored: sys.UnraisableHookArgs) -> None:
        if not issubclass(ignored.exc_type, KeyboardInterrupt):
            sys.__unraisablehook__(ignored)
            return
        self._is_noting, self._has_raised = True, False  # what is raised in here would be ignored as well
        self._raised.put(False)
        self._is_noting = False


def _listen() -> None:
    """Hear the parent alone: what a terminal sends to all, it passes on. Children of policies get the usual signals."""
    for name in ENDING:
        if signal.getsignal(getattr(signal, name)) != signal.SIG_IGN:
            signal.signal(getattr(signal, name), lambda number, frame: None)
    _Stop()


def _failure(error: BaseException) -> ChildFailed | ChildRefused | ChildSpoilt:
    said = _said(error)
    if _is_spoilt(error):
        return ChildSpoilt(f"a policy left its process unable to go on: {said}")
    if isinstance(error, LingjingError):
        hint, trace = error.hint, "".join(traceback.format_exception(error))
        return ChildFailed(int(error.exit_code), str(error), hint, trace)
    if isinstance(error, OSError) and error.errno is not None:
        return ChildRefused(error.errno, error.strerror or str(error), str(error.filename or ""))
    return ChildFailed(int(ExitCode.BUG), said, "", "".join(traceback.format_exception(error)))


def _said(error: BaseException) -> str:
    """Type, words and place of an exception in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" [{Path(frames[-1].filename).name}:{frames[-1].lineno}]" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _is_spoilt(error: BaseException | None) -> bool:
    """Whether it, or what it came from, is for want of descriptors, memory, threads, depth or loaded modules."""
    if __name__ not in sys.modules:
        return True
    while error is not None:
        if isinstance(error, (RecursionError, MemoryError)) or getattr(error, "errno", None) in _SPOILT:
            return True
        if isinstance(error, RuntimeError) and "start new thread" in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def _leave(code: int) -> NoReturn:
    """Flush, run what was registered for the end, end the children; never return."""
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()
    with contextlib.suppress(BaseException):
        end_children(set())
    os._exit(code)
