"""What names mean: the symbol tables of a mission and of the library files it uses."""

from __future__ import annotations

from typing import Any, Literal

import msgspec

from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.values import Taint
from lingjing.dsl.syntax import tree as s
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import Type


class PropertyType(msgspec.Struct, frozen=True):
    """One property of a type or a group: its type, the path by which it is hidden, whether it changes in a run."""

    type: Type
    taint: Taint = ()
    state: bool = False


class TypeDecl(msgspec.Struct, frozen=True):
    """An asset or target type. `properties` are already lowered and marked as inherited; `bases` are the types it
    extends, nearest first."""

    name: str
    role: str
    engine: str
    attributes: dict[str, PropertyType]
    properties: tuple[model.Property, ...]
    verbs: dict[str, model.Verb]
    interactions: dict[str, model.Interaction]
    span: Span
    bases: tuple[str, ...] = ()
    mounts: dict[str, model.CameraMount] = {}
    parts: dict[str, model.BodyPart] = {}


class RecordDecl(msgspec.Struct, frozen=True):
    """A message record."""

    name: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[model.Field, ...]
    span: Span


class CameraDecl(msgspec.Struct, frozen=True):
    """A camera preset: what it says, by key."""

    name: str
    entries: dict[str, PropertyEntry]
    span: Span


class WeatherDecl(msgspec.Struct, frozen=True):
    """A weather preset: what it says, by key."""

    name: str
    entries: dict[str, PropertyEntry]
    span: Span


class MissionDecl(msgspec.Struct, frozen=True):
    """A mission that another file may extend: the file it stands in."""

    name: str
    path: str
    span: Span


Declaration = TypeDecl | RecordDecl | CameraDecl | WeatherDecl | MissionDecl
"""What a file declares at its top and another may `use`."""


class Library(msgspec.Struct, frozen=True):
    """What one file declares, by name."""

    path: str
    declared: dict[str, Declaration]

    @property
    def types(self) -> dict[str, TypeDecl]:
        """Its asset and target types."""
        return {name: decl for name, decl in self.declared.items() if isinstance(decl, TypeDecl)}

    @property
    def records(self) -> dict[str, RecordDecl]:
        """Its message records."""
        return {name: decl for name, decl in self.declared.items() if isinstance(decl, RecordDecl)}

    @property
    def missions(self) -> dict[str, MissionDecl]:
        """Its missions."""
        return {name: decl for name, decl in self.declared.items() if isinstance(decl, MissionDecl)}


class DeclaredName(msgspec.Struct, frozen=True):
    """A declared name that expressions may use."""

    kind: Literal["param", "region", "grid", "group", "entity"]
    type: Type
    span: Span
    taint: Taint = ()


class GroupInfo(msgspec.Struct, frozen=True):
    """What rules and agents need to know of a group: its type, its attributes, and how many members it has at most, if
    that is written down: as a number, or as a param with bounds."""

    name: str
    role: str
    type: TypeDecl | None
    attributes: dict[str, PropertyType]
    most: float | None = None


class RuleInfo(msgspec.Struct, frozen=True):
    """The head of a rule."""

    name: str
    parameters: tuple[s.Typed, ...]
    span: Span


class SymbolTables:
    """All tables of one mission, filled in the order in which declarations may refer to each other."""

    def __init__(self) -> None:
        self.types: dict[str, TypeDecl] = {}
        self.records: dict[str, RecordDecl] = {}
        self.cameras: dict[str, CameraDecl] = {}
        self.weathers: dict[str, WeatherDecl] = {}
        self.missions: dict[str, MissionDecl] = {}
        self.symbols: dict[str, DeclaredName] = {}
        self.groups: dict[str, GroupInfo] = {}
        self.veiled: dict[str, Taint] = {}
        """Region → why it is hidden: found before the regions are checked."""
        self.agents: dict[str, Span] = {}
        self.roles: dict[str, Span] = {}
        self.messages: dict[str, tuple[RecordDecl | None, Span]] = {}
        self.rules: dict[str, RuleInfo] = {}
        self.stages: dict[str, tuple[str | None, Span]] = {}
        self.inspections: dict[str, Span] = {}
        self.limits: dict[str, Span] = {}
        self.constraints: dict[str, Span] = {}
        self.mounted: dict[str, list[str]] = {}
        """Group → the names of its cameras."""
        self.modes: tuple[str, ...] = ()
        self.constants: dict[str, float] = {}
        self.ceilings: dict[str, float] = {}
        """Param → the greatest value that its bounds allow: found before anything is checked."""
        self.poisoned: set[str] = set()
        """Names in faulty statements: they may have been declared there, so their absence is not reported."""
        self.left_behind: dict[str, str] = {}
        """What a library declares and the file did not ask for → the library."""
        self.incomplete = False
        """A library or a type is missing: what only it could declare is not reported as missing."""

    def enter(self, decl: Declaration) -> None:
        """Make what a file declares known by its name."""
        self._table(decl)[decl.name] = decl

    def declared(self, name: str) -> Declaration | None:
        """What a `use` or this file's top has declared under that name."""
        tables: tuple[dict[str, Any], ...] = (self.types, self.records, self.cameras, self.weathers, self.missions)
        return next((table[name] for table in tables if name in table), None)

    def _table(self, decl: Declaration) -> dict[str, Any]:
        tables: dict[type, dict[str, Any]] = {
            TypeDecl: self.types,
            RecordDecl: self.records,
            CameraDecl: self.cameras,
            WeatherDecl: self.weathers,
            MissionDecl: self.missions,
        }
        return tables[type(decl)]

    def interactions(self) -> dict[str, list[str]]:
        """Interaction name → the target types that offer it."""
        found: dict[str, list[str]] = {}
        for decl in self.types.values():
            for name in decl.interactions:
                found.setdefault(name, []).append(decl.name)
        return found

    def known_names(self) -> list[str]:
        """Every name an expression could have meant."""
        return [*self.symbols, *self.types, *self.roles, *self.agents, *self.modes, *self.messages]
