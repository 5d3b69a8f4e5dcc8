"""`SequentialPolicies`: the policy barrier without threads, for a process that is going to be forked.

The agents are asked one after the other in the caller's thread, in declaration order. Each may take K_model of wall
clock, measured from its own question; a call that blocks is interrupted by a signal, so the caller's thread must be the
main one. The event loop belongs to one process: a forked copy makes its own, and nobody touches that of the original.
"""

from __future__ import annotations

import asyncio
import inspect
import os
import signal
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

from lingjing.errors import InfrastructureError
from lingjing.kernel.barrier import (
    POLICY_ERRORS,
    LateCallError,
    OutageCheck,
    PolicyAnswer,
    PolicyBarrier,
    failure,
    no_outage,
    timed,
)
from lingjing.plugins.calls import AbandonedCallError

_AGAIN_S = 0.5
"""After what time a call that goes on is interrupted once more."""

_NOBODY = 0
"""The process that a loop belongs to which nobody uses again."""


class SequentialPolicies(PolicyBarrier):
    """Policies of one episode, asked in turn; the same answers as behind a `PolicyBarrier`."""

    def __init__(self, policies: Mapping[str, Any], limit_s: float, outage_check: OutageCheck = no_outage) -> None:
        super().__init__(policies, limit_s, outage_check)
        self._loops: list[tuple[int, asyncio.AbstractEventLoop]] = []

    def _collect(self, calls: Mapping[str, Callable[[], Awaitable[Any]]]) -> dict[str, PolicyAnswer]:
        return {name: self._answer(name, call) for name, call in calls.items()}

    def _answer(self, name: str, call: Callable[[], Awaitable[Any]]) -> PolicyAnswer:
        started, coroutine = time.monotonic(), timed(call)
        try:
            with _alarm(self._limit_s):
                value, wall_s = self._loop().run_until_complete(coroutine)
        except LateCallError:
            self._loops.append((_NOBODY, self._loops[-1][1]))  # the one that was interrupted is of no more use
            return self._late()
        except AbandonedCallError:  # what is replayed was given up here
            return self._late()
        except InfrastructureError as error:
            return self._accused(name, error, failure(error, started))
        except POLICY_ERRORS as error:
            return failure(error, started)
        finally:
            if inspect.getcoroutinestate(coroutine) == inspect.CORO_CREATED:  # interrupted before its first step
                coroutine.close()
        return PolicyAnswer(value=value, wall_s=wall_s)

    def _loop(self) -> asyncio.AbstractEventLoop:
        """The loop of this process. Those of an original are never closed: their descriptors are shared with it."""
        if not self._loops or self._loops[-1][0] != os.getpid():
            self._loops.append((os.getpid(), asyncio.new_event_loop()))
        return self._loops[-1][1]


@contextmanager
def _alarm(limit_s: float) -> Iterator[None]:
    """Raise `LateCallError` in the main thread when the time is over, and again: a callback's is only logged by its
    loop."""

    def late(number: int, frame: FrameType | None) -> None:
        raise LateCallError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
