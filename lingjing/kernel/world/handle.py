"""The caller's side of a worker process: requests with deadlines, and a diagnosis if a deadline passes.

One world uses a worker, or several if it has been forked or is a shared camera. The last user that releases it ends it.
A forked copy keeps its parent process alive, because the parent reaps it and its death signal is tied to the parent's
life.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import warnings
from collections.abc import Sequence
from typing import TypeVar

from lingjing.errors import AbortCause, InfrastructureError
from lingjing.kernel.world.launch import WorkerPlace, WorkerProcess, WorkerSettings, launch
from lingjing.kernel.world.messages import (
    Close,
    Closed,
    Failed,
    Fork,
    Forked,
    Refused,
    Reply,
    WorkerMessage,
    decoded_reply,
    encoded,
)
from lingjing.kernel.world.shared import CallMonitor, CurrentCall, progress_memory
from lingjing.processes.channel import Channel, ChannelClosedError, Packet
from lingjing.processes.deadlines import Deadline, OwnDeadline, own_clock_of_s
from lingjing.processes.fork_client import ForkedProcess, ForkServerClient
from lingjing.processes.output import OutputTail

ReplyT = TypeVar("ReplyT", bound=WorkerMessage)

_CLOSE_S = 5.0
"""Seconds of its own time that a worker may take to close its engines. Chosen."""
_EXIT_S = 60.0
"""Seconds that the operating system may take to end a process that was killed or has closed its socket. Chosen."""
_DUMP_S = 2.0
"""Most seconds to collect the stack dump of a hung worker. Chosen."""
_QUIET_S = 0.3
"""Seconds of silence after which a stack dump counts as complete. Chosen."""
_SHOWN_LINES = 5
"""Lines of a dead worker's output in the error message. Chosen."""
_DUMP_LINES = 60
"""Lines of a hung worker's stack dump in the error's note. Chosen."""
_CRASH = "Fatal Python error: "
"""The first output of `faulthandler`'s report of a crash."""


class Worker:
    """A worker process. Every deadline is measured in the worker's own time."""

    def __init__(
        self,
        place: WorkerPlace,
        pidfd: int,
        end: socket.socket,
        progress: int,
        output: OutputTail,
        *,
        process: WorkerProcess | None = None,
        parent: Worker | None = None,
        pid: int = 0,
        lent: bool = False,
    ) -> None:
        self.place = place
        self.name = f"{place} process"
        """Its name in error messages."""
        self.pid = process.pid if process is not None else pid
        self.parent = parent
        self.alive = True
        self.users = 1
        self._owner = os.getpid()
        self._process = process
        self._pidfd = pidfd
        self._channel = Channel(end)
        self._progress = CallMonitor(progress)
        os.close(progress)
        self._output = output
        self._lent = lent

    @classmethod
    def start(
        cls,
        place: WorkerPlace,
        settings: WorkerSettings,
        fork_server: ForkServerClient | None = None,
        start: bytes = b"",
    ) -> Worker:
        """Start a worker.

        Through a fork server, a camera process may be one that has drawn for others before, and a world process may be
        one that already stands at the boundary 0 with the key `start`.
        """
        made = launch(place, settings, fork_server, start)
        return cls(place, made.pidfd, made.end, made.progress, made.output, process=made.process, lent=made.lent)

    def share(self) -> Worker:
        """Add a user."""
        self.users += 1
        return self

    def release(self) -> None:
        """Remove a user. The last one ends the worker in an orderly way."""
        self.users -= 1
        if self.users == 0 and self.alive:
            self._end()

    def deadline(self, allowed_s: float) -> OwnDeadline:
        """Return a deadline `allowed_s` seconds from now, in the worker's own time."""
        return OwnDeadline(self.pid, allowed_s)

    def send(self, payload: bytes, deadline: OwnDeadline, descriptors: Sequence[int] = ()) -> None:
        """Send one encoded request. Past the deadline the worker is killed.

        Raises `InfrastructureError` if the worker has died or does not take the request in time.
        """
        self._check_alive()
        try:
            self._channel.send(payload, descriptors, deadline, self._output)
        except TimeoutError:
            raise self.hung(deadline.allowed_s) from None
        except ChannelClosedError:
            raise self._died() from None

    def receive(self, deadline: Deadline) -> tuple[Reply, Packet]:
        """Return the next reply and its packet. Raises `TimeoutError` past the deadline, which leaves the worker as it
        is.
        """
        self._check_alive()
        try:
            packet = self._channel.receive(deadline, self._output)
        except ChannelClosedError:
            raise self._died() from None
        return decoded_reply(packet.payload), packet

    def expect(self, kind: type[ReplyT], deadline: OwnDeadline) -> ReplyT:
        """Return the next reply, which must be of type `kind`. Past the deadline the worker is killed."""
        try:
            reply, packet = self.receive(deadline)
        except TimeoutError:
            raise self.hung(deadline.allowed_s) from None
        packet.close()
        if isinstance(reply, kind):
            return reply
        raise self.fault(reply)

    def ask(self, message: WorkerMessage, kind: type[ReplyT], deadline: OwnDeadline) -> ReplyT:
        """Send a request and return its reply."""
        self.send(encoded(message), deadline)
        return self.expect(kind, deadline)

    def fault(self, reply: WorkerMessage) -> InfrastructureError:
        """Return the error for an unexpected reply."""
        if isinstance(reply, Refused):
            return InfrastructureError(reply.message)
        if isinstance(reply, Failed):
            error = InfrastructureError(reply.message, hint=reply.hint, engine=reply.engine)
            error.add_note(reply.traceback)
            return error
        return InfrastructureError(f"the {self.name} sent an unexpected {type(reply).__name__}")

    def fork(self, deadline: OwnDeadline) -> Worker:
        """Return a bit-exact copy of this worker in a process of its own."""
        ours, theirs = socket.socketpair()
        progress = progress_memory()
        try:
            self.send(encoded(Fork()), deadline, (theirs.fileno(), progress))
            theirs.close()
            pid = self.expect(Forked, deadline).pid
            pidfd = os.pidfd_open(pid)
        except BaseException as error:
            ours.close()
            theirs.close()
            os.close(progress)
            if isinstance(error, ProcessLookupError):
                message = f"the copy of the {self.name} died at once"
                raise InfrastructureError(message, cause=self._cause) from error
            raise
        return Worker(self.place, pidfd, ours, progress, self._output, parent=self.share(), pid=pid)

    def kill(self) -> None:
        """End the worker at once, even if other worlds use it; its forks die with it. Idempotent."""
        if self.alive:
            self._signal(signal.SIGKILL)
            self._await_exit(_EXIT_S)
            self._dispose()

    def hung(self, allowed_s: float) -> InfrastructureError:
        """Kill a worker that missed its deadline. Return the error, which names the engine that took most of the
        time.
        """
        call = self._progress.read()
        now_s = own_clock_of_s(self.pid)
        late = _late(call, now_s, f"the {self.name}", allowed_s)
        # The stack is for the engine's author. The signal handler dumps it even from within a C call.
        self._signal(signal.SIGUSR2)
        until = self.deadline(_DUMP_S)
        while self._has_spoken(self.deadline(_QUIET_S)) and until.left_s() > 0.0:
            pass
        self.kill()
        # Without an engine at work the process was stopped, or its answer was lost.
        cause: AbortCause = "" if call.engine else self._cause
        error = InfrastructureError(
            f"{late}; the {self.name} was killed", cause=cause, engine=_slow_engine(call, now_s)
        )
        error.add_note(_tail(self._output.text(), _DUMP_LINES))
        return error

    def _has_spoken(self, deadline: OwnDeadline) -> bool:
        """Wait for output of the worker and read it. Return False if the deadline passes without any."""
        left_s = deadline.left_s()
        while self._output.fileno() >= 0:
            if self._output.wait(max(0.0, left_s)):
                return True
            if left_s <= 0.0:
                return False
            left_s = deadline.left_s()
        return False

    def _check_alive(self) -> None:
        if not self.alive:
            raise InfrastructureError(f"the {self.name} has ended", cause=self._cause)

    def _died(self) -> InfrastructureError:
        call = self._progress.read()
        self._await_exit(_EXIT_S)
        self._output.drain()
        reason = self._exit_reason()
        self.kill()
        where = f" while engine `{call.engine}` was in {call.call}" if call.engine else ""
        # The interpreter's crash dump is for the engine's author and goes into a note, not into the message.
        output, crash, dump = self._output.text().partition(_CRASH)
        last = f"; its last output: {_tail(output, _SHOWN_LINES)}" if output.strip() else ""
        text = f"the {self.name} died{reason}{where}{last}"
        error = InfrastructureError(text, cause=self._cause, engine=call.engine)
        if crash:
            error.add_note(crash + dump)
        return error

    @property
    def _cause(self) -> AbortCause:
        return "camera-process" if self.place == "camera" else "world-process"

    @property
    def _is_ours(self) -> bool:
        # In a fork of the caller the worker still belongs to the caller's process: signals must not reach it.
        return os.getpid() == self._owner

    def _exit_reason(self) -> str:
        if self._process is None:
            return ""
        try:
            code = self._process.wait(_EXIT_S)
        except subprocess.TimeoutExpired:
            return ""
        return f" ({signal.Signals(-code).name})" if code < 0 else f" (exit code {code})"

    def _end(self) -> None:
        if self._is_ours:
            self._ask_to_close()
            if not self._lent and not self._await_exit(_EXIT_S):
                self._signal(signal.SIGKILL)
                self._await_exit(_EXIT_S)
        self._dispose()

    def _ask_to_close(self) -> None:
        deadline = self.deadline(_CLOSE_S)
        try:
            self._channel.send(encoded(Close()), (), deadline, self._output)
            while not isinstance(reply := self._late_reply(deadline), Closed):
                pass
        except (TimeoutError, ChannelClosedError):
            self._signal(signal.SIGKILL)
            return
        for problem in reply.problems:
            warnings.warn(problem, RuntimeWarning, stacklevel=2)

    def _late_reply(self, deadline: OwnDeadline) -> Reply:
        packet = self._channel.receive(deadline, self._output)
        packet.close()
        return decoded_reply(packet.payload)

    def _signal(self, number: signal.Signals) -> None:
        if not self._is_ours:
            return
        try:
            signal.pidfd_send_signal(self._pidfd, number)
        except ProcessLookupError:
            return  # it has ended already

    def _await_exit(self, timeout_s: float) -> bool:
        if not self._is_ours:
            return True
        poller = select.poll()
        poller.register(self._pidfd, select.POLLIN)
        return bool(poller.poll(int(timeout_s * 1000)))

    def _dispose(self) -> None:
        self.alive = False
        self._channel.close()
        self._progress.close()
        os.close(self._pidfd)
        if isinstance(self._process, ForkedProcess):
            self._process.close()
        self._output.drain()
        if self.parent is None:
            self._output.close()
        else:
            self.parent.release()


def _late(call: CurrentCall, now_s: float, name: str, allowed_s: float) -> str:
    """Return the error text for a missed deadline. It names the current engine unless another one took more of the
    time.
    """
    if not call.engine:
        return f"{name} did not answer within {allowed_s:g} s"
    if _slow_engine(call, now_s) != call.engine:
        took = f"engine `{call.slowest}` took {call.slowest_s:.1f} of {allowed_s:g} s"
        return f"{took}, so that engine `{call.engine}` ({call.call}) had no time left"
    return f"engine `{call.engine}` ({call.call}) did not answer within {allowed_s:g} s"


def _slow_engine(call: CurrentCall, now_s: float) -> str:
    """Return the engine that took most of the time: the current one, or an earlier one of the same barrier."""
    return call.slowest if call.slowest and call.slowest_s > now_s - call.since_s else call.engine


def _tail(text: str, count: int) -> str:
    return "\n".join(text.strip().splitlines()[-count:])
