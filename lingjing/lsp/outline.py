"""The symbols of a file: its declarations, nested as their blocks are."""

from __future__ import annotations

from dataclasses import dataclass, field

from lingjing.dsl.syntax import tree as s


@dataclass(slots=True)
class OutlineEntry:
    """One declaration: what it is, where it and its name stand (offsets), and what is declared in its block."""

    name: str
    keyword: str
    detail: str
    start: int
    end: int
    name_start: int
    name_end: int
    children: list[OutlineEntry] = field(default_factory=list)


def outline(tree: s.File) -> list[OutlineEntry]:
    """The file's declarations in order."""
    return _entries(tree.items)


def _entries(items: tuple[s.Statement, ...]) -> list[OutlineEntry]:
    found: list[OutlineEntry] = []
    for item in items:
        inner = getattr(item, "item", item)
        block = getattr(inner, "block", None)
        children = _entries(block.items) if isinstance(block, s.BracedBlock) else []
        keyword = inner.keyword if isinstance(inner, s.EntityBlock) else s.DECLARING.get(type(inner))
        name = getattr(inner, "name", None)
        if keyword is None or not isinstance(name, s.Name):
            found.extend(children)
            continue
        found.append(
            OutlineEntry(name.text, keyword, _detail(inner), item.start, item.end, name.start, name.end, children)
        )
    return found


def _detail(item: s.Statement) -> str:
    kind = getattr(item, "type", None) or getattr(item, "role", None) or getattr(item, "category", None)
    if isinstance(item, s.MissionBlock) and item.title is not None:
        return item.title.value
    return kind.text if isinstance(kind, s.Name) else ""
