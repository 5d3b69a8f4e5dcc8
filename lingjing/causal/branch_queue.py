"""The queue of branches: processes that run in parallel; idle workers begin with plans that may be requested next.

The result of a branch depends on its plan alone. So a branch that was begun ahead is as good as one begun on request,
and results do not depend on the number of workers. An unused branch ahead is ended.
"""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import msgspec

from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.processor_time import cpu_of
from lingjing.decoding import from_msgpack
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.deadlines import Deadline, WallDeadline

_PID_BYTES = 4
"""Bytes of a process id, a C integer."""


@dataclass
class _Running:
    """A running branch."""

    key: bytes
    """The encoded plan."""
    channel: Channel
    """The end of the worker's channel that this process holds."""
    answer: bytes | bytearray = b""
    """Its encoded result; empty until it arrives."""
    pid: int = 0
    """Its process id; 0 until the branch has sent it."""
    pidfd: int = -1
    """Its pidfd; -1 until the branch has sent it."""

    def read(self, deadline: Deadline | None = None) -> bool:
        """Read the next packet, or wait for it until the deadline; return False at the end of the channel."""
        try:
            packet = self.channel.receive(deadline)
        except TimeoutError:
            return True
        except ChannelClosedError:
            return False
        if packet.descriptors:
            self.pid, self.pidfd = int.from_bytes(packet.payload, "little"), packet.descriptors[0]
        else:
            self.answer = packet.payload
        return True

    def result(self) -> BranchResult:
        """Return its result, or a failure if none arrived."""
        lost = BranchResult(
            failed="the process of the branch ended without a result",
            hint="it was killed, or a policy that ran in it ended it",
        )
        return from_msgpack(self.answer, BranchResult) if self.answer else lost

    def close(self) -> None:
        """Close its channel and pidfd."""
        self.channel.close()
        if self.pidfd >= 0:
            os.close(self.pidfd)

    def end(self) -> float:
        """Kill its process and return its CPU time, seconds."""
        while self.pidfd < 0 and self.read():
            pass
        spent = 0.0
        with suppress(OSError):  # it may have ended meanwhile
            spent = cpu_of(self.pid) if self.pid else 0.0
            if self.pidfd >= 0:
                signal.pidfd_send_signal(self.pidfd, signal.SIGKILL)
        self.close()
        return spent


class BranchQueue:
    """A queue of branches with `jobs` workers.

    `begin` starts the process of a branch and returns its channel. The process sends its id with `introduce`, then its
    result, and closes the channel. `unused_s` is the CPU time of unused branches ahead, seconds.
    """

    def __init__(self, begin: Callable[[BranchPlan], Channel], jobs: int) -> None:
        self._begin = begin
        self._jobs = jobs
        self._running: dict[int, _Running] = {}
        self._ended: dict[bytes, BranchResult] = {}
        self._poller = select.poll()
        self.unused_s = 0.0

    def play(
        self, plans: Sequence[BranchPlan], ahead: Sequence[BranchPlan], report: Callable[[int, BranchResult], None]
    ) -> None:
        """Play all plans and report each one's number and result; plans `ahead`, likeliest first, run on idle
        workers.
        """
        keys = list(map(msgspec.msgpack.encode, plans))
        further = dict(zip(map(msgspec.msgpack.encode, ahead), ahead, strict=True))
        self._forget_all_but({*keys, *further})
        numbers: dict[bytes, list[int]] = {}
        for number, key in enumerate(keys):
            numbers.setdefault(key, []).append(number)
        known = {*self._ended, *(running.key for running in self._running.values())}
        wanted = dict(zip(keys, plans, strict=True))
        waiting = [(key, plan) for key, plan in (wanted | further).items() if key not in known]
        for key in [key for key in numbers if key in self._ended]:
            self._report_all(numbers.pop(key), self._ended.pop(key), report)
        while numbers:
            while waiting and len(self._running) < self._jobs:
                self._start(*waiting.pop(0))
            for key, result in self._collected():
                if key in numbers:
                    self._report_all(numbers.pop(key), result, report)
                else:
                    self._ended[key] = result

    def close(self) -> None:
        """End all running branches."""
        self._forget_all_but(())

    def _start(self, key: bytes, plan: BranchPlan) -> None:
        channel = self._begin(plan)
        self._running[channel.fileno()] = _Running(key, channel)
        self._poller.register(channel, select.POLLIN)

    def _collected(self) -> Iterable[tuple[bytes, BranchResult]]:
        """Yield the branches that have ended, after at least one packet of any branch."""
        for descriptor, _ in self._poller.poll():
            running = self._running[descriptor]
            if not running.read(WallDeadline(0.0)):
                self._poller.unregister(descriptor)
                del self._running[descriptor]
                running.close()
                yield running.key, running.result()

    def _forget_all_but(self, keys: Iterable[bytes]) -> None:
        kept = frozenset(keys)
        for descriptor, running in list(self._running.items()):
            if running.key not in kept:
                self._poller.unregister(descriptor)
                del self._running[descriptor]
                self.unused_s += running.end()
        for key in [key for key in self._ended if key not in kept]:
            self.unused_s += self._ended.pop(key).cpu_s

    @staticmethod
    def _report_all(numbers: Iterable[int], result: BranchResult, report: Callable[[int, BranchResult], None]) -> None:
        for number in numbers:
            report(number, result)


def introduce(channel: Channel) -> None:
    """Send the id and pidfd of this process, so that the queue can end it."""
    pidfd = os.pidfd_open(os.getpid())
    try:
        channel.send(os.getpid().to_bytes(_PID_BYTES, "little"), (pidfd,))
    finally:
        os.close(pidfd)
