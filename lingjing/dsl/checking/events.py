"""Checkers of scripted events: `event squall at 12 tick { weather { … }, appear jam[2] }`."""

from __future__ import annotations

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.units import TICKS, TIME, si_value, unit_of


class EventChecker(DeclarationChecker):
    """Checks the events of one mission."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.seen: dict[str, Span] = {}

    def event(self, node: s.EventBlock) -> model.EventDeclaration | None:
        """`event name at 12 tick { … }`, `event name at ~ uniform(5 tick, 20 tick) { … }`."""
        self.report.once(self.seen, node.name, "the event")
        at = self._time(node)
        changes = [self._change(item, node) for item in node.block.items if not isinstance(item, s.Faulty)]
        guard = self.settings.guard(node.guard)
        if not node.block.items:
            self.report.at(
                "LJ0106", node.name, f"the event `{node.name.text}` changes nothing",
                "add `weather { … }`, `appear …` or `vanish …`")  # fmt: skip
            return None
        if at is None or None in changes:
            return None
        kept = tuple(change for change in changes if change is not None)
        return model.EventDeclaration(name=node.name.text, at=at.ir, changes=kept, when=guard)

    def after_the_end(self, node: s.EventBlock, budget: model.BudgetDeclaration, clock: model.ClockDeclaration) -> None:
        """Warn of an event that comes after the last tick of the episode."""
        ticks, tick_s = self.of.constant(budget.ticks), self.of.constant(clock.tick)
        if not isinstance(node.at, s.NumberLiteral) or node.drawn or ticks is None or not tick_s:
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

    # -- private

    def _time(self, node: s.EventBlock) -> TypedExpression | None:
        value = self.of.calls.draw(node.at, STATIC) if node.drawn else self.of.value(node.at, STATIC)
        if value is UNKNOWN:
            return None
        if value.type.kind != "quantity" or value.type.dimension not in (TICKS, TIME):
            unit = value.type.dimension == (0,) * 8
            code = "LJ0202" if unit else "LJ0203" if value.type.kind == "quantity" else "LJ0201"
            message = f"an event's time is in ticks or seconds, this is {with_article(value.type)}"
            bare = isinstance(node.at, s.NumberLiteral) and not node.at.unit
            text = self.report.source.text[node.at.start : node.at.end] if bare else "12"
            hint = f"write `{text} tick`, or `{text} s`" if bare else "write `at 12 tick` or `at 90 s`"
            self.report.at(code, node.at, message, hint, replace=f"{text} tick" if bare else None)
            return None
        number = self.of.constant(value.ir)
        if number is not None and number < 0:
            self.report.at("LJ0206", node.at, "an event cannot come before the mission begins")
            return None
        self.blocks.leak(value.taint, node.at, f"the time of the event `{node.name.text}`")
        counted_in = "s" if value.type.dimension == TIME else "tick"
        return msgspec.structs.replace(value, ir=_in_unit(value.ir, counted_in))

    def _change(self, item: s.Statement, node: s.EventBlock) -> model.Change | None:
        if isinstance(item, s.SettingsBlock) and item.keyword == "weather":
            if item.preset is None and not item.block.items:
                message, hint = "this `weather` changes nothing", "write `weather { visibility = 1 km }`"
                self.report("LJ0512", item.start, item.end, message, hint, severity="warning")
            return model.Change(kind="weather", weather=self.settings.weather(item))
        if not isinstance(item, s.ChangeLine):
            self.blocks.misplaced(item, f"the event `{node.name.text}`", ("weather", "appear", "vanish"))
            return None
        value = self.of.value(item.entity, STATIC)
        if value is UNKNOWN:
            return None
        if value.type.kind not in ("entity", "group") or self.scope.groups[value.type.of].role != "target":
            shown = with_article(value.type)
            if value.type.kind in ("entity", "group"):
                shown = f"the asset `{value.type.of}`"
            self.report.at("LJ0201", item.entity, f"only a target can {item.keyword}, this is {shown}")
            return None
        if isinstance(value.ir, ex.Index):
            self.blocks.leak(value.taint, item.entity, f"the event `{node.name.text}`")
        return model.Change(kind="appear" if item.keyword == "appear" else "vanish", entity=value.ir)


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
