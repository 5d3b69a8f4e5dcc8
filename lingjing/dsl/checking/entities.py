"""Checkers of a mission's entities: assets and targets, single or in groups, with their properties."""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.dsl.checking.behaviours import BehaviourChecker
from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.bodies import reshaped
from lingjing.dsl.checking.equipment import EquipmentChecker
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.properties import lowered
from lingjing.dsl.checking.scope import DeclaredName, GroupInfo, PropertyType, TypeDecl
from lingjing.dsl.checking.settings import SettingsChecker, split_guarded
from lingjing.dsl.checking.types import ANY_RELATION, COMMON_KEYS, NO_SENSOR, SENSORS
from lingjing.dsl.checking.values import STATIC, UNKNOWN, Taint
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import DEGREES, NUMBER, POSITION, Type
from lingjing.mission.instance_entities import place_fault
from lingjing.mission.units import NONE
from lingjing.mission.vocabulary import MOTION

DEADLINE = "deadline"
"""The property of an entity with the mission time at which something must be done with it."""


class EntityChecker(DeclarationChecker):
    """Checks the entities of a mission."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.equipment = EquipmentChecker(blocks, settings)
        self.behaviours = BehaviourChecker(blocks)

    def head(self, node: s.EntityBlock) -> None:
        """Register the name before other declarations refer to it, with the facts that need no values."""
        decl = self._type_of(node)
        attributes: dict[str, PropertyType] = {"position": PropertyType(POSITION), "heading": PropertyType(DEGREES)}
        if decl is not None:
            attributes.update(decl.attributes)
        own = [item.name.text for item in (node.block.items if node.block else ()) if isinstance(item, s.PropertyLine)]
        if DEADLINE in own:
            attributes.setdefault(DEADLINE, PropertyType(COMMON_KEYS[DEADLINE].type))
        for item in node.block.items if node.block else ():
            if isinstance(item, s.PropertyLine) and item.hidden:
                known = attributes.get(item.name.text)
                step = self.of.step(f"`{node.name.text}.{item.name.text}`", item)
                state = item.state or (known is not None and known.state)
                attributes[item.name.text] = PropertyType(known.type if known else Type("any"), (step,), state)
            elif isinstance(item, s.PropertyLine) and item.state and item.name.text in attributes:
                attributes[item.name.text] = msgspec.structs.replace(attributes[item.name.text], state=True)
        cameras = [
            item.name.text for item in (node.block.items if node.block else ()) if isinstance(item, s.CameraBlock)
        ]
        self.scope.mounted[node.name.text] = cameras
        single = node.index is None
        kind: Literal["group", "entity"] = "entity" if single else "group"
        span = self.report.span(node.name.start, node.name.end)
        self.settings.declare(node.name, DeclaredName(kind, Type(kind, of=node.name.text), span))
        if node.name.text not in self.scope.groups:
            most = None if node.index is None else self._most(node.index)
            items = node.block.items if node.block else ()
            lines = {item.name.text: item.value for item in items if isinstance(item, s.PropertyLine)}
            counted = () if node.index is None else self.hidden_source(node.index)
            self.scope.groups[node.name.text] = GroupInfo(
                node.name.text, node.keyword, decl, attributes, lines, most, counted
            )

    def propagate_taints(self, node: s.EntityBlock) -> None:
        """Hide properties that are computed from hidden ones. It runs over all entities until nothing changes."""
        for item in node.block.items if node.block else ():
            if not isinstance(item, s.PropertyLine) or item.hidden:
                continue
            info = self.scope.groups[node.name.text]
            known = info.attributes.get(item.name.text)
            if known is None or known.taint:
                continue
            taint = self.hidden_source(item.value)
            if taint:
                step = self.of.step(f"`{node.name.text}.{item.name.text}`", item.name)
                info.attributes[item.name.text] = PropertyType(known.type, (*taint, step), known.state)

    def propagate_taint_to_region(self, node: s.RegionLine) -> None:
        """Hide a region around a hidden place. It is found by names alone, before regions are checked."""
        taint = () if node.name.text in self.scope.hidden_regions else self.hidden_source(node.shape)
        if taint:
            self.scope.hidden_regions[node.name.text] = (*taint, self.of.step(f"region `{node.name.text}`", node.name))

    def hidden_source(self, node: s.Expression) -> Taint:
        """The taint of the hidden value that an expression reads, found by names alone, since types are checked later.

        An entity without a field stands for its place: `distance_xy(victim[1], boat)`.
        """
        from lingjing.dsl.checking.calls import children

        waiting = [node]
        while waiting:
            part = waiting.pop()
            if isinstance(part, s.FieldExpr):
                base = part.base.base if isinstance(part.base, s.Subscript) else part.base
                info = self.scope.groups.get(base.text) if isinstance(base, s.Name) else None
                if info is not None:
                    attribute = info.attributes.get(part.name.text)
                    if attribute is not None and attribute.taint:
                        return attribute.taint
                    if isinstance(part.base, s.Subscript):
                        waiting.append(part.base.index)
                    continue
            elif isinstance(part, s.Name):
                taint = self._named_taint(part.text)
                if taint:
                    return taint
            waiting.extend(children(part))
        return ()

    def _named_taint(self, name: str) -> Taint:
        if name in self.scope.hidden_regions:
            return self.scope.hidden_regions[name]
        if name in self.scope.hidden_params:
            return self.scope.hidden_params[name]
        symbol, info = self.scope.symbols.get(name), self.scope.groups.get(name)
        if symbol is not None and symbol.taint:
            return symbol.taint
        place = info.attributes.get("position") if info is not None else None
        return place.taint if place is not None else ()

    def entity(self, node: s.EntityBlock) -> model.Group | None:
        """Check the statement `asset uav[1..n] : quadrotor { … }`."""
        decl = self.scope.types.get(node.type.text) if node.type else None
        if decl is not None and decl.role != node.keyword:
            decl = None
        count, index = self.count(node.index, of_hidden=self._hides_members(node))
        environment = STATIC.binding(index, NUMBER) if node.index is not None else STATIC
        what = f"`{node.name.text}`"
        keys = self._keys_of(decl)
        others = (s.CameraBlock, s.SettingsBlock) if node.keyword == "asset" else (s.BehaviourBlock,)
        plain, guarded = split_guarded(node.block)
        entries = self.blocks.read(plain, keys, what, environment=environment, others=others, lenient=decl is None)
        cameras, verbs = self.equipment.equipment(node, decl)
        guard = self.settings.guard(node.guard)
        if decl is None:
            return None
        self._needs_position(node, decl)
        for sensor in SENSORS:
            self._check_sensor(node, decl, sensor, entries.get(sensor))
        self._possible_places(entries.get("position"), decl.engine)
        if verbs:
            self._check_receipt_leak(node, entries)
        for entry in entries.values():
            self.blocks.check_state(entry.node, entry.value.type)
        labels = self._labels(entries, count, node)
        own = self._lowered(node, entries)
        alternatives = self.settings.alternatives(
            guarded, keys, what, lambda entries: self._lowered(node, entries), environment
        )
        anew = reshaped(set(entries))
        replaced = {prop.name for prop in own} | ({"look"} if anew else set())
        hidden = self._hidden_attributes(node, decl)
        inherited = tuple(
            msgspec.structs.replace(prop, hidden=True) if hidden and prop.name.startswith(hidden) else prop
            for prop in decl.properties
            if prop.name not in replaced
        )
        role: Literal["asset", "target"] = "asset" if node.keyword == "asset" else "target"
        behaviour = self.behaviours.of_target(node, (*own, *inherited), decl.engine, environment)
        return model.Group(
            name=node.name.text,
            role=role,
            type=decl.name,
            engine=decl.engine,
            count=count,
            index=index,
            hides_count=bool(self.scope.groups[node.name.text].count_taint),
            properties=(*own, *inherited),
            cameras=cameras,
            verbs=verbs,
            labels=labels,
            when=guard,
            bases=decl.bases,
            interactions=tuple(decl.interactions.values()),
            mounts=tuple(decl.mounts.values()),
            parts=() if anew else tuple(decl.parts.values()),
            behaviour=behaviour,
            alternatives=alternatives,
        )

    def _lowered(self, node: s.EntityBlock, entries: dict[str, PropertyEntry]) -> tuple[model.Property, ...]:
        """The mission's properties for the lines of an entity's block; a label is none."""
        attributes = self.scope.groups[node.name.text].attributes
        known = {name: attributes.get(name, _PUBLIC) for name in entries}
        return tuple(
            prop
            for name, entry in entries.items()
            if name not in ("label", "labels")
            for prop in lowered(entry, hidden=bool(known[name].taint), state=known[name].state)
        )

    def _check_sensor(
        self, node: s.EntityBlock, decl: TypeDecl, sensor: str, entry: PropertyEntry | None
    ) -> None:  # fmt: skip
        """Report a sensor on a body that cannot carry one."""
        if entry is not None and (node.keyword != "asset" or decl.engine in NO_SENSOR):
            what = "a target" if node.keyword != "asset" else f"a body of the engine `{decl.engine}`"
            hint = "assets of the other engines carry one: aircraft, dogs, road vehicles and vessels"
            self.report.at("LJ0109", entry.node, f"{what} cannot carry `{sensor}`", hint)

    def count(self, index: s.Expression | None, *, of_hidden: bool = False) -> tuple[ex.Expr | None, str]:
        """`[1..n]` or `[i in 1..n]`: the number of members and the name of the index.

        A hidden number is an error, unless the members are `of_hidden` places, so that no agent can count them.
        """
        if index is None:
            return None, "i"
        name, range_node = "i", index
        if isinstance(index, s.BinaryExpr) and index.operator == "in" and isinstance(index.left, s.Name):
            name, range_node = index.left.text, index.right
        value = self.of.value(range_node, STATIC)
        if value is UNKNOWN:
            return ex.Number(1.0), name
        if not isinstance(value.ir, ex.Range) or value.type.dimension != NONE:
            text = self.report.source.text[range_node.start : range_node.end]
            self.report.at(
                "LJ0111",
                range_node,
                "members are counted `1..n`",
                f"write `[1..{text}]`" if value.type.kind == "quantity" else "",
                replace=f"1..{text}" if value.type.kind == "quantity" else None,
            )
            return ex.Number(1.0), name
        if self.of.constant(value.ir.low) != 1.0:
            self.report.at("LJ0111", range_node, "a group has no such member", "members are counted from 1: `[1..n]`")
        high = self.of.constant(value.ir.high)
        if high is not None and (high < 0 or high != int(high) or high > 100_000):
            self.report.at("LJ0206", range_node, "a group has 0 to 100000 members, in whole numbers")
        if not of_hidden:
            self.blocks.leak(value.taint, range_node, "the number of members, whose places are not hidden")
        return value.ir.high, name

    # -- private

    def _hides_members(self, node: s.EntityBlock) -> bool:
        """True for targets with a hidden place: an agent does not observe them, so that it cannot count them."""
        place = self.scope.groups[node.name.text].attributes.get("position")
        return node.keyword == "target" and place is not None and bool(place.taint)

    def _most(self, index: s.Expression) -> float | None:
        """Most members of `[1..n]`; None if it is computed, or a param without bounds."""
        range_node = index.right if isinstance(index, s.BinaryExpr) and index.operator == "in" else index
        high = range_node.right if isinstance(range_node, s.BinaryExpr) and range_node.operator == ".." else None
        if isinstance(high, s.NumberLiteral) and not high.unit:
            return high.value
        return self.scope.ceilings.get(high.text) if isinstance(high, s.Name) else None

    def _type_of(self, node: s.EntityBlock) -> TypeDecl | None:
        if node.type is None:
            self.report.at(
                "LJ0106", node.name, f"`{node.name.text}` lacks a type", f"write `{node.keyword} {node.name.text} : …`"
            )
            return None
        decl = self.scope.types.get(node.type.text)
        if decl is None:
            fitting = [name for name, known in self.scope.types.items() if known.role == node.keyword]
            self.of.unknown_name(node.type, fitting or list(self.scope.types), f"no {node.keyword} type")
            return None
        if decl.role != node.keyword:
            place = node.type
            self.report.at(
                "LJ0112",
                place,
                f"`{decl.name}` is {'an asset' if decl.role == 'asset' else 'a target'} type",
                f"write `{decl.role} {node.name.text} : {decl.name}`",
            )
            return None
        return decl

    def _keys_of(self, decl: TypeDecl | None) -> dict[str, PropertyKey]:
        keys = dict(COMMON_KEYS)
        if decl is not None:
            for name, attribute in decl.attributes.items():
                if name not in keys:
                    keys[name] = PropertyKey(name, attribute.type, ANY_RELATION, hideable=True, public=False)
        return keys

    def _hidden_attributes(self, node: s.EntityBlock, decl: TypeDecl) -> tuple[str, ...]:
        """Attributes of the type that the block hides. The names of their lowered properties begin with them."""
        attributes = self.scope.groups[node.name.text].attributes
        return tuple(name for name, attribute in attributes.items() if attribute.taint and name in decl.attributes)

    def _check_receipt_leak(self, node: s.EntityBlock, entries: dict[str, PropertyEntry]) -> None:
        """Report hidden properties that receipts of commands reveal.

        An asset's band bounds its commands, and its speed decides their duration. Receipts report the clipping and the
        end of a command, so both are public.
        """
        for name in ("band", *MOTION) if node.keyword == "asset" else ():
            entry, known = entries.get(name), self.scope.groups[node.name.text].attributes.get(name)
            if known is not None:
                self.blocks.leak(known.taint, entry.node.value if entry else node.name, "the receipts of commands")

    def _needs_position(self, node: s.EntityBlock, decl: TypeDecl) -> None:
        items = node.block.items if node.block else ()
        is_declared = any(isinstance(item, s.PropertyLine) and item.name.text == "position" for item in items)
        faulty = any(isinstance(item, s.Faulty) for item in items)
        if not is_declared and not faulty and "position" not in decl.attributes:
            self.report.at(
                "LJ0106",
                node.name,
                f"`{node.name.text}` lacks `position`",
                "add `position = (… m, … m)` or `position ~ sites(…)`",
            )

    def _possible_places(self, entry: PropertyEntry | None, engine: str) -> None:
        """Report constant places that no scene contains."""
        for part in ex.parts(entry.value.ir) if entry else ():
            if entry is None or not isinstance(part, ex.Point):
                continue
            place = tuple(number for item in part.items if (number := self.of.constant(item)) is not None)
            fault = place_fault(place, engine) if len(place) == len(part.items) else ""
            if fault:
                value = entry.node.value
                hint = "look at the sign and the unit of the elevation"
                self.report.at("LJ0211", value, fault, hint)
                return

    def _labels(self, entries: dict[str, PropertyEntry], count: ex.Expr | None, node: s.EntityBlock) -> tuple[str, ...]:
        entry = entries.get("labels") or entries.get("label")
        if entry is None:
            return ()
        if isinstance(entry.value.ir, ex.Text):
            return (entry.value.ir.value,)
        items = entry.value.ir.items if isinstance(entry.value.ir, ex.Sequence) else ()
        if count is None and len(items) > 1:
            place = entry.node.value
            self.report.at("LJ0206", place, f"`{node.name.text}` is a single entity and has one label")
        return tuple(item.value for item in items if isinstance(item, ex.Text))


_PUBLIC = PropertyType(Type("any"))
