"""The mission's rules in sentences, for briefs. They are generated from the rules that the kernel evaluates.

Conditions name hidden entities by their group (`victim`) and contain no value that the mission marks hidden. Scheduled
events are not mentioned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lingjing.kernel.facts import HANDOFF_M, SAME_POINT_M
from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.conditions.declared_values import deadlines_s
from lingjing.mission.expression import Attr, Call, Expr, Number, parts
from lingjing.mission.instance import Instance, InteractionSpec, LimitSpec, VerbSpec
from lingjing.mission.instance_text import InstanceText, public_values
from lingjing.mission.model import Stage
from lingjing.mission.vocabulary import PHOTO

_UNITS = {"deg": "degrees"}
"""Units in words, where the sign is none."""


def rule_sentences(instance: Instance) -> tuple[str, ...]:
    """Return the rules as sentences without full stops.

    They cover success and failure, adjudicated rules, interactions, inspections, permits, limits, constraints and timed
    stages.
    """
    return tuple(_Rules(instance).sentences())


def failure_sentences(instance: Instance) -> tuple[str, ...]:
    """Return the sentences on what ends the mission as a failure: its failure condition and its hard constraints."""
    return tuple(_Rules(instance).failures())


class _Rules:
    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._words = ConditionWords(InstanceText(instance).text, public_values(instance))

    def sentences(self) -> Iterator[str]:
        yield f"The mission is won when {self._condition(self._instance.success, {})}"
        yield from self._failure()
        yield from self._adjudicated()
        yield from self._interactions()
        yield from self._inspections()
        yield from self._permits()
        yield from map(_limit, self._instance.limits)
        yield from self._guided_steps()
        yield from self._constraints()
        yield from self._timed_stages()
        yield from self._assignments()

    def failures(self) -> Iterator[str]:
        """Yield the failure condition and the hard constraints."""
        yield from self._failure()
        yield from self._constraints("hard")

    def _failure(self) -> Iterator[str]:
        if self._instance.failure is not None:
            yield f"The mission is lost when {self._condition(self._instance.failure, {})}"

    def _condition(self, condition: Expr, domains: Mapping[str, str]) -> str:
        """Return the condition in words, followed by the bounds of its measured quantities."""
        bounds = ", ".join(self._words.bounds(condition, domains))
        return self._words.sentence(condition) + (f" [{bounds}]" if bounds else "")

    def _adjudicated(self) -> Iterator[str]:
        for rule in self._instance.rules:
            domains = {parameter.name: parameter.domain for parameter in rule.parameters}
            over = ", ".join(f"{domain} `{name}`" for name, domain in domains.items())
            whom = f" for {over}" if over else ""
            once = "; each report is matched with one target of its picture at most" if rule.matching else ""
            yield f"*{rule.name}* holds{whom} when {self._condition(rule.condition, domains)}{once}"

    def _interactions(self) -> Iterator[str]:
        groups = {entity.group: entity for entity in self._instance.entities}
        names = sorted({spec.name for entity in groups.values() for spec in entity.interactions})
        if names:
            plural = len(names) > 1
            yield (
                f"{', '.join(f'`{name}`' for name in names)} {'are no commands' if plural else 'is no command'}: an "
                f"engine does {'them' if plural else 'it'} by itself as soon as the conditions hold, also to what a "
                "body only passes"
            )
        for group, entity in groups.items():
            for spec in entity.interactions:
                actors = ", ".join(f"`{actor.id}`" for actor in self._instance.actors(spec)) or "nobody here"
                reach = f"within {spec.within_m:g} m (horizontally)"
                yield (
                    f"`{spec.name}` is done to a {group} by {actors} {reach}{_course(spec)}"
                    + "".join(
                        f", provided that {self._condition(unlock.condition, {})}"
                        for unlock in self._instance.unlocks
                        if unlock.interaction == spec.name and group in {bound.domain for bound in unlock.parameters}
                    )
                )

    def _inspections(self) -> Iterator[str]:
        for spec in self._instance.inspections:
            order = "in their order" if spec.order == "strict" else "in any order"
            by = " or ".join(f"`{name}`" for name in spec.by)
            again = f"; a `{spec.replan}` message asks for another route around its position" if spec.replan else ""
            yield (
                f"the route of `{spec.asset}` is inspected (*{spec.name}*) when {by} has come "
                f"within {spec.within_m:g} m (horizontally) of each of its waypoints"
                f"{' and one of its pictures shows the waypoint at the end of a tick' if spec.pictured else ''}, "
                f"{order}{again}; a new route is inspected anew"
            )

    def _permits(self) -> Iterator[str]:
        for permit in self._instance.permits:
            scope = (
                f"`{permit.verb}` of `{permit.resource}`" if permit.verb else f"every command to `{permit.resource}`"
            )
            yield f"{scope} is rejected until {self._condition(permit.condition, {})} (`stop` is always taken)"

    def _guided_steps(self) -> Iterator[str]:
        """Yield the commands that the receivers of steps have. The sender's brief does not contain the verbs of another
        agent's body."""
        entities = {entity.id: entity for entity in self._instance.entities}
        for message in self._instance.messages:
            if not {"assignee", "step"} <= {field.name for field in message.fields}:
                continue
            for agent in self._instance.agents:
                verbs = [
                    _bounded(verb)
                    for name in agent.controls
                    if message.is_for(agent.role)
                    for verb in entities[name].verbs
                    if verb.name != PHOTO
                ]
                if verbs:
                    yield (
                        f"the `step` of a `{message.kind}` is the name of one command and `amount` its argument; "
                        f"`{agent.id}` has for `{', '.join(agent.controls)}` {', '.join(verbs)}, and an amount beyond "
                        "these bounds is cut to them"
                    )

    def _constraints(self, kind: str = "") -> Iterator[str]:
        """Yield the constraints, of one kind if it is given."""
        for rule in self._instance.constraints:
            if kind not in ("", rule.kind):
                continue
            domains = {rule.variable: rule.domain} if rule.variable and rule.domain else {}
            each = f" for each {rule.domain} `{rule.variable}`" if domains else ""
            cost = f"at a penalty of {rule.penalty.value:g}" if isinstance(rule.penalty, Number) else "at a penalty"
            price = "the mission fails" if rule.kind == "hard" else cost
            yield f"always{each}: {self._condition(rule.condition, domains)}; else {price}"

    def _timed_stages(self) -> Iterator[str]:
        for stage in self._instance.stages:
            if isinstance(stage.ticks, Number):
                domains = {stage.variable: stage.domain} if stage.variable and stage.domain else {}
                each = f" of each {stage.domain} `{stage.variable}`" if domains else ""
                when = self._condition(stage.condition, domains)
                first = self._stages_before(stage)
                since = f"of the end of {first}" if first else "of the start"
                yield (
                    f"the stage *{stage.name}*{each} must be done within {stage.ticks.value:g} ticks {since}, or the "
                    f"mission ends; it is done when {when}"
                )
            if stage.deadline is not None:
                domains = {stage.variable: stage.domain} if stage.variable and stage.domain else {}
                times = ", ".join(self._deadlines(stage))
                when = self._condition(stage.condition, domains)
                yield f"the stage *{stage.name}* must be done by {times}, or the mission ends; it is done when {when}"

    def _stages_before(self, stage: Stage) -> str:
        """Return the names of the stages that must be done before a stage begins."""
        relations = self._instance.relations
        sources = [item.source for item in relations if item.kind == "dependency" and item.target == stage.name]
        return " and ".join(f"*{source}*" for source in sources)

    def _assignments(self) -> Iterator[str]:
        """Yield the meaning of `assigned` if a condition reads it, for rules that say no more than the word."""
        conditions = (
            *(rule.condition for rule in self._instance.rules),
            *(stage.condition for stage in self._instance.stages),
            *(permit.condition for permit in self._instance.permits),
            *(unlock.condition for unlock in self._instance.unlocks),
            self._instance.success,
        )
        if any(isinstance(part, Call) and part.function == "assigned" for expr in conditions for part in parts(expr)):
            yield (
                "a body is assigned to a target when its latest destination lies within "
                f"{HANDOFF_M:g} m (horizontally) of the target, or within {SAME_POINT_M:g} m of the position in a "
                "report that matches the target; a destination is the `position` of an assignment message with this "
                "body or its agent as `assignee`, or the place of a command that the body accepted"
            )

    def _deadlines(self, stage: Stage) -> Iterator[str]:
        """Yield the deadline of each subject. A group with a hidden property in the deadline is named without times."""
        read = {part.name for part in parts(stage.deadline) if isinstance(part, Attr)} if stage.deadline else set()
        hidden = {name for entity in self._instance.entities if entity.group == stage.domain for name in entity.hidden}
        if read & hidden:
            yield f"a time that each {stage.domain} has"
            return
        for (name, subject), time_s in deadlines_s(self._instance).items():
            if name == stage.name:
                yield f"{time_s:g} s{f' for {subject}' if subject else ''}"


def _course(spec: InteractionSpec) -> str:
    """Return in words how long an interaction takes and which states it changes."""
    lasting = f", who stays there for {spec.lasting_s:g} s" if spec.lasting_s else ""
    taken_words = f", which lowers its {spec.takes}" if spec.takes else ""
    source = f" by what the actor's {spec.source} allows" if spec.takes and spec.source else ""
    given_words = f", which raises the actor's {spec.gives} up to its {spec.up_to}" if spec.gives else ""
    return f"{lasting}{taken_words}{source}{given_words}"


def _bounded(verb: VerbSpec) -> str:
    """Return a verb with the bounds of its first argument."""
    first = verb.arguments[0] if verb.arguments else None
    if first is None or first.maximum is None:
        return f"`{verb.name}`"
    unit = _UNITS.get(first.unit, first.unit)
    return f"`{verb.name}` ({first.minimum or 0.0:g} to {first.maximum:g} {unit})"


def _limit(limit: LimitSpec) -> str:
    if any(item.kind == "claims" for item in limit.counts):
        return (
            f"*{limit.name}*: all agents together may make {limit.most} claims: each different box of a picture in a "
            "report is one, and each different place around which another route is requested; to pass a claim on is "
            "free; claims beyond the limit count for nothing, and no receipt says so"
        )
    counted = ", ".join(
        f"`{item.name}` messages"
        if item.kind == "message"
        else f"{f'`{item.name}` commands' if item.name else 'commands'} to `{item.resource}`"
        for item in limit.counts
    )
    within = f" within the stage *{limit.stage}*" if limit.stage else ""
    return f"*{limit.name}*: at most {limit.most} of {counted}{within} by all agents together"
