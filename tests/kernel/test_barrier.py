"""The threads of the policies."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import threading
import warnings
from concurrent.futures import Future
from typing import Any

import pytest

from lingjing.errors import InfrastructureError
from lingjing.kernel.barrier import AgentThread, PolicyBarrier
from lingjing.kernel.sequential import SequentialPolicies
from lingjing.trace.records import Decision, Usage


async def _answer() -> int:
    return 4


def test_an_interrupt_while_a_thread_starts_leaves_no_coroutine_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(self: AgentThread) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(AgentThread, "_ready", interrupted)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(KeyboardInterrupt):
            AgentThread("a").submit(_answer)
        gc.collect()
    assert not [warning for warning in caught if warning.category is RuntimeWarning]


def test_an_interrupt_before_a_call_is_handed_over_leaves_no_coroutine_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    hand_over = asyncio.run_coroutine_threadsafe

    def interrupted(*arguments: Any) -> Future[Any]:
        signal.raise_signal(signal.SIGINT)
        return hand_over(*arguments)

    thread = AgentThread("a")
    monkeypatch.setattr(asyncio, "run_coroutine_threadsafe", interrupted)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(KeyboardInterrupt):
            thread.submit(_answer)
        thread.close()
        gc.collect()
    assert not [warning for warning in caught if warning.category is RuntimeWarning]


def test_a_thread_answers() -> None:
    thread = AgentThread("a")
    try:
        assert thread.submit(_answer).result(timeout=600)[0] == 4
    finally:
        thread.close()


class _JustDone(Future[tuple[int, float]]):
    """A future that is not done when it is waited for, and done at the next look."""

    def result(self, timeout: float | None = None) -> tuple[int, float]:
        self.set_result((4, 0.1))
        raise TimeoutError


def test_an_answer_just_after_the_deadline_is_a_timeout_and_no_policy_error() -> None:
    barrier = PolicyBarrier({}, 5.0)
    barrier._threads["a"] = AgentThread("a")
    assert barrier._wait("a", _JustDone(), 0.0).reason == "policy_timeout"
    own: Future[tuple[int, float]] = Future()
    own.set_exception(TimeoutError("mine"))
    answer = barrier._wait("a", own, 0.0)
    assert (answer.reason, answer.detail) == ("policy_error", "TimeoutError: mine")


async def _lose_the_descriptor() -> int:
    os.close(asyncio.get_running_loop()._selector.fileno())  # type: ignore[attr-defined]
    return 5


def test_a_thread_with_a_broken_event_loop_ends_without_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python's own traceback would appear in the middle of a run's output."""
    caught: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", caught.append)
    thread = AgentThread("broken")
    future = thread.submit(_lose_the_descriptor)
    for running in [thread for thread in threading.enumerate() if thread.name == "policy-broken"]:
        running.join(600)
        assert not running.is_alive()
    assert [arguments.exc_value for arguments in caught] == []
    assert not future.done()


class _Accuser:
    """A policy that reports an outage of its infrastructure."""

    async def reset(self, brief: Any) -> None:
        """Do nothing."""

    async def act(self, observation: Any, inbox: Any) -> Decision:
        raise InfrastructureError("money: the service is gone")


@pytest.mark.parametrize("kind", [PolicyBarrier, SequentialPolicies])
def test_an_outage_that_a_policy_reports_ends_an_episode_only_if_confirmed(kind: type[PolicyBarrier]) -> None:
    inputs: dict[str, tuple[Any, Any]] = {"a": (None, None)}
    barrier = kind({"a": _Accuser()}, 600.0)
    (made,) = barrier.act(inputs)
    barrier.close()
    assert (made.substituted, made.detail) == ("policy_error", "InfrastructureError: money: the service is gone")
    outage = InfrastructureError("it is gone indeed")
    confirmed = kind({"a": _Accuser()}, 600.0, lambda agent, error: outage)
    with pytest.raises(InfrastructureError, match="gone indeed"):
        confirmed.act(inputs)
    confirmed.close()


@pytest.mark.parametrize(
    ("usage", "reason"),
    [
        (Usage(calls=3, prompt_tokens=10**9, cost_usd=0.25), ""),
        (Usage(prompt_tokens=2**62), "`usage.prompt_tokens` is no number from 0 to 1,000,000,000"),
        (Usage(calls=-1), "`usage.calls` is no number from 0"),
        (Usage(cost_usd=-5.0), "`usage.cost_usd` is no number from 0 to 10,000"),
        (Usage(cost_usd=float("nan")), "`usage.cost_usd` is no number"),
        (Usage(completion_tokens="many"), "`usage.completion_tokens` is no number"),  # type: ignore[arg-type]
    ],
)
def test_a_decision_with_an_impossible_consumption_is_malformed(usage: Usage, reason: str) -> None:
    class Spending:
        async def act(self, observation: object, inbox: object) -> Decision:
            return Decision(usage=usage)

    barrier = PolicyBarrier({"a": Spending()}, 600.0)  # type: ignore[dict-item]
    try:
        (record,) = barrier.act({"a": (None, None)})  # type: ignore[dict-item]
    finally:
        barrier.close()
    assert record.substituted == ("malformed" if reason else "")
    assert record.detail.startswith(reason)
    assert record.decision.usage == (None if reason else usage)
