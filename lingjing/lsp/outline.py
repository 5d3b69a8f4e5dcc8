"""The symbols of a file: its declarations, nested like their blocks."""

from __future__ import annotations

from dataclasses import dataclass, field

from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import keyword_of


@dataclass(slots=True)
class OutlineEntry:
    """One declaration. Its extents are offsets."""

    name: str
    """Declared name."""
    keyword: str
    """Keyword of the declaration."""
    detail: str
    """Its type, role or title; empty without one."""
    start: int
    """First character of the statement."""
    end: int
    """Offset after the statement."""
    name_start: int
    """First character of the name."""
    name_end: int
    """Offset after the name."""
    children: list[OutlineEntry] = field(default_factory=list)
    """Declarations in its block."""


def outline(tree: s.File) -> list[OutlineEntry]:
    """The file's declarations, in order."""
    return _entries(tree.items)


def _entries(items: tuple[s.Statement, ...]) -> list[OutlineEntry]:
    entries: list[OutlineEntry] = []
    for item in items:
        inner = getattr(item, "item", item)
        block = getattr(inner, "block", None)
        children = _entries(block.items) if isinstance(block, s.BracedBlock) else []
        keyword, name = keyword_of(inner), getattr(inner, "name", None)
        if keyword is None or not isinstance(name, s.Name):
            entries.extend(children)
            continue
        entries.append(
            OutlineEntry(name.text, keyword, _detail(inner), item.start, item.end, name.start, name.end, children)
        )
    return entries


def _detail(item: s.Statement) -> str:
    kind = getattr(item, "type", None) or getattr(item, "role", None) or getattr(item, "category", None)
    if isinstance(item, s.MissionBlock) and item.title is not None:
        return item.title.value
    return kind.text if isinstance(kind, s.Name) else ""
