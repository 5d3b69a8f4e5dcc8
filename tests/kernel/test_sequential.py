"""Policies that are asked in turn in the caller's thread."""

from __future__ import annotations

import asyncio
import os
import time
from typing import Any

from lingjing.kernel.sequential import SequentialPolicies
from lingjing.trace.records import Decision

LONG_S = 20.0
"""Longer than any limit here; who is not interrupted answers after it."""


class Slow:
    """A policy that takes its time, first in a callback of its loop if it is told to."""

    def __init__(self, callback_s: float = 0.0) -> None:
        self._callback_s = callback_s

    async def reset(self, brief: Any) -> None:
        """Nothing."""

    async def act(self, observation: Any, inbox: Any) -> Decision:
        if self._callback_s:
            asyncio.get_running_loop().call_soon(lambda: time.sleep(self._callback_s))
        await asyncio.sleep(LONG_S)
        return Decision()


def reasons(policies: SequentialPolicies) -> list[str]:
    return [made.substituted for made in policies.act({"a": (None, None)})]  # type: ignore[dict-item]


def test_a_callback_that_is_interrupted_is_no_way_round_the_limit() -> None:
    """A loop logs what a callback raises, and goes on."""
    assert reasons(SequentialPolicies({"a": Slow(callback_s=1.0)}, 0.2)) == ["policy_timeout"]


def test_late_answers_take_a_loop_each_and_no_more() -> None:
    policies = SequentialPolicies({"a": Slow()}, 0.01)
    assert reasons(policies) == ["policy_timeout"]
    before = len(os.listdir("/proc/self/fd"))
    assert reasons(policies) == reasons(policies) == ["policy_timeout"]
    loop = asyncio.new_event_loop()
    with_it = len(os.listdir("/proc/self/fd"))
    loop.close()
    of_a_loop = with_it - len(os.listdir("/proc/self/fd"))
    assert len(os.listdir("/proc/self/fd")) - before == 2 * of_a_loop
