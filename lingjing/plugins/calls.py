"""The record of the model calls of one agent, and their limits.

A policy declares with `PolicyPlugin.calls` that it calls chat models. Its factory then receives its options and a
`ModelCalls`, one for each agent. The policy calls `begin` before each request and `end` with its result. It has no
access to the place of the record or to the requests of other agents. All values are plain data, so that the two calls
can cross a border between processes.
"""

from __future__ import annotations

from typing import Protocol

from lingjing.errors import InfrastructureError
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


class ModelCalls(Protocol):
    """The record of one agent's calls."""

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

    def begin(self, request: CallRequest) -> None:
        """Return None: the service must be asked."""

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Do nothing."""


__all__ = [
    "AbandonedCallError", "CallFault", "CallRequest", "CallResult", "MissingCallError", "ModelCalls",
    "SpendingLimitError", "UnrecordedCalls",
]  # fmt: skip
