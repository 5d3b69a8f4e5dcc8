"""Renaming: the places to change, or the reason why it is impossible."""

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
"""Names with a built-in meaning."""


def renamable(analysis: Analysis, offset: int) -> Occurrence:
    """The name at an offset. Raises `UsageError` if there is no name that this file declares."""
    occurrence = analysis.names.at(offset)
    if occurrence is None:
        raise UsageError("there is no name here")
    if occurrence.key not in analysis.names.declared:
        raise UsageError(f"`{occurrence.key[1]}` is not declared in this file")
    return occurrence


def rename(analysis: Analysis, offset: int, new: str) -> list[Occurrence]:
    """The places of the new name. Raises `UsageError` if it is no name, is in use, or changes the mission."""
    occurrence = renamable(analysis, offset)
    if not _WORD.fullmatch(new):
        raise UsageError(f"`{new}` is no name: a name is letters, digits and _, and begins with no digit")
    if new in STATEMENTS or new in INNER:
        raise UsageError(f"`{new}` is a word of the language")
    if new in _RESERVED or new in FUNCTIONS or new in DISTRIBUTIONS:
        raise UsageError(f"`{new}` is built in")
    if new == occurrence.key[1]:
        return []
    clash = _clash(analysis, occurrence.key, new)
    if clash is not None:
        line = analysis.source.line_of(clash.start)
        raise UsageError(f"`{new}` is already declared in line {line}")
    places = analysis.names.of(occurrence.key)
    _must_compile_as_before(analysis, places, new)
    return places


def applied(text: str, places: list[Occurrence], new: str) -> str:
    """The text with the new name at all places."""
    parts: list[str] = []
    at = 0
    for place in places:
        parts.extend((text[at : place.start], new))
        at = place.end
    return "".join([*parts, text[at:]])


def _clash(analysis: Analysis, key: NameKey, new: str) -> Occurrence | None:
    """A declaration that conflicts with the new name, hides it or is hidden by it; None without one."""
    declared = analysis.names.declared
    for space in GLOBAL:
        if (space, new, None) in declared:
            return declared[space, new, None]
    if key[0] == "local" and key[2] is not None:
        scopes = [key[2]]
    else:
        scopes = [(place.start, place.end) for place in analysis.names.of(key)]
    for (space, name, around), declaration in declared.items():
        if space != "local" or name != new or around is None:
            continue
        if any(around[0] <= end and start <= around[1] for start, end in scopes):
            return declaration
    return None


def _must_compile_as_before(analysis: Analysis, places: list[Occurrence], new: str) -> None:
    if analysis.diagnostics:
        return
    after = Analysis(applied(analysis.source.text, places, new), analysis.source.path)
    if after.diagnostics:
        raise UsageError(f"`{new}` cannot be the name: {after.diagnostics[0].message}")
