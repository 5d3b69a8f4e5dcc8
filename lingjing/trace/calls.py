"""Records of calls to chat models: the request, the result, and the place in the episode."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Literal

import msgspec

from lingjing.decoding import from_json

CallFault = Literal["", "service", "model", "time", "backbone", "abandoned"]
"""The cause of a call without an answer; "" for a call with an answer.

- `service`: the service is unreachable or rejects the request.
- `model`: the model declines to answer this request.
- `time`: the policy's own deadline passed.
- `backbone`: the code of the backbone failed.
- `abandoned`: the kernel's barrier stopped the policy during the call.
"""


class CallRequest(msgspec.Struct, frozen=True, kw_only=True):
    """One request to a model, as it is recorded."""

    tick: int
    """The boundary at which the policy calls the model."""
    number: int
    """Number of the call among those of the agent at this boundary, from 0."""
    head: bytes
    """The parameters, a JSON object."""
    messages: tuple[bytes, ...]
    """The turns, a JSON object each. A picture is `{"type": "picture", "sha256": …}` there, the hash in hexadecimal."""
    pictures: tuple[bytes, ...] = ()
    """The JPEG files of the pictures."""
    most_usd: float | None = None
    """Upper bound of the price of one attempt, US dollars. None if the price is unknown."""
    most_tokens: int = 0
    """Upper bound of the tokens of one attempt."""


class CallResult(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The result of one request, over all its attempts."""

    text: str = ""
    """The answer."""
    reasoning: str = ""
    """The reasoning text that the service returned beside the answer."""
    finish_reason: str = ""
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cached_tokens: int = 0
    cost_usd: float | None = None
    """US dollars. None if the price is unknown."""
    unknown_usd: float = 0.0
    """Upper bound of the price, US dollars, of attempts that may or may not have been billed."""
    attempts: int = 1
    wall_s: float = 0.0
    """Wall-clock duration, for information only."""
    served: str = ""
    """The model that the service named in its answer; "" if it named none."""
    body: str = ""
    """The service's whole answer, as JSON text, where a policy asked with a whole request of its own."""
    failure: str = ""
    """The error in words; "" if there is an answer."""
    fault: CallFault = ""
    status: int | None = None
    """HTTP status of a failed call. None if there is none."""


class RecordedCall(msgspec.Struct, frozen=True, kw_only=True):
    """One call of one agent, read back from a record. See `CallRequest` for the fields of the request."""

    agent: str
    tick: int
    number: int
    head: bytes
    messages: tuple[bytes, ...]
    result: CallResult | None = None
    """The result; None if the process died first."""

    @property
    def pictures(self) -> tuple[str, ...]:
        """The hashes, in hexadecimal, of the pictures in the request, in order."""
        return tuple(name for message in self.messages for name in _pictures(from_json(message)))


class CalledEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """The identity of the episode that a record belongs to."""

    mission: str
    mode: str
    seed: int
    policy_seed: int = 0
    settings: dict[str, float] = {}
    """The settings of the mission that the user set."""
    tier: int = 0
    language: str = "en"


def sha256(data: bytes) -> bytes:
    """Return the SHA-256 under which a content is stored."""
    return hashlib.sha256(data).digest()


def _pictures(message: object) -> Iterator[str]:
    """Yield the picture hashes of a decoded message. Pictures occur only among the parts of its `content`."""
    parts = message.get("content") if isinstance(message, dict) else None
    for part in parts if isinstance(parts, list) else ():
        if isinstance(part, dict) and part.get("type") == "picture" and isinstance(part.get("sha256"), str):
            yield part["sha256"]


__all__ = ["CallFault", "CallRequest", "CallResult", "CalledEpisode", "RecordedCall", "sha256"]
