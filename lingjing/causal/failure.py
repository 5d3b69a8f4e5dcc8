"""Signatures of failures, by which two failed episodes are called equal or different.

Two episodes fail alike if these are equal: the reason of the outcome; the broken constraints or late stages; the unmet
parts of the mission's success, as written and without members; the failure family (`lingjing.analysis.families`); and
the replaced answers of policies, by reason and, for a policy that raised, by exception. Names of members and numbers
do not count, because members are renumbered when others are removed.
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
"""The compared parts of a signature. `reason`: reason and names. `clauses`: also unmet clauses and replaced answers.
`family`: also the family.
"""

_EXCEPTION = re.compile(r"\b([A-Z]\w*(?:Error|Exception|Warning|Exit|Interrupt))\b")
"""The name of an exception in the detail of a replaced answer."""


class FailureSignature(msgspec.Struct, frozen=True, kw_only=True):
    """The description of a failure."""

    reason: str
    """The reason of the outcome."""
    named: tuple[str, ...] = ()
    """Broken constraints or late stages."""
    unmet: tuple[str, ...] = ()
    """Parts of success that did not hold, as written in the mission."""
    family: str = ""
    """The failure family; empty if there is none."""
    replaced: tuple[str, ...] = ()
    """Reasons of replaced answers, such as `policy_error ValueError`."""

    def part(self, sameness: Sameness) -> FailureSignature:
        """Return the compared part of the signature."""
        if sameness == "family":
            return self
        if sameness == "clauses":
            return msgspec.structs.replace(self, family="")
        return FailureSignature(reason=self.reason, named=self.named)

    @property
    def text(self) -> str:
        """The signature in one line."""
        parts = [self.reason, *self.named]
        parts += [f"without {clause}" for clause in self.unmet]
        parts += [self.family] if self.family else []
        parts += [f"answers replaced: {', '.join(self.replaced)}"] if self.replaced else []
        return "; ".join(parts)


def failure_of(trace: Trace) -> FailureSignature | None:
    """Return the signature of a failed episode, or None for a won one.

    Raises `UsageError` for a trace without a failure of its own: cut, aborted, interrupted or empty.
    """
    outcome = trace.outcome
    if outcome is None or not trace.boundaries:
        raise UsageError(
            f"{trace.path} has no outcome: the episode was killed or the file was cut",
            hint="play the episode again: an unfinished episode has no failure",
        )
    if outcome.reason in CUT_SHORT:
        raise UsageError(
            f"{trace.path} was cut short ({outcome.reason}): this is no failure of its policies", hint=outcome.hint
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
    """Yield the broken hard constraints, or the late stages, of the outcome."""
    instance = trace.header.instance
    if reason == "constraint":
        names = {item.name for item in instance.constraints if item.kind == "hard"}
        broken = {event.kind for record in trace.boundaries for event in record.events}
        yield from names & broken
    if reason == "late":
        yield from (item.stage for item in Stages(instance).late(last.registry))


def _unmet(trace: Trace, last: RebuiltBoundary) -> Iterator[str]:
    at = last.at
    for each, part in components(trace.header.instance.success):
        members = [{}] if each is None else [{each.variable: member} for member in at.domain(each.domain)]
        if not all(holds(part, scope, at) for scope in members):
            yield spell(part)


def _replaced(trace: Trace) -> Iterator[str]:
    for record in trace.boundaries:
        for made in record.decisions:
            if made.substituted:
                exception = _EXCEPTION.search(made.detail)
                yield f"{made.substituted} {exception[1]}" if exception else made.substituted
