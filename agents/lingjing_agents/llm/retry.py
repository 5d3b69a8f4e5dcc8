"""Retries with backoff for transient failures, within a deadline that is never exceeded."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

from lingjing.plugins.backbone import Backbone, ChatRequest, ModelCompletion, ModelError

FIRST_PAUSE_S = 0.5
"""Seconds before the second attempt. Chosen."""
LONGEST_PAUSE_S = 20.0
"""Upper bound of the doubling pause in seconds. Chosen."""


class CallDeadline:
    """A deadline `seconds` of wall time from now."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds
        self.seconds = seconds

    def left_s(self) -> float:
        """Return the remaining seconds, at least 0."""
        return max(0.0, self._end - time.monotonic())


@dataclass(slots=True)
class Attempts:
    """The attempts of one call."""

    calls: int = 0
    """Number of attempts, failed ones included."""
    billed: int = 0
    """Number of failed attempts that the service may have charged for."""
    failure: str = ""
    """The last failure that was not a time-out; "" without one."""

    def with_failure(self, message: str) -> str:
        """Return the message of a time-out with the failure before it, which is its probable cause."""
        return f"{message}; before that: {self.failure}" if self.failure else message


async def complete_with_retries(
    client: Backbone, request: ChatRequest, deadline: CallDeadline, attempts: Attempts, *, tries: int = 5
) -> ModelCompletion:
    """Make a call until it succeeds, fails permanently, has failed `tries` times, or the deadline passes.

    The pause doubles from half a second; a `Retry-After` within the deadline takes its place. A client that has adapted
    its dialect tries again at once, which does not count as a failure.
    """
    pause, failures = FIRST_PAUSE_S, 0
    while (left := deadline.left_s()) > 0.0:
        attempts.calls += 1
        try:
            return await _ask(client, request, left)
        except ModelError as error:
            attempts.billed += error.billed
            if error.adapted:
                continue
            failures += 1
            if error.fault == "time":
                error.args = (attempts.with_failure(str(error)),)
            else:
                attempts.failure = str(error)
            if not error.transient or failures >= tries:
                raise
            wait = error.retry_after_s if error.retry_after_s is not None else pause
            if wait >= deadline.left_s():
                raise
            await asyncio.sleep(wait)
            pause = min(pause * 2, LONGEST_PAUSE_S)
    raise ModelError(
        attempts.with_failure(f"no usable answer within the deadline of {deadline.seconds:g} s"), fault="time"
    )


async def _ask(client: Backbone, request: ChatRequest, left_s: float) -> ModelCompletion:
    try:
        async with asyncio.timeout(left_s):
            return await client.complete(request, left_s)
    except TimeoutError as error:
        message = f"no answer from the model within {left_s:.1f} s"
        raise ModelError(message, transient=True, fault="time", billed=True) from error
