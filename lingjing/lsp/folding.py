"""The parts of a text that an editor can fold: blocks, comments of several lines, and the `use` lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from lingjing.dsl.syntax import tree as s
from lingjing.lsp.analysis import Analysis


class Fold(NamedTuple):
    """Lines that can be folded, counted from 1."""

    first: int
    last: int
    kind: str
    """`region`, `comment` or `imports`."""


def folds(analysis: Analysis) -> list[Fold]:
    """The folds of a text in order."""
    source = analysis.source
    ranges = [
        Fold(source.line_of(start), source.line_of(end) - 1, "region") for start, end in _blocks(analysis.tree.items)
    ]
    uses = [source.line_of(item.start) for item in analysis.tree.items if isinstance(item, s.UseLine)]
    ranges += [Fold(uses[0], uses[-1], "imports")] if len(uses) > 1 else []
    ranges += _comments(source.text)
    return sorted({fold for fold in ranges if fold.last > fold.first})


def _blocks(items: Iterable[s.Statement]) -> Iterator[tuple[int, int]]:
    for item in items:
        inner = getattr(item, "item", item)
        block = getattr(inner, "block", None)
        if isinstance(block, s.BracedBlock):
            yield item.start, block.end
            yield from _blocks(block.items)


def _comments(text: str) -> Iterator[Fold]:
    first = 0
    lines = text.splitlines()
    for number, line in enumerate([*lines, ""], 1):
        if line.lstrip().startswith("#"):
            first = first or number
            continue
        if first:
            yield Fold(first, number - 1, "comment")
        first = 0
