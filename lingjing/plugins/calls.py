"""What a policy that asks chat models is given beside its options: the record of its calls, and their limits.

A policy declares that it asks models with `PolicyPlugin.calls`. Its factory is then called with its options and an
object of `ModelCalls`, one per agent. The policy calls `begin` before it asks and `end` with what came out. It learns
neither where the record lies nor what other agents ask. All values are plain data, so that the two calls can cross a
border between processes.
"""

from __future__ import annotations

from typing import Protocol

from lingjing.errors import InfrastructureError
from lingjing.trace.calls import CallFault, CallRequest, CallResult


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


__all__ = [
    "AbandonedCallError", "CallFault", "CallRequest", "CallResult", "MissingCallError", "ModelCalls",
    "SpendingLimitError", "UnrecordedCalls",
]  # fmt: skip
