"""The policy barrier: every active agent's call in parallel, at most K_model of wall clock, collected by name.

Each agent has a worker thread with an event loop of its own, so a policy may block, await or run inside a notebook's
kernel without touching the caller's loop. A call that raises, answers something else than a `Decision` or passes the
deadline is replaced by (no-op, no messages) with a reason; a late answer is dropped. `InfrastructureError` is the
policy's word that its infrastructure is gone: it ends the episode only if an `OutageCheck` confirms it from outside of
the policy. What is in the decision is looked at by `candidates`. A thread
that stays blocked is left behind (it is a daemon) and the agent's next call starts in a fresh one.
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
from typing import Any

from lingjing.errors import InfrastructureError
from lingjing.kernel.ambient_random import load_generators, watched
from lingjing.kernel.budgets import ALLOWANCE
from lingjing.kernel.step import Published
from lingjing.plugins.calls import AbandonedCallError
from lingjing.plugins.policy import Brief, Inbox, NoDecisionError, Observation, Policy
from lingjing.trace.records import Decision, DecisionRecord, Usage
from lingjing.trace.signals import deferring_signals

_ADDRESS = re.compile(r"0x[0-9a-fA-F]{4,}")

POLICY_ERRORS = (Exception, asyncio.CancelledError, GeneratorExit)
"""Whatever a policy raises is the policy's failure. The last two are not `Exception`s; what closes or cancels a call
raises them as well, so they pass through it as they are."""


OutageCheck = Callable[[str, InfrastructureError], InfrastructureError | None]
"""Called with an agent and the `InfrastructureError` that its policy raised. Returns the error that ends the episode,
or None if nothing outside of the policy shows that its infrastructure is gone."""


def no_outage(agent: str, error: InfrastructureError) -> InfrastructureError | None:
    """The check where nothing is known of what policies depend on: what they raise is their own failure."""
    return None


class LateCallError(BaseException):
    """The time of a call is over. No policy that catches `Exception` catches it."""


class AgentThread:
    """One agent's thread and event loop; started lazily, replaced when it is stuck."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._loop: asyncio.AbstractEventLoop | None = None

    def submit(self, call: Callable[[], Awaitable[Any]]) -> concurrent.futures.Future[Any]:
        """Run `call()` on the agent's loop; the future belongs to the caller's thread."""
        loop = self._ready()
        with deferring_signals():  # an interrupt between the two would leave a coroutine that is never awaited
            return asyncio.run_coroutine_threadsafe(timed(call), loop)

    def abandon(self) -> None:
        """Stop waiting for this thread: its loop ends when its current call lets go of it."""
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
    """What the call returned and the seconds that it took."""
    started = time.monotonic()
    try:
        return await call(), time.monotonic() - started
    except (*POLICY_ERRORS, LateCallError):
        raise
    except BaseException as error:  # a policy must not end the process it is a guest of
        raise RuntimeError(f"the policy tried to exit ({type(error).__name__})") from error


def _serve(loop: asyncio.AbstractEventLoop) -> None:
    """Run calls until the loop is stopped, or cannot go on because a policy took what it stands on, such as its
    descriptors: no answer comes from it then, and the deadline of the call says so."""
    asyncio.set_event_loop(loop)
    with contextlib.suppress(Exception):
        try:
            loop.run_forever()
        finally:
            _drain(loop)


def _drain(loop: asyncio.AbstractEventLoop) -> None:
    """Cancel what an abandoned call left behind, then close the loop."""
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    if tasks:
        loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
    loop.close()


@dataclass(frozen=True, slots=True)
class PolicyAnswer:
    """What came out of one call: a value, or the reason code and detail of its failure and what it spent."""

    value: Any = None
    reason: str = ""
    detail: str = ""
    wall_s: float = 0.0
    usage: Usage | None = None


class Barrier(ABC):
    """The policies of one episode behind one barrier; agents keep declaration order. Where they run is a subclass's."""

    def __init__(self, agents: Iterable[str], limit_s: float, outage_check: OutageCheck = no_outage) -> None:
        self._agents = tuple(agents)
        self._limit_s = limit_s
        self._outage_check = outage_check

    @abstractmethod
    def reset(self, briefs: Mapping[str, Brief]) -> dict[str, PolicyAnswer]:
        """Give every policy its brief; failures come back as answers with a reason."""

    @abstractmethod
    def close(self) -> None:
        """Let every policy end."""

    @abstractmethod
    def _ask(self, inputs: Mapping[str, tuple[Observation, Inbox]]) -> dict[str, PolicyAnswer]:
        """The answers of the agents that have inputs."""

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents in whose calls a global random generator was used that nothing has seeded."""
        return frozenset()

    def act(
        self, inputs: Mapping[str, tuple[Observation, Inbox]], exhausted: Mapping[str, str] | None = None
    ) -> tuple[DecisionRecord, ...]:
        """Decisions in declaration order; a failed one is a no-op with the reason beside it.

        `exhausted` are agents that are not asked, with the sentence that says why.
        """
        silent = exhausted or {}
        given = self._ask({name: inputs[name] for name in self._agents if name not in silent})
        refused = {name: PolicyAnswer(reason=ALLOWANCE, detail=detail) for name, detail in silent.items()}
        answers = {name: {**given, **refused}[name] for name in self._agents}
        return tuple(_decision_record(name, _check(answer)) for name, answer in answers.items())

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """`act` on what was published at a boundary."""
        inputs = {name: (published.observations[name], published.inboxes[name]) for name in published.observations}
        return self.act(inputs, exhausted)

    def __contains__(self, agent: str) -> bool:
        """True if the agent's policy is behind this barrier."""
        return agent in self._agents

    def _accused(self, name: str, error: InfrastructureError, answer: PolicyAnswer) -> PolicyAnswer:
        """The policy's failure, unless the outage that it reports is confirmed, which is raised."""
        outage = self._outage_check(name, error)
        if outage is not None:
            raise outage from error
        return answer

    def _late(self) -> PolicyAnswer:
        return PolicyAnswer(reason="policy_timeout", detail=f"no answer within {self._limit_s:g} s")


class PolicyBarrier(Barrier):
    """Policies in the caller's process, a thread for each. `ambient_random` are the agents whose policies have used a
    global random generator while they were built."""

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
        """Agents in whose calls a global random generator was used. It is the caller's, and nothing seeds it."""
        return frozenset(self._ambient_random)

    def reset(self, briefs: Mapping[str, Brief]) -> dict[str, PolicyAnswer]:
        """Give every policy its brief; failures come back as answers with a reason."""
        calls = {name: _reset_call(policy, briefs[name]) for name, policy in self._policies.items()}
        return self._collect(self._watched(calls))

    def _ask(self, inputs: Mapping[str, tuple[Observation, Inbox]]) -> dict[str, PolicyAnswer]:
        calls = {name: _act_call(self._policies[name], *given) for name, given in inputs.items()}
        return self._collect(self._watched(calls))

    def _watched(self, calls: Mapping[str, Callable[[], Awaitable[Any]]]) -> dict[str, Callable[[], Awaitable[Any]]]:
        return {name: watched(call, partial(self._ambient_random.add, name)) for name, call in calls.items()}

    def close(self) -> None:
        """Let every thread end."""
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
            if _raised(future, error):  # the policy's own
                return failure(error, started)
            future.cancel()
            self._threads[name].abandon()
            return self._late()
        except AbandonedCallError:  # what is replayed was given up here
            return self._late()
        except InfrastructureError as error:
            return self._accused(name, error, failure(error, started))
        except POLICY_ERRORS as error:
            return failure(error, started)
        return PolicyAnswer(value=value, wall_s=wall_s)


def _raised(future: concurrent.futures.Future[Any], error: BaseException) -> bool:
    """Whether the call ended with this very error; one that answers at the last moment has not."""
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
    """A policy's exception as its answer, without addresses of objects, which would make the digest differ."""
    try:
        text = f"{type(error).__name__}: {error}".splitlines()[0]
    except Exception:  # noqa: BLE001 - a message that cannot be made is the policy's failure too
        text = type(error).__name__
    text = text.encode("utf-8", "backslashreplace").decode()  # a lone surrogate cannot be stored
    usage = error.usage if isinstance(error, NoDecisionError) and isinstance(error.usage, Usage) else None
    wall_s = time.monotonic() - started
    return PolicyAnswer(reason="policy_error", detail=_ADDRESS.sub("0x…", text)[:300], wall_s=wall_s, usage=usage)


def _reset_call(policy: Policy, brief: Brief) -> Callable[[], Awaitable[Any]]:
    return lambda: policy.reset(brief)


def _act_call(policy: Policy, observation: Observation, inbox: Inbox) -> Callable[[], Awaitable[Any]]:
    return lambda: policy.act(observation, inbox)


def _check(answer: PolicyAnswer) -> PolicyAnswer:
    """A `Decision`, or `malformed`."""
    if answer.reason or isinstance(answer.value, Decision):
        return answer
    kind = type(answer.value).__name__
    return PolicyAnswer(reason="malformed", detail=f"`act` returned {kind}, not a Decision", wall_s=answer.wall_s)
