"""What is adjudicated, as one table: every event, who makes it true, within which distance, under which condition."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.dsl.print import Printer
from lingjing.dsl.words import Words
from lingjing.mission import expression as ex
from lingjing.mission import model

HEADS = ("Event", "Made true by", "Bounds", "In words")
"""The table's heads; `judging` gives its rows."""

_DISTANCES = ("distance", "distance_xy")


def judging(mission: model.Mission) -> Iterator[tuple[str, ...]]:
    """A row for each rule, then for what the missions' targets offer: what an engine performs once it is allowed."""
    printer = Printer(mission)
    words = Words(printer.phrases)
    for rule in mission.rules:
        over = ", ".join(parameter.domain for parameter in rule.parameters)
        by = "a report" if rule.matching else "the kernel"
        bounds = ", ".join(dict.fromkeys(_bounds(rule.condition, _Given(mission, rule.parameters), printer)))
        yield f"**{rule.name}** ({over})" if over else f"**{rule.name}**", by, bounds, words.sentence(rule.condition)
    for group, one, before in interactions(mission):
        awaited = [words.sentence(condition) for condition in before if not _at_once(condition)]
        allowed = f"allowed when {awaited[0]}" if awaited else "allowed from the start"
        yield f"{one.name} ({group.name})", f"the `{one.by}` engine", f"≤ {printer.text(one.within)}", allowed
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


def _at_once(condition: ex.Expr) -> bool:
    """Whether a condition is `now >= 0 s`: how a mission says that nothing need be done first."""
    return (
        isinstance(condition, ex.Binary)
        and condition.operator == ">="
        and isinstance(condition.left, ex.Ref)
        and condition.left.name == "now"
        and isinstance(condition.right, ex.Number)
        and condition.right.value <= 0
    )


class _Given:
    """The declared properties of what a rule's parameters range over."""

    def __init__(self, mission: model.Mission, parameters: tuple[model.RuleParameter, ...]) -> None:
        self._domains = {parameter.name: parameter.domain for parameter in parameters}
        self._values = {(group.name, prop.name): prop.value for group in mission.groups for prop in group.properties}

    def value(self, node: ex.Expr) -> ex.Expr:
        """What `h.radius` is declared to be; anything else as it is."""
        if isinstance(node, ex.Attr) and isinstance(node.base, ex.Ref):
            group = self._domains.get(node.base.name, node.base.name)
            return self._values.get((group, node.name), node)
        return node


def _bounds(condition: object, given: _Given, printer: Printer) -> Iterator[str]:
    """`≤ 25 m` for each bounded distance, `IoU ≥ 0.5` for each overlap, in reading order."""
    if isinstance(condition, tuple):
        for item in condition:
            yield from _bounds(item, given, printer)
    elif isinstance(condition, ex.Node):
        if isinstance(condition, ex.Binary) and isinstance(condition.left, ex.Call):
            bound = printer.text(given.value(condition.right))
            if condition.left.function in _DISTANCES and condition.operator in ("<=", "<"):
                yield f"{'≤' if condition.operator == '<=' else '<'} {bound}"
            elif condition.left.function == "iou" and condition.operator == ">=":
                yield f"IoU ≥ {bound}"
        for name in condition.__struct_fields__:
            yield from _bounds(getattr(condition, name), given, printer)
