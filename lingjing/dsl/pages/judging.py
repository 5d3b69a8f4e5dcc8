"""The adjudication of a mission as one table: event, cause, distance, condition."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lingjing.dsl.printing.printer import Printer
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.alternatives import at_tier
from lingjing.mission.certain import Knowledge, truth
from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.intervals import Bounds
from lingjing.mission.values import Value

HEADS = ("Event", "Made true by", "Bounds", "In words")
"""The heads of the table; `judging` yields its rows."""


def judging(mission: model.Mission, tier: int = 0) -> Iterator[tuple[str, ...]]:
    """Yield a row for each rule, each interaction of the targets, and each inspection, as they are at a tier."""
    mission = at_tier(mission, tier)
    printer = Printer(mission)
    words = ConditionWords(printer.phrases.text, printer.phrases.declared())
    for rule in mission.rules:
        over = ", ".join(parameter.domain for parameter in rule.parameters)
        by = "a report" if rule.matching else "the kernel"
        bounds = ", ".join(words.bounds(rule.condition, {item.name: item.domain for item in rule.parameters}))
        yield f"**{rule.name}** ({over})" if over else f"**{rule.name}**", by, bounds, words.sentence(rule.condition)
    for group, item, before in interactions(mission):
        awaited = [words.sentence(condition) for condition in before if truth(condition, {}, _Start()) is not True]
        allowed = f"allowed when {awaited[0]}" if awaited else "allowed from the start"
        is_role = any(agent.role == item.by for agent in mission.agents)
        by = f"the role `{item.by}`" if is_role else f"the `{item.by}` engine"
        yield f"{item.name} ({group.name})", by, f"≤ {printer.text(item.within)}", allowed
    for route in mission.inspections:
        near = " or ".join(f"`{printer.text(by)}`" for by in route.by)
        order = "in their order" if route.order == "strict" else "in any order"
        sentence = f"{near} comes to every waypoint of the route of `{printer.text(route.asset)}`, {order}"
        yield f"**{route.name}** (route)", "the kernel", f"≤ {printer.text(route.within)}", sentence


def interactions(mission: model.Mission) -> Iterator[tuple[model.Group, model.Interaction, tuple[ex.Expr, ...]]]:
    """Yield (group, interaction, conditions that must hold before it) for the interactions of targets."""
    for group in mission.groups:
        for interaction in group.interactions:
            before = tuple(
                unlock.condition
                for unlock in mission.unlocks
                if unlock.interaction == interaction.name
                and group.name in {parameter.domain for parameter in unlock.parameters}
            )
            yield group, interaction, before


class _Start(Knowledge):
    """Knowledge before the first action: the time is not negative."""

    def name(self, ref: ex.Ref) -> Value:
        """The bounds of the time; None for every other name."""
        return Bounds(0.0, math.inf) if ref.kind == "clock" else None
