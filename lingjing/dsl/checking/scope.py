"""The meaning of names: the symbol tables of a mission and of the library files that it uses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import msgspec

from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.values import Taint
from lingjing.dsl.syntax import tree as s
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import Type


class PropertyType(msgspec.Struct, frozen=True):
    """One property of a type or a group."""

    type: Type
    taint: Taint = ()
    """The path by which it is hidden; empty for a public one."""
    state: bool = False
    """True if it changes during an episode."""


class TypeDecl(msgspec.Struct, frozen=True):
    """An asset or target type."""

    name: str
    role: str
    """`asset` or `target`."""
    engine: str
    """Name of the engine that moves it."""
    attributes: dict[str, PropertyType]
    properties: tuple[model.Property, ...]
    """Lowered properties, marked as inherited."""
    verbs: dict[str, model.Verb]
    interactions: dict[str, model.Interaction]
    span: Span
    bases: tuple[str, ...] = ()
    """The types that it extends, nearest first."""
    mounts: dict[str, model.CameraMount] = {}
    """Camera mounts by view."""
    parts: dict[str, model.BodyPart] = {}
    """Solid parts by name."""


class RecordDecl(msgspec.Struct, frozen=True):
    """A message record."""

    name: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[model.Field, ...]
    span: Span


class CameraDecl(msgspec.Struct, frozen=True):
    """A camera preset."""

    name: str
    entries: dict[str, PropertyEntry]
    """Its properties by key."""
    span: Span


class WeatherDecl(msgspec.Struct, frozen=True):
    """A weather preset."""

    name: str
    entries: dict[str, PropertyEntry]
    """Its properties by key."""
    span: Span


class MissionDecl(msgspec.Struct, frozen=True):
    """A mission that another file may extend."""

    name: str
    path: str
    """The file that declares it."""
    span: Span


Declaration = TypeDecl | RecordDecl | CameraDecl | WeatherDecl | MissionDecl
"""A declaration at the top of a file, which another file may `use`."""


class Library(msgspec.Struct, frozen=True):
    """The declarations of one file, by name."""

    path: str
    declared: Mapping[str, Declaration]
    uses: tuple[str, ...] = ()
    """The files that it uses, directly or through others, sorted."""

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
        """The missions of the file, by name."""
        return {name: decl for name, decl in self.declared.items() if isinstance(decl, MissionDecl)}


class DeclaredName(msgspec.Struct, frozen=True):
    """A declared name that expressions may use."""

    kind: Literal["param", "switch", "region", "grid", "group", "entity"]
    """`switch` for a param that is `true` or `false`."""
    type: Type
    span: Span
    taint: Taint = ()
    """The path by which its value is hidden; empty for a public one."""


PARAMS = ("param", "switch")
"""Kinds of names that a run may set."""


class GroupInfo(msgspec.Struct, frozen=True):
    """The facts about a group that rules and agents need."""

    name: str
    role: str
    type: TypeDecl | None
    attributes: dict[str, PropertyType]
    lines: dict[str, s.Expression] = {}
    """Values that the entity's own block declares, by name, before they are checked."""
    most: float | None = None
    """Most members, if the text states them as a number or as a param with bounds; else None."""
    count_taint: Taint = ()
    """The path by which the number of members is hidden; empty for a public one."""


class RuleInfo(msgspec.Struct, frozen=True):
    """The head of a rule."""

    name: str
    parameters: tuple[s.Typed, ...]
    span: Span


class SymbolTables:
    """All tables of one mission, filled in the order of the declarations' dependencies."""

    def __init__(self) -> None:
        self.types: dict[str, TypeDecl] = {}
        self.records: dict[str, RecordDecl] = {}
        self.cameras: dict[str, CameraDecl] = {}
        self.weathers: dict[str, WeatherDecl] = {}
        self.missions: dict[str, MissionDecl] = {}
        self.symbols: dict[str, DeclaredName] = {}
        self.groups: dict[str, GroupInfo] = {}
        self.hidden_params: dict[str, Taint] = {}
        """Param → the path by which it is hidden. Filled before anything else is checked."""
        self.hidden_regions: dict[str, Taint] = {}
        """Region → the path by which it is hidden. Filled before regions are checked."""
        self.agents: dict[str, Span] = {}
        self.agent_heads: dict[str, s.AgentBlock] = {}
        self.roles: dict[str, Span] = {}
        self.messages: dict[str, tuple[RecordDecl | None, Span]] = {}
        self.rules: dict[str, RuleInfo] = {}
        self.stages: dict[str, tuple[str | None, Span]] = {}
        self.inspections: dict[str, Span] = {}
        self.limits: dict[str, Span] = {}
        self.events: dict[str, Span] = {}
        self.constraints: dict[str, Span] = {}
        self.mounted: dict[str, list[str]] = {}
        """Group → names of its cameras."""
        self.modes: tuple[str, ...] = ()
        self.mode_line: tuple[str, int, int] | None = None
        """Default mode and offsets of the statement `mode`; equal offsets without one."""
        self.constants: dict[str, float] = {}
        self.ceilings: dict[str, float] = {}
        """Param → the greatest value within its bounds. Filled before anything else is checked."""
        self.poisoned: set[str] = set()
        """Names in faulty statements. They may have been declared there, so their absence is not reported."""
        self.not_imported: dict[str, str] = {}
        """Declarations of used libraries that the file does not import → the library."""
        self.incomplete = False
        """True if a library or a type is missing. Then names that it may declare are not reported as missing."""

    def enter(self, decl: Declaration) -> None:
        """Register a declaration under its name."""
        self._table(decl)[decl.name] = decl

    def declared(self, name: str) -> Declaration | None:
        """The declaration of that name from a `use` or from this file's top; None if there is none."""
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
        offering: dict[str, list[str]] = {}
        for decl in self.types.values():
            for name in decl.interactions:
                offering.setdefault(name, []).append(decl.name)
        return offering

    def known_names(self) -> list[str]:
        """Every name that an expression could refer to."""
        return [*self.symbols, *self.types, *self.roles, *self.agents, *self.modes, *self.messages]
