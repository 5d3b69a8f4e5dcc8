"""Episodes in a child process: whatever a policy does to its process ends one episode and nothing else.

The parent loads no policy. It hears from the child which episode began and what came of it; an episode of which it
hears nothing more, because the child has ended, closed its descriptors or run out of them, is an infrastructure abort,
and a new child plays the later ones. Interrupts go to the parent, which tells the child once. What the policies
started ends with the child, and the child with its parent.
"""

from __future__ import annotations

import contextlib
import itertools
import mmap
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Self

import msgspec

from lingjing.errors import ExitCode, InfrastructureError, error_of
from lingjing.kernel.world.deadlines import OwnDeadline
from lingjing.play.child_messages import (
    INTERRUPT,
    ChildFailed,
    ChildMessage,
    ChildRefused,
    ChildSpoilt,
    EpisodeBegan,
    EpisodePlayed,
    taken_out,
)
from lingjing.play.descendants import adopting
from lingjing.play.folders import release_if_empty
from lingjing.play.raw_output import RawOutput
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport, end_without_result
from lingjing.play.supervised_child import ENDING, Play, serve

GRACE_S = 60.0
"""How long a child may take to end when it was interrupted, or when it has nothing more to say: seconds of its own
time, as all that follow."""

MUTE_S = 5.0
"""How long a child that closed its pipe in the middle of an episode may take to end."""

SILENCE_S = 600.0
"""How long a child may have no thread of Python's running: a policy that stays in one call of foreign code, such as a
regular expression that never ends, keeps the interpreter and every deadline in it waiting."""

_BEAT_S = 0.5
_PATIENCE_S = 0.05
_FROM_OUTSIDE = {signal.SIGKILL, signal.SIGTERM}
"""Signals that an operator or a system without memory sends."""


def can_supervise(*, with_engines: bool = False) -> bool:
    """Linux, and a thread that can hear signals.

    A child `with_engines` (`--world inline`) needs a program without other threads: a fork copies the locks that they
    hold at the moment, nobody releases them in the child, and engines' libraries wait for them.
    """
    alone = not with_engines or threading.active_count() == 1
    return sys.platform == "linux" and threading.current_thread() is threading.main_thread() and alone


def play_supervised(
    seeds: Sequence[int],
    claim: Callable[[int], Path | None],
    play: Play,
    abort: Callable[[int, Path, str], EpisodeReport],
) -> Iterator[EpisodeReport]:
    """Have a child play the seeds, each in the folder that `claim` gives when its turn comes.

    `abort` makes the report of a seed and a folder whose episode has no result, for that reason. An error of the child
    is raised here; so is `KeyboardInterrupt` if an interrupt left no report.
    """
    waiting = list(seeds)
    with _Interrupts() as interrupts:
        while waiting and not interrupts.have_come():
            before = len(waiting)
            with adopting():
                child = _Child(interrupts, waiting, claim, play)
                with contextlib.closing(child.messages()) as messages:
                    for message in messages:
                        yield from _taken(message, child, waiting, abort)
            if interrupts.have_come():
                break
            if child.began is not None:
                waiting.remove(child.began.seed)
                why, by_policy = child.end()
                yield _aborted(child.began, why, abort, by_policy=by_policy)
            elif len(waiting) == before:
                raise InfrastructureError(f"no episode could begin: {child.end()[0]}")
        if interrupts.have_come() and not interrupts.reported:
            raise KeyboardInterrupt


def _taken(
    message: ChildMessage, child: _Child, waiting: list[int], abort: Callable[[int, Path, str], EpisodeReport]
) -> Iterator[EpisodeReport]:
    match message:
        case EpisodeBegan():
            child.began = message
        case EpisodePlayed(report) if child.began is not None and report.seed == child.began.seed:
            child.began = None
            child.interrupts.reported |= report.reason == INTERRUPTED
            waiting.remove(report.seed)
            if not waiting or report.reason == ABORTED:
                child.expect_its_end()
            yield report
        case ChildFailed(code, said, hint) if child.began is not None and code == ExitCode.INFRASTRUCTURE:
            began, child.began = child.began, None
            waiting.remove(began.seed)
            yield msgspec.structs.replace(_aborted(began, said, abort), hint=hint)
        case ChildFailed(code, said, hint, trace):
            error = error_of(code, said, hint)
            if trace:
                error.add_note(trace)
            raise error
        case ChildRefused(number, said, file):
            raise OSError(number, said, file or None)
        case ChildSpoilt(detail) if child.began is not None:
            began, child.began = child.began, None
            waiting.remove(began.seed)
            yield _aborted(began, detail, abort, by_policy=True)
        case ChildSpoilt(detail):
            raise InfrastructureError(detail)


def _aborted(
    began: EpisodeBegan, why: str, abort: Callable[[int, Path, str], EpisodeReport], *, by_policy: bool = False
) -> EpisodeReport:
    folder = Path(began.folder)
    release_if_empty(folder)
    return msgspec.structs.replace(abort(began.seed, folder, why), crashed=by_policy)


class _Interrupts:
    """A context manager: interrupts are noted and passed on to the child, once, instead of being raised."""

    def __init__(self) -> None:
        self._come = False
        self.reported = False
        self.tell: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        self._before = {
            number: signal.signal(number, self._heard)
            for number in (getattr(signal, name) for name in ENDING)
            if signal.getsignal(number) != signal.SIG_IGN
        }
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _heard(self, number: int, frame: FrameType | None) -> None:
        if not self._come:
            self._come = True
            self.tell()

    def have_come(self) -> bool:
        """Whether there was one."""
        return self._come


class _Heartbeat:
    """What a child writes as long as its interpreter runs, and its parent reads."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, 8)
        self._seen = b""
        self._deadline: OwnDeadline | None = None

    def beat(self) -> None:
        """Begin, in the child: from a thread, for as long as it lives."""

        def go_on() -> None:
            for count in itertools.count(1):
                self._memory[:] = count.to_bytes(8, "little")
                time.sleep(_BEAT_S)

        threading.Thread(target=go_on, name="lingjing-pulse", daemon=True).start()

    def has_stopped(self, pid: int) -> bool:
        """Whether the child has not written for too long; asked every second or so, by the parent."""
        now = self._memory[:]
        if now != self._seen or self._deadline is None:
            self._seen, self._deadline = now, OwnDeadline(pid, SILENCE_S, watched=True)
        return self._deadline.left_s() <= 0.0


class _Child:
    """A forked child, and what it says. `began` is the episode that has no result yet."""

    def __init__(
        self, interrupts: _Interrupts, seeds: Sequence[int], claim: Callable[[int], Path | None], play: Play
    ) -> None:
        self.interrupts = interrupts
        self.began: EpisodeBegan | None = None
        reading, writing = os.pipe2(os.O_CLOEXEC)
        parent = os.getpid()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        self._pulse = _Heartbeat()
        self._raw = RawOutput()
        self._pid = os.fork()
        if self._pid == 0:
            signal.pthread_sigmask(signal.SIG_BLOCK, {INTERRUPT})  # before there are threads, which take it over
            os.close(reading)
            self._raw.lead_here()
            self._pulse.beat()
            serve(parent, writing, tuple(seeds), claim, play)
        os.close(writing)
        self._raw.begin()
        self._pidfd = os.pidfd_open(self._pid)
        self._pipe = reading
        self._until: OwnDeadline | None = None
        self._status = 0
        self._is_mute = False
        self._is_held = False
        interrupts.tell = self._interrupt
        if interrupts.have_come():
            self._interrupt()

    def messages(self) -> Generator[ChildMessage, None, None]:
        """What the child says until it ends; it has ended afterwards, whatever happens."""
        os.set_blocking(self._pipe, False)
        buffer = bytearray()
        try:
            while self._has_more(buffer):
                yield from taken_out(buffer)
            yield from taken_out(buffer)
        except (ValueError, msgspec.MsgspecError):
            return  # somebody else wrote into the pipe: there is nothing more to be learnt from it
        finally:
            self.interrupts.tell = lambda: None
            self._kill_unless_it_ends()
            self._raw.pass_on()
            self._raw.close()
            os.close(self._pipe)
            os.close(self._pidfd)

    def end(self) -> tuple[str, bool]:
        """How it ended, for one who waited for more, and whether only its policy can have ended it: nobody else than
        the code in a process closes its pipe, holds its interpreter, exits or faults there. A kill may come from
        outside."""
        if self._is_held:
            return f"a policy let nothing else run for {SILENCE_S:.0f} s, in one call that held the interpreter", True
        if self._is_mute:
            return "its process closed what it reports through", True
        code = os.waitstatus_to_exitcode(self._status)
        return end_without_result(code), -code not in _FROM_OUTSIDE

    def _has_more(self, buffer: bytearray) -> bool:
        """Wait for the child to say something, and take it in; False when there is nothing more to come."""
        poller = select.poll()
        poller.register(self._pipe, select.POLLIN)
        poller.register(self._pidfd, select.POLLIN)
        if self._raw.descriptor is not None:
            poller.register(self._raw.descriptor, select.POLLIN)
        if self._until is not None and self._until.left_s() <= 0.0:
            return False
        poller.poll(1000)  # a signal between the line above and this one is met within a second
        self._raw.pass_on()
        if self._pulse.has_stopped(self._pid):
            self._is_held = True
            signal.pidfd_send_signal(self._pidfd, signal.SIGKILL)
        try:
            while data := os.read(self._pipe, 1 << 16):
                buffer += data
        except BlockingIOError:
            return not self._has_ended()
        return False

    def _has_ended(self, patience_s: float = 0.0) -> bool:
        poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
        poller.register(self._pidfd, select.POLLIN)
        return bool(poller.poll(int(patience_s * 1000)))

    def expect_its_end(self) -> None:
        """It has nothing more to say: what its policies left to be done at the end of the process keeps nobody."""
        if self._until is None:
            self._until = OwnDeadline(self._pid, GRACE_S, watched=True)

    def _interrupt(self) -> None:
        self._until = OwnDeadline(self._pid, GRACE_S, watched=True)
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._pidfd, INTERRUPT)

    def _kill_unless_it_ends(self) -> None:
        """Its pipe is closed: it is at its end, or can tell of nothing any more."""
        left_s = MUTE_S if self.began is not None else GRACE_S if self._until is None else self._until.left_s()
        deadline = OwnDeadline(self._pid, left_s, watched=True)
        while not (has_ended := self._has_ended(_PATIENCE_S)) and deadline.left_s() > 0.0:
            self._raw.pass_on()  # it may be waiting for that
        self._is_mute = not has_ended
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGKILL)
        _, self._status = os.waitpid(self._pid, 0)
