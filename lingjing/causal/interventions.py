"""What a branch changes: faculties replaced by the truth, messages changed on their way; and that applied to a run.

`BranchPlan` says what is changed and from which boundary on. `check` finds what cannot be done with a trace.
`InterveningPolicies` stands in the place of the policies and replaces parts of their decisions; `transit` stands on
the bus. Both leave everything else alone: no other agent is told anything, and random streams are named by message,
entity and tick, so that they do not shift.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.causal.faculties import TrueSituation, faculties_of, replaced
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
    """A branch: it leaves the trace at boundary `at`, whose decisions are the first that may differ.

    `replacements` (agent, boundary) → a decision are put in the place of what an agent decides there, whatever that
    is. With `out` the branch is written as a trace into that folder. With `watch` every agent's reference is asked, and
    it is noted in what else agents depart from theirs.
    """

    at: int
    substitutions: tuple[Substitution, ...] = ()
    messages: tuple[MessageChange, ...] = ()
    replacements: tuple[tuple[str, int, Decision], ...] = ()
    out: str = ""
    watch: bool = False

    @property
    def withheld(self) -> frozenset[str]:
        """The ids of the messages that are never sent."""
        return frozenset(one.message for one in self.messages if one.act == "withhold")


class ReplacedPart(msgspec.Struct, frozen=True, order=True):
    """A part of a decision that a branch replaced, or could have: at which boundary, of whom, which faculty's."""

    boundary: int
    agent: str
    faculty: str


def check_trace(trace: Trace) -> None:
    """Raise `UsageError` for a trace without boundaries, and for one whose verbs do not say how they move although
    their engines do: it was written before instances held that, and policies and faculties go by it."""
    if not trace.boundaries:
        raise UsageError(f"{trace.path} holds no boundary", hint="its episode was cut before it began")
    for entity in trace.header.instance.entities:
        known = engine_kind(entity.engine).verbs
        silent = [one.name for one in entity.verbs if not one.motion and one.name in known and known[one.name].motion]
        if silent:
            raise UsageError(
                f"{trace.path} cannot be branched: an older version wrote it, which did not say how `{silent[0]}` "
                f"moves `{entity.id}`",
                hint="play the episode again; `lingjing replay`, `why` and `metrics` read this one as it is",
            )


def check(plan: BranchPlan, trace: Trace) -> None:
    """Raise `UsageError` for a boundary, an agent, a faculty or a message that the trace does not have. What is
    replaced may begin after the trace ends: a branch may last longer, as long as the budget lets it."""
    last, most = len(trace.boundaries) - 1, trace.header.instance.budget.ticks
    if not 0 <= plan.at <= last:
        raise UsageError(f"there is no boundary {plan.at}", hint=f"{trace.path} has those of 0 to {last}")
    for one in plan.substitutions:
        if not 0 <= one.first <= max(last, most):
            raise UsageError(f"no branch has a boundary {one.first}", hint=f"the budget is {most} ticks")
    ended = trace.boundaries[plan.at].done or plan.at >= most
    if ended and (plan.substitutions or plan.messages):
        raise UsageError(
            f"the episode is over at boundary {plan.at}", hint=f"change something at one of 0 to {last - 1}"
        )
    for one in plan.substitutions:
        _check_substitution(one, trace.header.instance)
    for number, change in enumerate(plan.messages):
        _check_message(change, trace)
        if any(one.message == change.message for one in plan.messages[:number]):
            raise UsageError(
                f"`{change.message}` is changed twice", hint="one thing can be done to a message at a time"
            )


def boundary_of(trace: Trace, message: str) -> int:
    """The boundary whose decisions a message came from. `UsageError` if the trace has no such message."""
    for record in trace.boundaries:
        if any(receipt.request == message and receipt.by == "bus" for receipt in record.receipts):
            return record.tick - 1
    some = [envelope.id for record in trace.boundaries for envelope in record.messages]
    close = nearest(message, some)
    known = (
        f"did you mean `{close}`?" if close else f"for example {', '.join(dict.fromkeys(some))[:60]}" if some else ""
    )
    raise UsageError(f"no message is called `{message}` in {trace.path}", hint=known or "nobody said anything in it")


def _check_substitution(one: Substitution, instance: Instance) -> None:
    agents = {agent.id: agent for agent in instance.agents}
    if one.agent not in agents:
        hint = nearest_or(one.agent, agents, f"there are: {', '.join(agents)}")
        raise UsageError(f"there is no agent `{one.agent}`", hint=hint)
    has = faculties_of(instance, agents[one.agent])
    if one.faculty not in has:
        raise UsageError(
            f"`{one.agent}` has no {one.faculty}",
            hint=f"it has {', '.join(has) or 'no faculty'}; see docs/attribution.md",
        )


def _check_message(change: MessageChange, trace: Trace) -> None:
    boundary = boundary_of(trace, change.message)
    record = trace.boundaries[boundary + 1]
    edges = [envelope for envelope in record.messages if envelope.id == change.message]
    if change.act == "withhold":
        return
    if not edges:
        raise UsageError(
            f"`{change.message}` was on its way to nobody", hint="no agent ever read it: nothing to change"
        )
    if change.act in ("delay", "repeat") and change.ticks < 1:
        raise UsageError(f"{change.act} `{change.message}`: by at least one boundary is due")
    if change.act == "forge":
        spec = next(one for one in trace.header.instance.messages if one.kind == edges[0].kind)
        frames = {frame for earlier in trace.boundaries[: boundary + 1] for frame in (one.id for one in earlier.frames)}
        fault = body_check(spec).fault({**edges[0].body, **change.body}, frames)
        if fault:
            raise UsageError(f"forge `{change.message}`: {fault}", hint=f"its kind is `{edges[0].kind}`")


class InterveningPolicies:
    """The policies of a branch, in the place of the barrier's.

    `replaced` lists what was replaced so far, `departed` what agents whose references are asked got wrong beside what
    the plan would have replaced there.
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
        """What the policies decide, with what the plan replaces."""
        tick, scenes = published.record.tick, self._scenes()
        self._references.begin({one.agent for one in self._plan.substitutions if one.first == tick})
        due = self._references.decide(published)
        decisions = self._policies.decide(published, exhausted)
        made = tuple(self._altered(one, due, scenes, tick) for one in decisions)
        found = self._references.note(decisions, due, scenes)
        covered = {(one.faculty, one.agent) for one in self._plan.substitutions if one.covers(tick)}
        self.departed += [ReplacedPart(tick, who, what) for what, who in found if (what, who) not in covered]
        return self._without_withheld(made, tick)

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents in whose calls a global random generator was used."""
        return self._policies.ambient_random

    def close(self) -> None:
        """Let the policies go."""
        self._policies.close()

    def _scenes(self) -> dict[str, TrueSituation]:
        instance, registry = self._kernel.instance, self._kernel.state.registry
        return {agent.id: TrueSituation(instance, agent, registry) for agent in instance.agents}

    def _altered(
        self, made: DecisionRecord, due: Mapping[str, Decision], scenes: Mapping[str, TrueSituation], tick: int
    ) -> DecisionRecord:
        decision = made.decision
        for one in self._plan.substitutions:
            if one.agent != made.agent or not one.covers(tick):
                continue
            after = replaced(one.faculty, decision, due[one.agent], scenes[one.agent])
            if after is not decision:
                self.replaced.append(ReplacedPart(tick, one.agent, one.faculty))
            decision = after
        for agent, boundary, other in self._plan.replacements:
            decision = other if (agent, boundary) == (made.agent, tick) else decision
        if decision is made.decision:
            return made
        return replace(made, decision=decision, substituted="", detail="")

    def _without_withheld(self, decisions: tuple[DecisionRecord, ...], tick: int) -> tuple[DecisionRecord, ...]:
        """Without the messages that are withheld, which are known by their numbers at this boundary."""
        number, kept = 0, []
        for made in decisions:
            said = made.decision.messages
            left = tuple(
                one
                for place, one in enumerate(said, number + 1)
                if request_id("message", tick + 1, place) not in self._withheld
            )
            number += len(said)
            changed = len(left) != len(said)
            kept.append(replace(made, decision=replace(made.decision, messages=left)) if changed else made)
        return tuple(kept)


def transit(changes: Sequence[MessageChange]) -> Transit | None:
    """What becomes of messages on their way; None where nothing does."""
    changed = {one.message: one for one in changes if one.act != "withhold"}
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
    """How many records were replaced, by (agent, faculty)."""
    return Counter((one.agent, one.faculty) for one in parts)
