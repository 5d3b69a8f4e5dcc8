"""Checker of `behaviour flee { … }`, `wander` and `follow`: the motion of a target by itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, cast

from lingjing.dsl.checking.blocks import DeclarationChecker
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import Environment
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import KINDS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.natures import CITY
from lingjing.mission.vocabulary import BEHAVIOURS

SURFACES = ("ground", "road")
"""Surfaces that a target can move on by itself, besides the water on which one with a `drift` floats."""


class BehaviourChecker(DeclarationChecker):
    """Checks the behaviours of targets."""

    def of_target(
        self, node: s.EntityBlock, properties: Iterable[model.Property], engine: str, environment: Environment
    ) -> model.Behaviour | None:
        """The behaviour in the block of a target; None if it has none or a faulty one. `properties`: those of the
        target and of its type."""
        blocks = [item for item in (node.block.items if node.block else ()) if isinstance(item, s.BehaviourBlock)]
        if not blocks or node.keyword != "target":
            return None
        for extra in blocks[1:]:
            first = blocks[0].kind
            self.blocks.duplicate(extra.kind, first, f"`{node.name.text}` has two behaviours", "LJ0104")
        checked = self._behaviour(blocks[0], node, environment)
        return checked if self._can_move(blocks[0], node.name.text, properties, engine) else None

    # -- private

    def _behaviour(
        self, node: s.BehaviourBlock, target: s.EntityBlock, environment: Environment
    ) -> model.Behaviour | None:
        kind = node.kind.text
        if kind not in BEHAVIOURS:
            self.report.unknown("LJ0109", node.kind, f"no behaviour is called `{kind}`", tuple(BEHAVIOURS))
            return None
        known = KINDS["behaviour"].keys
        keys = {name: known[name] for name in BEHAVIOURS[kind]}
        entries = self.blocks.read(node.block, keys, f"`behaviour {kind}`", environment=environment)
        written = {item.name.text for item in node.block.items if isinstance(item, s.PropertyLine)}
        missing = [name for name in keys if name not in written]
        if missing:
            example = KINDS["behaviour"].example if kind == "flee" else _EXAMPLES[kind]
            self.report.at("LJ0106", node.kind, f"`behaviour {kind}` lacks `{missing[0]}`", f"write `{example}`")
        sound = [self._is_sound(entry) for entry in entries.values()]
        if entries.keys() != keys.keys() or not all(sound):
            return None
        values = {name: entry.value.ir for name, entry in entries.items()}
        region = values.get("in")
        return model.Behaviour(
            kind=cast('Literal["flee", "wander", "follow"]', kind),
            speed=values["speed"],
            of=values.get("from", values.get("of")),
            distance=values.get("within", values.get("distance")),
            region=region.name if isinstance(region, ex.Ref) else "",
        )

    def _is_sound(self, entry: PropertyEntry) -> bool:
        """True for a value that a behaviour can have; the reasons against any other value are reported.

        `lingjing.mission.conditions.exposures` finds the motion of a target with a public place by a hidden one.
        """
        name, value, place = entry.key.name, entry.value, entry.node.value
        if name in ("from", "of"):
            if value.type.kind not in ("entity", "group"):
                message = f"`{name}` names an asset, a target or a group, this is {with_article(value.type)}"
                self.report.at("LJ0201", place, message)
                return False
        elif name == "in" and not isinstance(value.ir, ex.Ref):
            self.report.at("LJ0201", place, "`in` takes the name of a region", "declare it: `region area = …`")
            return False
        elif name != "in" and not self._is_fixed(value.ir):
            message = f"`{name}` of a behaviour depends on a drawn value"
            self.report.at("LJ0307", place, message, "write a number, or a param with a fixed default")
            return False
        return True

    def _is_fixed(self, value: ex.Expr) -> bool:
        """True if a number depends on no draw: proofs hold for every seed and read it."""
        named = (part for part in ex.parts(value) if isinstance(part, ex.Ref))
        return all(part.kind == "param" and part.name in self.scope.constants for part in named)

    def _can_move(self, node: s.BehaviourBlock, target: str, properties: Iterable[model.Property], engine: str) -> bool:
        words = {prop.name: prop.value for prop in properties}
        surface, blocks = words.get("on"), words.get("blocks")
        fault = ""
        if engine != CITY:
            fault = f"is played by the engine `{engine}`"
        elif isinstance(surface, ex.Symbol) and surface.name not in SURFACES:
            fault = f"stands on a `{surface.name}`"
        elif isinstance(blocks, ex.Flag) and blocks.value:
            fault = "blocks a road"
        if fault:
            hint = f"it needs the engine `{CITY}`, the surface {' or '.join(SURFACES)} (or a `drift`), and no `blocks`"
            self.report.at("LJ0110", node.kind, f"`{target}` {fault}, so it has no behaviour", hint)
        return not fault


_EXAMPLES = {
    "wander": "behaviour wander { in = area, speed = 1 m/s }",
    "follow": "behaviour follow { of = dog, speed = 1 m/s, distance = 10 m }",
}
"""Examples of the behaviours that the table of statements does not show."""
