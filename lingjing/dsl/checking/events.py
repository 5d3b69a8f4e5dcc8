"""Checkers of events: `event squall at 12 tick { weather { … }, appear jam[2] }`, `event surge when … until … { … }`.

A new kind of effect is a statement with `event` among its places, a kind of `lingjing.mission.model.Change`, and a row
of `_EFFECTS`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.properties import suffix_of
from lingjing.dsl.checking.rules import way_back
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.status_words import status_side
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import RULE, STATIC, UNKNOWN, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import KINDS, keyword_of
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import FLAG, Type
from lingjing.mission.natures import is_never_negative
from lingjing.mission.units import TICKS, TIME, si_value, unit_of


class EventChecker(DeclarationChecker):
    """Checks the events of one mission."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings

    def head(self, node: s.EventBlock) -> None:
        """Register the event's name, for `count(…)`."""
        self.report.once(self.scope.events, node.name, "the event")

    def cycles(
        self, nodes: list[s.EventBlock], events: tuple[model.EventDeclaration, ...], rules: tuple[model.Rule, ...]
    ) -> None:
        """Report events with a condition over themselves, directly or through rules and other events."""
        reads = {event.name: _counted(event, rules) & self.scope.events.keys() for event in events}
        ways = {name: sorted(value) for name, value in reads.items() if value}
        by_name = {node.name.text: node.name for node in nodes}
        reported: set[str] = set()
        for name in ways:
            way = way_back(name, ways)
            if way and name in by_name and not reported.intersection(way):
                reported.update(way)
                message = f"the condition of the event `{name}` depends on the event itself: {' → '.join(way)}"
                self.report.at(
                    "LJ0308", by_name[name], message, "use `until` to undo it, and `repeat every` to repeat it"
                )

    def event(self, node: s.EventBlock) -> model.EventDeclaration | None:
        """Check the statement `event name at 12 tick { … }`, `event name at ~ uniform(5 tick, 20 tick) { … }`."""
        at = None if node.at is None else self._time(node, node.at)
        condition = self._condition(node.condition, "`when`")
        until = self._condition(node.until, "`until`")
        pause = None if node.pause is None else self._pause(node, node.pause)
        items = [item for item in node.block.items if not isinstance(item, s.Faulty)]
        changes = [self._change(item, node) for item in items]
        self._check_contradictions(items, changes, node)
        guard = self.settings.guard(node.guard)
        if not node.block.items:
            hint = f"add {', '.join(f'`{word} …`' for word in _EFFECTS)}"
            self.report.at("LJ0106", node.name, f"the event `{node.name.text}` changes nothing", hint)
            return None
        parts = ((node.at, at), (node.condition, condition), (node.until, until), (node.pause, pause))
        if None in changes or any(written is not None and part is None for written, part in parts):
            return None
        return model.EventDeclaration(
            name=node.name.text,
            at=None if at is None else at.ir,
            condition=condition,
            until=until,
            pause=pause,
            changes=tuple(change for change in changes if change is not None),
            when=guard,
        )

    def after_the_end(self, node: s.EventBlock, budget: model.BudgetDeclaration, clock: model.ClockDeclaration) -> None:
        """Warn of an event that comes after the last tick of the episode."""
        ticks, tick_s = self.of.constant(budget.ticks), self.of.constant(clock.tick)
        if node.at is None or not isinstance(node.at, s.NumberLiteral) or node.drawn or ticks is None or not tick_s:
            return
        unit = unit_of(node.at.unit)
        if unit is None or unit.dimension not in (TICKS, TIME):
            return
        at = si_value(node.at.value, node.at.unit) / (1.0 if unit.dimension == TICKS else tick_s)
        if at > ticks:
            message = f"the event `{node.name.text}` comes after the last of {ticks:g} ticks"
            self.report.at(
                "LJ0512", node.at, message, "let it come earlier, or give a larger budget", severity="warning"
            )

    def never_closed(self, nodes: list[s.EventBlock], events: tuple[model.EventDeclaration, ...]) -> None:
        """Report roads that an event reopens and that no event closes."""
        changes = [change for event in events for change in event.changes]
        closed = {change.region for change in changes if change.kind == "close"}
        never = {change.region for change in changes if change.kind == "reopen"} - closed
        for node in nodes:
            for item in node.block.items:
                if isinstance(item, s.RoadLine) and item.keyword == "reopen" and isinstance(item.region, s.Name):
                    region = item.region.text
                    if region in never:
                        message = f"no event closes `{region}`, so that `{node.name.text}` cannot reopen it"
                        hint = f"write `close {region}` in an earlier event, or remove the line"
                        self.report.at("LJ0512", item.region, message, hint, severity="warning")

    # -- private

    def _check_contradictions(
        self, items: list[s.Statement], changes: list[model.Change | None], node: s.EventBlock
    ) -> None:
        """Report two effects of one event on one thing: only one of them can hold."""
        first: dict[object, s.Statement] = {}
        for item, change in zip(items, changes, strict=True):
            for subject in () if change is None else _subjects(change):
                known = first.setdefault(subject, item)
                if known is not item:
                    name = self.report.source.text[known.start : known.end].partition("{")[0].strip()
                    message = f"the event `{node.name.text}` has two effects on one thing; the other is `{name}`"
                    self.report("LJ0103", item.start, item.end, message, "keep one of them, or write two events")
                    break

    def _condition(self, node: s.Expression | None, what: str) -> ex.Expr | None:
        value = UNKNOWN if node is None else self.of.expect(node, RULE, FLAG, what)
        return None if value is UNKNOWN else value.ir

    def _pause(self, node: s.EventBlock, written: s.Expression) -> ex.Expr | None:
        value = self.of.expect(written, STATIC, Type("quantity", TIME), "the pause of `repeat every`")
        self.blocks.leak(value.taint, written, f"the pause of the event `{node.name.text}`")
        seconds = self.of.constant(value.ir)
        if seconds is not None and seconds <= 0:
            message = f"the event `{node.name.text}` would repeat without end"
            self.report.at("LJ0206", written, message, "give a pause above 0 s: `repeat every 60 s`")
            return None
        return None if value is UNKNOWN else value.ir

    def _time(self, node: s.EventBlock, written: s.Expression) -> TypedExpression | None:
        value = self.of.calls.draw(written, STATIC) if node.drawn else self.of.value(written, STATIC)
        if value is UNKNOWN:
            return None
        if value.type.kind != "quantity" or value.type.dimension not in (TICKS, TIME):
            unit = value.type.dimension == (0,) * 8
            code = "LJ0202" if unit else "LJ0203" if value.type.kind == "quantity" else "LJ0201"
            message = f"an event's time is in ticks or seconds, this is {with_article(value.type)}"
            bare = isinstance(written, s.NumberLiteral) and not written.unit
            text = self.report.source.text[written.start : written.end] if bare else "12"
            hint = f"write `{text} tick`, or `{text} s`" if bare else "write `at 12 tick` or `at 90 s`"
            self.report.at(code, written, message, hint, replace=f"{text} tick" if bare else None)
            return None
        number = self.of.constant(value.ir)
        if number is not None and number < 0:
            self.report.at("LJ0206", written, "an event cannot come before the mission begins")
            return None
        self.blocks.leak(value.taint, written, f"the time of the event `{node.name.text}`")
        counted_in = "s" if value.type.dimension == TIME else "tick"
        return msgspec.structs.replace(value, ir=_in_unit(value.ir, counted_in))

    def _change(self, item: s.Statement, node: s.EventBlock) -> model.Change | None:
        keyword = keyword_of(item)
        check = _EFFECTS.get(keyword or "")
        if check is None:
            self.blocks.misplaced(item, f"the event `{node.name.text}`", _EFFECTS)
            return None
        return check(self, item, node)

    def _weather(self, item: s.SettingsBlock, node: s.EventBlock) -> model.Change:
        if item.preset is None and not item.block.items:
            message, hint = "this `weather` changes nothing", "write `weather { visibility = 1 km }`"
            self.report("LJ0512", item.start, item.end, message, hint, severity="warning")
        return model.Change(kind="weather", weather=self.settings.weather(item))

    def _presence(self, item: s.ChangeLine, node: s.EventBlock) -> model.Change | None:
        entity = self._target(item.entity, node, item.keyword)
        if entity is None:
            return None
        return model.Change(kind="appear" if item.keyword == "appear" else "vanish", entity=entity.ir)

    def _state(self, item: s.StateLine, node: s.EventBlock) -> model.Change | None:
        named = item.target
        if not isinstance(named, s.FieldExpr):
            self.report.at(
                "LJ0201", named, "`change` gives a state of a target another value", "write `change fire.heat to 0.8`"
            )
            return None
        entity = self._target(named.base, node, "be set by an event")
        if entity is None:
            return None
        group, name = self.scope.groups[entity.type.of], named.name
        if name.text == "status":
            member = TypedExpression(ex.Ref(group.name, "group"), Type("status", of=group.name))
            word = status_side(self.of, member, item.value, RULE)
            if word is UNKNOWN:
                return None
            return model.Change(kind="change", entity=entity.ir, field="status", value=word.ir)
        known = group.attributes.get(name.text)
        if known is None or not known.state:
            states = [each for each, attribute in group.attributes.items() if attribute.state]
            message = f"`{name.text}` of `{group.name}` is no state, so no event changes it"
            self.report.unknown("LJ0102", name, message, [*states, "status"])
            return None
        value = self.of.expect(item.value, RULE, known.type, f"`{name.text}`")
        if value is UNKNOWN:
            return None
        number = self.of.constant(value.ir)
        interactions = group.type.interactions.values() if group.type is not None else ()
        if number is not None and number < 0 and is_never_negative(name.text, interactions):
            self.report.at("LJ0206", item.value, f"`{name.text}` of `{group.name}` is never below 0", "give 0 or more")
            return None
        stored = name.text + suffix_of(known.type.dimension)
        return model.Change(kind="change", entity=entity.ir, field=stored, value=value.ir)

    def _roads(self, item: s.RoadLine, node: s.EventBlock) -> model.Change | None:
        region = self._region(item.region, node)
        if region is None:
            return None
        return model.Change(kind="close" if item.keyword == "close" else "reopen", region=region)

    def _comms(self, item: s.SettingsBlock, node: s.EventBlock) -> model.Change:
        return self._radio(item, "comms", "")

    def _jam(self, item: s.JamBlock, node: s.EventBlock) -> model.Change | None:
        region = self._region(item.region, node)
        return None if region is None else self._radio(item, "jam", region)

    def _radio(self, item: s.SettingsBlock | s.JamBlock, kind: Literal["comms", "jam"], region: str) -> model.Change:
        if not item.block.items:
            message, hint = f"this `{kind}` changes nothing", "write `loss = 80 %` or `range <= 50 m`"
            self.report("LJ0512", item.start, item.end, message, hint, severity="warning")
        entries = self.blocks.read(item.block, KINDS["jam"].keys, f"`{kind}` of an event")
        values = {name: entry.value.ir for name, entry in entries.items()}
        return model.Change(kind=kind, region=region, loss=values.get("loss"), range=values.get("range"))

    def _region(self, written: s.Expression, node: s.EventBlock) -> str | None:
        """The name of the region that an effect names; None for another expression, which is reported."""
        value = self.of.value(written, STATIC)
        if value is UNKNOWN:
            return None
        if not isinstance(value.ir, ex.Ref) or value.type.kind != "region":
            is_region = value.type.kind == "region"
            shown = "a region without a name" if is_region else with_article(value.type)
            shape = self.report.source.text[written.start : written.end] if is_region else "…"
            message = f"the name of a region is due here, this is {shown}"
            self.report.at("LJ0201", written, message, f"declare it: `region bridge = {shape}`")
            return None
        self.blocks.leak(value.taint, written, f"the event `{node.name.text}`")
        return value.ir.name

    def _target(self, written: s.Expression, node: s.EventBlock, action: str) -> TypedExpression | None:
        """The target or group of targets that an effect names; None for another expression, which is reported."""
        value = self.of.value(written, STATIC)
        if value is UNKNOWN:
            return None
        if value.type.kind not in ("entity", "group") or self.scope.groups[value.type.of].role != "target":
            shown = with_article(value.type)
            if value.type.kind in ("entity", "group"):
                shown = f"the asset `{value.type.of}`"
            self.report.at("LJ0201", written, f"only a target can {action}, this is {shown}")
            return None
        if isinstance(value.ir, ex.Index):
            self.blocks.leak(value.taint, written, f"the event `{node.name.text}`")
        return value


_EFFECTS: dict[str, Callable[[EventChecker, Any, s.EventBlock], model.Change | None]] = {
    "weather": EventChecker._weather,
    "appear": EventChecker._presence,
    "vanish": EventChecker._presence,
    "change": EventChecker._state,
    "close": EventChecker._roads,
    "reopen": EventChecker._roads,
    "comms": EventChecker._comms,
    "jam": EventChecker._jam,
}
"""Keyword of an effect → its check."""


def _subjects(change: model.Change) -> tuple[object, ...]:
    """The things that an effect sets. Two effects with one of them in common contradict each other."""
    match change.kind:
        case "weather":
            return tuple(("weather", prop.name) for prop in change.weather)
        case "appear" | "vanish":
            return (("presence", change.entity),)
        case "close" | "reopen":
            return (("roads", change.region),)
        case "change":
            return (("value", change.entity, change.field),)
        case _:
            numbers = (("loss", change.loss), ("range", change.range))
            return tuple((change.kind, change.region, name) for name, number in numbers if number is not None)


def _counted(event: model.EventDeclaration, rules: tuple[model.Rule, ...]) -> set[str]:
    """The events and interactions that the conditions and values of an event count, also through rules."""
    conditions = {rule.name: rule.condition for rule in rules}
    waiting = [event.condition, event.until, *(change.value for change in event.changes)]
    counted: set[str] = set()
    expanded: set[str] = set()
    while waiting:
        condition = waiting.pop()
        calls = (part for part in ex.parts(condition) if isinstance(part, ex.Call)) if condition is not None else ()
        for call in calls:
            if call.rule and call.function in conditions and call.function not in expanded:
                expanded.add(call.function)
                waiting.append(conditions[call.function])
            elif call.function == "count" and isinstance(call.arguments[0], ex.Symbol):
                counted.add(call.arguments[0].name)
    return counted


def _in_unit(ir: ex.Expr, unit: str) -> ex.Expr:
    """The time with its unit, if it has one: `wait` becomes `wait + 0 s`."""
    if isinstance(ir, ex.Number):
        return ir
    if isinstance(ir, ex.Draw):
        first, *others = ir.arguments
        return msgspec.structs.replace(ir, arguments=(_in_unit(first, unit), *others))
    if isinstance(ir, ex.Sequence) and ir.items:
        return ex.Sequence((_in_unit(ir.items[0], unit), *ir.items[1:]))
    return ir if _says_unit(ir) else ex.Binary("+", ir, ex.Number(0.0, unit))


def _says_unit(ir: ex.Expr) -> bool:
    return isinstance(ir, ex.Binary) and isinstance(ir.right, ex.Number) and ir.operator == "+"
