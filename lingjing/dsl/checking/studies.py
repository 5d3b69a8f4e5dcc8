"""Checkers of matched studies: `sweep team over uavs in [1, 2, 3] when mode == broadcast`."""

from __future__ import annotations

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import Type
from lingjing.mission.units import NONE

MOST = 10_000
"""Most combinations of one sweep (chosen): such a study runs for weeks, so a larger one is a mistake."""


class StudyChecker(DeclarationChecker):
    """Checks the sweeps of one mission."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.bounds: dict[str, ex.Expr | None] = {}
        self.seen: dict[str, Span] = {}

    def sweep(self, node: s.SweepLine) -> model.Sweep | None:
        """`sweep name over param in [values], … when …`."""
        self.report.once(self.seen, node.name, "the sweep")
        with self.of.without_clock():
            axes = [self._axis(axis) for axis in node.axes]
            guard = self.settings.guard(node.guard)
        names = [axis.name for axis in node.axes]
        for position, name in enumerate(names):
            if any(name.text == other.text for other in names[:position]):
                self.report.at("LJ0103", name, f"`{name.text}` is swept twice")
                return None
        if None in axes:
            return None
        values = tuple(axis for axis in axes if axis is not None)
        size = 1
        for column in values:
            size *= len(column)
        if size > MOST:
            self.report(
                "LJ0503",
                node.name.start,
                node.axes[-1].end,
                f"the sweep `{node.name.text}` has {size:,} combinations",
                f"at most {MOST:,} are possible: sweep fewer params or fewer values",
            )
            return None
        return model.Sweep(name=node.name.text, parameters=tuple(n.text for n in names), values=values, when=guard)

    # -- private

    def _axis(self, axis: s.Axis) -> tuple[ex.Expr, ...] | None:
        symbol = self.scope.symbols.get(axis.name.text)
        if symbol is None or symbol.kind != "param":
            params = [name for name, known in self.scope.symbols.items() if known.kind == "param"]
            self.of.unknown_name(axis.name, params, "no param")
            return None
        node = axis.values
        value = self.of.value(node, STATIC)
        if value is UNKNOWN or symbol.type.kind == "any":
            return None
        self.blocks.leak(value.taint, node, f"the sweep over `{axis.name.text}`")
        if value.type.kind not in ("list", "range") or value.type.item not in (None, "quantity"):
            self.report.at(
                "LJ0201",
                node,
                f"the values of a sweep are a list or a range, this is {with_article(value.type)}",
                f"write `{axis.name.text} in [1, 2, 3]`",
            )
            return None
        if (value.type.dimension or NONE) != (symbol.type.dimension or NONE):
            due = with_article(symbol.type)
            actual = with_article(Type("quantity", value.type.dimension or NONE))
            self.report.at("LJ0203", node, f"`{axis.name.text}` is {due}, the values are {actual}s")
            return None
        items = self._items(node, value.ir)
        return items if items is not None and self._allowed(axis, items) else None

    def _items(self, node: s.Expression, ir: ex.Expr) -> tuple[ex.Expr, ...] | None:
        if isinstance(ir, ex.Sequence):
            if not ir.items:
                self.report.at("LJ0206", node, "a sweep over nothing")
            return ir.items or None
        assert isinstance(ir, ex.Range)
        low, high = self.of.constant(ir.low), self.of.constant(ir.high)
        if low is None or high is None or low != int(low) or high != int(high):
            self.report.at("LJ0206", node, "a range is swept in whole numbers", "list the values instead")
            return None
        if high - low >= MOST:
            self.report.at(
                "LJ0503", node, f"the range has {high - low + 1:,.0f} values", f"at most {MOST:,} are possible"
            )
            return None
        unit = ir.low.unit if isinstance(ir.low, ex.Number) else ""
        return tuple(ex.Number(float(k), unit) for k in range(int(low), int(high) + 1))

    def _allowed(self, axis: s.Axis, items: tuple[ex.Expr, ...]) -> bool:
        bounds = self.bounds.get(axis.name.text)
        if not isinstance(bounds, ex.Range):
            return True
        low, high = self.of.constant(bounds.low), self.of.constant(bounds.high)
        for item in items:
            number = self.of.constant(item)
            if number is not None and ((low is not None and number < low) or (high is not None and number > high)):
                message = f"{number:g} is outside of the bounds of `{axis.name.text}`"
                self.report.at("LJ0206", axis.values, message)
                return False
        return True
