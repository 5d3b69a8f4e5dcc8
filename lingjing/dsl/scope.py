"""What names mean: the symbol tables of a mission and of the library files it uses."""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.dsl import syntax as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import ANY, Type


class Step(msgspec.Struct, frozen=True):
    """One station on the way of a hidden value: what it is called there and where that stands."""

    name: str
    span: Span


Taint = tuple[Step, ...]
"""How a hidden value came here, first the declaration that hides it; empty for a public value."""


class Value(msgspec.Struct, frozen=True):
    """A checked expression: its form in the graph, its type, and the hidden value it depends on, if any."""

    ir: ex.Expr
    type: Type
    taint: Taint = ()


UNKNOWN = Value(ex.Symbol("?"), ANY)
"""Stands for what was already reported; fits everywhere, so that nothing is reported twice."""


class Attribute(msgspec.Struct, frozen=True):
    """One property of a type or a group: its type, and the path by which it is hidden."""

    type: Type
    taint: Taint = ()


class TypeDecl(msgspec.Struct, frozen=True):
    """An asset or target type. `properties` are already lowered and marked as inherited."""

    name: str
    role: str
    engine: str
    attributes: dict[str, Attribute]
    properties: tuple[model.Property, ...]
    verbs: dict[str, model.Verb]
    interactions: tuple[str, ...]
    span: Span


class RecordDecl(msgspec.Struct, frozen=True):
    """A message record."""

    name: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[model.Field, ...]
    span: Span


class Library(msgspec.Struct, frozen=True):
    """What one library file declares."""

    path: str
    types: dict[str, TypeDecl]
    records: dict[str, RecordDecl]


class Symbol(msgspec.Struct, frozen=True):
    """A declared name that expressions may use."""

    kind: Literal["param", "region", "grid", "group", "entity"]
    type: Type
    span: Span
    taint: Taint = ()


class GroupInfo(msgspec.Struct, frozen=True):
    """What rules and agents need to know of a group: its type, its attributes, its count if it is constant."""

    name: str
    role: str
    type: TypeDecl | None
    attributes: dict[str, Attribute]
    single: bool


class RuleInfo(msgspec.Struct, frozen=True):
    """The head of a rule."""

    name: str
    parameters: tuple[s.Typed, ...]
    span: Span


class Scope:
    """All tables of one mission, filled in the order in which declarations may refer to each other."""

    def __init__(self) -> None:
        self.types: dict[str, TypeDecl] = {}
        self.records: dict[str, RecordDecl] = {}
        self.symbols: dict[str, Symbol] = {}
        self.groups: dict[str, GroupInfo] = {}
        self.agents: dict[str, Span] = {}
        self.roles: dict[str, Span] = {}
        self.messages: dict[str, tuple[RecordDecl | None, Span]] = {}
        self.rules: dict[str, RuleInfo] = {}
        self.stages: dict[str, tuple[str | None, Span]] = {}
        self.modes: tuple[str, ...] = ()
        self.constants: dict[str, float] = {}
        self.poisoned: set[str] = set()
        """Names in faulty statements: they may have been declared there, so their absence is not reported."""
        self.left_behind: dict[str, str] = {}
        """What a library declares and the file did not ask for → the library."""
        self.incomplete = False
        """A library or a type is missing: what only it could declare is not reported as missing."""

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


class Environment(msgspec.Struct, frozen=True):
    """Names bound around an expression, and whether it stands in a rule (evaluated while the mission runs)."""

    locals: dict[str, Type] = {}
    rule: bool = False

    def binding(self, name: str, of: Type) -> Environment:
        """The same with one more name."""
        return Environment({**self.locals, name: of}, self.rule)


STATIC = Environment()
RULE = Environment(rule=True)
