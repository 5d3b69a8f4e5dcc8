"""What is kept of questions to chat models: what was asked, what came out of it, and at which place in an episode."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Literal

import msgspec

CallFault = Literal["", "service", "model", "time", "abandoned"]
"""Whose failure it is that a call has no answer: the service refuses or is not there, the model will not answer this,
the policy's own deadline passed, or the kernel's barrier gave the policy up while it waited."""


class CallRequest(msgspec.Struct, frozen=True, kw_only=True):
    """One question to a model as it is recorded.

    `tick` is the boundary at which the policy asks and `number` counts its questions there, from 0. `head` is a JSON
    object with the parameters, `messages` are the turns, a JSON object each, in which a picture is
    `{"type": "picture", "sha256": …}` with its hash in hexadecimal; `pictures` are the JPEG files themselves.
    `most_usd` bounds the price of one attempt, None if its price is unknown; `most_tokens` bounds its tokens.
    """

    tick: int
    number: int
    head: bytes
    messages: tuple[bytes, ...]
    pictures: tuple[bytes, ...] = ()
    most_usd: float | None = None
    most_tokens: int = 0


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


class RecordedCall(msgspec.Struct, frozen=True, kw_only=True):
    """One question of one agent, as it lies in a record. `result` is None if the process died before there was one."""

    agent: str
    tick: int
    number: int
    head: bytes
    messages: tuple[bytes, ...]
    result: CallResult | None = None

    @property
    def pictures(self) -> tuple[str, ...]:
        """The hashes in hexadecimal of the pictures that were shown, in order."""
        return tuple(name for message in self.messages for name in _pictures(msgspec.json.decode(message)))


class CalledEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """Which episode a record belongs to; `settings` are those that were given."""

    mission: str
    mode: str
    seed: int
    policy_seed: int = 0
    settings: dict[str, float] = {}


def sha256(data: bytes) -> bytes:
    """The hash under which a content is kept."""
    return hashlib.sha256(data).digest()


def _pictures(message: object) -> Iterator[str]:
    """The hashes of the pictures in a decoded message. Those stand among the parts of its `content` alone."""
    parts = message.get("content") if isinstance(message, dict) else None
    for part in parts if isinstance(parts, list) else ():
        if isinstance(part, dict) and part.get("type") == "picture" and isinstance(part.get("sha256"), str):
            yield part["sha256"]


__all__ = ["CallFault", "CallRequest", "CallResult", "CalledEpisode", "RecordedCall", "sha256"]
