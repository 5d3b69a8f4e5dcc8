"""The record of the model calls of one agent, and their limits.

A policy declares with `PolicyPlugin.calls` that it calls chat models. Its factory then receives its options and a
`ModelCalls`, one for each agent. The policy calls `begin` before each request and `end` with its result. It has no
access to the place of the record or to the requests of other agents. All values are plain data, so that the two calls
can cross a border between processes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.plugins.backbone import ChatMessage
from lingjing.trace.calls import CallFault, CallRequest, CallResult


class SpendingLimitError(InfrastructureError):
    """The money or the tokens of a run are used up. This is no failure of the policy."""


class MissingCallError(InfrastructureError):
    """The error of a replay without a record of the call."""


class AbandonedCallError(Exception):
    """A recorded call for which the kernel stopped waiting. A policy must not catch it: the kernel then substitutes the
    same no-op for the same reason."""

    def __init__(self, result: CallResult) -> None:
        super().__init__(result.failure)
        self.result = result


@dataclass(frozen=True, slots=True)
class ModelQuestion:
    """A question to the model that the options of a policy name."""

    tick: int
    """The boundary at which the policy asks."""
    messages: tuple[ChatMessage, ...]
    timeout_s: float
    """The longest wait for the answer with all attempts, seconds."""
    schema: bytes | None = None
    """The JSON Schema that the answer must satisfy, as JSON text; None for free text."""


class ModelBroker(Protocol):
    """The harness's side of the model calls of a policy behind walls, which has no network and no key.

    The broker builds the request from the user's options, and records, limits, retries and bills it.
    """

    async def ask(self, question: ModelQuestion) -> CallResult:
        """Return the result of a question, an answer or a failure. Raises the errors of `ModelCalls.begin`."""
        ...


class ModelCalls(Protocol):
    """The record of one agent's calls."""

    @property
    def broker(self) -> ModelBroker | None:
        """The broker that makes the calls of a policy behind walls; None if the policy makes them itself."""
        ...

    @property
    def replaying(self) -> bool:
        """True if every answer comes from a record: no service is called, and neither key nor address is needed."""
        ...

    @property
    def capped(self) -> bool:
        """True if money is limited: every call then needs a price."""
        ...

    def begin(self, request: CallRequest) -> CallResult | None:
        """Return the recorded result of this request, or None if the service must be called.

        Raises `SpendingLimitError` if it could cost more than is left, `MissingCallError` if a replay has no record of
        it, `AbandonedCallError` for an abandoned one, `InfrastructureError` if it cannot be recorded.
        """
        ...

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Record the result of a request for which `begin` returned None."""
        ...


class UnrecordedCalls:
    """A record without limits that keeps nothing, for policies outside of a recorded episode."""

    replaying = False
    capped = False
    broker = None

    def begin(self, request: CallRequest) -> None:
        """Return None: the service must be asked."""

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Do nothing."""


class EpisodeShape(msgspec.Struct, frozen=True, kw_only=True):
    """The size of an episode, on which the number of its model calls depends."""

    mission: str
    mode: str
    ticks: int
    """Ticks that the mission allows."""
    roles: dict[str, int]
    """Number of agents by role."""


class CallSum(msgspec.Struct, frozen=True, kw_only=True):
    """Calls and their tokens, of one episode."""

    calls: float = 0.0
    prompt_tokens: float = 0.0
    cached_tokens: float = 0.0
    """Tokens of the requests that the service bills as cached."""
    completion_tokens: float = 0.0
    cost_usd: float | None = 0.0
    """US dollars. None if the price is unknown."""


class CallEstimate(msgspec.Struct, frozen=True, kw_only=True):
    """The estimated model calls of one episode (ADR 0062)."""

    usual: CallSum = CallSum()
    """The calls of an episode that ends as early as the measured one."""
    full: CallSum = CallSum()
    """The calls of an episode that uses all of its ticks."""
    most: CallSum = CallSum()
    """Upper bound: one call for each agent at each tick, with all repairs, full requests and the longest answers."""
    ticks: float = 0.0
    """Ticks of the usual episode. The calls of one tick are made at once."""
    work_s: float = 0.0
    """CPU seconds of the usual episode without those of the model."""
    measured: bool = True
    """False for a mission that was not measured, reckoned with the means of others."""


CallEstimator = Callable[[Any, EpisodeShape], CallEstimate]
"""Takes the options of a policy and the size of an episode, and returns the estimate of its model calls."""


__all__ = [
    "AbandonedCallError", "CallEstimate", "CallEstimator", "CallFault", "CallRequest", "CallResult", "CallSum",
    "EpisodeShape", "MissingCallError", "ModelBroker", "ModelCalls", "ModelQuestion", "SpendingLimitError",
    "UnrecordedCalls",
]  # fmt: skip
