"""Backoff for transient failures, within a deadline: the caller never waits longer than it may."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

from lingjing_agents.llm.chat import ChatRequest, ModelClient, ModelCompletion, ModelError

FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 20.0


class CallDeadline:
    """A span of wall time that starts now."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds
        self.seconds = seconds

    def left_s(self) -> float:
        """Seconds left, never negative."""
        return max(0.0, self._end - time.monotonic())


@dataclass(slots=True)
class Attempts:
    """The calls of one question. `calls`: their number, failed ones included. `billed`: those of the failed ones that
    may have been billed all the same. `failure`: the last failure that was not a lack of time, in words, or ""."""

    calls: int = 0
    billed: int = 0
    failure: str = ""

    def told(self, message: str) -> str:
        """The message of a lack of time, with the failure before it, which is why there is no answer."""
        return f"{message}; before that: {self.failure}" if self.failure else message


async def complete_with_retries(
    client: ModelClient, request: ChatRequest, deadline: CallDeadline, attempts: Attempts, *, tries: int = 5
) -> ModelCompletion:
    """Ask until there is an answer, a failure that repeating cannot mend, `tries` failures, or no time left.

    The pause doubles from half a second; a `Retry-After` that fits into the deadline is honoured instead. A client
    that has adapted to the service is asked again at once, which is no failure.
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
                error.args = (attempts.told(str(error)),)
            else:
                attempts.failure = str(error)
            if not error.transient or failures >= tries:
                raise
            wait = error.retry_after_s if error.retry_after_s is not None else pause
            if wait >= deadline.left_s():
                raise
            await asyncio.sleep(wait)
            pause = min(pause * 2, LONGEST_PAUSE_S)
    raise ModelError(attempts.told(f"no usable answer within the deadline of {deadline.seconds:g} s"), fault="time")


async def _ask(client: ModelClient, request: ChatRequest, left_s: float) -> ModelCompletion:
    try:
        async with asyncio.timeout(left_s):
            return await client.complete(request, left_s)
    except TimeoutError as error:
        message = f"no answer from the model within {left_s:.1f} s"
        raise ModelError(message, transient=True, fault="time", billed=True) from error
