"""The far end: the process of one agent's policy, a fork of a fork server that calls `serve`.

It answers one request of the player after the other (`messages`). The policy's coroutines run in its main thread, in an
event loop that lives as long as the process. The code that runs here can ruin nothing but this process: the player
holds the deadlines, and ends it with all that it started.
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

from lingjing.errors import InfrastructureError, LingjingError
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.kernel.barrier import POLICY_ERRORS, failure, timed
from lingjing.kernel.candidates import normalise_decision
from lingjing.kernel.world.held_cities import unpacked
from lingjing.mission.instance import Instance
from lingjing.play.policy_files import load_policy
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
    encoded,
    raised,
)
from lingjing.play.policy_processes.model_calls import RemoteModelCalls
from lingjing.play.policy_processes.observations import observation_of
from lingjing.play.policy_processes.pictures import MappedSlots
from lingjing.plugins.calls import AbandonedCallError
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import Picture, Policy
from lingjing.processes.channel import Channel, ChannelClosedError, Packet
from lingjing.processes.deadlines import WallDeadline
from lingjing.processes.linux import adopt_orphans
from lingjing.scene.city import City
from lingjing.trace.records import Decision, DecisionRecord

_REQUESTS: msgspec.msgpack.Decoder[PolicyRequest] = msgspec.msgpack.Decoder(PolicyRequest)

MEMORY_VARIABLE = "LINGJING_POLICY_MEMORY_GB"
MEMORY_GB = 4.0
"""Chosen: eight times what the shipped policies and their libraries take, and what a small detector on a CPU needs."""

_FIRST_TO_GO = b"1000"
"""The highest `oom_score_adj`: a machine without memory ends a policy and not the player (`proc(5)`)."""


def serve(argument: bytes, ends: tuple[int, ...]) -> None:
    """Answer until the player closes the channel or asks for the end. `argument` is empty; `ends` are the channel and
    that for model calls."""
    limit_memory(memory_limit())
    _yield_memory()
    _detach_from_terminal()
    adopt_orphans()
    faulthandler.enable()
    channel, calls = (Channel(socket.socket(fileno=end)) for end in ends)
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    host = _PolicyHost(channel, ends[0], calls)
    with contextlib.suppress(ChannelClosedError):
        loop.run_until_complete(host.run())
    _leave(loop, host)


@dataclass(slots=True)
class _Order:
    """A request with its descriptors."""

    request: PolicyRequest
    descriptors: tuple[int, ...]


class _PolicyHost:
    """One policy and the player's requests to it."""

    def __init__(self, channel: Channel, descriptor: int, calls: Channel) -> None:
        self._channel = channel
        self._descriptor = descriptor
        self._calls = calls
        self._orders: asyncio.Queue[_Order | None] = asyncio.Queue()
        self._current: asyncio.Task[Any] | None = None
        self._handed: list[int] = []
        self._slots = MappedSlots()
        self._declarations = LoadedDeclarations()
        self._constants: tuple[Instance, City] | None = None
        self.policy: Policy | None = None

    async def run(self) -> None:
        """Answer every request, until `ClosePolicy` or the end of the channel."""
        asyncio.get_running_loop().add_reader(self._descriptor, self._read)
        while (order := await self._orders.get()) is not None and not isinstance(order.request, ClosePolicy):
            answer = await self._answer(order)
            self._channel.send(encoded(answer))

    def _read(self) -> None:
        """Take in what has come. The deadline of a call comes while the call runs."""
        try:
            while True:
                self._take(self._channel.receive(WallDeadline(0.0)))
        except TimeoutError:
            return
        except (ChannelClosedError, OSError):  # the other end is gone, or what came cannot be read: there is no more
            asyncio.get_running_loop().remove_reader(self._descriptor)
            self._orders.put_nowait(None)

    def _take(self, packet: Packet) -> None:
        request = _REQUESTS.decode(packet.payload)
        self._handed += packet.descriptors
        if isinstance(request, CancelCall):
            if self._current is not None:
                self._current.cancel()
        elif not isinstance(request, HandOverPictures):
            self._orders.put_nowait(_Order(request, tuple(self._handed)))
            self._handed.clear()

    async def _answer(self, order: _Order) -> PolicyAnswerMessage:
        match order.request:
            case ExaminePolicies():
                seed_generators(0)
                return self._declarations.examine(order.request)
            case DeclarePolicy():
                seed_generators(0)
                return self._declarations.declare(order.request)
            case CheckOptions():
                return self._declarations.check(order.request)
            case LoadPolicy():
                return self._load(order.request)
            case ResetPolicy(brief=brief):
                return await self._call(lambda: self._playing.reset(brief), lambda value: CallEnded())
            case ActPolicy():
                return await self._act(order.request, order.descriptors)
            case _:
                raise ChannelClosedError("a request out of turn")

    @property
    def _playing(self) -> Policy:
        if self.policy is None:
            raise ChannelClosedError("no policy is loaded")
        return self.policy

    def _load(self, request: LoadPolicy) -> PolicyAnswerMessage:
        seed_generators(request.seed)
        if request.truth is not None:
            self._constants = request.truth.instance, unpacked(request.truth.city)
        calls = RemoteModelCalls(self._calls, replaying=request.replaying, capped=request.capped)
        try:
            host = _host((request.source, *request.makers))
            self.policy = build_policy(load_policy(request.spec, host), request.arguments, calls, host)
        except LingjingError as error:
            return raised(error)
        return CallEnded()

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
    """Start the global generators of `random` and `numpy.random`: a policy that draws from them draws the same in each
    run."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - the global generator is what is seeded


def memory_limit() -> int:
    """Bytes that a policy may allocate: `LINGJING_POLICY_MEMORY_GB`, or `MEMORY_GB`."""
    with contextlib.suppress(ValueError):
        return int(float(os.environ.get(MEMORY_VARIABLE, MEMORY_GB)) * 2**30)
    return int(MEMORY_GB * 2**30)


def limit_memory(limit: int) -> None:
    """Bound what this process and each process that it starts may allocate, and write no core dump."""
    for kind, value in ((resource.RLIMIT_DATA, limit), (resource.RLIMIT_CORE, 0)):
        _, most = resource.getrlimit(kind)
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        resource.setrlimit(kind, (value, value))


def _decided(value: Any) -> PolicyAnswerMessage:
    if not isinstance(value, Decision):
        detail = f"`act` returned {type(value).__name__}, not a Decision"
        return CallFailed(reason="malformed", detail=detail)
    made = normalise_decision(DecisionRecord(agent="", decision=value))
    if made.substituted:
        return CallFailed(reason="malformed", detail=made.detail)
    return DecisionMade(decision=made.decision)


def _host(names: tuple[str, ...]) -> PluginHost:
    """Return a host with the installed plug-ins of these names alone."""
    points = {point.value: point for point in find_entries(PLUGINS).points if point.name in names}
    return PluginHost(entry_points=False, extra=[point.load() for point in points.values()])


def _yield_memory() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_bytes(_FIRST_TO_GO)


def _detach_from_terminal() -> None:
    """Give up the terminal of the user, which could be steered through `/dev/tty`, and standard input."""
    with contextlib.suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY)
        fcntl.ioctl(terminal, termios.TIOCNOTTY)
        os.close(terminal)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def _leave(loop: asyncio.AbstractEventLoop, host: _PolicyHost) -> None:
    """Let go of the policy as the end of a program does: its tasks, the object, what it registered for the end."""
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


__all__ = ["MEMORY_GB", "MEMORY_VARIABLE", "limit_memory", "memory_limit", "seed_generators", "serve"]
