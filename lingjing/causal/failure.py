"""`FailureSignature`: how an episode failed, so that two failures can be called the same or not.

Two episodes fail the same way if all of this is equal: the reason of the ending; the constraint or the stage that it
names; the parts of the mission's success that did not hold at the end, as they are written and without saying for whom;
the failure family (`lingjing.analysis.families`); and which answers of policies were replaced, by reason and, for a
policy that raised, by the exception. Names of members and numbers are left out: whoever is left when others are removed
is counted anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

import msgspec

from lingjing.analysis.families import attribute
from lingjing.analysis.registries import RebuiltBoundary, registries
from lingjing.errors import UsageError
from lingjing.kernel.rules import holds
from lingjing.kernel.stages import Stages
from lingjing.mission.expression import components
from lingjing.mission.expression_text import spell
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT

Sameness = Literal["reason", "clauses", "family"]
"""How much of a signature must be equal: the reason and what it names; also what success lacked and which answers were
replaced; also the family."""

_EXCEPTION = re.compile(r"\b([A-Z]\w*(?:Error|Exception|Warning|Exit|Interrupt))\b")


class FailureSignature(msgspec.Struct, frozen=True, kw_only=True):
    """How an episode failed. `named` are the constraints that were broken, or the stages that were late; `unmet` the
    parts of success that did not hold, as written; `replaced` why answers were replaced (`policy_error ValueError`)."""

    reason: str
    named: tuple[str, ...] = ()
    unmet: tuple[str, ...] = ()
    family: str = ""
    replaced: tuple[str, ...] = ()

    def part(self, sameness: Sameness) -> FailureSignature:
        """What of it counts."""
        if sameness == "family":
            return self
        if sameness == "clauses":
            return msgspec.structs.replace(self, family="")
        return FailureSignature(reason=self.reason, named=self.named)

    @property
    def text(self) -> str:
        """In a line."""
        told = [self.reason, *self.named]
        told += [f"without {clause}" for clause in self.unmet]
        told += [self.family] if self.family else []
        told += [f"answers replaced: {', '.join(self.replaced)}"] if self.replaced else []
        return "; ".join(told)


def failure_of(trace: Trace) -> FailureSignature | None:
    """The signature of a failed episode; None for one that was won.

    Raises `UsageError` for a trace that shows no failure of its own: cut, aborted, interrupted, without a boundary.
    """
    outcome = trace.outcome
    if outcome is None or not trace.boundaries:
        raise UsageError(
            f"{trace.path} has no outcome: its episode was killed or the file cut",
            hint="play it again: what an episode did not come to cannot be made to stay",
        )
    if outcome.reason in CUT_SHORT:
        raise UsageError(
            f"{trace.path} was cut short ({outcome.reason}): it failed for or against nobody", hint=outcome.hint
        )
    if outcome.success:
        return None
    attribution = attribute(trace)
    *_, last = registries(trace)
    return FailureSignature(
        reason=outcome.reason,
        named=tuple(sorted(set(_named(trace, outcome.reason, last)))),
        unmet=tuple(sorted(set(_unmet(trace, last)))),
        family="" if attribution is None else attribution.family,
        replaced=tuple(sorted(set(_replaced(trace)))),
    )


def _named(trace: Trace, reason: str, last: RebuiltBoundary) -> Iterator[str]:
    """What the ending names: broken hard constraints, late stages."""
    instance = trace.header.instance
    if reason == "constraint":
        names = {one.name for one in instance.constraints if one.kind == "hard"}
        broken = {event.kind for record in trace.boundaries for event in record.events}
        yield from names & broken
    if reason == "late":
        yield from (one.stage for one in Stages(instance).late(last.registry))


def _unmet(trace: Trace, last: RebuiltBoundary) -> Iterator[str]:
    at = last.at
    for each, part in components(trace.header.instance.success):
        members = [{}] if each is None else [{each.variable: one} for one in at.domain(each.domain)]
        if not all(holds(part, scope, at) for scope in members):
            yield spell(part)


def _replaced(trace: Trace) -> Iterator[str]:
    for record in trace.boundaries:
        for made in record.decisions:
            if made.substituted:
                raised = _EXCEPTION.search(made.detail)
                yield f"{made.substituted} {raised[1]}" if raised else made.substituted
