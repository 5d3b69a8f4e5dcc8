"""The processes that a single-threaded process has forked: their ends, and the ends of the processes that they work
for.

A fork of several threads would keep the locks of those that are gone, so that one thread is asserted before each fork.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from lingjing.kernel.world.descendants import end_children
from lingjing.kernel.world.forking import ForkRequest

_PATROL_S = 1.0
"""After so long the caller's end is looked for again, whatever has happened."""

_MOST_DESCRIPTORS = 8

_REQUESTS: msgspec.msgpack.Decoder[ForkRequest] = msgspec.msgpack.Decoder(ForkRequest)


@dataclass(slots=True)
class ForkedChild:
    """A process that was forked.

    `pidfd`: shows its end. `listener`: the connection that receives its exit status. `owner`: a descriptor of the
    process that it ends with (-1: none, or that process has ended). `at_end` is called with its status,
    `at_end_of_owner` in the place of the signal that kills it. `is_module`: it is asked to end, not killed.
    """

    pid: int
    pidfd: int
    listener: socket.socket
    is_module: bool = False
    owner: int = -1
    at_end: Callable[[int], None] | None = None
    at_end_of_owner: Callable[[], None] | None = None

    def announce(self) -> None:
        """Send its process id and its `pidfd` to the listener."""
        with contextlib.suppress(OSError):  # the listener may have ended
            socket.send_fds(self.listener, [self.pid.to_bytes(4, "little")], [self.pidfd])

    def kill(self) -> None:
        """End it at once. It has not been reaped, so the number is its own."""
        os.kill(self.pid, signal.SIGKILL)


@dataclass(slots=True)
class Forks:
    """The forks of this process, and the descriptors that it waits for."""

    selector: selectors.BaseSelector = field(default_factory=selectors.DefaultSelector)
    processes: dict[int, ForkedChild] = field(default_factory=dict)

    def serve(self) -> bool:
        """Answer what has come, or wait for it; False if a callback says that this was the last."""
        for key, _ in self.selector.select(_PATROL_S):
            # An earlier answer of this round may have ended the object of this one.
            if self.selector.get_map().get(key.fd) == key and key.data(key.fileobj) is False:
                return False
        return True

    def listen(self, asking: socket.socket, answer: Callable[[socket.socket], bool | None]) -> None:
        """Call `answer` when a request can be read."""
        self.selector.register(asking, selectors.EVENT_READ, answer)

    def fork(self, listener: socket.socket) -> int | None:
        """Fork: 0 in the copy, else its process id, which the listener has received; None where it cannot be done."""
        try:
            if len(list(Path("/proc/self/task").iterdir())) != 1:
                listener.close()
                raise AssertionError("the process that episodes are forked from has more than one thread")
            pid = os.fork()
        except OSError:
            listener.close()  # its other end reads the end of it
            return None
        if pid:
            try:
                pidfd = os.pidfd_open(pid)
            except OSError:
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                raise
            process = self.processes[pid] = ForkedChild(pid, pidfd, listener)
            self.selector.register(process.pidfd, selectors.EVENT_READ, lambda _: self._ended(process))
            process.announce()
        return pid

    def watch(self, process: ForkedChild, owner: int) -> None:
        """Have a fork end with the process that asked for it."""
        process.owner = os.dup(owner)
        self.selector.register(process.owner, selectors.EVENT_READ, lambda _: self._owner_ended(process))

    def unwatch(self, process: ForkedChild) -> None:
        """Let a fork outlive its owner."""
        if process.owner >= 0:
            self.selector.unregister(process.owner)
            os.close(process.owner)
            process.owner = -1

    def end_all(self) -> None:
        """End what is left: modules are asked to and waited for, workers are killed."""
        modules = {pid for pid, process in self.processes.items() if process.is_module}
        for pid in modules:
            os.kill(pid, signal.SIGTERM)
        end_children(modules)

    def forget(self) -> None:
        """In a fork: let go of what is its original's."""
        self.selector.close()
        for process in self.processes.values():
            process.listener.close()
            close_all([one for one in (process.pidfd, process.owner) if one >= 0])

    def _ended(self, process: ForkedChild) -> None:
        """Reap a fork and report its status."""
        _, status = os.waitpid(process.pid, 0)
        self.selector.unregister(process.pidfd)
        os.close(process.pidfd)
        self.unwatch(process)
        with process.listener, contextlib.suppress(OSError):
            process.listener.sendall(status.to_bytes(4, "little"))
        if process.at_end is not None:
            process.at_end(status)
        del self.processes[process.pid]
        end_children(set(self.processes))  # what it left behind

    def _owner_ended(self, process: ForkedChild) -> None:
        """The process that a worker works for is gone."""
        self.unwatch(process)
        (process.at_end_of_owner or process.kill)()


def received(asking: socket.socket) -> tuple[ForkRequest | None, list[int]]:
    """A request and the descriptors that came with it, None for nonsense; `EOFError` at the end of the socket."""
    try:
        data, descriptors, _, _ = socket.recv_fds(asking, 1, _MOST_DESCRIPTORS, socket.MSG_CMSG_CLOEXEC)
    except OSError as error:
        raise EOFError from error
    if not data:
        raise EOFError
    try:
        with open(descriptors[0], "rb") as letter:  # noqa: PTH123 - a descriptor
            letter.seek(0)
            return _REQUESTS.decode(letter.read()), descriptors[1:]
    except (OSError, IndexError, msgspec.DecodeError):
        return None, descriptors[1:]


def close_all(descriptors: Iterable[int]) -> None:
    """Close these descriptors."""
    for descriptor in descriptors:
        os.close(descriptor)


__all__ = ["ForkedChild", "Forks", "close_all", "received"]
