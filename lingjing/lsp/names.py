"""Declarations and uses of names: occurrences, grouped by their meaning.

A *space* is a set of names that must differ, such as all types. The table of statements gives the space into which a
field of a statement declares, and the spaces in which a use is looked up; a table below does so for expressions. A name
in a place outside of both is looked up in all spaces.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statement_kinds import NamePlace
from lingjing.dsl.syntax.statements import declared_spaces, kind_of

TextExtent = tuple[int, int]
"""First and last offset of a part of the text."""
NameKey = tuple[str, str, TextExtent | None]
"""Space, name, and the part of the text in which a local name is known; None for other names."""

_OTHER_PLACES: dict[str, NamePlace] = {
    "CallExpr.function": NamePlace(spaces=("rule",)),
    "Typed.type": NamePlace(spaces=("symbol", "message")),
    "Typed.name": NamePlace(binds=True),
    "QuantifiedExpr.variable": NamePlace(binds=True),
    "ForClause.variable": NamePlace(binds=True),
    "FieldExpr.name": NamePlace(spaces=()),
    "PropertyLine.name": NamePlace(spaces=()),
    "CallArgument.name": NamePlace(spaces=()),
    "UnknownBlock.name": NamePlace(spaces=()),
}
"""Field of a node that is no row of `lingjing.dsl.syntax.statements` → the meaning of the names in it."""

_FIRST_SPACES = (
    "local", "symbol", "type", "message", "limit", "inspection", "agent", "role", "stage", "interaction", "rule",
    "event", "record", "preset", "verb", "constraint",
)  # fmt: skip
SPACES = tuple(dict.fromkeys((*_FIRST_SPACES, *declared_spaces())))
"""All spaces, in the order of lookup: those with an order of their own, then others of the table of statements."""
GLOBAL = tuple(space for space in SPACES if space not in ("local", "verb"))
"""Spaces of names that are known in the whole file."""
_HOLE = re.compile(r"\{\{|\{\s*([^\W\d]\w*)")


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One name in the text."""

    start: int
    end: int
    key: NameKey
    """Identifies its meaning: occurrences with equal keys mean the same."""
    declares: bool
    """True if it declares the name."""
    node: s.SyntaxNode | None = None
    """The node that declares it; None for a use."""


@dataclass(slots=True)
class _Use:
    name: str
    start: int
    end: int
    spaces: tuple[str, ...]


@dataclass(slots=True)
class Names:
    """All occurrences of a file, by place."""

    occurrences: list[Occurrence] = field(default_factory=list)
    declared: dict[NameKey, Occurrence] = field(default_factory=dict)
    """The first declaration of each key."""

    def at(self, offset: int) -> Occurrence | None:
        """The occurrence at a cursor or directly before it."""
        index = bisect_right(self.occurrences, offset, key=lambda occurrence: occurrence.start) - 1
        for candidate in self.occurrences[max(0, index - 1) : index + 1][::-1]:
            if candidate.start <= offset <= candidate.end:
                return candidate
        return None

    def of(self, key: NameKey) -> list[Occurrence]:
        """All occurrences with that key."""
        return [occurrence for occurrence in self.occurrences if occurrence.key == key]

    def locals_at(self, offset: int) -> list[Occurrence]:
        """Local names that are known at a place, innermost first."""
        bound = [
            occurrence
            for key, occurrence in self.declared.items()
            if key[0] == "local" and key[2] is not None and key[2][0] <= offset <= key[2][1]
        ]
        return sorted(bound, key=lambda occurrence: occurrence.key[2] or (0, 0), reverse=True)


def find_names(tree: s.File, text: str) -> Names:
    """Find declarations and uses in the tree, and resolve the uses."""
    finder = _Finder(text)
    finder.walk(tree, ())
    return finder.resolved()


class _Finder:
    def __init__(self, text: str) -> None:
        self.text = text
        self.names = Names()
        self.uses: list[_Use] = []

    def walk(self, node: s.SyntaxNode, above: tuple[s.SyntaxNode, ...]) -> None:
        if isinstance(node, s.TextLine):
            self._holes(node)
        for place, child in _children(node):
            if isinstance(child, s.Name):
                self._name(child, node, f"{type(node).__name__}.{place}", above)
            elif isinstance(child, s.SyntaxNode):
                self.walk(child, (*above, node))

    def resolved(self) -> Names:
        scopes: dict[str, list[TextExtent]] = {}
        for space, name, scope in self.names.declared:
            if space == "local" and scope is not None:
                scopes.setdefault(name, []).append(scope)
        used = [Occurrence(use.start, use.end, self._meaning(use, scopes), declares=False) for use in self.uses]
        occurrences = [*self.names.occurrences, *used]
        self.names.occurrences = sorted(occurrences, key=lambda occurrence: (occurrence.start, occurrence.end))
        return self.names

    def _meaning(self, use: _Use, scopes: dict[str, list[TextExtent]]) -> NameKey:
        if "local" in use.spaces:
            around = [scope for scope in scopes.get(use.name, ()) if scope[0] <= use.start < scope[1]]
            if around:
                return ("local", use.name, max(around))
        for space in use.spaces:
            if (space, use.name, None) in self.names.declared:
                return (space, use.name, None)
        return (use.spaces[0] if len(use.spaces) == 1 else "", use.name, None)

    def _name(self, node: s.Name, parent: s.SyntaxNode, place: str, above: tuple[s.SyntaxNode, ...]) -> None:
        meaning = _name_place(parent, place)
        if meaning.spaces == () or (isinstance(parent, s.Typed) and not _binds(above)):
            return
        space = _declared(parent, place, meaning, above)
        if space is None and meaning.binds:
            self._declare(node, ("local", node.text, _scope_of(parent, place, above)), parent)
        elif space is None and _is_index(node, parent, above):
            owner = above[-1]
            self._declare(node, ("local", node.text, (owner.start, owner.end)), owner)
        elif space is not None:
            self._declare(node, (space, node.text, None), parent)
        else:
            self.uses.append(_Use(node.text, node.start, node.end, _spaces(parent, place, meaning, above)))

    def _declare(self, node: s.Name, key: NameKey, by: s.SyntaxNode) -> None:
        known = key in self.names.declared
        again = known and key[0] == "role"
        occurrence = Occurrence(node.start, node.end, key, declares=not again, node=by)
        self.names.declared.setdefault(key, occurrence)
        self.names.occurrences.append(occurrence)

    def _holes(self, node: s.TextLine) -> None:
        raw = self.text[node.text.start : node.text.end]
        for hole in _HOLE.finditer(raw):
            if hole[1] is None:
                continue  # a doubled brace stands for one brace
            start = node.text.start + hole.start(1)
            self.uses.append(_Use(hole[1], start, start + len(hole[1]), ("symbol",)))


def _children(node: s.SyntaxNode) -> Iterator[tuple[str, object]]:
    for place in node.__struct_fields__:
        value = getattr(node, place)
        if isinstance(value, tuple):
            for item in value:
                yield place, item
        elif isinstance(value, s.SyntaxNode):
            yield place, value


def _name_place(parent: s.SyntaxNode, place: str) -> NamePlace:
    """The meaning of the names in a field of a node."""
    kind = kind_of(parent)
    return _OTHER_PLACES.get(place, _ANYWHERE) if kind is None else kind.place(place.partition(".")[2])


def _declared(parent: s.SyntaxNode, place: str, meaning: NamePlace, above: tuple[s.SyntaxNode, ...]) -> str | None:
    """The space into which a name is declared; None for a use. Entities and cameras depend on their place."""
    inside = any(isinstance(node, s.MissionBlock) for node in above)
    if place == "EntityBlock.name":
        return "symbol" if inside else "type"
    if place == "CameraBlock.name":
        return None if inside else "preset"
    return meaning.declares or None


def _spaces(parent: s.SyntaxNode, place: str, meaning: NamePlace, above: tuple[s.SyntaxNode, ...]) -> tuple[str, ...]:
    if place == "Bare.name":
        return ("type", "record", "preset") if any(isinstance(node, s.UseLine) for node in above) else ("verb",)
    if place == "CameraBlock.name":
        return ("camera",)
    dependent = isinstance(parent, s.RelationLine) and parent.kind.text == "dependency"
    spaces = meaning.dependency if dependent and meaning.dependency else meaning.spaces
    return SPACES if spaces is None else spaces


_ANYWHERE = NamePlace()


def _binds(above: tuple[s.SyntaxNode, ...]) -> bool:
    return bool(above) and isinstance(above[-1], s.RuleBlock | s.UnlockLine)


def _scope_of(parent: s.SyntaxNode, place: str, above: tuple[s.SyntaxNode, ...]) -> TextExtent:
    """The part of the text in which a local name is known: its quantifier, or the declaration around its parameter."""
    owner = above[-1] if place in ("Typed.name", "ForClause.variable") else parent
    return (owner.start, owner.end)


def _is_index(node: s.Name, parent: s.SyntaxNode, above: tuple[s.SyntaxNode, ...]) -> bool:
    """`i` of `agent scout[i in 1..n]`."""
    return (
        isinstance(parent, s.BinaryExpr)
        and parent.operator == "in"
        and parent.left is node
        and bool(above)
        and parent is getattr(above[-1], "index", None)
    )
