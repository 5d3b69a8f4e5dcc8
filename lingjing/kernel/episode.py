"""The episode loop around W.Step: policies act and the kernel commits until termination, tick limit or abort.

An infrastructure abort ends the loop with a readable partial trace and never counts as a failure of a model. An
interrupt closes the trace in the same way and propagates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from lingjing.errors import ForeignCodeError, InfrastructureError, hint_of
from lingjing.kernel.barrier import Barrier, OutageCheck, PolicyBarrier, no_outage
from lingjing.kernel.step import Kernel, Published
from lingjing.numerics import runtime_fingerprint
from lingjing.plugins.foreign_errors import print_wanted_traceback
from lingjing.plugins.policy import Policy
from lingjing.processes.signals import deferring_signals
from lingjing.trace.records import CUT_SHORT, BoundaryRecord, DecisionRecord, Outcome, Reason

WON_AT_START = "success held at the start, before anybody acted"
"""The detail of an episode that was won at boundary 0."""
LOST_AT_START = "failure held at the start, before anybody acted"
"""The detail of an episode that was lost at boundary 0."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a running episode, for displays only."""

    tick: int
    """The last committed boundary."""
    ticks: int
    """The mission's tick limit."""
    time_s: float
    """Simulated time in seconds."""
    wall_s: float
    """Wall-clock seconds since the start of the loop."""
    last_event: str
    """The latest event in words; "" before the first."""
    record: BoundaryRecord
    """The record of the last boundary."""


class Ending(Protocol):
    """The interface by which the loop closes a recorder."""

    def finish(self, outcome: Outcome) -> object:
        """Write the outcome of a complete episode and give the file its final name."""
        ...

    def abandon(self, outcome: Outcome | None) -> object:
        """Write the outcome, if any, and keep the file recognisable as partial."""
        ...


class DecisionSource(Protocol):
    """A source of decisions: the policy barrier or a replacement."""

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """Return the decisions of all agents at a boundary, in declaration order. Agents in `exhausted` are not
        called.
        """
        ...

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents with a call that used an unseeded global random generator."""
        ...

    def close(self) -> None:
        """End the source; no further decision is requested."""
        ...


def policy_barrier(
    kernel: Kernel, policies: Mapping[str, Policy], outage_check: OutageCheck = no_outage
) -> PolicyBarrier:
    """Put the active agents' policies behind a barrier, in declaration order, and send each its brief.

    An agent without a policy here is controlled from outside: its decisions go directly to `Kernel.step`. Raises
    `ForeignCodeError` with the agent's name if a policy fails in `reset`; nothing has been recorded by then.
    """
    present = [agent.id for agent in kernel.instance.agents if agent.id in policies]
    limit_s = kernel.instance.budget.policy_s
    barrier = PolicyBarrier({agent: policies[agent] for agent in present}, limit_s, outage_check)
    reset_policies(kernel, barrier)
    return barrier


def reset_policies(kernel: Kernel, barrier: Barrier) -> None:
    """Send every policy behind the barrier its brief.

    Raises `ForeignCodeError` with the agent's name if a policy fails in `reset`. The barrier is closed on any error.
    """
    try:
        answers = barrier.reset(kernel.briefs())
    except BaseException:
        barrier.close()
        raise
    for agent, answer in answers.items():
        if answer.reason:
            barrier.close()
            raise ForeignCodeError(
                f"the policy of `{agent}` failed in `reset`: {answer.detail}",
                hint="correct the code that failed, or choose another policy with --policy",
            )


def play(
    kernel: Kernel,
    barrier: DecisionSource,
    recorder: Ending | None = None,
    progress: Callable[[Progress], None] | None = None,
    since: Published | None = None,
) -> Outcome:
    """Play one episode with the policies behind `barrier`, which is closed afterwards.

    Starts at boundary 0, or continues from the boundary output `since`. Returns an outcome with reason
    `infrastructure-abort` if the world fails. Any other interruption, above all a `KeyboardInterrupt`, propagates after
    the trace is closed as partial.
    """
    started = time.perf_counter()
    reason: Reason = "error"
    detail = ""
    abort: InfrastructureError | None = None
    try:
        reason, detail = _loop(kernel, barrier, progress, started, since)
    except InfrastructureError as error:
        print_wanted_traceback(error)
        reason, abort = "infrastructure-abort", error
    except KeyboardInterrupt:
        reason = "interrupted"
        raise
    finally:
        with deferring_signals():
            barrier.close()
            outcome = _outcome(kernel, reason, abort or detail, time.perf_counter() - started, barrier.ambient_random)
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
    """Return the reason and detail of the episode's termination."""
    published = since if since is not None else kernel.reset()
    last = ""
    while True:
        last = _last_event(published, last)
        if progress is not None:
            progress(_progress(kernel, published, last, started))
        reason, detail = end_reason(kernel)
        if reason is not None:
            return reason, detail
        published = kernel.step(barrier.decide(published, kernel.exhausted()))


def end_reason(kernel: Kernel) -> tuple[Reason | None, str]:
    """Return the reason and detail if the episode is over at the kernel's boundary; the reason is None if it is not."""
    ended, tick = kernel.state.evaluation, kernel.state.registry.tick
    if ended.done:
        # A plug-in's evaluator may end an episode without a reason; only the reason `success` counts as a win.
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
    kernel: Kernel, reason: Reason, why: InfrastructureError | str, wall_s: float, ambient_random: frozenset[str]
) -> Outcome:
    """Return the outcome. `why` is the error of an abort, or else the detail of the ending."""
    state = kernel.state
    hint, cause = (hint_of(why), why.cause) if isinstance(why, InfrastructureError) else ("", "")
    return Outcome(
        success=reason == "success",
        reason=reason,
        scr=state.scr,
        score=state.evaluation.reward,
        ticks=state.registry.tick,
        digest=state.digest,
        frames_digest=state.frames_digest,
        detail=str(why),
        hint=hint,
        cause=cause,
        wall_s=wall_s,
        ambient_random=tuple(sorted(ambient_random)),
        processes={
            "caller": runtime_fingerprint(),
            **{name: dict(table) for name, table in kernel.world.processes.items()},
        },
    )
