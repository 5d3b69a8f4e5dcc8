"""Placebos: branches that have no right to win, to say how often luck repairs.

- *same*: a decision replaced by itself. It must lead to the same digests, or the method changes what it measures.
- *nudge*: a destination moved by up to `NUDGE_M`, less than what counts as a departure. Whatever it changes is chance.
- *uninvolved*: a pair that no repair contains, replaced from one of its departures on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, TypeVar

import msgspec
from msgspec.structs import replace

from lingjing.analysis.shares import wilson
from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan
from lingjing.mission.seeding import Stream
from lingjing.trace.reader import Trace
from lingjing.trace.records import Decision, Faculty, Substitution

NUDGE_M = 3.0
SAME = 2
"""So many placebos replace a decision by itself."""

ItemT = TypeVar("ItemT")
PlaceboKind = Literal["same", "nudge", "uninvolved"]


class Placebos(msgspec.Struct, frozen=True, kw_only=True):
    """`same` decisions were replaced by themselves, of which `changed` led to other digests (0, or the method is
    broken). Of `nudges` and `uninvolved` replacements `repaired` won; `low` to `high` is the 95 % interval of that
    share (Wilson)."""

    same: int = 0
    changed: int = 0
    nudges: int = 0
    uninvolved: int = 0
    repaired: int = 0
    low: float = 0.0
    high: float = 1.0


def placebo_plans(
    trace: Trace, innocent: Mapping[tuple[Faculty, str], Sequence[int]], number: int, seed: int
) -> dict[PlaceboKind, list[BranchPlan]]:
    """`number` placebos: `SAME` of the first kind, of the others as many as there are places for, in turn."""
    moves = _moves(trace)
    decided = _decided(trace)
    same = [
        BranchPlan(at=tick, replacements=((agent, tick, made),)) for agent, tick, made in _drawn(decided, seed, SAME)
    ]
    same = same[:number]
    nudged = [
        BranchPlan(at=tick, replacements=((agent, tick, _nudged(made, Stream(seed, f"nudge/{agent}/{tick}"))),))
        for agent, tick, made in _drawn(moves, seed, number)
    ]
    uninvolved = [
        BranchPlan(at=tick, substitutions=(Substitution(faculty=faculty, agent=agent, first=tick),))
        for faculty, agent, tick in _drawn(
            [(faculty, agent, tick) for (faculty, agent), ticks in innocent.items() for tick in ticks], seed, number
        )
    ]
    room = max(0, number - len(same))
    others = uninvolved[: room // 2 if nudged else room]
    return {"same": same, "nudge": nudged[: room - len(others)], "uninvolved": others}


def judged_placebos(plans: Mapping[PlaceboKind, Sequence[BranchPlan]], results: Sequence[BranchResult]) -> Placebos:
    """What came of placebos; their results in the order of the plans."""
    same, nudges, uninvolved = (len(plans[kind]) for kind in ("same", "nudge", "uninvolved"))
    lucky = sum(one.success for one in results[same:])
    trials = nudges + uninvolved
    low, high = wilson(lucky, trials) if trials else (0.0, 1.0)
    return Placebos(
        same=same,
        changed=sum(one.differs is not None for one in results[:same]),
        nudges=nudges,
        uninvolved=uninvolved,
        repaired=lucky,
        low=low,
        high=high,
    )


def _decided(trace: Trace) -> list[tuple[str, int, Decision]]:
    """Every decision that was an answer, with its agent and boundary."""
    return [
        (made.agent, record.tick - 1, made.decision)
        for record in trace.boundaries[1:]
        for made in record.decisions
        if not made.substituted
    ]


def _moves(trace: Trace) -> list[tuple[str, int, Decision]]:
    """Those that send somebody to a place."""
    return [
        (agent, tick, made)
        for agent, tick, made in _decided(trace)
        if made.command is not None
        and isinstance(made.command.arguments.get("x"), int | float)
        and isinstance(made.command.arguments.get("y"), int | float)
    ]


def _nudged(made: Decision, stream: Stream) -> Decision:
    assert made.command is not None
    angle, far = stream.uniform(0.0, math.tau), stream.uniform(NUDGE_M / 3.0, NUDGE_M)
    x, y = made.command.arguments["x"], made.command.arguments["y"]
    assert isinstance(x, int | float) and isinstance(y, int | float)
    moved = {"x": x + far * math.sin(angle), "y": y + far * math.cos(angle)}
    return replace(made, command=replace(made.command, arguments={**made.command.arguments, **moved}))


def _drawn(items: Sequence[ItemT], seed: int, number: int) -> list[ItemT]:
    """So many of them, without repetition, from a named stream."""
    left, stream = list(items), Stream(seed, "placebos")
    drawn: list[ItemT] = []
    while left and len(drawn) < number:
        drawn.append(left.pop(stream.below(len(left))))
    return drawn
