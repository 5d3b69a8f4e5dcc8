"""Checkers of a mission's settings: scene, clock, budget, weather, parameters, mode, regions, grids, comms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal

import msgspec

from lingjing.dsl.checking.blocks import DeclarationChecker
from lingjing.dsl.checking.corrections import range_of
from lingjing.dsl.checking.keys import PropertyEntry, word_of
from lingjing.dsl.checking.properties import lowered
from lingjing.dsl.checking.scope import DeclaredName
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN, Environment, TypedExpression
from lingjing.dsl.source.reporter import Change
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey, keyed
from lingjing.dsl.syntax.statements import DRAWN, KINDS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.clock import clock_fault
from lingjing.mission.functions import FLAG, METRES, NUMBER, POSITIONS, REGION, TEXT, Type
from lingjing.mission.kinds import builtin_scenes, scene_kind
from lingjing.mission.kinds_format import SceneOption
from lingjing.mission.units import LENGTH
from lingjing.mission.vocabulary import MODES

OWN_NAMES = {"mode": "the mode of the episode", "now": "the time since the beginning", "tick": "the length of a tick"}
"""Names that expressions have without a declaration → their meaning."""

_SCENE_KEYS = keyed(
    PropertyKey("datum", Type("level")),
    PropertyKey("origin", Type("position", of="degrees")),
    PropertyKey("layout", NUMBER, DRAWN, low=0, whole=True),
    PropertyKey("displacement", METRES, low=0),
)
"""Properties of every scene. `layout` selects another scene of the same kind. `displacement` limits the distance from a
body's declared place to its place in the scene."""

_OPTION_TYPES = {
    "text": TEXT, "path": TEXT, "number": NUMBER, "metres": METRES, "size": Type("size"),
    "range": Type("range", LENGTH), "positions": POSITIONS, "region": REGION,
}  # fmt: skip


ALLOWANCES = ("tokens", "money", "messages")
"""Budgets that an agent may have of its own."""
_DEADLINES = {"policy": 90.0, "engine": 30.0, "capture": 10.0}
"""Default deadlines in seconds: the paper's limits, for a budget that declares only ticks."""


def scene_keys(kind: str) -> dict[str, PropertyKey]:
    """The properties of a scene: its own options, and those of built-in scenes, which `scene_faults` rejects with a
    reason.
    """
    known = scene_kind(kind)
    kinds = (*builtin_scenes().values(), *((known,) if known else ()))
    options = {name: option for each in kinds for name, option in each.options.items()}
    own = known.options if known else options
    return _SCENE_KEYS | {name: _option_key(name, option, name in own) for name, option in options.items()}


def _option_key(name: str, option: SceneOption, own: bool) -> PropertyKey:
    low, above = (None, 0.0) if option.type == "metres" else (option.low if option.type == "number" else None, None)
    relations = DRAWN if option.drawn else ("=",)
    return PropertyKey(name, _OPTION_TYPES[option.type], relations, low=low, above=above, proposed=own)


class SettingsChecker(DeclarationChecker):
    """Checks settings of a mission. A method for each kind returns its part of the graph, or None if it is faulty."""

    def declare(self, name: s.Name, symbol: DeclaredName) -> None:
        """Register a name for expressions. Reports a second declaration, and a name with a built-in meaning."""
        if name.text in OWN_NAMES:
            self.report.at("LJ0104", name, f"`{name.text}` means {OWN_NAMES[name.text]}", "choose another name")
            return
        first = self.scope.symbols.get(name.text)
        if first is None:
            self.scope.symbols[name.text] = symbol
            return

        self.report.declared_twice(name, f"`{name.text}`", first.span)

    def scene(self, node: s.SceneBlock) -> model.Scene:
        """Check the statement `scene kind { … }`."""
        keys = scene_keys(node.kind.text)
        plain, guarded = split_guarded(node.block)
        entries = self.blocks.read(plain, keys, "`scene`")
        self._map_beside(entries.get("map"))
        alternatives = self.alternatives(guarded, keys, "`scene`", _lowered)
        return model.Scene(kind=node.kind.text, options=_lowered(entries), alternatives=alternatives)

    def clock(self, node: s.SettingsBlock) -> model.ClockDeclaration | None:
        """Check the statement `clock { tick = …, sync = … }`. The tick must be a multiple of the macro-step."""
        with self.of.without_clock():
            entries = self.blocks.read(node.block, KINDS["clock"].keys, "`clock`", owner=node)
        if len(entries) < 2:
            return None
        tick, sync = entries["tick"], entries["sync"]
        a, b = self.of.constant(tick.value.ir), self.of.constant(sync.value.ir)
        fault = "" if a is None or b is None else clock_fault(a, b)
        if fault:
            place = sync.node.value
            self.report.at("LJ0501", place, fault)
            return None
        return model.ClockDeclaration(tick=tick.value.ir, sync=sync.value.ir)

    def budget(self, node: s.SettingsBlock) -> model.BudgetDeclaration | None:
        """Check the statement `budget { ticks <= …, … }`. Missing deadlines get the values of the paper."""
        entries = self.blocks.read(node.block, KINDS["budget"].keys, "`budget`", owner=node)
        if "ticks" not in entries:
            return None
        limits = {
            name: entries[name].value.ir if name in entries else ex.Number(default, "s")
            for name, default in _DEADLINES.items()
        }
        spent = {name: entries[name].value.ir for name in ALLOWANCES if name in entries}
        return model.BudgetDeclaration(ticks=entries["ticks"].value.ir, **limits, **spent)

    def allowance(self, node: s.SettingsBlock) -> model.AllowanceDeclaration:
        """Check `budget { tokens <= …, money <= …, messages <= … }` of one agent."""
        keys = {name: KINDS["budget"].keys[name] for name in ALLOWANCES}
        entries = self.blocks.read(node.block, keys, "an agent's `budget`", owner=node)
        return model.AllowanceDeclaration(**{name: entry.value.ir for name, entry in entries.items()})

    def weather(self, node: s.SettingsBlock) -> tuple[model.Property, ...]:
        """Check `weather { … }`, or `weather storm { … }`: a preset with changes, without its alternatives."""
        entries = self.blocks.read(split_guarded(node.block)[0], KINDS["weather"].keys, "`weather`")
        return _lowered({**self._preset(node.preset), **entries})

    def weather_alternatives(self, node: s.SettingsBlock) -> tuple[model.Alternative, ...]:
        """The lines of `weather { … }` with a condition."""
        return self.alternatives(split_guarded(node.block)[1], KINDS["weather"].keys, "`weather`", _lowered)

    def alternatives(
        self,
        lines: Iterable[s.PropertyLine],
        keys: dict[str, PropertyKey],
        what: str,
        lower: Callable[[dict[str, PropertyEntry]], tuple[model.Property, ...]],
        environment: Environment = STATIC,
        *,
        lenient: bool = False,
    ) -> tuple[model.Alternative, ...]:
        """Lines with `when`, as `guarded_lines` checks them; `lower` gives the properties of each."""
        checked = self.guarded_lines(lines, keys, what, environment, lenient=lenient)
        return tuple(model.Alternative(properties=lower(entries), when=guard) for entries, guard in checked)

    def guarded_lines(
        self,
        lines: Iterable[s.PropertyLine],
        keys: dict[str, PropertyKey],
        what: str,
        environment: Environment = STATIC,
        *,
        lenient: bool = False,
    ) -> Iterator[tuple[dict[str, PropertyEntry], model.Guard]]:
        """Check lines with `when` like lines without, and yield the entry and the condition of each correct one."""
        optional = {name: msgspec.structs.replace(key, required=False) for name, key in keys.items()}
        for line in lines:
            bare = msgspec.structs.replace(line, guard=None)
            block = s.BracedBlock(line.start, line.end, (bare,))
            entries = self.blocks.read(block, optional, what, environment=environment, lenient=lenient)
            guard = self.guard(line.guard)
            if entries and guard is not None:
                yield entries, guard

    def mode(self, node: s.ModeLine) -> model.Modes | None:
        """Check the statement `mode default in { … }`."""
        names = [name.text for name in node.allowed.names]
        for position, name in enumerate(node.allowed.names):
            if name.text not in MODES:
                self.report.unknown("LJ0109", name, f"no mode is called `{name.text}`", MODES)
                self.scope.poisoned.add(name.text)
                return None
            if name.text in names[:position]:
                self.report.at("LJ0103", name, f"`{name.text}` is given twice")
        if node.default.text not in names:
            default = node.default
            self.report.unknown("LJ0109", default, f"the mode `{default.text}` is not among those allowed", names)
            return None
        if "single" in names and len(names) > 1:
            self.report.at(
                "LJ0504",
                node.allowed,
                "`single` excludes other modes: its one agent sends no messages",
                "write `mode single`",
            )
            return None
        return model.Modes(default=node.default.text, allowed=tuple(dict.fromkeys(names)))

    def param(self, node: s.Param) -> model.Parameter | None:
        """Check the statement `param name = default in low..high`."""
        with self.of.without_clock():
            return self._param(node)

    def _drawn_param(self, node: s.Param) -> model.Parameter | None:
        """Check the statement `param name ~ integer(2, 5)`."""
        if isinstance(node.value, s.BinaryExpr) and node.value.operator == "in":
            place = node.value
            hint, edits = "leave the bounds out", ((place.left.end, place.right.end, ""),)
            self.report.at("LJ0110", place.right, "a drawn param has the bounds of its distribution", hint, edits=edits)
            return self._drawn_param(msgspec.structs.replace(node, value=place.left))
        value = self.of.calls.draw(node.value, STATIC)
        if value is not UNKNOWN and value.type.kind != "quantity":
            self.report.at("LJ0201", node.value, f"a param is a number, this draws {with_article(value.type)}")
            value = UNKNOWN
        self.blocks.leak(value.taint, node.value, f"the param `{node.name.text}`")
        span = self.report.span(node.name.start, node.name.end)
        taint = self.scope.hidden_params.get(node.name.text, ())
        self.declare(node.name, DeclaredName("param", Type("any") if value is UNKNOWN else value.type, span, taint))
        if value is UNKNOWN:
            return None
        return model.Parameter(name=node.name.text, default=value.ir, hidden=node.hidden)

    def _param(self, node: s.Param) -> model.Parameter | None:
        if node.drawn:
            return self._drawn_param(node)
        if isinstance(node.value, s.FlagLiteral):
            span = self.report.span(node.name.start, node.name.end)
            self.declare(node.name, DeclaredName("switch", FLAG, span))
            return model.Parameter(name=node.name.text, default=ex.Flag(node.value.value))
        default_node, bounds_node = self._default_and_bounds(node.value)
        default = self.of.expect(default_node, STATIC, Type("quantity"), f"the param `{node.name.text}`")
        bounds = self._bounds(node, bounds_node, default) if bounds_node is not None else None
        for value, place in ((default, default_node), (bounds, bounds_node)):
            if value is not None and place is not None:
                self.blocks.leak(value.taint, place, f"the param `{node.name.text}`")
        kind = default.type if default is not UNKNOWN and bounds is not UNKNOWN else Type("any")
        span = self.report.span(node.name.start, node.name.end)
        self.declare(node.name, DeclaredName("param", kind, span))  # without a taint: a leak is reported only here
        constant = self.of.constant(default.ir)
        if constant is not None and default is not UNKNOWN:
            self.scope.constants[node.name.text] = constant
        if default is UNKNOWN or bounds is UNKNOWN:
            return None
        self._default_in_bounds(default_node, default, bounds, bounds_node)
        return model.Parameter(name=node.name.text, default=default.ir, bounds=bounds.ir if bounds else None)

    def _default_and_bounds(self, node: s.Expression) -> tuple[s.Expression, s.Expression | None]:
        """The two parts of a param's value. Reports `2 in 1 to 4`, and reads it as `2 in 1..4`."""
        inside = node.left if isinstance(node, s.BinaryExpr) and node.operator == "to" else node
        if not isinstance(inside, s.BinaryExpr) or inside.operator != "in":
            return node, None
        if inside is node or not isinstance(node, s.BinaryExpr):
            return inside.left, inside.right
        text, low, high = self.report.source.text, inside.right, node.right
        written = f"{text[low.start : low.end]}..{text[high.start : high.end]}"
        edits = ((low.end, high.start, ".."),)
        self.report("LJ0205", low.start, high.end, "`to` makes no range", f"write `{written}`", edits=edits)
        return inside.left, s.Broken(low.start, high.end)

    def region(self, node: s.RegionLine) -> model.RegionDeclaration | None:
        """Check the statement `region name = polygon(…)`."""
        shape = self.of.expect(node.shape, STATIC, REGION, f"the region `{node.name.text}`")
        taint = (*shape.taint, self.of.step(f"region `{node.name.text}`", node.name)) if shape.taint else ()
        span = self.report.span(node.name.start, node.name.end)
        self.declare(node.name, DeclaredName("region", REGION, span, taint))
        if shape is UNKNOWN:
            return None
        self._outline(node.shape, shape.ir)
        return model.RegionDeclaration(name=node.name.text, shape=shape.ir, hidden=bool(taint))

    def grid(self, node: s.GridBlock) -> model.Grid | None:
        """Check the statement `grid name over region { … }`."""
        region = self.scope.symbols.get(node.region.text)
        if region is None or region.kind != "region":
            regions = [name for name, symbol in self.scope.symbols.items() if symbol.kind == "region"]
            self.of.unknown_name(node.region, regions, "no region")
        taint = (*region.taint, self.of.step(f"grid `{node.name.text}`", node.name)) if region and region.taint else ()
        span = self.report.span(node.name.start, node.name.end)
        self.declare(node.name, DeclaredName("grid", Type("grid", of=node.name.text), span, taint))
        entries = self.blocks.read(node.block, KINDS["grid"].keys, "`grid`", owner=node)
        if "shape" not in entries:
            return None
        rows, columns = entries["shape"].parts
        overlap = entries["overlap"].value.ir if "overlap" in entries else ex.Number(0.0)
        return model.Grid(
            name=node.name.text,
            region=node.region.text,
            rows=rows.ir,
            columns=columns.ir,
            overlap=overlap,
            seen=entries["seen"].value.ir if "seen" in entries else None,
        )

    def comms(self, node: s.SettingsBlock) -> model.Comms:
        """Check the statement `comms { … }`.

        The only possible condition of a hub is `mode == star`, because only star mode has a hub.
        """
        entries = self.blocks.read(node.block, KINDS["comms"].keys, "`comms`")
        hub = entries.get("hub")
        name = None
        if hub is not None:
            name = self._hub(hub)
        return model.Comms(
            hub=name,
            delay=entries["delay"].value.ir if "delay" in entries else None,
            payload=entries["payload"].value.ir if "payload" in entries else None,
            range=entries["range"].value.ir if "range" in entries else None,
            loss=entries["loss"].value.ir if "loss" in entries else None,
            receipts=_receipts(word_of(entries, "receipts")),
        )

    def guard(self, node: s.Expression | None, environment: Environment = STATIC) -> model.Guard | None:
        """`when …` after a declaration: a condition over mode and params, and over the names of `environment`."""
        if node is None:
            return None
        value = self.of.expect(node, environment, FLAG, "`when`")
        self.blocks.leak(value.taint, node, "a declaration's condition")
        return model.Guard(condition=value.ir)

    # -- private

    def _preset(self, name: s.Name | None) -> dict[str, PropertyEntry]:
        if name is None:
            return {}
        decl = self.scope.weathers.get(name.text)
        if decl is None:
            self.of.unknown_name(name, list(self.scope.weathers), "no weather")
            return {}
        return decl.entries

    def _map_beside(self, entry: PropertyEntry | None) -> None:
        """Check the path of a map. A map is a file of the project, so its path must not lead out of the project's
        folder.
        """
        if entry is None or not isinstance(entry.value.ir, ex.Text):
            return
        words = entry.value.ir.value.replace("\\", "/").split("/")
        if ".." in words or not words[0] or ":" in words[0]:
            place = entry.node.value
            hint = "put the map beside the mission and name it from there"
            self.report.at("LJ0122", place, "the path leads out of the project", hint)

    def _bounds(self, node: s.Param, bounds: s.Expression, default: TypedExpression) -> TypedExpression:
        if isinstance(bounds, s.List):
            value = self.of.value(bounds, STATIC)
            same = default is UNKNOWN or value is UNKNOWN or value.type.dimension == default.type.dimension
            if same:
                return value
            self.of.mismatch(
                bounds, value, default.type, f"the values allowed for `{node.name.text}` are of another dimension"
            )
            return UNKNOWN
        due = Type("range", default.type.dimension if default is not UNKNOWN else None)
        value = self.of.value(bounds, STATIC)
        if value.type.kind == "range" and due.dimension is not None and value.type.dimension != due.dimension:
            self.report.at(
                "LJ0203",
                bounds,
                f"{with_article(due)} is due for the bounds of `{node.name.text}`, this is {with_article(value.type)}",
            )
            return UNKNOWN
        return value if self.of.fits(value, due, bounds, f"the bounds of `{node.name.text}`") else UNKNOWN

    def _default_in_bounds(
        self,
        node: s.Expression,
        default: TypedExpression,
        bounds: TypedExpression | None,
        node_of_bounds: s.Expression | None,
    ) -> None:
        number = self.of.constant(default.ir)
        if bounds is None or number is None:
            return
        if isinstance(bounds.ir, ex.Sequence):
            allowed = [self.of.constant(item) for item in bounds.ir.items]
            if None not in allowed and number not in allowed:
                right = None if node_of_bounds is None else range_of(node_of_bounds, self.report.source)
                hint: str = ""
                edits: tuple[Change, ...] = ()
                if right is not None and node_of_bounds is not None and None not in allowed:
                    hint, edits = f"for a range write `{right}`", ((node_of_bounds.start, node_of_bounds.end, right),)
                self.report.at("LJ0206", node, "the default is none of the values allowed", hint, edits=edits)
            return
        if not isinstance(bounds.ir, ex.Range):
            return
        low, high = self.of.constant(bounds.ir.low), self.of.constant(bounds.ir.high)
        if (low is not None and number < low) or (high is not None and number > high):
            self.report.at("LJ0206", node, "the default is outside of its bounds")

    def _outline(self, node: s.Expression, shape: ex.Expr) -> None:
        """A polygon of constant corners must enclose an area without crossing itself."""
        if not (isinstance(shape, ex.Call) and shape.function == "polygon"):
            return
        corners: list[tuple[float, float]] = []
        for argument in shape.arguments:
            if not isinstance(argument, ex.Point):
                return
            east, north = (self.of.constant(item) for item in argument.items[:2])
            if east is None or north is None:
                return
            corners.append((east, north))
        from lingjing.mission.geometry2d import fault

        wrong = fault(tuple(corners))
        if wrong:
            self.report.at("LJ0208", node, f"the outline {wrong}", "list the corners in order around the area")

    def _hub(self, hub: PropertyEntry) -> str | None:
        guard, node = hub.node.guard, hub.node.value
        if guard is not None:
            condition = self.of.expect(guard, STATIC, FLAG, "`when`")
            star = ex.Binary("==", ex.Ref("mode", "mode"), ex.Symbol("star"))
            if condition is not UNKNOWN and condition.ir != star:
                self.report.at("LJ0307", guard, "a hub exists in star mode only", "write `when mode == star`")
                return None
        if not isinstance(node, s.Name):
            self.report.at("LJ0201", node, "the hub is one agent", "name a single agent, not a group's member")
            return None
        if node.text not in self.scope.agents:
            if node.text == NO_HUB:
                return None
            self.of.unknown_name(node, list(self.scope.agents), "no agent")
            return None
        return node.text


NO_HUB = "none"
"""Word in `hub = none`, which removes the hub of the extended mission."""


def _receipts(word: str) -> Literal["own", "all", "none"]:
    return "all" if word == "all" else "none" if word == "none" else "own"


def split_guarded(block: s.BracedBlock | None) -> tuple[s.BracedBlock | None, tuple[s.PropertyLine, ...]]:
    """A block without its property lines that have a condition, and these lines."""
    items = block.items if block is not None else ()
    guarded = tuple(item for item in items if isinstance(item, s.PropertyLine) and item.guard is not None)
    if block is None or not guarded:
        return block, ()
    plain = tuple(item for item in items if not isinstance(item, s.PropertyLine) or item.guard is None)
    return msgspec.structs.replace(block, items=plain), guarded


def _lowered(entries: dict[str, PropertyEntry]) -> tuple[model.Property, ...]:
    return tuple(prop for entry in entries.values() for prop in lowered(entry))
