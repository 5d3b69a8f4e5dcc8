"""The record of model calls across processes: `RemoteModelCalls` in a policy's process, `ModelCallService` in the
player.

The player holds the record, its limits and the spending of all agents. If a process is ended during a call, the call is
recorded as abandoned, so that a replay abandons it as well.
"""

from __future__ import annotations

import threading

import msgspec

from lingjing.decoding import MsgpackDecoder, msgpack_decoder
from lingjing.errors import LingjingError
from lingjing.play.policy_processes.messages import (
    BeginModelCall,
    EndModelCall,
    ModelCallAnswer,
    ModelCallKnown,
    ModelCallRequest,
    RaisedError,
    encoded,
    error_of,
    raised,
)
from lingjing.plugins.calls import AbandonedCallError, ModelCalls
from lingjing.plugins.policy import Usage
from lingjing.plugins.policy_calls import with_result
from lingjing.processes.channel import Channel
from lingjing.trace.calls import CallRequest, CallResult

_REQUESTS: MsgpackDecoder[ModelCallRequest] = msgpack_decoder(ModelCallRequest)
_ANSWERS: MsgpackDecoder[ModelCallAnswer] = msgpack_decoder(ModelCallAnswer)

_MOST_COUNTED, _MOST_USD = 1_000_000_000, 1_000_000.0
"""The highest tick, number, tokens or attempts of a call, and its highest price in US dollars (chosen; they fit the
record's 64 bits)."""

ENDED = "the policy's process was ended while it waited"
"""The failure of a call that was open when its process was ended."""


class RemoteModelCalls:
    """The `ModelCalls` of a policy in a process of its own. Any thread may call it."""

    broker = None

    def __init__(self, channel: Channel, *, replaying: bool, capped: bool) -> None:
        self._channel = channel
        self._lock = threading.Lock()
        self.replaying = replaying
        self.capped = capped

    def begin(self, request: CallRequest) -> CallResult | None:
        """See `ModelCalls.begin`."""
        answer = self._ask(BeginModelCall(request=request))
        if answer.abandoned and answer.result is not None:
            raise AbandonedCallError(answer.result)
        return answer.result

    def end(self, request: CallRequest, result: CallResult) -> None:
        """See `ModelCalls.end`."""
        self._ask(EndModelCall(request=request, result=result))

    def _ask(self, message: BeginModelCall | EndModelCall) -> ModelCallKnown:
        with self._lock:
            self._channel.send(encoded(message))
            packet = self._channel.receive()
        answer = _ANSWERS.decode(packet.payload)
        if isinstance(answer, RaisedError):
            raise error_of(answer)
        return answer


class ModelCallService:
    """The player's side: it answers the requests of one agent from its `ModelCalls`."""

    def __init__(self, calls: ModelCalls) -> None:
        self._calls = calls
        self._open: dict[tuple[int, int], CallRequest] = {}
        self._begun: set[tuple[int, int]] = set()
        self._unbilled = Usage()

    def bill(self) -> Usage:
        """Return the usage of the calls that ended since the last bill."""
        usage, self._unbilled = self._unbilled, Usage()
        return usage

    def answer(self, payload: bytes | bytearray) -> bytes:
        """Return the answer to one request. Raises `msgspec.MsgspecError` for an invalid request: one that cannot be
        decoded, has impossible numbers, or begins a call again.
        """
        request = _REQUESTS.decode(payload)
        self._check(request)
        try:
            if isinstance(request, BeginModelCall):
                return encoded(self._begin(request.request))
            self._end(request.request, request.result)
        except AbandonedCallError as error:
            return encoded(ModelCallKnown(result=error.result, abandoned=True))
        except LingjingError as error:
            return encoded(raised(error))
        return encoded(ModelCallKnown())

    def _check(self, message: ModelCallRequest) -> None:
        request, place = message.request, (message.request.tick, message.request.number)
        if not all(-1 <= number <= _MOST_COUNTED for number in place):
            raise msgspec.ValidationError(f"a model call at tick {request.tick} with the number {request.number}")
        costs = [request.most_usd]
        counts = [request.most_tokens]
        if isinstance(message, EndModelCall):
            result = message.result
            costs += [result.cost_usd, result.unknown_usd]
            counts += [result.prompt_tokens, result.completion_tokens, result.cached_tokens, result.attempts]
        elif place in self._begun:
            raise msgspec.ValidationError(f"model call {request.number} at tick {request.tick} was begun before")
        else:
            self._begun.add(place)
        if not all(cost is None or 0.0 <= cost <= _MOST_USD for cost in costs):
            raise msgspec.ValidationError("a model call with an impossible price")
        if not all(0 <= count <= _MOST_COUNTED for count in counts):
            raise msgspec.ValidationError("a model call with an impossible number of tokens or attempts")

    def give_up(self) -> None:
        """Record every open call as abandoned. Its cost counts in full, because it may be billed."""
        for request in list(self._open.values()):
            unknown_usd = request.most_usd or 0.0
            self._end(request, CallResult(failure=ENDED, fault="abandoned", unknown_usd=unknown_usd))

    def _begin(self, request: CallRequest) -> ModelCallKnown:
        try:
            known = self._calls.begin(request)
        except AbandonedCallError as error:
            self._unbilled = with_result(self._unbilled, error.result)
            raise
        if known is None:
            self._open[request.tick, request.number] = request
        else:
            self._unbilled = with_result(self._unbilled, known)
        return ModelCallKnown(result=known)

    def _end(self, request: CallRequest, result: CallResult) -> None:
        self._open.pop((request.tick, request.number), None)
        self._unbilled = with_result(self._unbilled, result)
        self._calls.end(request, result)
