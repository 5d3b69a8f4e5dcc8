"""What an agent is told of the mission's rules: a sentence each, made from the very rules that the kernel evaluates.

Conditions name hidden entities by their group (`victim`) and hold no value that the mission marks hidden. Nothing is
said of events that are still to come.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.expression import Expr, Number
from lingjing.mission.instance import Instance, InteractionSpec, LimitSpec
from lingjing.mission.instance_text import InstanceText, public_values


def rule_sentences(instance: Instance) -> tuple[str, ...]:
    """How the mission is won and lost, what counts, what may be done, what is forbidden; without full stops."""
    return tuple(_Rules(instance).sentences())


class _Rules:
    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._words = ConditionWords(InstanceText(instance).text, public_values(instance))

    def sentences(self) -> Iterator[str]:
        yield f"The mission is won when {self._condition(self._instance.success, {})}"
        if self._instance.failure is not None:
            yield f"The mission is lost when {self._condition(self._instance.failure, {})}"
        yield from self._adjudicated()
        yield from self._interactions()
        yield from self._inspections()
        yield from self._permits()
        yield from map(_limit, self._instance.limits)
        yield from self._constraints()
        yield from self._timed_stages()

    def _condition(self, condition: Expr, domains: Mapping[str, str]) -> str:
        """The condition, with the bounds of what is measured in it behind."""
        bounds = ", ".join(self._words.bounds(condition, domains))
        return self._words.sentence(condition) + (f" [{bounds}]" if bounds else "")

    def _adjudicated(self) -> Iterator[str]:
        for rule in self._instance.rules:
            domains = {one.name: one.domain for one in rule.parameters}
            over = ", ".join(f"{domain} `{name}`" for name, domain in domains.items())
            whom = f" for {over}" if over else ""
            once = "; each report is matched with one target of its picture at most" if rule.matching else ""
            yield f"*{rule.name}* holds{whom} when {self._condition(rule.condition, domains)}{once}"

    def _interactions(self) -> Iterator[str]:
        groups = {entity.group: entity for entity in self._instance.entities}
        for group, entity in groups.items():
            for one in entity.interactions:
                actors = ", ".join(f"`{actor.id}`" for actor in self._instance.actors(one)) or "nobody here"
                yield (
                    f"`{one.name}` is done to a {group} by {actors} within {one.within_m:g} m{_course(one)}"
                    + "".join(
                        f", once {self._condition(unlock.condition, {})}"
                        for unlock in self._instance.unlocks
                        if unlock.interaction == one.name and group in {given.domain for given in unlock.parameters}
                    )
                )

    def _inspections(self) -> Iterator[str]:
        for one in self._instance.inspections:
            order = "in their order" if one.order == "strict" else "in any order"
            by = " or ".join(f"`{name}`" for name in one.by)
            again = f"; a `{one.replan}` message asks for another route around its position" if one.replan else ""
            yield (
                f"the route of `{one.asset}` is inspected (*{one.name}*) when {by} has come within {one.within_m:g} m "
                f"(horizontally) of each of its waypoints, {order}{again}; a new route is inspected anew"
            )

    def _permits(self) -> Iterator[str]:
        for one in self._instance.permits:
            what = f"`{one.verb}` of `{one.resource}`" if one.verb else f"every command to `{one.resource}`"
            yield f"{what} is rejected until {self._condition(one.condition, {})} (`stop` is always taken)"

    def _constraints(self) -> Iterator[str]:
        for one in self._instance.constraints:
            domains = {one.variable: one.domain} if one.variable and one.domain else {}
            each = f" for each {one.domain} `{one.variable}`" if domains else ""
            cost = f"at a penalty of {one.penalty.value:g}" if isinstance(one.penalty, Number) else "at a penalty"
            price = "the mission fails" if one.kind == "hard" else cost
            yield f"always{each}: {self._condition(one.condition, domains)}; else {price}"

    def _timed_stages(self) -> Iterator[str]:
        for stage in self._instance.stages:
            if isinstance(stage.ticks, Number):
                domains = {stage.variable: stage.domain} if stage.variable and stage.domain else {}
                each = f" of each {stage.domain} `{stage.variable}`" if domains else ""
                when = self._condition(stage.condition, domains)
                yield f"the stage *{stage.name}*{each} must be done within {stage.ticks.value:g} ticks: when {when}"


def _course(one: InteractionSpec) -> str:
    """How long an interaction takes and what it moves."""
    lasting = f", who stays there for {one.lasting_s:g} s" if one.lasting_s else ""
    taken = f", which lowers its {one.takes}" if one.takes else ""
    source = f" by what the actor's {one.source} allows" if one.takes and one.source else ""
    given = f", which raises the actor's {one.gives} up to its {one.up_to}" if one.gives else ""
    return f"{lasting}{taken}{source}{given}"


def _limit(limit: LimitSpec) -> str:
    counted = ", ".join(
        f"`{one.name}` messages"
        if one.kind == "message"
        else f"{f'`{one.name}` commands' if one.name else 'commands'} to `{one.resource}`"
        for one in limit.counts
    )
    within = f" within the stage *{limit.stage}*" if limit.stage else ""
    return f"*{limit.name}*: at most {limit.most} of {counted}{within} by all agents together"
