"""`BranchQueue`: branches as processes, so many at a time; those that may be asked for next when a worker is idle.

A branch's result depends on its plan alone. So one that was begun before anybody asked for it is as good as one begun
afterwards, and what is told does not depend on how many run at once. A branch that was begun ahead and is of no use any
more is ended.
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
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.deadlines import Deadline, WallDeadline

_PID_BYTES = 4
"""Bytes of a process id, a C integer."""


@dataclass
class _Running:
    """A branch that runs. `channel`: this process's end. `answer`: its encoded result. `pid`, `pidfd`: its process, 0
    and -1 until it has introduced itself."""

    key: bytes
    channel: Channel
    answer: bytes | bytearray = b""
    pid: int = 0
    pidfd: int = -1

    def read(self, deadline: Deadline | None = None) -> bool:
        """Read the next packet, or wait for it until the deadline; False at the end of the channel."""
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
        """Its result."""
        lost = BranchResult(
            failed="the process of the branch ended without a word",
            hint="it was killed, or a policy that ran in it ended it",
        )
        return msgspec.msgpack.decode(self.answer, type=BranchResult) if self.answer else lost

    def close(self) -> None:
        self.channel.close()
        if self.pidfd >= 0:
            os.close(self.pidfd)

    def end(self) -> float:
        """End it; the CPU seconds that it has taken."""
        while self.pidfd < 0 and self.read():
            pass
        spent = 0.0
        with suppress(OSError):  # it may just have ended
            spent = cpu_of(self.pid) if self.pid else 0.0
            if self.pidfd >= 0:
                signal.pidfd_send_signal(self.pidfd, signal.SIGKILL)
        self.close()
        return spent


class BranchQueue:
    """Branches, `jobs` at a time. `begin` has a branch played by a process of its own, which introduces itself with
    `introduce` on the channel that is returned, writes its result there and closes it. `unused_s` are CPU seconds of
    branches that were begun ahead for nothing."""

    def __init__(self, begin: Callable[[BranchPlan], Channel], jobs: int) -> None:
        self._begin = begin
        self._jobs = jobs
        self._running: dict[int, _Running] = {}
        self._ended: dict[bytes, BranchResult] = {}
        self._poller = select.poll()
        self.unused_s = 0.0

    def play(
        self, plans: Sequence[BranchPlan], ahead: Sequence[BranchPlan], tell: Callable[[int, BranchResult], None]
    ) -> None:
        """Play all plans and tell each one's number and result; those `ahead`, likeliest first, only on the side."""
        keys = list(map(msgspec.msgpack.encode, plans))
        further = dict(zip(map(msgspec.msgpack.encode, ahead), ahead, strict=True))
        self._forget_all_but({*keys, *further})
        numbers: dict[bytes, list[int]] = {}
        for number, key in enumerate(keys):
            numbers.setdefault(key, []).append(number)
        known = {*self._ended, *(one.key for one in self._running.values())}
        wanted = dict(zip(keys, plans, strict=True))
        due = [(key, plan) for key, plan in (wanted | further).items() if key not in known]
        for key in [key for key in numbers if key in self._ended]:
            self._tell(numbers.pop(key), self._ended.pop(key), tell)
        while numbers:
            while due and len(self._running) < self._jobs:
                self._start(*due.pop(0))
            for key, result in self._collected():
                if key in numbers:
                    self._tell(numbers.pop(key), result, tell)
                else:
                    self._ended[key] = result

    def close(self) -> None:
        """End all that run."""
        self._forget_all_but(())

    def _start(self, key: bytes, plan: BranchPlan) -> None:
        channel = self._begin(plan)
        self._running[channel.fileno()] = _Running(key, channel)
        self._poller.register(channel, select.POLLIN)

    def _collected(self) -> Iterable[tuple[bytes, BranchResult]]:
        """Those that end, at least one packet of one later."""
        for descriptor, _ in self._poller.poll():
            one = self._running[descriptor]
            if not one.read(WallDeadline(0.0)):
                self._poller.unregister(descriptor)
                del self._running[descriptor]
                one.close()
                yield one.key, one.result()

    def _forget_all_but(self, keys: Iterable[bytes]) -> None:
        kept = frozenset(keys)
        for descriptor, one in list(self._running.items()):
            if one.key not in kept:
                self._poller.unregister(descriptor)
                del self._running[descriptor]
                self.unused_s += one.end()
        for key in [key for key in self._ended if key not in kept]:
            self.unused_s += self._ended.pop(key).cpu_s

    @staticmethod
    def _tell(numbers: Iterable[int], result: BranchResult, tell: Callable[[int, BranchResult], None]) -> None:
        for number in numbers:
            tell(number, result)


def introduce(channel: Channel) -> None:
    """Say which process this is, so that it can be ended."""
    pidfd = os.pidfd_open(os.getpid())
    try:
        channel.send(os.getpid().to_bytes(_PID_BYTES, "little"), (pidfd,))
    finally:
        os.close(pidfd)
