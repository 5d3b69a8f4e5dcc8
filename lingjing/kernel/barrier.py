"""The policy barrier: calls every active agent's policy in parallel and collects the decisions by name.

Each agent has a worker thread with its own event loop, so a policy may block, await or run inside a notebook's kernel
without touching the caller's loop. All calls together have K_model seconds of wall clock. A call that raises, returns
something else than a `Decision` or exceeds the deadline is replaced by (no-op, no messages) with a reason; a late
result is dropped. With an `InfrastructureError` a policy reports that its infrastructure is gone. It ends the episode
only if an `OutageCheck` confirms the outage independently of the policy. `candidates` validates the content of
decisions.

A thread that stays blocked is abandoned (it is a daemon), and the agent's next call starts in a new thread.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import re
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from lingjing.errors import InfrastructureError, LingjingError, PluginError
from lingjing.kernel.ambient_random import load_generators, with_detection
from lingjing.kernel.budgets import ALLOWANCE
from lingjing.kernel.step import Published
from lingjing.plugins.calls import AbandonedCallError
from lingjing.plugins.foreign_errors import place_of, print_wanted_traceback
from lingjing.plugins.policy import Brief, Inbox, NoDecisionError, Observation, Policy
from lingjing.processes.signals import deferring_signals
from lingjing.trace.records import Decision, DecisionRecord, Usage

if TYPE_CHECKING:
    from lingjing.processes.walls.report import WallReport

_ADDRESS = re.compile(r"0x[0-9a-fA-F]{4,}")
_SHOWN = 300
"""The most characters of an exception's text in a record. Chosen."""
"""The address in an object's default `repr`."""

POLICY_ERRORS = (Exception, asyncio.CancelledError, GeneratorExit)
"""The exceptions that count as the policy's own failure. The last two are not subclasses of `Exception`. A closed or
cancelled call raises them too, so they propagate unchanged.
"""


OutageCheck = Callable[[str, InfrastructureError], InfrastructureError | None]
"""A function of an agent and the `InfrastructureError` that its policy raised. Returns the error that ends the episode,
or None if nothing outside the policy confirms that its infrastructure is gone.
"""


def no_outage(agent: str, error: InfrastructureError) -> InfrastructureError | None:
    """The check for callers without access to the policies' services: every error is the policy's own failure."""
    return None


class LateCallError(BaseException):
    """Raised in a call that has exceeded its deadline. A policy's `except Exception` does not catch it."""


class AgentThread:
    """The thread and event loop of one agent. Started lazily, replaced after it was abandoned."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._loop: asyncio.AbstractEventLoop | None = None

    def submit(self, call: Callable[[], Awaitable[Any]]) -> concurrent.futures.Future[Any]:
        """Run `call()` on the agent's loop. The returned future belongs to the caller's thread."""
        loop = self._ready()
        with deferring_signals():  # an interrupt between the two would leave a coroutine that is never awaited
            return asyncio.run_coroutine_threadsafe(timed(call), loop)

    def abandon(self) -> None:
        """Stop waiting for this thread. Its loop ends when the current call returns control."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._loop = None

    close = abandon

    def _ready(self) -> asyncio.AbstractEventLoop:
        if self._loop is None:
            self._loop = asyncio.new_event_loop()  # a stuck policy must not hold the others (ADR 0005)
            threading.Thread(target=_serve, args=(self._loop,), name=f"policy-{self._name}", daemon=True).start()
        return self._loop


async def timed(call: Callable[[], Awaitable[Any]]) -> tuple[Any, float]:
    """Return the result of the call and its duration in seconds. Raises `RuntimeError` if the call tries to end the
    process.
    """
    started = time.monotonic()
    try:
        return await call(), time.monotonic() - started
    except (*POLICY_ERRORS, LateCallError):
        raise
    except BaseException as error:  # such as `SystemExit`: a policy must not end the process that hosts it
        raise RuntimeError(f"the policy tried to exit ({type(error).__name__})") from error


def _serve(loop: asyncio.AbstractEventLoop) -> None:
    """Run calls until the loop is stopped or broken.

    A policy may break the loop, for example by closing its descriptors. No result arrives then, and the deadline of the
    call reports it.
    """
    asyncio.set_event_loop(loop)
    with contextlib.suppress(Exception):
        try:
            loop.run_forever()
        finally:
            _drain(loop)


def _drain(loop: asyncio.AbstractEventLoop) -> None:
    """Cancel the tasks of an abandoned call, then close the loop."""
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    if tasks:
        loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
    loop.close()


@dataclass(frozen=True, slots=True)
class PolicyAnswer:
    """The result of one policy call."""

    value: Any = None
    """The returned value; None after a failure."""
    reason: str = ""
    """The reason code of a failure; "" for a success."""
    detail: str = ""
    """The description of a failure."""
    wall_s: float = 0.0
    """Duration of the call in seconds of wall clock."""
    usage: Usage | None = None
    """Model usage of a failed call; None if unknown. A successful call reports it in its decision."""


class Barrier(ABC):
    """The policies of one episode behind one barrier, in declaration order. Subclasses define where the policies
    run.
    """

    def __init__(self, agents: Iterable[str], limit_s: float, outage_check: OutageCheck = no_outage) -> None:
        self._agents = tuple(agents)
        self._limit_s = limit_s
        self._outage_check = outage_check

    @abstractmethod
    def reset(self, briefs: Mapping[str, Brief]) -> dict[str, PolicyAnswer]:
        """Send every policy its brief. A failure is returned as an answer with a reason."""

    @abstractmethod
    def close(self) -> None:
        """End every policy."""

    @abstractmethod
    def _call_policies(self, inputs: Mapping[str, tuple[Observation, Inbox]]) -> dict[str, PolicyAnswer]:
        """Call the policies of the agents in `inputs` and return their answers."""

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents with a call that used an unseeded global random generator."""
        return frozenset()

    @property
    def wall_reports(self) -> tuple[WallReport, ...]:
        """The walls around the policies, one report for each process; empty without walls."""
        return ()

    def act(
        self, inputs: Mapping[str, tuple[Observation, Inbox]], exhausted: Mapping[str, str] | None = None
    ) -> tuple[DecisionRecord, ...]:
        """Return the decisions in declaration order. A failed decision is a no-op with the reason in its record.

        `exhausted` are agents that are not called, with the reason.
        """
        not_called = exhausted or {}
        called = self._call_policies({name: inputs[name] for name in self._agents if name not in not_called})
        skipped = {name: PolicyAnswer(reason=ALLOWANCE, detail=detail) for name, detail in not_called.items()}
        answers = {name: {**called, **skipped}[name] for name in self._agents}
        return tuple(_decision_record(name, _check(answer)) for name, answer in answers.items())

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """Call `act` on the output of a boundary."""
        inputs = {name: (published.observations[name], published.inboxes[name]) for name in published.observations}
        return self.act(inputs, exhausted)

    def __contains__(self, agent: str) -> bool:
        """Return whether the agent's policy is behind this barrier."""
        return agent in self._agents

    def _failure_or_outage(self, name: str, error: InfrastructureError, answer: PolicyAnswer) -> PolicyAnswer:
        """Return the policy's failure. Raises the outage instead if the outage check confirms it."""
        outage = self._outage_check(name, error)
        if outage is not None:
            raise outage from error
        return answer

    def _timeout_answer(self) -> PolicyAnswer:
        return PolicyAnswer(reason="policy_timeout", detail=f"no answer within {self._limit_s:g} s")


class PolicyBarrier(Barrier):
    """Policies in the caller's process, each in its own thread.

    `ambient_random` are the agents with policies that used a global random generator while they were built.
    """

    def __init__(
        self,
        policies: Mapping[str, Policy],
        limit_s: float,
        outage_check: OutageCheck = no_outage,
        ambient_random: Iterable[str] = (),
    ) -> None:
        super().__init__(policies, limit_s, outage_check)
        load_generators()
        self._policies = dict(policies)
        self._threads = {name: AgentThread(name) for name in self._policies}
        self._ambient_random = set(ambient_random)

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents with a call that used a global random generator. It is shared with the caller, and nothing
        seeds it.
        """
        return frozenset(self._ambient_random)

    def reset(self, briefs: Mapping[str, Brief]) -> dict[str, PolicyAnswer]:
        """Send every policy its brief. A failure is returned as an answer with a reason."""
        calls = {name: _reset_call(policy, briefs[name]) for name, policy in self._policies.items()}
        return self._collect(self._detecting(calls))

    def _call_policies(self, inputs: Mapping[str, tuple[Observation, Inbox]]) -> dict[str, PolicyAnswer]:
        calls = {name: _act_call(self._policies[name], *arguments) for name, arguments in inputs.items()}
        return self._collect(self._detecting(calls))

    def _detecting(self, calls: Mapping[str, Callable[[], Awaitable[Any]]]) -> dict[str, Callable[[], Awaitable[Any]]]:
        return {name: with_detection(call, partial(self._ambient_random.add, name)) for name, call in calls.items()}

    def close(self) -> None:
        """End every thread."""
        for thread in self._threads.values():
            thread.close()

    def _collect(self, calls: Mapping[str, Callable[[], Awaitable[Any]]]) -> dict[str, PolicyAnswer]:
        started = time.monotonic()
        futures = {name: self._threads[name].submit(call) for name, call in calls.items()}
        return {name: self._wait(name, future, started) for name, future in futures.items()}

    def _wait(self, name: str, future: concurrent.futures.Future[Any], started: float) -> PolicyAnswer:
        left = max(0.0, started + self._limit_s - time.monotonic())
        try:
            value, wall_s = future.result(timeout=left)
        except concurrent.futures.TimeoutError as error:
            if _raised(future, error):  # the policy raised it, the deadline has not passed
                return failure(error, started)
            future.cancel()
            self._threads[name].abandon()
            return self._timeout_answer()
        except AbandonedCallError:  # the replayed call was abandoned at this point
            return self._timeout_answer()
        except InfrastructureError as error:
            return self._failure_or_outage(name, error, failure(error, started))
        except POLICY_ERRORS as error:
            return failure(error, started)
        return PolicyAnswer(value=value, wall_s=wall_s)


_MOST_COUNTED = 1_000_000_000
"""The most tokens or calls that a policy may report for one turn (chosen: a sum over an episode fits 64 bits)."""

_MOST_USD = 10_000.0
"""The highest cost that a policy may report for one turn, US dollars (chosen)."""


def _raised(future: concurrent.futures.Future[Any], error: BaseException) -> bool:
    """Return whether the call itself raised this error. A call that finished at the last moment did not."""
    return future.done() and not future.cancelled() and future.exception() is error


def _decision_record(agent: str, answer: PolicyAnswer) -> DecisionRecord:
    return DecisionRecord(
        agent=agent,
        decision=Decision(usage=answer.usage) if answer.reason else answer.value,
        substituted=answer.reason,
        detail=answer.detail,
        policy_wall_s=answer.wall_s,
    )


def failure(error: BaseException, started: float) -> PolicyAnswer:
    """Return a policy's exception as an answer. Object addresses are removed: they would change the digest in each
    run.
    """
    print_wanted_traceback(error)
    try:
        kind = "" if isinstance(error, PluginError) else f"{type(error).__name__}: "  # a `PluginError` names its code
        text = f"{kind}{error}".splitlines()[0]
    except Exception:  # noqa: BLE001 - an exception with a failing `__str__` is the policy's failure too
        text = type(error).__name__
    text = text.encode("utf-8", "backslashreplace").decode()  # a lone surrogate cannot be stored
    text = _ADDRESS.sub("0x…", text)[:_SHOWN]
    stated = isinstance(error, NoDecisionError | LingjingError)  # raised on purpose: the text states the reason
    place = "" if stated else place_of(error)
    detail = f"{text.rstrip(': ')} ({place})" if place else text
    usage = error.usage if isinstance(error, NoDecisionError) and isinstance(error.usage, Usage) else None
    wall_s = time.monotonic() - started
    return PolicyAnswer(reason="policy_error", detail=detail, wall_s=wall_s, usage=usage)


def _reset_call(policy: Policy, brief: Brief) -> Callable[[], Awaitable[Any]]:
    return lambda: policy.reset(brief)


def _act_call(policy: Policy, observation: Observation, inbox: Inbox) -> Callable[[], Awaitable[Any]]:
    return lambda: policy.act(observation, inbox)


def _check(answer: PolicyAnswer) -> PolicyAnswer:
    """Return the answer if it holds a `Decision` or a failure, with a consumption that is possible. Otherwise return a
    failure with the reason `malformed`.
    """
    if not answer.reason and not isinstance(answer.value, Decision):
        detail = f"`act` returned {type(answer.value).__name__}, not a Decision"
        return PolicyAnswer(reason="malformed", detail=detail, wall_s=answer.wall_s)
    usage = answer.usage if answer.reason else answer.value.usage
    fault = usage_fault(usage) if usage is not None else ""
    return PolicyAnswer(reason="malformed", detail=fault, wall_s=answer.wall_s) if fault else answer


def usage_fault(usage: Usage) -> str:
    """Return the reason for which a policy cannot have consumed this much in one turn; "" if it can."""
    for name in ("calls", "prompt_tokens", "completion_tokens", "answers", "valid_answers"):
        count = getattr(usage, name)
        if not isinstance(count, int) or not 0 <= count <= _MOST_COUNTED:
            return f"`usage.{name}` is no number from 0 to {_MOST_COUNTED:,}"
    cost: object = usage.cost_usd  # nothing has checked the types of a policy in this process
    if not isinstance(cost, int | float) or not 0.0 <= cost <= _MOST_USD:
        return f"`usage.cost_usd` is no number from 0 to {_MOST_USD:,.0f}"
    return ""
