"""The mission's rules in sentences, for briefs. They are generated from the rules that the kernel evaluates.

Conditions name hidden entities by their group (`victim`) and contain no value that the mission marks hidden. Scheduled
events are not mentioned. The sentences of other languages are in `phrases.zh.json` beside this file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lingjing.kernel.facts import HANDOFF_M, SAME_POINT_M
from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.conditions.declared_values import deadlines_s
from lingjing.mission.expression import Attr, Call, Expr, Number, parts
from lingjing.mission.instance import Instance, InteractionSpec, LimitSpec, VerbSpec
from lingjing.mission.instance_text import InstanceText, public_values
from lingjing.mission.languages import ORIGINAL, phrases
from lingjing.mission.model import Stage
from lingjing.mission.vocabulary import PHOTO


def rule_sentences(instance: Instance, language: str = ORIGINAL) -> tuple[str, ...]:
    """Return the rules as sentences without full stops, in a language.

    They cover success and failure, adjudicated rules, interactions, inspections, permits, limits, constraints and timed
    stages.
    """
    return tuple(_Rules(instance, language).sentences())


def failure_sentences(instance: Instance, language: str = ORIGINAL) -> tuple[str, ...]:
    """Return the sentences on what ends the mission as a failure: its failure condition and its hard constraints."""
    return tuple(_Rules(instance, language).failures())


class _Rules:
    def __init__(self, instance: Instance, language: str) -> None:
        self._instance = instance
        self._words = ConditionWords(InstanceText(instance).text, public_values(instance), language)
        self._say = phrases(language, __package__)

    def sentences(self) -> Iterator[str]:
        yield self._say("The mission is won when {condition}", condition=self._condition(self._instance.success, {}))
        yield from self._failure()
        yield from self._adjudicated()
        yield from self._interactions()
        yield from self._inspections()
        yield from self._permits()
        yield from map(self._limit, self._instance.limits)
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
            condition = self._condition(self._instance.failure, {})
            yield self._say("The mission is lost when {condition}", condition=condition)

    def _condition(self, condition: Expr, domains: Mapping[str, str]) -> str:
        """Return the condition in words, followed by the bounds of its measured quantities."""
        bounds = ", ".join(self._words.bounds(condition, domains))
        return self._words.sentence(condition) + (f" [{bounds}]" if bounds else "")

    def _list(self, items: Sequence[str]) -> str:
        """Return items with the comma of lists."""
        return self._say.text(", ").join(items)

    def _adjudicated(self) -> Iterator[str]:
        say = self._say
        for rule in self._instance.rules:
            domains = {parameter.name: parameter.domain for parameter in rule.parameters}
            over = self._list([f"{domain} `{name}`" for name, domain in domains.items()])
            once = say("; each report is matched with one target of its picture at most") if rule.matching else ""
            condition = self._condition(rule.condition, domains)
            if over:
                yield (
                    say("*{rule}* holds for {over} when {condition}", rule=rule.name, over=over, condition=condition)
                    + once
                )
            else:
                yield say("*{rule}* holds when {condition}", rule=rule.name, condition=condition) + once

    def _interactions(self) -> Iterator[str]:
        say = self._say
        groups = {entity.group: entity for entity in self._instance.entities}
        names = sorted({spec.name for entity in groups.values() for spec in entity.interactions})
        listed = self._list([f"`{name}`" for name in names])
        if len(names) == 1:
            yield say(
                "{names} is no command: an engine does it by itself as soon as the conditions hold, also to what a "
                "body only passes",
                names=listed,
            )
        elif names:
            yield say(
                "{names} are no commands: an engine does them by itself as soon as the conditions hold, also to what a "
                "body only passes",
                names=listed,
            )
        for group, entity in groups.items():
            for spec in entity.interactions:
                actors = self._list([f"`{actor.id}`" for actor in self._instance.actors(spec)]) or say("nobody here")
                yield (
                    say(
                        "`{name}` is done to a {group} by {actors} within {within:g} m (horizontally)",
                        name=spec.name, group=group, actors=actors, within=spec.within_m,
                    )
                    + self._course(spec)
                    + "".join(
                        say(", provided that {condition}", condition=self._condition(unlock.condition, {}))
                        for unlock in self._instance.unlocks
                        if unlock.interaction == spec.name and group in {bound.domain for bound in unlock.parameters}
                    )
                )  # fmt: skip

    def _inspections(self) -> Iterator[str]:
        say = self._say
        for spec in self._instance.inspections:
            pictured = say(" and one of its pictures shows the waypoint at the end of a tick") if spec.pictured else ""
            again = (
                say("; a `{kind}` message asks for another route around its position", kind=spec.replan)
                if spec.replan
                else ""
            )
            yield (
                say(
                    "the route of `{asset}` is inspected (*{name}*) when {by} has come within {within:g} m "
                    "(horizontally) of each of its waypoints",
                    asset=spec.asset, name=spec.name, by=say.text(" or ").join(f"`{name}`" for name in spec.by),
                    within=spec.within_m,
                )
                + pictured
                + say(", in their order" if spec.order == "strict" else ", in any order")
                + again
                + say("; a new route is inspected anew")
            )  # fmt: skip

    def _permits(self) -> Iterator[str]:
        for permit in self._instance.permits:
            scope = (
                self._say("`{verb}` of `{resource}`", verb=permit.verb, resource=permit.resource)
                if permit.verb
                else self._say("every command to `{resource}`", resource=permit.resource)
            )
            yield self._say(
                "{scope} is rejected until {condition} (`stop` is always taken)",
                scope=scope,
                condition=self._condition(permit.condition, {}),
            )

    def _guided_steps(self) -> Iterator[str]:
        """Yield the commands that the receivers of steps have. The sender's brief does not contain the verbs of another
        agent's body."""
        entities = {entity.id: entity for entity in self._instance.entities}
        for message in self._instance.messages:
            if not {"assignee", "step"} <= {field.name for field in message.fields}:
                continue
            for agent in self._instance.agents:
                verbs = [
                    self._bounded(verb)
                    for name in agent.controls
                    if message.is_for(agent.role)
                    for verb in entities[name].verbs
                    if verb.name != PHOTO
                ]
                if verbs:
                    yield self._say(
                        "the `step` of a `{kind}` is the name of one command and `amount` its argument; `{agent}` has "
                        "for `{bodies}` {verbs}, and an amount beyond these bounds is cut to them",
                        kind=message.kind, agent=agent.id, bodies=", ".join(agent.controls), verbs=self._list(verbs),
                    )  # fmt: skip

    def _constraints(self, kind: str = "") -> Iterator[str]:
        """Yield the constraints, of one kind if it is given."""
        say = self._say
        for rule in self._instance.constraints:
            if kind not in ("", rule.kind):
                continue
            domains = {rule.variable: rule.domain} if rule.variable and rule.domain else {}
            condition = self._condition(rule.condition, domains)
            if rule.kind == "hard":
                price = say("; else the mission fails")
            elif isinstance(rule.penalty, Number):
                price = say("; else at a penalty of {penalty:g}", penalty=rule.penalty.value)
            else:
                price = say("; else at a penalty")
            if domains:
                each = f"{rule.domain} `{rule.variable}`"
                yield say("always for each {each}: {condition}", each=each, condition=condition) + price
            else:
                yield say("always: {condition}", condition=condition) + price

    def _timed_stages(self) -> Iterator[str]:
        say = self._say
        for stage in self._instance.stages:
            domains = {stage.variable: stage.domain} if stage.variable and stage.domain else {}
            if isinstance(stage.ticks, Number):
                each = (
                    say(" of each {domain} `{variable}`", domain=stage.domain, variable=stage.variable)
                    if domains
                    else ""
                )
                first = self._stages_before(stage)
                yield say(
                    "the stage *{stage}*{each} must be done within {ticks:g} ticks {since}, or the mission ends; it is "
                    "done when {condition}",
                    stage=stage.name, each=each, ticks=stage.ticks.value,
                    since=say("of the end of {stages}", stages=first) if first else say("of the start"),
                    condition=self._condition(stage.condition, domains),
                )  # fmt: skip
            if stage.deadline is not None:
                yield say(
                    "the stage *{stage}* must be done by {times}, or the mission ends; it is done when {condition}",
                    stage=stage.name,
                    times=self._list(list(self._deadlines(stage))),
                    condition=self._condition(stage.condition, domains),
                )

    def _stages_before(self, stage: Stage) -> str:
        """Return the names of the stages that must be done before a stage begins."""
        relations = self._instance.relations
        sources = [item.source for item in relations if item.kind == "dependency" and item.target == stage.name]
        return self._say.text(" and ").join(f"*{source}*" for source in sources)

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
            yield self._say(
                "a body is assigned to a target when its latest destination lies within {handoff:g} m (horizontally) "
                "of the target, or within {same:g} m of the position in a report that matches the target; a "
                "destination is the `position` of an assignment message with this body or its agent as `assignee`, or "
                "the place of a command that the body accepted",
                handoff=HANDOFF_M,
                same=SAME_POINT_M,
            )

    def _deadlines(self, stage: Stage) -> Iterator[str]:
        """Yield the deadline of each subject. A group with a hidden property in the deadline is named without times."""
        read = {part.name for part in parts(stage.deadline) if isinstance(part, Attr)} if stage.deadline else set()
        hidden = {name for entity in self._instance.entities if entity.group == stage.domain for name in entity.hidden}
        if read & hidden:
            yield self._say("a time that each {group} has", group=stage.domain)
            return
        for (name, subject), time_s in deadlines_s(self._instance).items():
            if name == stage.name and subject:
                yield self._say("{time:g} s for {subject}", time=time_s, subject=subject)
            elif name == stage.name:
                yield f"{time_s:g} s"

    def _course(self, spec: InteractionSpec) -> str:
        """Return in words how long an interaction takes and which states it changes."""
        say = self._say
        lasting = say(", who stays there for {time:g} s", time=spec.lasting_s) if spec.lasting_s else ""
        taken_words = say(", which lowers its {state}", state=spec.takes) if spec.takes else ""
        source = say(" by what the actor's {state} allows", state=spec.source) if spec.takes and spec.source else ""
        given_words = (
            say(", which raises the actor's {state} up to its {most}", state=spec.gives, most=spec.up_to)
            if spec.gives
            else ""
        )
        return f"{lasting}{taken_words}{source}{given_words}"

    def _bounded(self, verb: VerbSpec) -> str:
        """Return a verb with the bounds of its first argument."""
        first = verb.arguments[0] if verb.arguments else None
        if first is None or first.maximum is None:
            return f"`{verb.name}`"
        unit = self._say("degrees") if first.unit == "deg" else first.unit
        low, high = first.minimum or 0.0, first.maximum
        return self._say("`{verb}` ({low:g} to {high:g} {unit})", verb=verb.name, low=low, high=high, unit=unit)

    def _limit(self, limit: LimitSpec) -> str:
        say = self._say
        if any(item.kind == "claims" for item in limit.counts):
            return say(
                "*{limit}*: all agents together may make {most} claims: each different box of a picture in a report "
                "is one, unless no rule asks for its class, and each different place around which another route is "
                "requested; to pass a claim on is free; claims beyond the limit count for nothing, and no receipt says "
                "so",
                limit=limit.name,
                most=limit.most,
            )
        counted = self._list(
            [
                say("`{kind}` messages", kind=item.name)
                if item.kind == "message"
                else say("`{verb}` commands to `{resource}`", verb=item.name, resource=item.resource)
                if item.name
                else say("commands to `{resource}`", resource=item.resource)
                for item in limit.counts
            ]
        )
        within = say(" within the stage *{stage}*", stage=limit.stage) if limit.stage else ""
        return say(
            "*{limit}*: at most {most} of {counted}{within} by all agents together",
            limit=limit.name, most=limit.most, counted=counted, within=within,
        )  # fmt: skip
