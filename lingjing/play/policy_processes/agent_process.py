"""The process of one agent's policy from the player's side: start, requests, answers, end.

No function here waits for the process: `send` passes a descriptor, `receive` returns what has arrived. The player waits
for several processes at once (`barrier`).
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress

import msgspec

from lingjing.decoding import MsgpackDecoder, msgpack_decoder
from lingjing.errors import InfrastructureError
from lingjing.play.policy_processes.messages import (
    BrokerStart,
    HandOverPictures,
    PolicyAnswerMessage,
    PolicyRequest,
    WallsBuilt,
    encoded,
)
from lingjing.play.policy_processes.model_calls import ModelCallService
from lingjing.play.policy_processes.output import PolicyOutput
from lingjing.play.policy_processes.servers import PolicyServer, memory_limit
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.policy import Usage
from lingjing.processes.channel import MAX_DESCRIPTORS, Channel, ChannelClosedError, NoMemoryError
from lingjing.processes.deadlines import WallDeadline
from lingjing.processes.fork_client import ForkedProcess
from lingjing.processes.linux import private_memory
from lingjing.processes.walls.offer import check_strict
from lingjing.processes.walls.report import WallReport

ANSWER_BYTES = 4_000_000
"""The largest accepted answer, bytes. Chosen: four times the largest decision that the kernel accepts."""

CALL_BYTES = 256_000_000
"""The largest accepted model call with its pictures, bytes. Chosen."""

_STATUS_S = 10.0
"""The longest wait for the fork server's report of an ended process, seconds of wall clock. Chosen."""

_UNCOUNTED_BYTES = 256 << 20
"""The memory beyond the limit at which a process is ended, bytes. Chosen: 64 MB for the stack, and room for the pages
of libraries that the loader has written and made read-only, none of which RLIMIT_DATA counts.
"""

_MEMORY_S = 0.1
"""The time between two checks of the memory of policies, seconds of wall clock. Chosen: a policy fills less than 1 GB
in it. A check of ten processes takes 0.3 ms (measured).
"""

_HINT = "`lingjing doctor` lists what this kernel offers; `ulimit -a` shows limits of this shell"
"""The hint for walls that cannot be built."""

_ANSWERS: MsgpackDecoder[PolicyAnswerMessage] = msgpack_decoder(PolicyAnswerMessage)


class PolicyProcess:
    """The process of an agent's policy. `calls` is the record of its model calls.

    `broker` starts a process that makes the calls in its place; None if the policy makes them itself.

    `wall_report` describes its walls; None without walls, or before they stand.
    """

    def __init__(self, agent: str, server: PolicyServer, calls: ModelCalls, broker: BrokerStart | None = None) -> None:
        self.agent = agent
        self._calls = ModelCallService(calls)
        self._makes_calls = broker is not None or server.walls is None
        self._broker: ForkedProcess | None = None
        ours, theirs = socket.socketpair()
        our_calls, their_calls = socket.socketpair()
        reading, writing = os.pipe2(os.O_CLOEXEC)
        try:
            if broker is not None:
                self._broker, their_calls = _broker_between(server, broker, their_calls, writing)
            ends = theirs.fileno(), their_calls.fileno()
            self._process: ForkedProcess = server.start_policy(ends, writing)
        except BaseException:
            self._end_broker()
            ours.close()
            our_calls.close()
            os.close(reading)
            raise
        finally:
            theirs.close()
            their_calls.close()
            os.close(writing)
        self._channel = Channel(ours, ANSWER_BYTES)
        self._call_channel = Channel(our_calls, CALL_BYTES)
        self._output = PolicyOutput(agent, reading)
        self.is_alive = True
        self._walls = server.walls
        self.wall_report: WallReport | None = None
        self._ending = threading.Lock()
        self._memory_limit = memory_limit()
        self._exceeded = ""

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    def descriptors(self) -> Iterator[int]:
        """Yield the descriptors to wait for: answers, model calls, the end of the process, output."""
        yield from (self._channel.fileno(), self._call_channel.fileno(), self._process.pidfd)
        if self._output.fileno() >= 0:
            yield self._output.fileno()
        if self._broker is not None:
            yield self._broker.pidfd

    def send(self, request: PolicyRequest, slots: Sequence[int] = ()) -> None:
        """Send a request. A process that has ended does not read it, which the next `receive` reports."""
        room = MAX_DESCRIPTORS - 1
        rest = list(slots)
        while len(rest) > room:
            self._send(HandOverPictures(), rest[:room])
            del rest[:room]
        self._send(request, rest)

    def receive(self) -> PolicyAnswerMessage | None:
        """Return the answer to the request; None if it has not arrived. Serves model calls and output too.

        Raises `EOFError` with the reason if the process has ended, or has sent an invalid answer. Then the process is
        ended. Raises `InfrastructureError` if its walls cannot be built, or break a promise and are strict.
        """
        self._output.drain()
        if self._broker is not None and self._broker.poll() is not None:
            code = self._broker.returncode
            self.end()
            raise InfrastructureError(
                f"the broker of the model calls of `{self.agent}` has ended: {how_it_ended(code or 0)}",
                hint="see its messages on standard error",
                cause="call-record",
            )
        has_ended = self.has_ended()  # read first: the last packet may be an answer
        try:
            answer = self._received()
            if answer is None:
                self._serve_calls()
        except (ChannelClosedError, msgspec.MsgspecError, RecursionError) as error:  # the last for 1,000 nested lists
            if self._ends_by_itself():
                raise self._error_of_end() from error
            self.end()
            raise EOFError("its process sent an invalid answer, or closed its channel") from error
        if answer is None and has_ended:
            raise self._error_of_end()
        return answer

    @property
    def is_walled(self) -> bool:
        """True if there are walls around it."""
        return self._walls is not None

    def check_memory(self) -> None:
        """Kill a process behind walls that uses more memory than the limit. Any thread may call this.

        RLIMIT_DATA counts pages while they may be written, so a policy escapes it with pages that it fills and then
        makes read-only (getrlimit(2), mprotect(2)).
        """
        with self._ending:
            if self.is_alive and private_memory(self.pid) > self._memory_limit + _UNCOUNTED_BYTES:
                self._exceeded = f"its process used more than {self._memory_limit / 2**30:g} GB of memory"
                with suppress(ProcessLookupError):
                    self._process.kill()

    def bill(self) -> Usage:
        """Return the usage of the model calls that ended since the last bill, as the player has recorded them."""
        return self._calls.bill()

    def has_ended(self, patience_s: float = 0.0) -> bool:
        """Return True if the process has ended, or ends within `patience_s` seconds."""
        poller = select.poll()
        poller.register(self._process.pidfd, select.POLLIN)
        return bool(poller.poll(int(patience_s * 1000)))

    def end(self) -> str:
        """Kill the process unless it has ended, and return its end in words. The fork server ends its children."""
        if not self.is_alive:
            return ""
        with self._ending:  # its descriptor is closed below, and its number may then be another process's
            self.is_alive = False
        with suppress(ProcessLookupError):
            self._process.kill()
        code = self._status()
        self._end_broker()
        self._output.drain()
        self._output.close()
        self._channel.close()
        self._call_channel.close()
        self._process.close()
        self._calls.give_up()
        return self._exceeded or how_it_ended(code)

    def _error_of_end(self) -> Exception:
        """End the process, and return the error: a process that ends before its walls stand has run no foreign code."""
        ending = self.end()
        if self._walls is not None and self._process.returncode == -signal.SIGKILL and not self._exceeded:
            ending += f", as at its limit of {self._walls.cpu_s} s of processor time"
        if self._walls is None or self.wall_report is not None:
            return EOFError(ending)
        return InfrastructureError(f"the walls around `{self.agent}` cannot be built: {ending}", hint=_HINT)

    def _end_broker(self) -> None:
        """Kill the broker. Its open calls are recorded as abandoned."""
        if self._broker is not None:
            with suppress(ProcessLookupError):
                self._broker.kill()
            self._broker.close()
            self._broker = None

    def _send(self, request: PolicyRequest, slots: Sequence[int]) -> None:
        with suppress(ChannelClosedError):
            _send_in_memory(self._channel, encoded(request), slots)

    def _received(self) -> PolicyAnswerMessage | None:
        try:
            packet = self._channel.receive(WallDeadline(0.0))
        except TimeoutError:
            return None
        packet.close()
        answer = _ANSWERS.decode(packet.payload)
        if not isinstance(answer, WallsBuilt):
            return answer
        if self._walls is None or self.wall_report is not None:
            raise ChannelClosedError("an unexpected report of walls")
        self.wall_report = answer.report
        if self._walls.strict:
            check_strict(answer.report)
        return self._received()

    def _serve_calls(self) -> None:
        try:
            packet = self._call_channel.receive(WallDeadline(0.0))
        except TimeoutError:
            return
        packet.close()
        if not self._makes_calls:  # it has no network and no broker, so the call was never made
            raise ChannelClosedError("a model call behind walls without a broker")
        _send_in_memory(self._call_channel, self._calls.answer(packet.payload))

    def _status(self) -> int:
        try:
            return self._process.wait(_STATUS_S)
        except subprocess.TimeoutExpired:
            return ForkedProcess.LOST

    def _ends_by_itself(self) -> bool:
        """Return True if the process ends by itself: its descriptors close shortly before it ends."""
        return self.has_ended(0.2)


class MemoryWatch:
    """A thread that checks the memory of processes behind walls, at turns and between them. `processes` may change."""

    def __init__(self, processes: Iterable[PolicyProcess]) -> None:
        self._processes = processes
        self._thread: threading.Thread | None = None
        self._over = threading.Event()

    def begin(self) -> None:
        """Start the thread unless it runs."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="policy-memory", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread. A later `begin` does nothing."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(_MEMORY_S):
            for process in tuple(self._processes):
                process.check_memory()


def _broker_between(
    server: PolicyServer, start: BrokerStart, calls: socket.socket, output: int
) -> tuple[ForkedProcess, socket.socket]:
    """Start a broker that holds `calls`. Returns its process, and the end of its channel for the policy."""
    theirs, ours = socket.socketpair()
    with calls, ours:
        try:
            return server.start_broker((ours.fileno(), calls.fileno()), output, encoded(start)), theirs
        except BaseException:
            theirs.close()
            raise


def _send_in_memory(channel: Channel, payload: bytes, descriptors: Sequence[int] = ()) -> None:
    """Send without waiting for a reader. Raises `InfrastructureError` if the system has no memory."""
    try:
        channel.send_in_memory(payload, descriptors)
    except NoMemoryError as error:
        raise InfrastructureError(
            f"a request to the process of a policy cannot be sent: {error}",
            hint="memory or file descriptors of this machine or container have run out",
        ) from error


def how_it_ended(code: int) -> str:
    """Return the end of a policy's process in words, by its exit code (negative: a signal)."""
    if code < 0:
        names = {number.value: f" ({number.name})" for number in signal.Signals}
        return f"its process was killed by signal {-code}{names.get(-code, '')}"
    return f"its process ended (exit code {code})"
