"""Checkers of values of params: sweeps (`sweep team over uavs in [1, 2, 3]`) and tiers (`tier 1 { claims }`)."""

from __future__ import annotations

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.scope import PARAMS, DeclaredName
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import FLAG, Type
from lingjing.mission.tiers import HIGHEST, PLAYED
from lingjing.mission.units import NONE

MOST = 10_000
"""Most combinations of one sweep (chosen): such a study runs for weeks, so a larger one is a mistake."""


class StudyChecker(DeclarationChecker):
    """Checks the sweeps and the tiers of one mission, and the settings of its expectations."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.bounds: dict[str, ex.Expr | None] = {}
        self.seen: dict[str, Span] = {}
        self.tiers: dict[int, s.NumberLiteral] = {}

    def sweep(self, node: s.SweepLine) -> model.Sweep | None:
        """Check the statement `sweep name over param in [values], … when …`."""
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

    def tier(self, node: s.TierBlock) -> model.Tier | None:
        """`tier 1 { claims, victims = 4 }`: a switch that is named alone is set to `true`."""
        if isinstance(node.level, s.Broken):  # `tier 1e999`: its error is already reported
            return None
        level = int(node.level.value)
        if node.level.unit or level != node.level.value or not 1 <= level <= PLAYED:
            reserved = f"; 2 to {HIGHEST} are reserved" if 2 <= level <= HIGHEST else ""
            hint = "write `tier 1 { … }`" if level else "tier 0 is the mission with the defaults of its params"
            self.report.at("LJ0206", node.level, f"only tier 1 can be declared{reserved}", hint)
            return None
        if level in self.tiers:
            first = self.tiers[level]
            self.blocks.duplicate(node.level, first, f"`tier {level}` is given twice")
            return None
        self.tiers[level] = node.level
        settings: dict[str, model.Setting] = {}
        for item in node.block.items:
            setting = self._tier_setting(item)
            if setting is not None and setting.name in settings:
                self.report.at("LJ0103", item, f"`{setting.name}` is set twice")
            elif setting is not None:
                settings[setting.name] = setting
        return model.Tier(level=level, settings=tuple(settings.values()))

    # -- private

    def _tier_setting(self, item: s.Statement) -> model.Setting | None:
        if isinstance(item, s.Bare) and self._param(item.name) is not None:
            value: s.Expression = s.FlagLiteral(item.start, item.end, True)
            return self.setting(s.Axis(item.start, item.end, item.name, value))
        if isinstance(item, s.PropertyLine) and item.relation == "=" and item.guard is None and not item.hidden:
            return self.setting(s.Axis(item.start, item.end, item.name, item.value))
        if not isinstance(item, s.Bare | s.Faulty):
            self.blocks.misplaced(item, "`tier`")
        return None

    def _param(self, name: s.Name) -> DeclaredName | None:
        """The declaration of a param or switch. Reports an unknown one."""
        symbol = self.scope.symbols.get(name.text)
        if symbol is None or symbol.kind not in PARAMS:
            params = [each for each, known in self.scope.symbols.items() if known.kind in PARAMS]
            self.of.unknown_name(name, params, "no param")
            return None
        return symbol

    def setting(self, axis: s.Axis) -> model.Setting | None:
        """`name = value` of a tier or an expectation: a number within the param's bounds, or `true` or `false`."""
        symbol = self._param(axis.name)
        if symbol is None or symbol.type.kind == "any":
            return None
        if symbol.kind == "switch":
            value = self.of.expect(axis.values, STATIC, FLAG, f"`{axis.name.text}`")
            return model.Setting(name=axis.name.text, value=value.ir) if isinstance(value.ir, ex.Flag) else None
        value = self.of.value(axis.values, STATIC)
        if value is UNKNOWN:
            return None
        self.blocks.leak(value.taint, axis.values, f"the value of `{axis.name.text}`")
        number = self.of.constant(value.ir)
        if value.type.kind != "quantity" or number is None:
            self.report.at("LJ0201", axis.values, f"the value of `{axis.name.text}` is one number")
            return None
        if (value.type.dimension or NONE) != (symbol.type.dimension or NONE):
            due, actual = with_article(symbol.type), with_article(Type("quantity", value.type.dimension or NONE))
            self.report.at("LJ0203", axis.values, f"`{axis.name.text}` is {due}, this is {actual}")
            return None
        self._in_bounds(axis, number)
        return model.Setting(name=axis.name.text, value=value.ir)

    def _in_bounds(self, axis: s.Axis, number: float) -> None:
        bounds = self.bounds.get(axis.name.text)
        if isinstance(bounds, ex.Range):
            low, high = self.of.constant(bounds.low), self.of.constant(bounds.high)
            outside = (low is not None and number < low) or (high is not None and number > high)
        elif isinstance(bounds, ex.Sequence):
            allowed = [self.of.constant(item) for item in bounds.items]
            outside = None not in allowed and number not in allowed
        else:
            outside = False
        if outside:
            message = f"{number:g} is outside of the bounds of `{axis.name.text}`"
            self.report.at("LJ0206", axis.values, message)

    def _axis(self, axis: s.Axis) -> tuple[ex.Expr, ...] | None:
        symbol = self._param(axis.name)
        if symbol is None:
            return None
        if symbol.kind == "switch":
            return self._flags(axis)
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

    def _flags(self, axis: s.Axis) -> tuple[ex.Expr, ...] | None:
        """The values of a switch in a sweep: `[false, true]`."""
        listed = axis.values.items if isinstance(axis.values, s.List) else ()
        if listed and all(isinstance(item, s.FlagLiteral) for item in listed):
            return tuple(ex.Flag(item.value) for item in listed if isinstance(item, s.FlagLiteral))
        hint = f"write `{axis.name.text} in [false, true]`"
        self.report.at("LJ0201", axis.values, f"`{axis.name.text}` is true or false", hint)
        return None

    def _items(self, node: s.Expression, ir: ex.Expr) -> tuple[ex.Expr, ...] | None:
        if isinstance(ir, ex.Sequence):
            if not ir.items:
                self.report.at("LJ0206", node, "the sweep has no values")
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
