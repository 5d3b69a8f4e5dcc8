"""What a policy that asks chat models is given beside its options: the record of its calls, and their limits.

A policy declares that it asks models with `PolicyPlugin.calls`. Its factory is then called with its options and an
object of `ModelCalls`, one per agent. The policy calls `begin` before it asks and `end` with what came out. It learns
neither where the record lies nor what other agents ask. All values are plain data, so that the two calls can cross a
border between processes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Literal, Protocol

import msgspec

from lingjing.errors import InfrastructureError

CallFault = Literal["", "service", "model", "time", "abandoned"]
"""Whose failure it is that a call has no answer: the service refuses or is not there, the model will not answer this,
the policy's own deadline passed, or the kernel's barrier gave the policy up while it waited."""


class CallRequest(msgspec.Struct, frozen=True, kw_only=True):
    """One question to a model as it is recorded.

    `tick` is the boundary at which the policy asks. `head` is a JSON object with the parameters, `messages` are the
    turns, a JSON object each, in which a picture is `{"type": "picture", "sha256": …}` with its hash in hexadecimal;
    `pictures` are the JPEG files themselves. `most_usd` bounds the price of one attempt, None if its price is unknown;
    `most_tokens` bounds its tokens.
    """

    tick: int
    head: bytes
    messages: tuple[bytes, ...]
    pictures: tuple[bytes, ...] = ()
    most_usd: float | None = None
    most_tokens: int = 0

    @property
    def hashes(self) -> tuple[bytes, ...]:
        """SHA-256 of each message."""
        return tuple(hashlib.sha256(message).digest() for message in self.messages)


class CallResult(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What came out of one question, all its attempts together.

    `failure` says in words why there is no answer and `fault` whose fault that is; both are empty if there is one.
    `cost_usd` is None if the price is unknown; `unknown_usd` bounds the price of the attempts of which nobody knows
    whether they were billed. `wall_s` is seconds of wall clock, for people.
    """

    text: str = ""
    reasoning: str = ""
    finish_reason: str = ""
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cached_tokens: int = 0
    cost_usd: float | None = None
    unknown_usd: float = 0.0
    attempts: int = 1
    wall_s: float = 0.0
    failure: str = ""
    fault: CallFault = ""
    status: int | None = None


class SpendingLimitError(InfrastructureError):
    """The money or the tokens that a run may spend on models are used up: it says nothing about the policy."""


class MissingCallError(InfrastructureError):
    """A run is replayed from recorded calls, and this one is not among them."""


class AbandonedCallError(Exception):
    """A recorded call that the kernel's barrier gave up waiting for. It is not to be caught by a policy: the barrier
    then substitutes the same no-op for the same reason."""

    def __init__(self, result: CallResult) -> None:
        super().__init__(result.failure)
        self.result = result


class ModelCalls(Protocol):
    """The record of one agent's calls. `replaying` says that no service is asked, `capped` that money is limited, so
    that every call must have a price."""

    @property
    def replaying(self) -> bool:
        """Whether every answer comes from a record, so that neither key nor address is needed."""
        ...

    @property
    def capped(self) -> bool:
        """Whether money is limited."""
        ...

    def begin(self, request: CallRequest) -> CallResult | None:
        """The recorded result of this question, or None if it is to be asked.

        Raises `SpendingLimitError` if it could cost more than is left, `MissingCallError` if a replay has no record of
        it, `AbandonedCallError` for one that was given up, `InfrastructureError` if it cannot be recorded.
        """
        ...

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Record what came out of a question that `begin` said is to be asked."""
        ...


class UnrecordedCalls:
    """Asks always, limits and records nothing: for policies that are built outside of a recorded episode."""

    replaying = False
    capped = False

    def begin(self, request: CallRequest) -> None:
        """Every question is to be asked."""

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Nothing is kept."""


def pictures_of(message: object) -> Iterator[str]:
    """The hashes in hexadecimal of the pictures in a decoded message, in order."""
    if isinstance(message, dict):
        if message.get("type") == "picture" and isinstance(message.get("sha256"), str):
            yield message["sha256"]
        for value in message.values():
            yield from pictures_of(value)
    elif isinstance(message, list):
        for value in message:
            yield from pictures_of(value)


__all__ = [
    "AbandonedCallError", "CallFault", "CallRequest", "CallResult", "MissingCallError", "ModelCalls",
    "SpendingLimitError", "UnrecordedCalls", "pictures_of",
]  # fmt: skip
