"""Renaming: the places to change, or the reason why it cannot be."""

from __future__ import annotations

import re

from lingjing.dsl.syntax.tokens import INNER, STATEMENTS
from lingjing.errors import UsageError
from lingjing.lsp.analysis import Analysis
from lingjing.lsp.names import GLOBAL, NameKey, Occurrence
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS
from lingjing.mission.vocabulary import EVERYONE, MODES

_WORD = re.compile(r"[^\W\d]\w*")
_RESERVED = frozenset((EVERYONE, "events", "peers", "mode", "tick", *MODES))


def renamable(analysis: Analysis, offset: int) -> Occurrence:
    """The name at an offset; raises `UsageError` if there is none of this file's own."""
    one = analysis.names.at(offset)
    if one is None:
        raise UsageError("there is no name here")
    if one.key not in analysis.names.declared:
        raise UsageError(f"`{one.key[1]}` is not declared in this file")
    return one


def rename(analysis: Analysis, offset: int, new: str) -> list[Occurrence]:
    """The places where the new name goes; raises `UsageError` if it is no name, is taken, or changes the mission."""
    one = renamable(analysis, offset)
    if not _WORD.fullmatch(new):
        raise UsageError(f"`{new}` is no name: a name is letters, digits and _, and begins with no digit")
    if new in STATEMENTS or new in INNER:
        raise UsageError(f"`{new}` is a word of the language")
    if new in _RESERVED or new in FUNCTIONS or new in DISTRIBUTIONS:
        raise UsageError(f"`{new}` is built in")
    if new == one.key[1]:
        return []
    taken = _taken(analysis, one.key, new)
    if taken is not None:
        line = analysis.source.line_of(taken.start)
        raise UsageError(f"`{new}` is already declared in line {line}")
    places = analysis.names.of(one.key)
    _must_compile_as_before(analysis, places, new)
    return places


def applied(text: str, places: list[Occurrence], new: str) -> str:
    """The text with the new name in all the places."""
    parts: list[str] = []
    at = 0
    for place in places:
        parts.extend((text[at : place.start], new))
        at = place.end
    return "".join([*parts, text[at:]])


def _taken(analysis: Analysis, key: NameKey, new: str) -> Occurrence | None:
    """A declaration the new name would clash with, or hide, or be hidden by."""
    declared = analysis.names.declared
    for space in GLOBAL:
        if (space, new, None) in declared:
            return declared[space, new, None]
    if key[0] == "local" and key[2] is not None:
        scopes = [key[2]]
    else:
        scopes = [(place.start, place.end) for place in analysis.names.of(key)]
    for (space, name, around), one in declared.items():
        if space != "local" or name != new or around is None:
            continue
        if any(around[0] <= end and start <= around[1] for start, end in scopes):
            return one
    return None


def _must_compile_as_before(analysis: Analysis, places: list[Occurrence], new: str) -> None:
    if analysis.diagnostics:
        return
    after = Analysis(applied(analysis.source.text, places, new), analysis.source.path)
    if after.diagnostics:
        raise UsageError(f"`{new}` cannot be the name: {after.diagnostics[0].message}")
