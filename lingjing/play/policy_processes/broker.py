"""The broker of the model calls of one agent behind walls: a process on the harness's side.

The policy's process sends questions over its second channel, and has no network, no key and no record. The broker has
the environment of the player. It builds each request from the user's options, and records it with the player
(`model_calls`). It executes no code of the policy, and closes the channel at the first message that is no question.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable, Mapping

import msgspec

from lingjing.decoding import MsgpackDecoder, from_msgpack, msgpack_decoder
from lingjing.errors import InfrastructureError, LingjingError
from lingjing.installation import OWN
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.mission.instance import GivenOption
from lingjing.play.policy_processes.messages import (
    AskBroker,
    BrokerAnswer,
    BrokerOpened,
    BrokerRequest,
    BrokerStart,
    CancelQuestion,
    QuestionAnswered,
    RaisedError,
    encoded,
    error_of,
    raised,
)
from lingjing.play.policy_processes.model_calls import RemoteModelCalls
from lingjing.play.policy_processes.preloading import policy_host
from lingjing.plugins.calls import AbandonedCallError, CallRequest, CallResult, ModelBroker, ModelCalls, ModelQuestion
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.deadlines import WallDeadline

SERVE = "lingjing.play.policy_processes.broker:serve"
"""The function that a fork server calls in the broker's process."""

QUESTION_BYTES = 64_000_000
"""The largest accepted question with its pictures, bytes. Chosen: far above any model's limit."""

MOST_QUESTIONS = 64
"""The most questions that wait for an answer at a time. Chosen."""

_UNREAD_S = 5.0
"""The longest wait for a policy that does not read its answer, seconds of wall clock. Chosen."""

_REQUESTS: MsgpackDecoder[BrokerRequest] = msgpack_decoder(BrokerRequest)
_ANSWERS: MsgpackDecoder[BrokerAnswer] = msgpack_decoder(BrokerAnswer)


def serve(argument: bytes, ends: tuple[int, ...]) -> None:
    """Answer questions until the player ends this process. `ends`: the policy's channel, and the player's."""
    start = from_msgpack(argument, BrokerStart)
    policy = Channel(socket.socket(fileno=ends[0]), QUESTION_BYTES)
    calls = RemoteModelCalls(Channel(socket.socket(fileno=ends[1])), replaying=start.replaying, capped=start.capped)
    asyncio.run(_Broker(policy, ends[0]).run(lambda: open_broker(start.spec, start.arguments, calls)))


def open_broker(spec: str, arguments: Mapping[str, GivenOption], calls: ModelCalls) -> ModelBroker:
    """Return the broker of a policy: its own if it is this project's, else the first of this project's policies.

    Raises `UsageError` for options that name no model or no key.
    """
    own = {entry.plugin for entry in OWN}
    host = policy_host(point.name for point in find_entries(PLUGINS).points if point.value in own)
    declared = host.policies.get(spec)
    if declared is not None and declared.broker is not None:
        own_broker: ModelBroker = declared.broker(arguments, calls)
        return own_broker
    factory = next((policy.broker for policy in host.policies.values() if policy.broker is not None), None)
    if factory is None:
        raise InfrastructureError("no installed policy brings a broker of model calls", hint="install the agents")
    broker: ModelBroker = factory(arguments, calls)
    return broker


class _Broker:
    """The questions of one policy."""

    def __init__(self, policy: Channel, descriptor: int) -> None:
        self._policy = policy
        self._descriptor = descriptor
        self._tasks: dict[int, asyncio.Task[None]] = {}

    async def run(self, opened: Callable[[], ModelBroker]) -> None:
        """Open the broker, answer questions, and wait for the end of this process."""
        try:
            self._broker = opened()
        except LingjingError as error:
            self._send(encoded(raised(error)))
        else:
            self._send(encoded(BrokerOpened()))
            asyncio.get_running_loop().add_reader(self._descriptor, self._read)
        await asyncio.Event().wait()

    def _read(self) -> None:
        try:
            while True:
                self._take(_REQUESTS.decode(self._policy.receive(WallDeadline(0.0)).payload))
        except TimeoutError:
            return
        except (ChannelClosedError, msgspec.MsgspecError, RecursionError, OSError):
            self._hang_up()

    def _take(self, request: BrokerRequest) -> None:
        if isinstance(request, CancelQuestion):
            if request.number in self._tasks:
                self._tasks[request.number].cancel()
        elif request.number in self._tasks or len(self._tasks) >= MOST_QUESTIONS:
            raise ChannelClosedError("an unexpected question")
        else:
            self._tasks[request.number] = asyncio.ensure_future(self._answer(request))

    async def _answer(self, request: AskBroker) -> None:
        number = request.number
        try:
            answer = QuestionAnswered(number=number, result=await self._broker.ask(request.question))
        except AbandonedCallError as error:
            answer = QuestionAnswered(number=number, result=error.result, abandoned=True)
        except LingjingError as error:
            answer = QuestionAnswered(number=number, error=raised(error))
        finally:
            self._tasks.pop(number, None)
        self._send(encoded(answer))

    def _send(self, payload: bytes) -> None:
        try:
            self._policy.send(payload, deadline=WallDeadline(_UNREAD_S))
        except (ChannelClosedError, TimeoutError):
            self._hang_up()

    def _hang_up(self) -> None:
        """Close the policy's channel. The calls in progress are recorded as abandoned."""
        with contextlib.suppress(OSError, ValueError):
            asyncio.get_running_loop().remove_reader(self._descriptor)
        self._policy.close()
        for task in [*self._tasks.values()]:
            task.cancel()


class BrokeredCalls:
    """The `ModelCalls` of a policy behind walls: questions go to the broker, which keeps the record."""

    def __init__(self, channel: Channel, *, replaying: bool, capped: bool) -> None:
        self.replaying = replaying
        self.capped = capped
        self.client = BrokerClient(channel)
        self.broker: ModelBroker | None = self.client

    def begin(self, request: CallRequest) -> CallResult | None:
        """Raises `InfrastructureError`: a process behind walls makes no call itself."""
        raise InfrastructureError(
            "a policy behind walls has no network", hint="ask its model through `ModelCalls.broker`"
        )

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Do nothing: the broker has recorded the call."""


class BrokerClient:
    """The policy's end of its broker. One event loop uses it."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._asked = 0
        self._waiting: dict[int, asyncio.Future[QuestionAnswered]] = {}
        self._is_read = False

    def wait_until_open(self) -> None:
        """Wait for the broker. Raises the error for which it cannot make calls."""
        try:
            answer = _ANSWERS.decode(self._channel.receive().payload)
        except (ChannelClosedError, msgspec.MsgspecError) as error:
            raise InfrastructureError("the broker of the model calls has ended") from error
        if isinstance(answer, RaisedError):
            raise error_of(answer)

    async def ask(self, question: ModelQuestion) -> CallResult:
        """See `ModelBroker.ask`."""
        if not self._is_read:
            asyncio.get_running_loop().add_reader(self._channel.fileno(), self._read)
            self._is_read = True
        number, self._asked = self._asked, self._asked + 1
        self._waiting[number] = asyncio.get_running_loop().create_future()
        try:
            self._channel.send(encoded(AskBroker(number=number, question=question)))
            answer = await self._waiting[number]
        except asyncio.CancelledError:
            with contextlib.suppress(ChannelClosedError):
                self._channel.send(encoded(CancelQuestion(number=number)))
            raise
        except ChannelClosedError as error:
            raise InfrastructureError("the broker of the model calls has ended") from error
        finally:
            del self._waiting[number]
        if answer.error is not None:
            raise error_of(answer.error)
        if answer.result is None:
            raise InfrastructureError("the broker of the model calls sent no result")
        if answer.abandoned:
            raise AbandonedCallError(answer.result)
        return answer.result

    def _read(self) -> None:
        try:
            while True:
                answer = _ANSWERS.decode(self._channel.receive(WallDeadline(0.0)).payload)
                future = self._waiting.get(answer.number) if isinstance(answer, QuestionAnswered) else None
                if future is not None and not future.done() and isinstance(answer, QuestionAnswered):
                    future.set_result(answer)
        except TimeoutError:
            return
        except (ChannelClosedError, msgspec.MsgspecError) as error:
            asyncio.get_running_loop().remove_reader(self._channel.fileno())
            for future in self._waiting.values():
                if not future.done():
                    future.set_exception(ChannelClosedError(str(error)))


__all__ = ["SERVE", "BrokerClient", "BrokeredCalls", "open_broker", "serve"]
