"""The episode loop around W.Step: policies act, the kernel commits, until done, the tick limit or an abort.

An infrastructure abort ends the loop with a readable partial trace and is never a model failure. An interrupt closes
the trace the same way and travels on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from lingjing.errors import ForeignCodeError, InfrastructureError
from lingjing.kernel.barrier import Barrier, OutageCheck, PolicyBarrier, no_outage
from lingjing.kernel.step import Kernel, Published
from lingjing.numerics import runtime_fingerprint
from lingjing.plugins.policy import Policy
from lingjing.trace.records import CUT_SHORT, BoundaryRecord, DecisionRecord, Outcome, Reason
from lingjing.trace.signals import deferring_signals

WON_AT_START = "success held at the start, before anybody acted"
LOST_AT_START = "failure held at the start, before anybody acted"
"""The detail of an episode that was won at boundary 0."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where an episode is: for a progress display, never for a decision."""

    tick: int
    ticks: int
    time_s: float
    wall_s: float
    last_event: str
    record: BoundaryRecord


class Ending(Protocol):
    """How a recorder is closed: `finish` for an episode that ran to its end, `abandon` for a partial one."""

    def finish(self, outcome: Outcome) -> object:
        """Write the outcome and give the file its final name."""
        ...

    def abandon(self, outcome: Outcome | None) -> object:
        """Write the outcome, if any, and keep the file recognisable as partial."""
        ...


class DecisionSource(Protocol):
    """Who decides: the policy barrier, or somebody in its place."""

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """Everybody's decisions at a boundary, in declaration order; who is `exhausted` is not asked."""
        ...

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents in whose calls a global random generator was used that nothing has seeded."""
        ...

    def close(self) -> None:
        """Nobody will be asked any more."""
        ...


def policy_barrier(
    kernel: Kernel, policies: Mapping[str, Policy], outage_check: OutageCheck = no_outage
) -> PolicyBarrier:
    """Put the active agents' policies behind the barrier, in declaration order, and give each its brief.

    An agent without a policy here is played from outside: its decisions go straight to `Kernel.step`.
    Raises `ForeignCodeError` that names the agent if a policy cannot take it: nothing has been recorded by then.
    """
    present = [agent.id for agent in kernel.instance.agents if agent.id in policies]
    limit_s = kernel.instance.budget.policy_s
    barrier = PolicyBarrier({agent: policies[agent] for agent in present}, limit_s, outage_check)
    give_briefs(kernel, barrier)
    return barrier


def give_briefs(kernel: Kernel, barrier: Barrier) -> None:
    """Give every policy behind the barrier its brief. Raises `ForeignCodeError` that names the agent if a policy cannot
    take it; the barrier is closed then."""
    try:
        answers = barrier.reset(kernel.briefs())
    except BaseException:
        barrier.close()
        raise
    for agent, answer in answers.items():
        if answer.reason:
            barrier.close()
            raise ForeignCodeError(
                f"the policy of `{agent}` could not take its brief: {answer.detail}",
                hint="correct the policy's `reset`, or choose another with --policy",
            )


def play(
    kernel: Kernel,
    barrier: DecisionSource,
    recorder: Ending | None = None,
    progress: Callable[[Progress], None] | None = None,
    since: Published | None = None,
) -> Outcome:
    """Play one episode with the policies behind `barrier`, which is closed afterwards: from its beginning, or on from
    what was published `since` last.

    Returns an outcome with reason `infrastructure-abort` if the world fails. Anything else that ends the episode
    from outside, a `KeyboardInterrupt` above all, is passed on after the trace is closed as a partial one.
    """
    started = time.perf_counter()
    reason: Reason = "error"
    detail, hint = "", ""
    try:
        reason, detail = _loop(kernel, barrier, progress, started, since)
    except InfrastructureError as error:
        reason, detail, hint = "infrastructure-abort", f"{error}", error.hint
    except KeyboardInterrupt:
        reason = "interrupted"
        raise
    finally:
        with deferring_signals():
            barrier.close()
            outcome = _outcome(kernel, reason, (detail, hint), time.perf_counter() - started, barrier.ambient_random)
            if recorder is not None:
                (recorder.abandon if reason in CUT_SHORT else recorder.finish)(outcome)
    return outcome


def _loop(
    kernel: Kernel,
    barrier: DecisionSource,
    progress: Callable[[Progress], None] | None,
    started: float,
    since: Published | None,
) -> tuple[Reason, str]:
    """Why the episode ended by itself, and the detail of it."""
    published = since if since is not None else kernel.reset()
    last = ""
    while True:
        last = _last_event(published, last)
        if progress is not None:
            progress(_progress(kernel, published, last, started))
        reason, detail = ended_because(kernel)
        if reason is not None:
            return reason, detail
        published = kernel.step(barrier.decide(published, kernel.exhausted()))


def ended_because(kernel: Kernel) -> tuple[Reason | None, str]:
    """Why the episode is over at the boundary that the kernel stands at, with the detail of it; None if it is not."""
    ended, tick = kernel.state.evaluation, kernel.state.registry.tick
    if ended.done:
        # an evaluator of somebody's own that ends an episode without a reason has seen no success
        reason = ended.reason or "failure"
        at_start = {"success": WON_AT_START, "failure": LOST_AT_START}.get(reason, "") if tick == 0 else ""
        return reason, ended.detail or at_start
    return ("budget", "") if tick >= kernel.instance.budget.ticks else (None, "")


def _last_event(published: Published, before: str) -> str:
    record = published.record
    for event in reversed(record.events):
        return f"{event.kind}({', '.join(event.bindings)})"
    for happened in reversed(record.task_events):
        return happened.line
    return before


def _progress(kernel: Kernel, published: Published, last: str, started: float) -> Progress:
    return Progress(
        tick=published.record.tick,
        ticks=kernel.instance.budget.ticks,
        time_s=published.record.time_s,
        wall_s=time.perf_counter() - started,
        last_event=last,
        record=published.record,
    )


def _outcome(
    kernel: Kernel, reason: Reason, cause: tuple[str, str], wall_s: float, ambient_random: frozenset[str]
) -> Outcome:
    state = kernel.state
    return Outcome(
        success=reason == "success",
        reason=reason,
        scr=state.scr,
        score=state.evaluation.reward,
        ticks=state.registry.tick,
        digest=state.digest,
        frames_digest=state.frames_digest,
        detail=cause[0],
        hint=cause[1],
        wall_s=wall_s,
        ambient_random=tuple(sorted(ambient_random)),
        processes={
            "caller": runtime_fingerprint(),
            **{name: dict(table) for name, table in kernel.world.processes.items()},
        },
    )
