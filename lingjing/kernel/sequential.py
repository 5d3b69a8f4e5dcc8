"""`SequentialPolicies`: the policy barrier without threads, for a process that will be forked.

Policies are called one after the other in the caller's thread, in declaration order. Each may take K_model seconds of
wall clock from its own start. A signal interrupts a call that blocks, so the caller's thread must be the main thread.
An event loop belongs to one process: a forked copy creates its own and never touches that of the original.
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
"""Seconds after which a call that still runs is interrupted again. Chosen."""

_RETIRED = 0
"""Stands in place of a process id for a loop that must not be used again."""


class SequentialPolicies(PolicyBarrier):
    """The policies of one episode, called in turn. The answers equal those of a `PolicyBarrier`."""

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
            self._loops.append((_RETIRED, self._loops[-1][1]))  # an interrupted loop is in an unknown state
            return self._timeout_answer()
        except AbandonedCallError:  # the replayed call was abandoned at this point
            return self._timeout_answer()
        except InfrastructureError as error:
            return self._failure_or_outage(name, error, failure(error, started))
        except POLICY_ERRORS as error:
            return failure(error, started)
        finally:
            if inspect.getcoroutinestate(coroutine) == inspect.CORO_CREATED:  # interrupted before its first step
                coroutine.close()
        return PolicyAnswer(value=value, wall_s=wall_s)

    def _loop(self) -> asyncio.AbstractEventLoop:
        """Return the loop of this process. Loops of an original are never closed, because their descriptors are shared
        with it.
        """
        if not self._loops or self._loops[-1][0] != os.getpid():
            self._loops.append((os.getpid(), asyncio.new_event_loop()))
        return self._loops[-1][1]


@contextmanager
def _alarm(limit_s: float) -> Iterator[None]:
    """Raise `LateCallError` in the main thread after `limit_s` seconds, and again at intervals.

    A single signal is not enough: an event loop only logs an error that is raised inside a callback.
    """

    def late(number: int, frame: FrameType | None) -> None:
        raise LateCallError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
