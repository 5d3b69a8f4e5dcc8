"""Checks of what has a body: asset and target types, and a mission's entities with their cameras and actions."""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.dsl import syntax as s
from lingjing.dsl.blocks import BlockReader, Entry, Key
from lingjing.dsl.properties import lowered
from lingjing.dsl.scope import (
    STATIC,
    UNKNOWN,
    Attribute,
    Environment,
    GroupInfo,
    RecordDecl,
    Scope,
    Symbol,
    Taint,
    TypeDecl,
)
from lingjing.dsl.settings import SettingsChecker
from lingjing.dsl.suggest import did_you_mean, nearest
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import DEGREES, FIELD_TYPES, NUMBER, POSITION, TEXT, Type
from lingjing.mission.units import BY_NAME, NONE, TIME, dimension_unit

CHANNELS = ("rgb", "depth", "semantic")
VIEWS = ("nadir", "front", "oblique")
CAPTURES = ("on_request", "each_tick")
CATEGORIES = ("report", "assignment", "target_status", "other")
_ANY_RELATION = ("=", "~", "<=")

CAMERA_KEYS = {
    key.name: key
    for key in (
        Key("view", Type("name"), choices=VIEWS),
        Key("size", Type("size"), required=True),
        Key("hfov", DEGREES, required=True, above=0, high=179),
        Key("channels", Type("list", item="name"), choices=CHANNELS, required=True),
        Key("capture", Type("name"), choices=CAPTURES),
    )
}
INTERACTION_KEYS = {
    key.name: key
    for key in (
        Key("by", Type("name"), choices=None),
        Key("within", Type("quantity", (1, 0, 0, 0, 0, 0, 0, 0)), above=0),
        Key("lasting", Type("quantity", TIME), low=0),
    )
}
COMMON_KEYS = {
    key.name: key
    for key in (
        Key("position", POSITION, ("=", "~"), hideable=True, public=False),
        Key("heading", DEGREES, ("=", "~"), hideable=True, public=False),
        Key("label", TEXT),
        Key("labels", Type("list", item="text")),
    )
}
"""What every entity may be given, whatever its type."""


class EntityChecker:
    """Types at the top of files, entities in missions."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        self.blocks = blocks
        self.settings = settings
        self.of = blocks.of
        self.report = blocks.report
        self.scope: Scope = blocks.of.scope

    # -- types

    def type(self, node: s.EntityBlock) -> TypeDecl | None:
        """An asset or target type: engine, properties, verbs, interactions."""
        if node.index is not None or node.type is not None or node.guard is not None:
            wrong = node.index or node.type or node.guard
            assert wrong is not None
            self.report(
                "LJ0110",
                wrong.start,
                wrong.end,
                f"outside of a mission `{node.keyword} {node.name.text}` declares a type",
                f"write `{node.keyword} {node.name.text} {{ … }}`",
            )
        attributes: dict[str, Attribute] = {}
        properties: list[model.Property] = []
        verbs: dict[str, model.Verb] = {}
        interactions: list[str] = []
        engine = ""
        seen: dict[str, s.Property] = {}
        for item in node.block.items if node.block else ():
            if isinstance(item, s.Property) and item.name.text == "engine":
                engine = self._engine(item, seen)
            elif isinstance(item, s.Property):
                entry = self._type_property(item, seen)
                if entry is not None:
                    attributes[item.name.text] = _attribute(entry, self)
                    properties.extend(lowered(entry, inherited=True))
            elif isinstance(item, s.VerbLine):
                self._add_verb(item, verbs)
            elif isinstance(item, s.InteractionBlock):
                interactions.append(item.name.text)
                properties.extend(self._interaction(item))
            elif not isinstance(item, s.Faulty):
                self.blocks.misplaced(
                    item, f"the {node.keyword} type `{node.name.text}`", ("engine", "verb", "interaction")
                )
        faulty = any(isinstance(item, s.Faulty) for item in (node.block.items if node.block else ()))
        if not engine and "engine" not in seen and not faulty:
            self.report(
                "LJ0106",
                node.name.start,
                node.name.end,
                f"the type `{node.name.text}` lacks `engine`",
                "add `engine = …`: who moves it",
            )
        return TypeDecl(
            node.name.text,
            node.keyword,
            engine,
            attributes,
            tuple(properties),
            verbs,
            tuple(interactions),
            self.report.span(node.name.start, node.name.end),
        )

    def record(self, node: s.RecordBlock) -> RecordDecl | None:
        """`record name : category { fields }`."""
        category = node.category
        if category.text not in CATEGORIES:
            self.report(
                "LJ0109",
                category.start,
                category.end,
                f"no category of messages is called `{category.text}`",
                did_you_mean(category.text, CATEGORIES),
                replace=nearest(category.text, CATEGORIES),
            )
        fields: dict[str, model.Field] = {}
        for item in node.block.items:
            if isinstance(item, s.FieldLine):
                field = self._field(item.typed)
                if field is not None and field.name in fields:
                    self.report("LJ0103", item.start, item.end, f"the field `{field.name}` is given twice")
                elif field is not None:
                    fields[field.name] = field
            elif not isinstance(item, s.Faulty):
                self.blocks.misplaced(item, f"the record `{node.name.text}`")
        if category.text not in CATEGORIES:
            return None
        kind: Literal["report", "assignment", "target_status", "other"] = category.text  # type: ignore[assignment]
        return RecordDecl(
            node.name.text, kind, tuple(fields.values()), self.report.span(node.name.start, node.name.end)
        )

    # -- entities of a mission

    def head(self, node: s.EntityBlock) -> None:
        """Make the name known before anything refers to it, with what can be said without its values."""
        decl = self._type_of(node)
        attributes: dict[str, Attribute] = {"position": Attribute(POSITION), "heading": Attribute(DEGREES)}
        if decl is not None:
            attributes.update(decl.attributes)
        for item in node.block.items if node.block else ():
            if isinstance(item, s.Property) and item.hidden:
                known = attributes.get(item.name.text)
                step = self.of.step(f"`{node.name.text}.{item.name.text}`", item)
                attributes[item.name.text] = Attribute(known.type if known else Type("any"), (step,))
        single = node.index is None
        kind: Literal["group", "entity"] = "entity" if single else "group"
        span = self.report.span(node.name.start, node.name.end)
        self.settings.declare(node.name, Symbol(kind, Type(kind, of=node.name.text), span))
        if node.name.text not in self.scope.groups:
            self.scope.groups[node.name.text] = GroupInfo(node.name.text, node.keyword, decl, attributes, single)

    def taints(self, node: s.EntityBlock) -> None:
        """Properties computed from hidden ones are hidden too; runs until nothing changes, over all entities."""
        for item in node.block.items if node.block else ():
            if not isinstance(item, s.Property) or item.hidden:
                continue
            info = self.scope.groups[node.name.text]
            known = info.attributes.get(item.name.text)
            if known is None or known.taint:
                continue
            taint = self.hidden_source(item.value)
            if taint:
                step = self.of.step(f"`{node.name.text}.{item.name.text}`", item.name)
                info.attributes[item.name.text] = Attribute(known.type, (*taint, step))

    def hidden_source(self, node: s.Expression) -> Taint:
        """The hidden attribute an expression reads, found by its names alone (types are checked later)."""
        from lingjing.dsl.calls import children

        waiting = [node]
        while waiting:
            part = waiting.pop()
            if isinstance(part, s.Attribute):
                base = part.base.base if isinstance(part.base, s.Subscript) else part.base
                info = self.scope.groups.get(base.text) if isinstance(base, s.Name) else None
                attribute = info.attributes.get(part.name.text) if info else None
                if attribute is not None and attribute.taint:
                    return attribute.taint
            elif isinstance(part, s.Name):
                symbol = self.scope.symbols.get(part.text)
                if symbol is not None and symbol.taint:
                    return symbol.taint
            waiting.extend(children(part))
        return ()

    def entity(self, node: s.EntityBlock) -> model.Group | None:
        """`asset uav[1..n] : quadrotor { … }`."""
        decl = self.scope.types.get(node.type.text) if node.type else None
        if decl is not None and decl.role != node.keyword:
            decl = None
        count, index = self.count(node.index)
        environment = STATIC.binding(index, NUMBER) if node.index is not None else STATIC
        what = f"`{node.name.text}`"
        keys = self._keys_of(decl)
        others = (s.CameraBlock, s.Section) if node.keyword == "asset" else ()
        entries = self.blocks.read(node.block, keys, what, environment=environment, others=others, lenient=decl is None)
        cameras, verbs = self._equipment(node, decl)
        guard = self.settings.guard(node.guard)
        if decl is None:
            return None
        self._needs_position(node, decl)
        labels = self._labels(entries, count, node)
        own: list[model.Property] = []
        for name, entry in entries.items():
            if name not in ("label", "labels"):
                hidden = bool(self.scope.groups[node.name.text].attributes.get(name, _PUBLIC).taint)
                own.extend(lowered(entry, hidden=hidden))
        given = {prop.name for prop in own}
        inherited = tuple(
            msgspec.structs.replace(prop, hidden=True) if self._is_hidden(node, prop.name, decl) else prop
            for prop in decl.properties
            if prop.name not in given
        )
        role: Literal["asset", "target"] = "asset" if node.keyword == "asset" else "target"
        return model.Group(
            name=node.name.text,
            role=role,
            type=decl.name,
            engine=decl.engine,
            count=count,
            index=index,
            properties=(*own, *inherited),
            cameras=cameras,
            verbs=verbs,
            labels=labels,
            when=guard,
        )

    def count(self, index: s.Expression | None) -> tuple[ex.Expr | None, str]:
        """`[1..n]` or `[i in 1..n]`: how many, and what the index is called."""
        if index is None:
            return None, "i"
        name, range_node = "i", index
        if isinstance(index, s.Binary) and index.operator == "in" and isinstance(index.left, s.Name):
            name, range_node = index.left.text, index.right
        value = self.of.value(range_node, STATIC)
        if value is UNKNOWN:
            return ex.Number(1.0), name
        if not isinstance(value.ir, ex.Range) or value.type.dimension != NONE:
            text = self.report.source.text[range_node.start : range_node.end]
            self.report(
                "LJ0111",
                range_node.start,
                range_node.end,
                "members are counted `1..n`",
                f"write `[1..{text}]`" if value.type.kind == "quantity" else "",
            )
            return ex.Number(1.0), name
        if self.of.constant(value.ir.low) != 1.0:
            self.report("LJ0111", range_node.start, range_node.end, "members are counted from 1")
        high = self.of.constant(value.ir.high)
        if high is not None and (high < 0 or high != int(high) or high > 100_000):
            self.report("LJ0206", range_node.start, range_node.end, "a group has 0 to 100000 members, in whole numbers")
        self.blocks.leak(value.taint, range_node, "the number of members")
        return value.ir.high, name

    # -- private

    def _type_of(self, node: s.EntityBlock) -> TypeDecl | None:
        if node.type is None:
            self.report(
                "LJ0106",
                node.name.start,
                node.name.end,
                f"`{node.name.text}` lacks a type",
                f"write `{node.keyword} {node.name.text} : …`",
            )
            return None
        decl = self.scope.types.get(node.type.text)
        if decl is None:
            fitting = [name for name, known in self.scope.types.items() if known.role == node.keyword]
            self.of.unknown_name(node.type, fitting or list(self.scope.types), f"no {node.keyword} type")
            return None
        if decl.role != node.keyword:
            place = node.type
            self.report(
                "LJ0112",
                place.start,
                place.end,
                f"`{decl.name}` is {'an asset' if decl.role == 'asset' else 'a target'} type",
                f"write `{decl.role} {node.name.text} : {decl.name}`",
            )
            return None
        return decl

    def _keys_of(self, decl: TypeDecl | None) -> dict[str, Key]:
        keys = dict(COMMON_KEYS)
        if decl is not None:
            for name, attribute in decl.attributes.items():
                if name not in keys:
                    keys[name] = Key(name, attribute.type, _ANY_RELATION, hideable=True, public=False)
        return keys

    def _is_hidden(self, node: s.EntityBlock, lowered_name: str, decl: TypeDecl) -> bool:
        attributes = self.scope.groups[node.name.text].attributes
        return any(
            attribute.taint and lowered_name.startswith(name)
            for name, attribute in attributes.items()
            if name in decl.attributes
        )

    def _needs_position(self, node: s.EntityBlock, decl: TypeDecl) -> None:
        items = node.block.items if node.block else ()
        given = any(isinstance(item, s.Property) and item.name.text == "position" for item in items)
        faulty = any(isinstance(item, s.Faulty) for item in items)
        if not given and not faulty and "position" not in decl.attributes:
            self.report(
                "LJ0106",
                node.name.start,
                node.name.end,
                f"`{node.name.text}` lacks `position`",
                "add `position = (… m, … m)` or `position ~ sites(…)`",
            )

    def _labels(self, entries: dict[str, Entry], count: ex.Expr | None, node: s.EntityBlock) -> tuple[str, ...]:
        entry = entries.get("labels") or entries.get("label")
        if entry is None:
            return ()
        if isinstance(entry.value.ir, ex.Text):
            return (entry.value.ir.value,)
        items = entry.value.ir.items if isinstance(entry.value.ir, ex.Sequence) else ()
        if count is None and len(items) > 1:
            place = entry.node.value
            self.report("LJ0206", place.start, place.end, f"`{node.name.text}` is one, it has one label")
        return tuple(item.value for item in items if isinstance(item, ex.Text))

    def _equipment(
        self, node: s.EntityBlock, decl: TypeDecl | None
    ) -> tuple[tuple[model.Camera, ...], tuple[model.Verb, ...]]:
        cameras: dict[str, model.Camera | None] = {}
        verbs: tuple[model.Verb, ...] | None = None
        for item in node.block.items if node.block else ():
            if isinstance(item, s.CameraBlock):
                if item.name.text in cameras:
                    self.report("LJ0104", item.name.start, item.name.end, f"`{item.name.text}` is declared twice")
                cameras[item.name.text] = self._camera(item)
            elif isinstance(item, s.Section) and item.keyword == "actions":
                if verbs is not None:
                    self.report("LJ0103", item.start, item.start + len("actions"), "`actions` is given twice")
                verbs = self._actions(item, decl)
            elif isinstance(item, s.Section):
                self.blocks.misplaced(item, f"`{node.name.text}`")
        if verbs is None:
            verbs = tuple(decl.verbs.values()) if decl else ()
        return tuple(camera for camera in cameras.values() if camera), verbs

    def _camera(self, node: s.CameraBlock) -> model.Camera | None:
        entries = self.blocks.read(node.block, CAMERA_KEYS, f"the camera `{node.name.text}`", owner=node.name)
        view = _word(entries.get("view")) or node.name.text
        if view not in VIEWS:
            self.report(
                "LJ0106",
                node.name.start,
                node.name.end,
                f"the camera `{node.name.text}` lacks `view`",
                f"add `view = …`: {', '.join(VIEWS)}",
            )
            return None
        if not {"size", "hfov", "channels"} <= entries.keys():
            return None
        width, height = entries["size"].parts
        listed = entries["channels"].value.ir
        names = listed.items if isinstance(listed, ex.Sequence) else ()
        return model.Camera(
            name=node.name.text,
            view=view,  # type: ignore[arg-type]
            width=width.ir,
            height=height.ir,
            hfov=entries["hfov"].value.ir,
            channels=tuple(name.name for name in names if isinstance(name, ex.Symbol)),
            capture=_word(entries.get("capture")) or "on_request",  # type: ignore[arg-type]
        )

    def _actions(self, node: s.Section, decl: TypeDecl | None) -> tuple[model.Verb, ...]:
        verbs: dict[str, model.Verb] = {}
        for item in node.block.items:
            if isinstance(item, s.Faulty):
                continue
            if not isinstance(item, s.Bare | s.Property):
                self.blocks.misplaced(item, "`actions`")
                continue
            name = item.name
            verb = decl.verbs.get(name.text) if decl else None
            if name.text in verbs:
                self.report("LJ0103", name.start, name.end, f"`{name.text}` is given twice")
                continue
            if verb is None:
                if decl is not None:
                    self.report(
                        "LJ0113",
                        name.start,
                        name.end,
                        f"the type `{decl.name}` has no verb `{name.text}`",
                        did_you_mean(name.text, decl.verbs),
                        replace=nearest(name.text, decl.verbs),
                    )
                continue
            verbs[name.text] = verb if isinstance(item, s.Bare) else self._bounded(item, verb)
        return tuple(verbs.values())

    def _bounded(self, item: s.Property, verb: model.Verb) -> model.Verb:
        """`forward <= 50 m`: the bound of the verb's first argument."""
        if item.relation != "<=" or item.hidden or item.guard:
            self.report(
                "LJ0303", item.start, item.value.start, "an action is named or bounded", f"write `{verb.name} <= …`"
            )
            return verb
        first = verb.arguments[0] if verb.arguments else None
        if first is None or first.dimension == "name":
            self.report(
                "LJ0306", item.value.start, item.value.end, f"`{verb.name}` has no argument that could be bounded"
            )
            return verb
        due = next(entry.dimension for entry in BY_NAME.values() if entry.unit == first.dimension)
        bound = self.of.expect(item.value, STATIC, Type("quantity", due), f"the bound of `{verb.name}`")
        self.blocks.leak(bound.taint, item.value, f"the bound of the action `{verb.name}`")
        if bound is UNKNOWN:
            return verb
        least, most = (None if e is None else self.of.constant(e) for e in (first.minimum, first.maximum))
        value = self.of.constant(bound.ir)
        if value is not None and ((least is not None and value < least) or (most is not None and value > most)):
            shown = f"{'' if least is None else f'{least:g}'}..{'' if most is None else f'{most:g}'} {first.dimension}"
            self.report(
                "LJ0206", item.value.start, item.value.end, f"`{verb.name}` takes {shown}: the bound lies outside"
            )
            return verb
        arguments = (msgspec.structs.replace(first, maximum=bound.ir), *verb.arguments[1:])
        return msgspec.structs.replace(verb, arguments=arguments)

    def _engine(self, item: s.Property, seen: dict[str, s.Property]) -> str:
        if "engine" in seen:
            self.blocks.duplicate(item.name, seen["engine"].name, "`engine` is given twice")
        seen["engine"] = item
        if item.relation == "=" and isinstance(item.value, s.Name):
            return item.value.text
        self.report(
            "LJ0201", item.value.start, item.value.end, "an engine's name is due here", "write `engine = vessel`"
        )
        return ""

    def _type_property(self, item: s.Property, seen: dict[str, s.Property]) -> Entry | None:
        name = item.name
        if name.text in seen:
            self.blocks.duplicate(name, seen[name.text].name, f"`{name.text}` is given twice")
            return None
        seen[name.text] = item
        key = COMMON_KEYS.get(name.text) or Key(name.text, Type("any"), _ANY_RELATION, hideable=True, public=False)
        if item.guard is not None:
            self.report("LJ0307", item.guard.start, item.guard.end, f"`{name.text}` cannot depend on a condition")
            return None
        if key.type.kind == "any" and isinstance(item.value, s.Name) and item.value.text not in self.scope.symbols:
            key = Key(name.text, Type("name"), _ANY_RELATION)
        parts = self.blocks.parts(item.value, key, item.relation, STATIC)
        if any(part is UNKNOWN for part in parts):
            return None
        return Entry(item, Key(name.text, parts[0].type, _ANY_RELATION), parts)

    def _add_verb(self, node: s.VerbLine, verbs: dict[str, model.Verb]) -> None:
        if node.name.text in verbs:
            self.report("LJ0104", node.name.start, node.name.end, f"the verb `{node.name.text}` is declared twice")
            return
        arguments = []
        for parameter in node.parameters:
            argument = self._verb_argument(parameter)
            if argument is not None:
                arguments.append(argument)
        verbs[node.name.text] = model.Verb(name=node.name.text, arguments=tuple(arguments))

    def _verb_argument(self, node: s.Typed) -> model.Argument | None:
        name = node.name.text
        if node.type.text == "name":
            return model.Argument(name=name, dimension="name", optional=node.optional)
        known = BY_NAME.get(node.type.text)
        if known is None:
            self._no_type(node.type, ["name", *BY_NAME])
            return None
        low, high = self._limits(node, Type("quantity", known.dimension))
        unit = dimension_unit(known.dimension)
        return model.Argument(name=name, dimension=unit, minimum=low, maximum=high, optional=node.optional)

    def _limits(self, node: s.Typed, kind: Type) -> tuple[ex.Expr | None, ex.Expr | None]:
        if node.bounds is None:
            return None, None
        due = Type("range", kind.dimension)
        value = self.of.expect(node.bounds, STATIC, due, f"the bounds of `{node.name.text}`")
        if not isinstance(value.ir, ex.Range):
            return None, None
        return value.ir.low, value.ir.high

    def _no_type(self, node: s.Name, known: list[str]) -> None:
        self.report(
            "LJ0109",
            node.start,
            node.end,
            f"no type is called `{node.text}`",
            did_you_mean(node.text, known),
            replace=nearest(node.text, known),
        )

    def _field(self, node: s.Typed) -> model.Field | None:
        if node.type.text not in FIELD_TYPES:
            self._no_type(node.type, list(FIELD_TYPES))
            return None
        low, high = self._limits(node, NUMBER)
        if node.bounds is not None and node.type.text != "number":
            self.report("LJ0201", node.bounds.start, node.bounds.end, "only a number has bounds")
        minimum = None if low is None else self.of.constant(low)
        maximum = None if high is None else self.of.constant(high)
        kind = node.type.text
        return model.Field(
            name=node.name.text,
            type=kind,  # type: ignore[arg-type]
            optional=node.optional,
            minimum=minimum,
            maximum=maximum,
        )

    def _interaction(self, node: s.InteractionBlock) -> list[model.Property]:
        what = f"the interaction `{node.name.text}`"
        entries = self.blocks.read(node.block, INTERACTION_KEYS, what, environment=Environment())
        prefix = f"{node.name.text}_"
        return [prop for entry in entries.values() for prop in lowered(entry, prefix=prefix, inherited=True)]


_PUBLIC = Attribute(Type("any"))


def _word(entry: Entry | None) -> str:
    if entry is None or not isinstance(entry.value.ir, ex.Symbol):
        return ""
    return entry.value.ir.name


def _attribute(entry: Entry, checker: EntityChecker) -> Attribute:
    item = entry.node
    taint = (checker.of.step(f"`{item.name.text}`", item),) if item.hidden else ()
    return Attribute(entry.key.type if entry.key.type.kind != "any" else entry.value.type, taint)
