"""Placebos: branches that should not win, which measure how often a branch wins by chance.

- *same*: a decision replaced by itself. The digests must stay equal, or the method is broken.
- *nudge*: a destination moved by up to `NUDGE_M`, which is less than a departure. All its effects are chance.
- *uninvolved*: a pair that is in no repair, substituted from one of its departures on.
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
"""The greatest displacement of a nudge, metres. Chosen below `faculties.PLACE_M`."""

SAME = 2
"""The number of placebos of the kind `same`. Chosen."""

ItemT = TypeVar("ItemT")
"""An item to draw."""

PlaceboKind = Literal["same", "nudge", "uninvolved"]
"""The kinds of placebos."""


class Placebos(msgspec.Struct, frozen=True, kw_only=True):
    """The result of the placebos."""

    same: int = 0
    """Decisions replaced by themselves."""
    changed: int = 0
    """Decisions replaced by themselves that change the digest; 0 unless the method is broken."""
    nudges: int = 0
    """Nudged destinations."""
    uninvolved: int = 0
    """Substitutions of uninvolved pairs."""
    repaired: int = 0
    """Nudges and uninvolved substitutions that won."""
    low: float = 0.0
    """Lower end of the 95 % interval (Wilson) of the share of `repaired`."""
    high: float = 1.0
    """Upper end of the interval of `low`."""


def placebo_plans(
    trace: Trace, innocent: Mapping[tuple[Faculty, str], Sequence[int]], number: int, seed: int
) -> dict[PlaceboKind, list[BranchPlan]]:
    """Return `number` placebos: `SAME` of the first kind, the others in equal parts as far as the trace allows them."""
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


def placebo_result(plans: Mapping[PlaceboKind, Sequence[BranchPlan]], results: Sequence[BranchResult]) -> Placebos:
    """Return the result of placebos; `results` are in the order of the plans."""
    same, nudges, uninvolved = (len(plans[kind]) for kind in ("same", "nudge", "uninvolved"))
    lucky = sum(result.success for result in results[same:])
    trials = nudges + uninvolved
    low, high = wilson(lucky, trials) if trials else (0.0, 1.0)
    return Placebos(
        same=same,
        changed=sum(result.differs is not None for result in results[:same]),
        nudges=nudges,
        uninvolved=uninvolved,
        repaired=lucky,
        low=low,
        high=high,
    )


def _decided(trace: Trace) -> list[tuple[str, int, Decision]]:
    """Return every decision that was not substituted, with its agent and boundary."""
    return [
        (made.agent, record.tick - 1, made.decision)
        for record in trace.boundaries[1:]
        for made in record.decisions
        if not made.substituted
    ]


def _moves(trace: Trace) -> list[tuple[str, int, Decision]]:
    """Return the decisions that move a body to a position."""
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
    """Return items drawn without replacement from a named stream."""
    left, stream = list(items), Stream(seed, "placebos")
    drawn: list[ItemT] = []
    while left and len(drawn) < number:
        drawn.append(left.pop(stream.below(len(left))))
    return drawn
