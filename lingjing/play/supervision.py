"""Episodes in a child process: whatever a policy does to its process ends one episode and nothing else.

The parent loads no policy. It hears from the child which episode began and what came of it; an episode of which it
hears nothing more, because the child has ended, closed its descriptors or run out of them, is an infrastructure abort,
and a new child plays the later ones. Interrupts go to the parent, which tells the child once. What the policies
started ends with the child, and the child with its parent.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import itertools
import json
import mmap
import os
import select
import signal
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import NoReturn, Self

import msgspec

from lingjing.errors import (
    ExitCode,
    InfrastructureError,
    LingjingError,
    MissionError,
    UsageError,
)
from lingjing.kernel.world.deadlines import OwnDeadline
from lingjing.play.descendants import adopt, adopting, be_told_of_the_end_of, end_children
from lingjing.play.folders import release_if_empty
from lingjing.play.raw_output import RawOutput
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.trace.signals import STOP, deferring_signals

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
_HEADER = struct.Struct("<Q")
_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
_FROM_OUTSIDE = {signal.SIGKILL, signal.SIGTERM}
"""Signals that an operator or a system without memory sends."""
_SPOILT = {errno.EBADF, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""What a process meets whose descriptors were closed or used up, or that has no memory left."""
_KINDS: dict[int, type[LingjingError]] = {
    ExitCode.USAGE: UsageError,
    ExitCode.INFRASTRUCTURE: InfrastructureError,
    ExitCode.MISSION: MissionError,
}

SeedFolder = tuple[int, Path | None]
Play = Callable[[Iterator[SeedFolder]], Iterator[EpisodeReport]]
"""Plays (seed, folder) pairs as it takes them, as `play_here` does."""


class _Began(msgspec.Struct, frozen=True, tag=True):
    """The child begins an episode."""

    seed: int
    folder: str


class _Played(msgspec.Struct, frozen=True, tag=True):
    """What came of it."""

    report: EpisodeReport


class _Failed(msgspec.Struct, frozen=True, tag=True):
    """The child was given something wrong, or has a fault; the later episodes would fail as well."""

    code: int
    message: str
    hint: str = ""
    trace: str = ""


class _Refused(msgspec.Struct, frozen=True, tag=True):
    """The system refused the child something, as a place to write to."""

    number: int
    message: str
    file: str


class _Spoilt(msgspec.Struct, frozen=True, tag=True):
    """The process can play no more; its episode is an abort."""

    detail: str


_Message = _Began | _Played | _Failed | _Refused | _Spoilt


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
    message: _Message, child: _Child, waiting: list[int], abort: Callable[[int, Path, str], EpisodeReport]
) -> Iterator[EpisodeReport]:
    match message:
        case _Began():
            child.began = message
        case _Played(report) if child.began is not None and report.seed == child.began.seed:
            child.began = None
            child.interrupts.reported |= report.reason == INTERRUPTED
            waiting.remove(report.seed)
            yield report
        case _Failed(code, said) if child.began is not None and code == ExitCode.INFRASTRUCTURE:
            began, child.began = child.began, None
            waiting.remove(began.seed)
            yield _aborted(began, said, abort)
        case _Failed(code, said, hint, trace):
            error = _KINDS.get(code, LingjingError)(said, hint=hint)
            if trace:
                error.add_note(trace)
            raise error
        case _Refused(number, said, file):
            raise OSError(number, said, file or None)
        case _Spoilt(detail) if child.began is not None:
            began, child.began = child.began, None
            waiting.remove(began.seed)
            yield _aborted(began, detail, abort, by_policy=True)
        case _Spoilt(detail):
            raise InfrastructureError(detail)


def _aborted(
    began: _Began, why: str, abort: Callable[[int, Path, str], EpisodeReport], *, by_policy: bool = False
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
            for number in (getattr(signal, name) for name in _ENDING)
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


class _Pulse:
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
        self.began: _Began | None = None
        reading, writing = os.pipe2(os.O_CLOEXEC)
        parent = os.getpid()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        self._pulse = _Pulse()
        self._raw = RawOutput()
        self._pid = os.fork()
        if self._pid == 0:
            signal.pthread_sigmask(signal.SIG_BLOCK, {_INTERRUPT})  # before there are threads, which take it over
            os.close(reading)
            self._raw.lead_here()
            self._pulse.beat()
            _serve(parent, writing, tuple(seeds), claim, play)
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

    def messages(self) -> Generator[_Message, None, None]:
        """What the child says until it ends; it has ended afterwards, whatever happens."""
        os.set_blocking(self._pipe, False)
        buffer = bytearray()
        try:
            while self._has_more(buffer):
                yield from _decoded(buffer)
            yield from _decoded(buffer)
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
        if os.WIFSIGNALED(self._status):
            number = os.WTERMSIG(self._status)
            return f"its process was killed by signal {number}", number not in _FROM_OUTSIDE
        return f"its process ended without a result (exit code {os.WEXITSTATUS(self._status)})", True

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

    def _interrupt(self) -> None:
        self._until = OwnDeadline(self._pid, GRACE_S, watched=True)
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._pidfd, _INTERRUPT)

    def _kill_unless_it_ends(self) -> None:
        """Its pipe is closed: it is at its end, or can tell of nothing any more."""
        deadline = OwnDeadline(self._pid, GRACE_S if self.began is None else MUTE_S, watched=True)
        while not (has_ended := self._has_ended(_PATIENCE_S)) and deadline.left_s() > 0.0:
            self._raw.pass_on()  # it may be waiting for that
        self._is_mute = not has_ended
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGKILL)
        _, self._status = os.waitpid(self._pid, 0)


_INTERRUPT = getattr(signal, "SIGRTMIN", 34) + 3
"""What the parent tells the child to stop with: none that a terminal, a shell or `timeout` sends to a whole group."""


def _decoded(buffer: bytearray) -> Iterator[_Message]:
    """The whole messages at the beginning of the buffer, which they leave."""
    while len(buffer) >= _HEADER.size:
        (size,) = _HEADER.unpack_from(buffer)
        if len(buffer) < _HEADER.size + size:
            return
        text = bytes(buffer[_HEADER.size : _HEADER.size + size])
        del buffer[: _HEADER.size + size]
        yield msgspec.convert(json.loads(text), _Message)


# -- the child


def _serve(parent: int, pipe: int, seeds: Sequence[int], claim: Callable[[int], Path | None], play: Play) -> NoReturn:
    """Play, tell, end what is left, and leave without a word to the parent's own exit handlers."""
    code = 1
    try:
        atexit._clear()
        adopt()
        _listen()
        if be_told_of_the_end_of(parent, _INTERRUPT):
            _play(pipe, seeds, claim, play)
        code = 0
    except KeyboardInterrupt:
        code = int(ExitCode.INTERRUPTED)
    except BaseException as error:  # noqa: BLE001 - whatever it is, the parent is told
        sys.setrecursionlimit(max(10_000, sys.getrecursionlimit()))  # a policy may have left too little to tell it
        with contextlib.suppress(OSError):
            _tell(pipe, _failure(error))
    finally:
        try:
            _leave(code)
        finally:
            os._exit(code)  # whatever is left of the interpreter, the parent's code below is not ours to run


def _play(pipe: int, seeds: Sequence[int], claim: Callable[[int], Path | None], play: Play) -> None:
    def places() -> Iterator[SeedFolder]:
        for seed in seeds:
            folder = claim(seed)
            _tell(pipe, _Began(seed, "" if folder is None else str(folder)))
            yield seed, folder

    episodes = play(places())
    for report in episodes:
        with deferring_signals():
            _tell(pipe, _Played(report))
        if report.reason == ABORTED:  # nobody knows what is left of this process: a new one plays the next
            break
    close = getattr(episodes, "close", None)
    if close is not None:
        close()


def _tell(pipe: int, message: _Message) -> None:
    text = json.dumps(msgspec.to_builtins(message)).encode()  # names of files may be no text: JSON escapes them
    rest = memoryview(_HEADER.pack(len(text)) + text)
    while rest:
        rest = rest[os.write(pipe, rest) :]


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
        signal.sigwait({_INTERRUPT})
        while True:
            signal.pthread_kill(self._main, STOP)
            with contextlib.suppress(Empty):
                if self._raised.get(timeout=_BEAT_S):
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
    for name in _ENDING:
        if signal.getsignal(getattr(signal, name)) != signal.SIG_IGN:
            signal.signal(getattr(signal, name), lambda number, frame: None)
    _Stop()


def _failure(error: BaseException) -> _Failed | _Refused | _Spoilt:
    said = _said(error)
    if _is_spoilt(error):
        return _Spoilt(f"a policy left its process unable to go on: {said}")
    if isinstance(error, LingjingError):
        hint, trace = error.hint, "".join(traceback.format_exception(error))
        return _Failed(int(error.exit_code), str(error), hint, trace)
    if isinstance(error, OSError) and error.errno is not None:
        return _Refused(error.errno, error.strerror or str(error), str(error.filename or ""))
    return _Failed(int(ExitCode.BUG), said, "", "".join(traceback.format_exception(error)))


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
