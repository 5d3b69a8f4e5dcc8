"""The processes that a process of one thread has forked: their ends, and the ends of their owners."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import msgspec

from lingjing.decoding import MsgpackDecoder, msgpack_decoder
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.deadlines import WallDeadline
from lingjing.processes.descendants import end_children
from lingjing.processes.fork_requests import ForkRequest
from lingjing.processes.linux import fork
from lingjing.processes.walls.namespaces import PidNamespaces

_PATROL_S = 1.0
"""The longest wait of `Forks.serve`, seconds; then the caller checks its parent. Chosen: an orphan lives a second."""

_NUMBER_BYTES = 4
"""The bytes of a process id and of a wait status in a report. Both are C integers."""

_REQUESTS: MsgpackDecoder[ForkRequest] = msgpack_decoder(ForkRequest)


@dataclass(slots=True)
class ForkedChild:
    """A forked process."""

    pid: int
    pidfd: int
    """Readable once the process has ended."""
    listener: Channel | None
    """The channel that receives the process id, and at the end the wait status; None without a listener."""
    is_module: bool = False
    """True if the process is ended by SIGTERM and waited for, instead of killed."""
    owner: int = -1
    """A pidfd of the owner; -1 without an owner, or after its end."""
    at_end: Callable[[int], None] | None = None
    """Called with the wait status; None for no call."""
    at_end_of_owner: Callable[[], None] | None = None
    """Called instead of `kill` when the owner ends; None for `kill`."""

    def announce(self) -> None:
        """Send its process id and its `pidfd` to the listener."""
        self._report(self.pid, (self.pidfd,))

    def report_end(self, status: int) -> None:
        """Send its wait status to the listener, and close the listener."""
        self._report(status, ())
        if self.listener is not None:
            self.listener.close()

    def kill(self) -> None:
        """Kill it. It has not been reaped, so its process id is still its own."""
        os.kill(self.pid, signal.SIGKILL)

    def _report(self, number: int, descriptors: tuple[int, ...]) -> None:
        if self.listener is not None:
            with contextlib.suppress(ChannelClosedError, TimeoutError):  # the listener may have ended
                self.listener.send(number.to_bytes(_NUMBER_BYTES, "little"), descriptors, WallDeadline(0.0))


@dataclass(slots=True)
class Forks:
    """The forks of this process, and the channels of its requests."""

    selector: selectors.BaseSelector = field(default_factory=selectors.DefaultSelector)
    processes: dict[int, ForkedChild] = field(default_factory=dict)
    namespaces: PidNamespaces | None = None
    """Makes a process-id namespace for each fork; None to fork in the namespace of this process."""

    def serve(self) -> bool:
        """Handle the requests that have arrived, or wait for one. Returns False if a callback returns False."""
        for key, _ in self.selector.select(_PATROL_S):
            # An earlier callback of this round may have unregistered this object.
            if self.selector.get_map().get(key.fd) == key and key.data(key.fileobj) is False:
                return False
        return True

    def listen(self, channel: Channel, answer: Callable[[Channel], bool | None]) -> None:
        """Call `answer` whenever the channel is readable."""
        self.selector.register(channel, selectors.EVENT_READ, answer)

    def fork(self, listener: Channel | None) -> int | None:
        """Fork this process.

        Returns 0 in the copy, otherwise its process id, which the listener receives; None if the system refuses. Raises
        `SeveralThreadsError`.
        """
        try:
            pid = self._fork()
        except OSError:
            _close(listener)  # its other end reads that it is closed
            return None
        except BaseException:
            _close(listener)
            raise
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

    def _fork(self) -> int:
        if self.namespaces is None:
            return fork()
        self.namespaces.begin()
        pid = -1
        try:
            pid = fork()
        finally:
            if pid:
                self.namespaces.end()
        return pid

    def watch(self, process: ForkedChild, owner: int) -> None:
        """End a fork with the process that has requested it. `owner`: a pidfd of that process."""
        process.owner = os.dup(owner)
        self.selector.register(process.owner, selectors.EVENT_READ, lambda _: self._owner_ended(process))

    def unwatch(self, process: ForkedChild) -> None:
        """Let a fork outlive its owner."""
        if process.owner >= 0:
            self.selector.unregister(process.owner)
            os.close(process.owner)
            process.owner = -1

    def end_all(self) -> None:
        """End every fork and its descendants: modules by SIGTERM, and they are waited for; the others are killed.

        The kernel ends the forks of the first process of a namespace when that process ends.
        """
        if self.namespaces is not None:
            return
        modules = {pid for pid, process in self.processes.items() if process.is_module}
        for pid in modules:
            os.kill(pid, signal.SIGTERM)
        end_children(modules)

    def forget(self) -> None:
        """Close the descriptors that belong to the original, in a fork."""
        self.selector.close()
        for process in self.processes.values():
            _close(process.listener)
            close_all([descriptor for descriptor in (process.pidfd, process.owner) if descriptor >= 0])

    def _ended(self, process: ForkedChild) -> None:
        """Reap a fork and report its status."""
        _, status = os.waitpid(process.pid, 0)
        self.selector.unregister(process.pidfd)
        os.close(process.pidfd)
        self.unwatch(process)
        process.report_end(status)
        if process.at_end is not None:
            process.at_end(status)
        del self.processes[process.pid]
        if self.namespaces is None:  # else the kernel has ended them
            end_children(set(self.processes))  # its descendants, which are children now

    def _owner_ended(self, process: ForkedChild) -> None:
        """Handle the end of a fork's owner."""
        self.unwatch(process)
        (process.at_end_of_owner or process.kill)()


def receive_request(channel: Channel) -> tuple[ForkRequest | None, tuple[int, ...]]:
    """Return the next request and its descriptors; None as the request if it is invalid or incomplete.

    Raises `EOFError` at the end of the channel.
    """
    try:
        packet = channel.receive(WallDeadline(0.0))
    except TimeoutError:
        return None, ()
    except ChannelClosedError as error:
        raise EOFError from error
    try:
        return _REQUESTS.decode(packet.payload), packet.descriptors
    except msgspec.DecodeError:
        return None, packet.descriptors


def close_all(descriptors: Iterable[int]) -> None:
    """Close these descriptors."""
    for descriptor in descriptors:
        os.close(descriptor)


def _close(listener: Channel | None) -> None:
    if listener is not None:
        listener.close()


__all__ = ["ForkedChild", "Forks", "close_all", "receive_request"]
