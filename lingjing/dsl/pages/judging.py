"""What is adjudicated, as one table: every event, who makes it true, within which distance, under which condition."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lingjing.dsl.printing.printer import Printer
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.certain import Knowledge, truth
from lingjing.mission.condition_words import ConditionWords
from lingjing.mission.intervals import Bounds
from lingjing.mission.values import Value

HEADS = ("Event", "Made true by", "Bounds", "In words")
"""The table's heads; `judging` gives its rows."""


def judging(mission: model.Mission) -> Iterator[tuple[str, ...]]:
    """A row for each rule, then for what the missions' targets offer: what an engine performs once it is allowed."""
    printer = Printer(mission)
    words = ConditionWords(printer.phrases.text, printer.phrases.declared())
    for rule in mission.rules:
        over = ", ".join(parameter.domain for parameter in rule.parameters)
        by = "a report" if rule.matching else "the kernel"
        bounds = ", ".join(words.bounds(rule.condition, {one.name: one.domain for one in rule.parameters}))
        yield f"**{rule.name}** ({over})" if over else f"**{rule.name}**", by, bounds, words.sentence(rule.condition)
    for group, one, before in interactions(mission):
        awaited = [words.sentence(condition) for condition in before if truth(condition, {}, _Start()) is not True]
        allowed = f"allowed when {awaited[0]}" if awaited else "allowed from the start"
        is_role = any(agent.role == one.by for agent in mission.agents)
        by = f"the role `{one.by}`" if is_role else f"the `{one.by}` engine"
        yield f"{one.name} ({group.name})", by, f"≤ {printer.text(one.within)}", allowed
    for route in mission.inspections:
        near = " or ".join(f"`{printer.text(by)}`" for by in route.by)
        order = "in their order" if route.order == "strict" else "in any order"
        said = f"{near} comes to every waypoint of the route of `{printer.text(route.asset)}`, {order}"
        yield f"**{route.name}** (route)", "the kernel", f"≤ {printer.text(route.within)}", said


def interactions(mission: model.Mission) -> Iterator[tuple[model.Group, model.Interaction, tuple[ex.Expr, ...]]]:
    """(group, interaction, what must be true before) of what targets offer."""
    for group in mission.groups:
        for one in group.interactions:
            before = tuple(
                unlock.condition
                for unlock in mission.unlocks
                if unlock.interaction == one.name and group.name in {given.domain for given in unlock.parameters}
            )
            yield group, one, before


class _Start(Knowledge):
    """What is known before anything is done: the time is not negative."""

    def name(self, ref: ex.Ref) -> Value:
        """The time, or nothing."""
        return Bounds(0.0, math.inf) if ref.kind == "clock" else None
