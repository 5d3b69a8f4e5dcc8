"""Interventions: the changes of a branch, their check, and their application to a running episode.

`BranchPlan` holds the changes and the first boundary. `check` finds changes that a trace does not allow.
`InterveningPolicies` stands in front of the policies and replaces parts of their decisions; `transit` changes messages
on the bus. Nothing else changes: other agents receive nothing new, and random streams do not shift, because they are
named by message, entity and tick.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.causal.faculties import TrueSituation, faculties_of, replace_faculty
from lingjing.causal.references import References
from lingjing.errors import UsageError
from lingjing.kernel.admission import body_check
from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.step import Kernel, Published, Transit
from lingjing.mission.instance import Instance
from lingjing.mission.kinds import engine_kind
from lingjing.suggest import nearest, nearest_or
from lingjing.trace.reader import Trace
from lingjing.trace.records import Decision, DecisionRecord, Envelope, MessageChange, Substitution
from lingjing.trace.request_ids import request_id


class BranchPlan(msgspec.Struct, frozen=True, kw_only=True):
    """The plan of a branch."""

    at: int
    """The boundary of the fork; its decisions are the first that may differ."""
    substitutions: tuple[Substitution, ...] = ()
    """Faculties to replace by their references."""
    messages: tuple[MessageChange, ...] = ()
    """Changes of messages."""
    replacements: tuple[tuple[str, int, Decision], ...] = ()
    """Decisions by agent and boundary, which replace the agent's decision."""
    out: str = ""
    """The folder for the branch's trace; empty: no trace."""
    watch: bool = False
    """True if all references run and all departures are recorded."""

    @property
    def withheld(self) -> frozenset[str]:
        """The ids of the messages that are not sent."""
        return frozenset(change.message for change in self.messages if change.act == "withhold")


class ReplacedPart(msgspec.Struct, frozen=True, order=True):
    """A part of a decision that a branch replaced, or would have replaced."""

    boundary: int
    """The boundary of the decision."""
    agent: str
    faculty: str
    """The faculty of the part."""


def check_trace(trace: Trace) -> None:
    """Raise `UsageError` for a trace without boundaries, or one by an old version without the motions of verbs.
    Policies and faculties need the motions.
    """
    if not trace.boundaries:
        raise UsageError(f"{trace.path} holds no boundary", hint="its episode was cut before boundary 0")
    for entity in trace.header.instance.entities:
        known = engine_kind(entity.engine).verbs
        incomplete = [
            verb.name for verb in entity.verbs if not verb.motion and verb.name in known and known[verb.name].motion
        ]
        if incomplete:
            raise UsageError(
                f"{trace.path} cannot be branched: an older version wrote it without the motion of `{incomplete[0]}` "
                f"of `{entity.id}`",
                hint="play the episode again; `lingjing replay`, `why` and `metrics` can read this trace",
            )


def check(plan: BranchPlan, trace: Trace) -> None:
    """Raise `UsageError` for a boundary, an agent, a faculty or a message that the trace does not have.

    A substitution may begin after the end of the trace, because a branch may last up to the budget.
    """
    last, most = len(trace.boundaries) - 1, trace.header.instance.budget.ticks
    if not 0 <= plan.at <= last:
        raise UsageError(f"there is no boundary {plan.at}", hint=f"{trace.path} has boundaries 0 to {last}")
    for item in plan.substitutions:
        if not 0 <= item.first <= max(last, most):
            raise UsageError(f"no branch has a boundary {item.first}", hint=f"the budget is {most} ticks")
    ended = trace.boundaries[plan.at].done or plan.at >= most
    if ended and (plan.substitutions or plan.messages):
        raise UsageError(f"the episode has ended at boundary {plan.at}", hint=f"choose a boundary from 0 to {last - 1}")
    for item in plan.substitutions:
        _check_substitution(item, trace.header.instance)
    for number, change in enumerate(plan.messages):
        _check_message(change, trace)
        if any(item.message == change.message for item in plan.messages[:number]):
            raise UsageError(f"`{change.message}` is changed twice", hint="make one change per message")


def boundary_of(trace: Trace, message: str) -> int:
    """Return the boundary of the decision that sent a message. Raises `UsageError` if the trace has no such message."""
    for record in trace.boundaries:
        if any(receipt.request == message and receipt.by == "bus" for receipt in record.receipts):
            return record.tick - 1
    ids = [envelope.id for record in trace.boundaries for envelope in record.messages]
    close = nearest(message, ids)
    hint = f"did you mean `{close}`?" if close else f"for example {', '.join(dict.fromkeys(ids))[:60]}" if ids else ""
    raise UsageError(f"there is no message `{message}` in {trace.path}", hint=hint or "the trace holds no messages")


def _check_substitution(substitution: Substitution, instance: Instance) -> None:
    agents = {agent.id: agent for agent in instance.agents}
    if substitution.agent not in agents:
        hint = nearest_or(substitution.agent, agents, f"there are: {', '.join(agents)}")
        raise UsageError(f"there is no agent `{substitution.agent}`", hint=hint)
    own_faculties = faculties_of(instance, agents[substitution.agent])
    if substitution.faculty not in own_faculties:
        raise UsageError(
            f"`{substitution.agent}` has no {substitution.faculty}",
            hint=f"it has {', '.join(own_faculties) or 'no faculty'}; see docs/attribution.md",
        )


def _check_message(change: MessageChange, trace: Trace) -> None:
    boundary = boundary_of(trace, change.message)
    record = trace.boundaries[boundary + 1]
    edges = [envelope for envelope in record.messages if envelope.id == change.message]
    if change.act == "withhold":
        return
    if not edges:
        raise UsageError(f"`{change.message}` had no recipients", hint="choose a message that was delivered")
    if change.act in ("delay", "repeat") and change.ticks < 1:
        raise UsageError(f"{change.act} `{change.message}`: the number of boundaries must be at least 1")
    if change.act == "forge":
        spec = next(item for item in trace.header.instance.messages if item.kind == edges[0].kind)
        frames = {
            frame for earlier in trace.boundaries[: boundary + 1] for frame in (item.id for item in earlier.frames)
        }
        fault = body_check(spec).fault({**edges[0].body, **change.body}, frames)
        if fault:
            raise UsageError(f"forge `{change.message}`: {fault}", hint=f"its kind is `{edges[0].kind}`")


class InterveningPolicies:
    """The policies of a branch, in place of the barrier's.

    `replaced` lists the replaced parts. `departed` lists the departures that the plan does not replace.
    """

    def __init__(self, policies: PolicyBarrier, references: References, kernel: Kernel, plan: BranchPlan) -> None:
        self._policies = policies
        self._references = references
        self._kernel = kernel
        self._plan = plan
        self._withheld = plan.withheld
        self.replaced: list[ReplacedPart] = []
        self.departed: list[ReplacedPart] = []

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """Return the policies' decisions after the replacements of the plan."""
        tick, scenes = published.record.tick, self._scenes()
        self._references.begin({item.agent for item in self._plan.substitutions if item.first == tick})
        references = self._references.decide(published)
        decisions = self._policies.decide(published, exhausted)
        made = tuple(self._replace_parts(item, references, scenes, tick) for item in decisions)
        departures = self._references.note(decisions, references, scenes)
        covered = {(item.faculty, item.agent) for item in self._plan.substitutions if item.covers(tick)}
        self.departed += [
            ReplacedPart(tick, agent, faculty) for faculty, agent in departures if (faculty, agent) not in covered
        ]
        return self._without_withheld(made, tick)

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents that used a global random generator in their calls."""
        return self._policies.ambient_random

    def close(self) -> None:
        """Close the policies."""
        self._policies.close()

    def _scenes(self) -> dict[str, TrueSituation]:
        instance, registry = self._kernel.instance, self._kernel.state.registry
        return {agent.id: TrueSituation(instance, agent, registry) for agent in instance.agents}

    def _replace_parts(
        self, made: DecisionRecord, references: Mapping[str, Decision], scenes: Mapping[str, TrueSituation], tick: int
    ) -> DecisionRecord:
        decision = made.decision
        for substitution in self._plan.substitutions:
            if substitution.agent != made.agent or not substitution.covers(tick):
                continue
            after = replace_faculty(
                substitution.faculty, decision, references[substitution.agent], scenes[substitution.agent]
            )
            if after is not decision:
                self.replaced.append(ReplacedPart(tick, substitution.agent, substitution.faculty))
            decision = after
        for agent, boundary, other in self._plan.replacements:
            decision = other if (agent, boundary) == (made.agent, tick) else decision
        if decision is made.decision:
            return made
        return replace(made, decision=decision, substituted="", detail="")

    def _without_withheld(self, decisions: tuple[DecisionRecord, ...], tick: int) -> tuple[DecisionRecord, ...]:
        """Return the decisions without withheld messages, which are identified by their numbers at this boundary."""
        number, kept = 0, []
        for made in decisions:
            messages = made.decision.messages
            left = tuple(
                message
                for place, message in enumerate(messages, number + 1)
                if request_id("message", tick + 1, place) not in self._withheld
            )
            number += len(messages)
            changed = len(left) != len(messages)
            kept.append(replace(made, decision=replace(made.decision, messages=left)) if changed else made)
        return tuple(kept)


def transit(changes: Sequence[MessageChange]) -> Transit | None:
    """Return the function that changes messages on the bus, or None if there are no changes."""
    changed = {change.message: change for change in changes if change.act != "withhold"}
    if not changed:
        return None

    def travel(tick: int, edges: tuple[Envelope, ...]) -> tuple[Envelope, ...]:
        return tuple(sent for edge in edges for sent in _sent(edge, changed.get(edge.id)))

    return travel


def _sent(edge: Envelope, change: MessageChange | None) -> tuple[Envelope, ...]:
    if change is None:
        return (edge,)
    later = replace(edge, deliver_at=edge.deliver_at + change.ticks)
    match change.act:
        case "delay":
            return (later,)
        case "repeat":
            return edge, later
        case "forge":
            body = {**edge.body, **change.body}
            return (replace(edge, body=body, bytes=len(msgspec.json.encode(body))),)
    return ()


def counts(parts: Sequence[ReplacedPart]) -> Counter[tuple[str, str]]:
    """Return the number of replaced records by (agent, faculty)."""
    return Counter((part.agent, part.faculty) for part in parts)
