"""Policies that are called one after the other in the caller's thread."""

from __future__ import annotations

import asyncio
import gc
import time
import warnings
from typing import Any

import pytest

from lingjing.kernel.sequential import SequentialPolicies
from lingjing.trace.records import Decision

LONG_S = 20.0
"""Longer than any limit here; a policy that is not interrupted answers afterwards."""


class Slow:
    """A policy that sleeps, optionally first in a callback of its loop."""

    def __init__(self, callback_s: float = 0.0) -> None:
        self._callback_s = callback_s

    async def reset(self, brief: Any) -> None:
        """Do nothing."""

    async def act(self, observation: Any, inbox: Any) -> Decision:
        if self._callback_s:
            asyncio.get_running_loop().call_soon(lambda: time.sleep(self._callback_s))
        await asyncio.sleep(LONG_S)
        return Decision()


def reasons(policies: SequentialPolicies) -> list[str]:
    return [made.substituted for made in policies.act({"a": (None, None)})]  # type: ignore[dict-item]


def test_a_policy_that_blocks_in_a_callback_is_still_interrupted_at_the_limit() -> None:
    """A loop only logs an exception in a callback and continues."""
    assert reasons(SequentialPolicies({"a": Slow(callback_s=1.0)}, 0.2)) == ["policy_timeout"]


def test_each_late_answer_costs_exactly_one_event_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[asyncio.AbstractEventLoop] = []
    new_loop = asyncio.new_event_loop

    def noted() -> asyncio.AbstractEventLoop:
        made.append(new_loop())
        return made[-1]

    monkeypatch.setattr(asyncio, "new_event_loop", noted)
    policies = SequentialPolicies({"a": Slow()}, 0.01)
    for count in (1, 2, 3):
        assert reasons(policies) == ["policy_timeout"]
        assert len(made) == count


def test_an_interrupt_before_the_first_step_leaves_no_coroutine_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(self: SequentialPolicies) -> asyncio.AbstractEventLoop:
        raise KeyboardInterrupt

    monkeypatch.setattr(SequentialPolicies, "_loop", interrupted)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(KeyboardInterrupt):
            reasons(SequentialPolicies({"a": Slow()}, 600.0))
        gc.collect()
    assert not [warning for warning in caught if warning.category is RuntimeWarning]
