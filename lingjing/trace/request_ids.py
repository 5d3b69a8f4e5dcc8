"""The ids of requests: what a receipt answers, told by its id alone.

`c5-2` is the second command of agents that was looked at on the way to tick 5, `m5-1` the first message, `k5-1` the
first command of the kernel's own; `p5-uav` stands for the answer of agent `uav` that was replaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

RequestKind = Literal["command", "message", "kernel command", "policy answer"]

_LETTERS: Mapping[RequestKind, str] = {"command": "c", "message": "m", "kernel command": "k", "policy answer": "p"}


def request_id(kind: RequestKind, tick: int, part: int | str) -> str:
    """The id of a request: `part` is its number among those of its kind and tick, of a policy's answer the agent."""
    return f"{_LETTERS[kind]}{tick}-{part}"


def is_request_of(kind: RequestKind, request: str, tick: int | None = None) -> bool:
    """Whether an id is that of a request of a kind, and of a tick if one is given."""
    return request.startswith(_LETTERS[kind] if tick is None else f"{_LETTERS[kind]}{tick}-")
