"""The policy's side: the process of one agent's policy, a fork of a fork server that calls `serve`.

It answers the requests of the player in order (`messages`). The policy's coroutines run in its main thread, in one
event loop for the life of the process. The policy's code can damage only this process: the player holds the deadlines,
and ends the process with all its children.
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import faulthandler
import fcntl
import os
import random
import resource
import socket
import sys
import termios
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from lingjing.decoding import MsgpackDecoder, from_msgpack, msgpack_decoder
from lingjing.errors import InfrastructureError, LingjingError
from lingjing.kernel.barrier import POLICY_ERRORS, failure, timed
from lingjing.kernel.candidates import normalise_decision
from lingjing.kernel.world.held_cities import unpacked
from lingjing.mission.instance import Instance
from lingjing.play.policy_files import load_policy
from lingjing.play.policy_processes.broker import BrokeredCalls
from lingjing.play.policy_processes.declaring import LoadedDeclarations
from lingjing.play.policy_processes.messages import (
    ActPolicy,
    CallEnded,
    CallFailed,
    CancelCall,
    CheckOptions,
    ClosePolicy,
    DecisionMade,
    DeclarePolicy,
    ExaminePolicies,
    HandOverPictures,
    LoadPolicy,
    PolicyAnswerMessage,
    PolicyRequest,
    ResetPolicy,
    WallsBuilt,
    encoded,
    raised,
)
from lingjing.play.policy_processes.model_calls import RemoteModelCalls
from lingjing.play.policy_processes.observations import observation_of
from lingjing.play.policy_processes.pictures import MappedSlots
from lingjing.play.policy_processes.preloading import policy_host
from lingjing.play.policy_processes.servers import memory_limit
from lingjing.plugins.calls import AbandonedCallError, ModelCalls
from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import Picture, Policy
from lingjing.processes.channel import Channel, ChannelClosedError, Packet
from lingjing.processes.deadlines import WallDeadline
from lingjing.processes.linux import adopt_orphans
from lingjing.processes.walls.entering import Walls, enter
from lingjing.scene.city import City
from lingjing.trace.records import Decision, DecisionRecord

_REQUESTS: MsgpackDecoder[PolicyRequest] = msgpack_decoder(PolicyRequest)

_OOM_SCORE = b"1000"
"""The highest `oom_score_adj`: a machine without memory ends policies before the player (`proc(5)`)."""


def serve(argument: bytes, ends: tuple[int, ...]) -> None:
    """Answer requests until the player closes the channel or requests the end.

    `argument` is empty. `ends` are the channel of requests and that of model calls.
    """
    _yield_memory()
    _detach_from_terminal()
    channel, calls = (Channel(socket.socket(fileno=end)) for end in ends)
    _serve(channel, calls, ends[0])


def serve_walled(argument: bytes, ends: tuple[int, ...]) -> None:
    """Build the walls of the argument (`Walls`), report them, and answer requests as `serve` does.

    A process with strict walls that break a promise ends after the report.
    """
    walls = from_msgpack(argument, Walls)
    _yield_memory()
    _detach_from_terminal()
    report = enter(walls, has_namespaces=os.getpid() == 1)
    channel, calls = (Channel(socket.socket(fileno=end)) for end in ends)
    channel.send(encoded(WallsBuilt(report=report)))
    if not (walls.strict and report.broken):
        _serve(channel, calls, ends[0])


def _serve(channel: Channel, calls: Channel, descriptor: int) -> None:
    limit_memory(memory_limit())
    adopt_orphans()
    faulthandler.enable()
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    host = _PolicyHost(channel, descriptor, calls)
    with contextlib.suppress(ChannelClosedError):
        loop.run_until_complete(host.run())
    _release_policy(loop, host)


@dataclass(slots=True)
class _QueuedRequest:
    """A request with its descriptors."""

    request: PolicyRequest
    descriptors: tuple[int, ...]


class _PolicyHost:
    """One policy, and the answers to the player's requests."""

    def __init__(self, channel: Channel, descriptor: int, calls: Channel) -> None:
        self._channel = channel
        self._descriptor = descriptor
        self._calls = calls
        self._queue: asyncio.Queue[_QueuedRequest | None] = asyncio.Queue()
        self._current: asyncio.Task[Any] | None = None
        self._handed: list[int] = []
        self._slots = MappedSlots()
        self._declarations = LoadedDeclarations()
        self._constants: tuple[Instance, City] | None = None
        self.policy: Policy | None = None

    async def run(self) -> None:
        """Answer every request, until `ClosePolicy` or the end of the channel."""
        asyncio.get_running_loop().add_reader(self._descriptor, self._read)
        while (queued := await self._queue.get()) is not None and not isinstance(queued.request, ClosePolicy):
            answer = await self._answer(queued)
            self._channel.send(encoded(answer))

    def _read(self) -> None:
        """Queue the requests that have arrived. The cancellation of a call arrives while the call runs."""
        try:
            while True:
                self._take(self._channel.receive(WallDeadline(0.0)))
        except TimeoutError:
            return
        except (ChannelClosedError, OSError):  # closed, or an invalid packet: the end
            asyncio.get_running_loop().remove_reader(self._descriptor)
            self._queue.put_nowait(None)

    def _take(self, packet: Packet) -> None:
        request = _REQUESTS.decode(packet.payload)
        self._handed += packet.descriptors
        if isinstance(request, CancelCall):
            if self._current is not None:
                self._current.cancel()
        elif not isinstance(request, HandOverPictures):
            self._queue.put_nowait(_QueuedRequest(request, tuple(self._handed)))
            self._handed.clear()

    async def _answer(self, queued: _QueuedRequest) -> PolicyAnswerMessage:
        match queued.request:
            case ExaminePolicies():
                seed_generators(0)
                return self._declarations.examine(queued.request)
            case DeclarePolicy():
                seed_generators(0)
                return self._declarations.declare(queued.request)
            case CheckOptions():
                return self._declarations.check(queued.request)
            case LoadPolicy():
                return self._load(queued.request)
            case ResetPolicy(brief=brief):
                return await self._call(lambda: self._playing.reset(brief), lambda value: CallEnded())
            case ActPolicy():
                return await self._act(queued.request, queued.descriptors)
            case _:
                raise ChannelClosedError("an unexpected request")

    @property
    def _playing(self) -> Policy:
        if self.policy is None:
            raise ChannelClosedError("no policy is loaded")
        return self.policy

    def _load(self, request: LoadPolicy) -> PolicyAnswerMessage:
        seed_generators(request.seed)
        if request.truth is not None:
            self._constants = request.truth.instance, unpacked(request.truth.city)
        try:
            calls = self._calls_of(request)
            host = policy_host(filter(None, (request.source, *request.makers)))
            plugin = load_policy(request.spec, host)
            self.policy = build_policy(plugin, request.arguments, calls, host, as_given=request.as_given)
        except LingjingError as error:
            return raised(error)
        return CallEnded()

    def _calls_of(self, request: LoadPolicy) -> ModelCalls:
        """Return the policy's model calls: by its own process, or by a broker."""
        if not request.brokered:
            return RemoteModelCalls(self._calls, replaying=request.replaying, capped=request.capped)
        calls = BrokeredCalls(self._calls, replaying=request.replaying, capped=request.capped)
        calls.client.wait_until_open()
        return calls

    async def _act(self, request: ActPolicy, descriptors: tuple[int, ...]) -> PolicyAnswerMessage:
        answer = await self._decide(request, self._slots.pictures(request.pictures, descriptors))
        if isinstance(answer, DecisionMade | CallFailed):
            return msgspec.structs.replace(answer, kept=self._slots.kept())
        return answer

    async def _decide(self, request: ActPolicy, pictures: tuple[Picture, ...]) -> PolicyAnswerMessage:
        observation = observation_of(request, pictures, self._constants)
        return await self._call(lambda: self._playing.act(observation, request.inbox), _decided)

    async def _call(
        self, call: Callable[[], Awaitable[Any]], answer: Callable[[Any], PolicyAnswerMessage]
    ) -> PolicyAnswerMessage:
        started = time.monotonic()
        self._current = asyncio.get_running_loop().create_task(timed(call))
        try:
            value, _ = await self._current
        except AbandonedCallError:
            return CallFailed(reason="policy_timeout", detail="")
        except InfrastructureError as error:
            return msgspec.structs.replace(raised(error), detail=failure(error, started).detail)
        except POLICY_ERRORS as error:
            failed = failure(error, started)
            return CallFailed(reason="policy_error", detail=failed.detail, usage=failed.usage)
        finally:
            self._current = None
        return answer(value)


def seed_generators(seed: int) -> None:
    """Seed the global generators of `random` and `numpy.random`, so that a policy draws the same in each run."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - the global generator is what is seeded


def limit_memory(limit: int) -> None:
    """Limit the memory of this process and its children, `limit` bytes each, and disable core dumps."""
    for kind, value in ((resource.RLIMIT_DATA, limit), (resource.RLIMIT_CORE, 0)):
        _, most = resource.getrlimit(kind)
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(kind, (value, value))


def _decided(value: Any) -> PolicyAnswerMessage:
    """Return the message of a decision, or the failure of a value that is none."""
    if not isinstance(value, Decision):
        detail = f"`act` returned {type(value).__name__}, not a Decision"
        return CallFailed(reason="malformed", detail=detail)
    made = normalise_decision(DecisionRecord(agent="", decision=value))
    if made.substituted:
        return CallFailed(reason="malformed", detail=made.detail)
    return DecisionMade(decision=made.decision)


def _yield_memory() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_bytes(_OOM_SCORE)


def _detach_from_terminal() -> None:
    """Detach from the user's terminal, which could be controlled through `/dev/tty`, and close standard input."""
    with contextlib.suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY)
        fcntl.ioctl(terminal, termios.TIOCNOTTY)
        os.close(terminal)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _release_policy(loop: asyncio.AbstractEventLoop, host: _PolicyHost) -> None:
    """Release the policy like the end of a program: cancel its tasks, delete the object, run its exit functions."""
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    if tasks:
        loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
    host.policy = None
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()


__all__ = ["limit_memory", "seed_generators", "serve"]
