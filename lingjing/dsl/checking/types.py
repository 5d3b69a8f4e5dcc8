"""Checkers of the top of a file: asset and target types with verbs and interactions, presets, message records.

A type may extend another one (`asset fire_truck : car { … }`): it has all of that type's properties, verbs and
interactions, and declares the differences.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.bodies import BODY_KEYS, BodyChecker, reshaped
from lingjing.dsl.checking.interactions import declared
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.properties import lowered
from lingjing.dsl.checking.scope import CameraDecl, PropertyType, RecordDecl, TypeDecl, WeatherDecl
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, UNKNOWN, Environment
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey, keyed
from lingjing.dsl.syntax.statements import CATEGORIES, KINDS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import DEGREES, FIELD_TYPES, GNSS, IMU, NUMBER, POSITION, SECONDS, TEXT, Type
from lingjing.mission.units import BY_NAME, NAMED, dimension_unit, without_unit

SURFACES = ("ground", "road", "roof", "facade", "bridge", "pipe")
"""Surfaces on which the scene places an entity: `on = road` moves it to the nearest carriageway."""
SENSORS = {GNSS: ("m8", "f9p"), IMU: ("bmi088",)}
"""Sensors that an asset can carry: satellite navigation receivers (`lingjing.kernel.gnss`) and inertial units
(`lingjing.kernel.imu`)."""
NO_SENSOR = ("satellite", "city")
"""Engines of bodies that cannot carry a sensor."""
ANY_RELATION = ("=", "~", "<=")

COMMON_KEYS = (
    keyed(
        PropertyKey("position", POSITION, ("=", "~"), hideable=True, public=False),
        PropertyKey("heading", DEGREES, ("=", "~"), hideable=True, public=False),
        PropertyKey("label", TEXT),
        PropertyKey("labels", Type("list", item="text")),
        PropertyKey("on", Type("name"), choices=SURFACES),
        *(PropertyKey(name, Type("name"), choices=models) for name, models in SENSORS.items()),
        PropertyKey("deadline", SECONDS, ("=", "~"), hideable=True, public=False, above=0),
    )
    | BODY_KEYS
)
"""Properties of every entity, whatever its type."""


class TypeChecker(DeclarationChecker):
    """Checks types and records. A method for each kind returns the declaration, or None if it is faulty."""

    def __init__(self, blocks: BlockReader) -> None:
        super().__init__(blocks)
        self.bodies = BodyChecker(blocks)

    def type(self, node: s.EntityBlock) -> TypeDecl | None:
        """An asset or target type: engine, properties, verbs, interactions."""
        if node.index is not None or node.guard is not None:
            wrong = node.index or node.guard
            assert wrong is not None
            self.report.at(
                "LJ0110",
                wrong,
                f"outside of a mission `{node.keyword} {node.name.text}` declares a type",
                f"write `{node.keyword} {node.name.text} {{ … }}`",
            )
        base = self._base(node)
        attributes: dict[str, PropertyType] = dict(base.attributes) if base else {}
        verbs: dict[str, model.Verb] = dict(base.verbs) if base else {}
        interactions: dict[str, model.Interaction] = dict(base.interactions) if base else {}
        engine = base.engine if base else ""
        own: list[model.Property] = []
        seen: dict[str, s.PropertyLine] = {}
        declared_verbs: set[str] = set()
        performed: dict[str, Span] = {}
        for item in node.block.items if node.block else ():
            if isinstance(item, s.PropertyLine) and item.name.text == "engine":
                engine = self._engine(item, seen)
            elif isinstance(item, s.PropertyLine):
                entry = self._type_property(item, seen, base)
                if entry is not None:
                    attribute = attributes[item.name.text] = _attribute(entry, self, attributes.get(item.name.text))
                    own.extend(lowered(entry, inherited=True, hidden=bool(attribute.taint), state=attribute.state))
            elif isinstance(item, s.VerbLine):
                self._add_verb(item, verbs, declared_verbs)
            elif isinstance(item, s.InteractionBlock):
                self.report.once(performed, item.name, "the interaction")
                entries = self._interaction(item)
                name = item.name.text
                interactions[name] = declared(name, entries, interactions.get(name))
            elif not isinstance(item, s.MountBlock | s.PartBlock | s.Faulty):
                self.blocks.misplaced(
                    item, f"the {node.keyword} type `{node.name.text}`", ("engine", "verb", "interaction")
                )
        items = node.block.items if node.block else ()
        anew = reshaped(set(seen))
        if anew:
            attributes.pop("look", None)
        mounts = self.bodies.mounts([i for i in items if isinstance(i, s.MountBlock)], base.mounts if base else {})
        parts = self.bodies.parts(
            [i for i in items if isinstance(i, s.PartBlock)], base.parts if base and not anew else {}
        )
        faulty = any(isinstance(item, s.Faulty) for item in items)
        if not engine and "engine" not in seen and not faulty and node.type is None:
            self.report.at(
                "LJ0106",
                node.name,
                f"the type `{node.name.text}` lacks `engine`",
                "add `engine = …`: the engine that moves it",
            )
        self._crowd(node, attributes)
        replaced = {prop.name for prop in own} | ({"look"} if anew else set())
        kept = tuple(prop for prop in (base.properties if base else ()) if prop.name not in replaced)
        return TypeDecl(
            node.name.text,
            node.keyword,
            engine,
            attributes,
            (*kept, *own),
            verbs,
            interactions,
            self.report.span(node.name.start, node.name.end),
            (base.name, *base.bases) if base else (),
            mounts,
            parts,
        )

    def camera(self, node: s.CameraBlock) -> CameraDecl | None:
        """`camera nadir_hd { … }`: a preset that the cameras of missions may extend."""
        if node.type is not None:
            self.report.at("LJ0110", node.type, "a camera preset cannot extend another")
        keys = {name: msgspec.structs.replace(key, required=False) for name, key in KINDS["camera"].keys.items()}
        entries = self.blocks.read(node.block, keys, f"the camera `{node.name.text}`", owner=node.name)
        return CameraDecl(node.name.text, entries, self.report.span(node.name.start, node.name.end))

    def weather(self, node: s.SettingsBlock) -> WeatherDecl | None:
        """`weather storm { … }`: a preset that the weather of missions may extend."""
        name = node.preset
        if name is None:
            self.report(
                "LJ0107", node.start, node.start + len("weather"), "outside of a mission a weather has a name",
                "write `weather storm { … }`")  # fmt: skip
            return None
        entries = self.blocks.read(node.block, KINDS["weather"].keys, f"the weather `{name.text}`")
        return WeatherDecl(name.text, entries, self.report.span(name.start, name.end))

    def record(self, node: s.RecordBlock) -> RecordDecl | None:
        """Check the statement `record name : category { fields }`."""
        category = node.category
        if category.text not in CATEGORIES:
            self.report.unknown("LJ0109", category, f"no category of messages is called `{category.text}`", CATEGORIES)
        fields: dict[str, model.Field] = {}
        for item in node.block.items:
            if isinstance(item, s.FieldLine):
                field = self._field(item.typed)
                if field is not None and field.name in fields:
                    self.report.at("LJ0103", item, f"the field `{field.name}` is given twice")
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

    # -- private

    def _base(self, node: s.EntityBlock) -> TypeDecl | None:
        if node.type is None:
            return None
        base = self.scope.types.get(node.type.text)
        if base is None:
            self.of.unknown_name(node.type, list(self.scope.types), f"no {node.keyword} type")
            return None
        if base.role != node.keyword:
            kind = "an asset" if base.role == "asset" else "a target"
            self.report.at("LJ0112", node.type, f"`{base.name}` is {kind} type")
            return None
        return base

    def _engine(self, item: s.PropertyLine, seen: dict[str, s.PropertyLine]) -> str:
        if "engine" in seen:
            self.blocks.duplicate(item.name, seen["engine"].name, "`engine` is given twice")
        seen["engine"] = item
        if item.relation == "=" and isinstance(item.value, s.Name):
            return item.value.text
        self.report.at("LJ0201", item.value, "an engine's name is due here", "write `engine = vessel`")
        return ""

    def _type_property(
        self, item: s.PropertyLine, seen: dict[str, s.PropertyLine], base: TypeDecl | None
    ) -> PropertyEntry | None:
        name = item.name
        if name.text in seen:
            self.blocks.duplicate(name, seen[name.text].name, f"`{name.text}` is given twice")
            return None
        seen[name.text] = item
        known = base.attributes.get(name.text) if base else None
        key = COMMON_KEYS.get(name.text) or PropertyKey(
            name.text, known.type if known else Type("any"), ANY_RELATION, hideable=True, public=False
        )
        if item.guard is not None:
            self.report.at("LJ0307", item.guard, f"`{name.text}` cannot depend on a condition")
            return None
        if key.type.kind == "any" and isinstance(item.value, s.Name) and item.value.text not in self.scope.symbols:
            key = PropertyKey(name.text, Type("name"), ANY_RELATION)
        parts = self.blocks.parts(item.value, key, item.relation, STATIC)
        if any(part is UNKNOWN for part in parts) or self._ends_like_a_unit(item, parts[0].type):
            return None
        if not self.blocks.in_bounds(item, key, parts):
            return None
        self.blocks.check_state(item, parts[0].type)
        return PropertyEntry(item, PropertyKey(name.text, parts[0].type, ANY_RELATION), parts)

    def _ends_like_a_unit(self, item: s.PropertyLine, kind: Type) -> bool:
        """True if a name ends like a unit: `load_kg = 5` would collide with the mass `load = 5 kg` in the graph."""
        plain = without_unit(item.name.text)
        if kind != NUMBER or plain == item.name.text:
            return False
        place, named = item.name, next(n for n in NAMED if n.suffix == item.name.text.removeprefix(plain))
        message = f"`{place.text}` is the stored name of {with_article(Type('quantity', named.dimension))} `{plain}`"
        self.report.at("LJ0202", place, message, f"write `{plain} = … {named.unit}`")
        return True

    def _crowd(self, node: s.EntityBlock, attributes: dict[str, PropertyType]) -> None:
        """Arrivals and departures count people: they need a state `people` without a unit."""
        rate = next((name for name in ("arrivals", "departures") if name in attributes), None)
        people = attributes.get("people")
        if node.keyword == "target" and rate and (people is None or not people.state or people.type != NUMBER):
            message = f"`{rate}` counts people, `{node.name.text}` lacks a state for them"
            self.report.at("LJ0106", node.name, message, "add `state people = 0`, without a unit")

    def _add_verb(self, node: s.VerbLine, verbs: dict[str, model.Verb], declared: set[str]) -> None:
        if node.name.text in declared:
            self.report.at("LJ0104", node.name, f"the verb `{node.name.text}` is declared twice")
            return
        declared.add(node.name.text)
        arguments = []
        named: dict[str, Span] = {}
        for parameter in node.parameters:
            self.report.once(named, parameter.name, "the argument")
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
        self.report.unknown("LJ0109", node, f"no type is called `{node.text}`", known)

    def _field(self, node: s.Typed) -> model.Field | None:
        measured = BY_NAME.get(node.type.text)
        if node.type.text not in FIELD_TYPES and measured is None:
            self._no_type(node.type, [*FIELD_TYPES, *BY_NAME])
            return None
        low, high = self._limits(node, Type("quantity", measured.dimension) if measured else NUMBER)
        if node.bounds is not None and measured is None:
            self.report.at("LJ0201", node.bounds, "only a number has bounds")
        minimum = None if low is None else self.of.constant(low)
        maximum = None if high is None else self.of.constant(high)
        kind = "number" if measured else node.type.text
        return model.Field(
            name=node.name.text,
            type=kind,  # type: ignore[arg-type]
            optional=node.optional,
            minimum=minimum,
            maximum=maximum,
            unit=dimension_unit(measured.dimension) if measured else "",
        )

    def _interaction(self, node: s.InteractionBlock) -> dict[str, PropertyEntry]:
        what = f"the interaction `{node.name.text}`"
        return self.blocks.read(node.block, KINDS["interaction"].keys, what, environment=Environment())


def _attribute(entry: PropertyEntry, checker: TypeChecker, base: PropertyType | None) -> PropertyType:
    """The property in the type. It stays hidden if the base hides it, and stays a state if it is one in the base."""
    item = entry.node
    taint = base.taint if base is not None else ()
    taint = (checker.of.step(f"`{item.name.text}`", item),) if item.hidden else taint
    kind = entry.key.type if entry.key.type.kind != "any" else entry.value.type
    return PropertyType(kind, taint, item.state or (base is not None and base.state))
