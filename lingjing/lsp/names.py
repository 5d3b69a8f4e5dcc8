"""Where names are declared and where they are used: occurrences, grouped by what they mean.

The tables below say which field of which node declares into which space and in which spaces a use is looked up. A name
in a place the tables do not mention is looked up everywhere, so a new statement of the grammar is half known at once.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing.dsl.syntax import tree as s

TextExtent = tuple[int, int]
NameKey = tuple[str, str, TextExtent | None]
"""Space, name, and for what is known in a part of the text only, that part."""

SYMBOLS = frozenset(("param", "region", "grid"))
"""What these declare shares one space. The rest have a space each, called as they begin; entities and cameras depend on
where they stand, see `_declared`."""

LOCALS = frozenset(
    ("StageBlock.variable", "ConstraintBlock.variable", "QuantifiedExpr.variable", "ForClause.variable", "Typed.name")
)
USES: dict[str, tuple[str, ...]] = {
    "EntityBlock.type": ("type",),
    "CameraBlock.type": ("preset",),
    "MessageLine.type": ("record",),
    "MessageLine.senders": ("role",),
    "MessageLine.recipients": ("role",),
    "AuthorityLine.role": ("role",),
    "AuthorityLine.roles": ("role",),
    "RevealLine.role": ("role",),
    "CallExpr.function": ("rule",),
    "UnlockLine.name": ("interaction",),
    "Typed.type": ("symbol", "message"),
}
SILENT = frozenset(
    (
        "FieldExpr.name",
        "PropertyLine.name",
        "CallArgument.name",
        "RelationLine.kind",
        "ConstraintBlock.kind",
        "SceneBlock.kind",
        "ModeLine.default",
        "RecordBlock.category",
        "RevealLine.what",
        "UseLine.path",
        "UnknownBlock.name",
        "MountBlock.view",
        "PartBlock.name",
        "PartBlock.shape",
    )
)
"""Words of the language's own tables, and fields of other things: no names of declarations."""

SPACES = (
    "local", "symbol", "type", "message", "limit", "inspection", "agent", "role", "stage", "interaction", "rule",
    "event", "record", "preset", "verb", "constraint",
)  # fmt: skip
GLOBAL = tuple(space for space in SPACES if space not in ("local", "verb"))
_HOLE = re.compile(r"\{\{|\{\s*([^\W\d]\w*)")


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One name in the text. `key` says what it means; two with one key mean the same. `node` is what declares it."""

    start: int
    end: int
    key: NameKey
    declares: bool
    node: s.SyntaxNode | None = None


@dataclass(slots=True)
class _Use:
    name: str
    start: int
    end: int
    spaces: tuple[str, ...]


@dataclass(slots=True)
class Names:
    """All occurrences of a file, by place; `declared` holds the first declaration of each key."""

    occurrences: list[Occurrence] = field(default_factory=list)
    declared: dict[NameKey, Occurrence] = field(default_factory=dict)

    def at(self, offset: int) -> Occurrence | None:
        """The occurrence a cursor stands in or right behind."""
        index = bisect_right(self.occurrences, offset, key=lambda one: one.start) - 1
        for candidate in self.occurrences[max(0, index - 1) : index + 1][::-1]:
            if candidate.start <= offset <= candidate.end:
                return candidate
        return None

    def of(self, key: NameKey) -> list[Occurrence]:
        """All that mean the same."""
        return [one for one in self.occurrences if one.key == key]

    def locals_at(self, offset: int) -> list[Occurrence]:
        """Bound names known at a place, innermost first."""
        found = [
            one
            for key, one in self.declared.items()
            if key[0] == "local" and key[2] is not None and key[2][0] <= offset <= key[2][1]
        ]
        return sorted(found, key=lambda one: one.key[2] or (0, 0), reverse=True)


def find_names(tree: s.File, text: str) -> Names:
    """Walk the tree once for declarations and uses, then resolve the uses."""
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
        found = [*self.names.occurrences, *used]
        self.names.occurrences = sorted(found, key=lambda one: (one.start, one.end))
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
        if place in SILENT or (isinstance(parent, s.Typed) and not _binds(above)):
            return
        space = _declared(parent, place, above)
        if space is None and place in LOCALS:
            self._declare(node, ("local", node.text, _scope_of(parent, place, above)), parent)
        elif space is None and _is_index(node, parent, above):
            owner = above[-1]
            self._declare(node, ("local", node.text, (owner.start, owner.end)), owner)
        elif space is not None:
            self._declare(node, (space, node.text, None), parent)
        else:
            self.uses.append(_Use(node.text, node.start, node.end, _spaces(parent, place, above)))

    def _declare(self, node: s.Name, key: NameKey, by: s.SyntaxNode) -> None:
        known = key in self.names.declared
        again = known and key[0] == "role"
        one = Occurrence(node.start, node.end, key, declares=not again, node=by)
        self.names.declared.setdefault(key, one)
        self.names.occurrences.append(one)

    def _holes(self, node: s.TextLine) -> None:
        raw = self.text[node.text.start : node.text.end]
        for hole in _HOLE.finditer(raw):
            if hole[1] is None:
                continue  # a doubled brace stands for itself
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


def _declared(parent: s.SyntaxNode, place: str, above: tuple[s.SyntaxNode, ...]) -> str | None:
    """The space that a name is declared into; None if it is a use of one."""
    inside = any(isinstance(node, s.MissionBlock) for node in above)
    if place == "AgentBlock.role":
        return "role"
    if place == "EntityBlock.name":
        return "symbol" if inside else "type"
    if place == "CameraBlock.name":
        return None if inside else "preset"
    if place == "RuleBlock.name":
        return "rule"
    word = s.DECLARING.get(type(parent)) if place.endswith(".name") and place not in USES else None
    return "symbol" if word in SYMBOLS else word


def _spaces(parent: s.SyntaxNode, place: str, above: tuple[s.SyntaxNode, ...]) -> tuple[str, ...]:
    if place == "Bare.name":
        return ("type", "record", "preset") if any(isinstance(node, s.UseLine) for node in above) else ("verb",)
    if isinstance(parent, s.RelationLine):
        return ("stage",) if parent.kind.text == "dependency" else ("role",)
    if place == "CameraBlock.name":
        return ("camera",)
    return USES.get(place, SPACES)


def _binds(above: tuple[s.SyntaxNode, ...]) -> bool:
    return bool(above) and isinstance(above[-1], s.RuleBlock | s.UnlockLine)


def _scope_of(parent: s.SyntaxNode, place: str, above: tuple[s.SyntaxNode, ...]) -> TextExtent:
    """Where a bound name is known: its quantifier, or the declaration around its parameter."""
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
