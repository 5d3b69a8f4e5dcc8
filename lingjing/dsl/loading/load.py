"""Any mission file → `Mission`: `.ljs`, `mission.json` or a `resetScenario` document."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.dsl.compilation import Compilation, compile_file
from lingjing.dsl.diagnostics.render import render_text, summary
from lingjing.dsl.loading.cache import compile_cached
from lingjing.dsl.loading.shipped import find_mission
from lingjing.dsl.source.text import SourceText, read_source, read_stream
from lingjing.errors import MissionError, UsageError
from lingjing.mission.model import Mission

if TYPE_CHECKING:
    from lingjing.mission.diagnostics import Diagnostic

STDIN = "-"
LONGEST_NAME = 100
"""Letters of a mission's name: file systems refuse longer names than some 250 bytes."""


def load_mission(path: str | os.PathLike[str]) -> Mission:
    """The mission of a file, or a shipped one by name (`ssr`). `UsageError` if it cannot be read or holds no mission,
    `MissionError` with the rendered diagnostics if it has errors."""
    mission, _ = load_noted(os.fspath(path))
    return mission


def load_noted(path: str) -> tuple[Mission, tuple[str, ...]]:
    """The mission of a file or of a shipped name and, for a document, notes on how it was understood."""
    source = source_of(str(find_mission(path)))
    if is_document(source):
        mission, notes = read_document(source)
        _winnable(mission, source)
        return mission, notes
    return mission_of(compile_cached(source)), ()


def source_of(path: str) -> SourceText:
    """The text of a file, or of standard input for `-`."""
    if path == STDIN:
        return read_stream(sys.stdin.buffer, "<stdin>")
    return read_source(path)


def is_document(source: SourceText) -> bool:
    """Whether the text is JSON: by the file's name, or for standard input by its first character."""
    if source.path == "<stdin>":
        return source.text.lstrip()[:1] in ("{", "[")
    return source.path.lower().endswith(".json")


def read_document(source: SourceText) -> tuple[Mission, tuple[str, ...]]:
    """The mission of a `mission.json` or a `resetScenario` document, and notes."""
    from lingjing.mission.document import read

    return read(source.text, source.path, templates_beside(Path(source.path).parent))


def proofs(mission: Mission, source: SourceText) -> tuple[Diagnostic, ...]:
    """Why the mission of a document would be refused as a text, cannot be won or cannot be played, at the document's
    first line."""
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.feasibility import prove
    from lingjing.mission.interactions import faults_of
    from lingjing.mission.trial import trial

    start = source.span(0, 0)
    refused = tuple(Diagnostic(one.code, start, f"{path}: {one.message}", one.hint) for path, one in faults_of(mission))
    if refused:
        return refused

    def told(message: str, path: str = "") -> str:
        place = place_of(mission, path, message)
        return f"{place}: {message}" if place else message

    found = [
        Diagnostic(one.code, start, told(one.message), one.hint, severity="warning" if one.partly else "error")
        for one in prove(mission)
    ]
    tried = (Diagnostic(item.code, start, told(item.message, item.path), item.hint) for item in trial(mission))
    return (*found, *tried)


def place_of(mission: Mission, path: str, message: str) -> str:
    """JSON path at which the mission's document places the entity or group that a fault is about, else ""."""
    places = mission.origin.places
    names = [*re.findall(r"[`']([^`']+)[`']", message), *path.split("/")[1:]]
    for name in names:
        if name in places:
            return places[name]
    groups = {one.partition("[")[0]: where for one, where in reversed(places.items())}
    return next((re.sub(r"\[\d+\](\.data)?$", "", groups[name]) for name in names if name in groups), "")


def _winnable(mission: Mission, source: SourceText) -> None:
    """`MissionError` for the mission of a document that cannot be won, as for one written in the language."""
    from lingjing.mission.diagnostics import has_errors

    found = proofs(mission, source)
    if has_errors(found):
        raise MissionError(f"{summary(found)}\n\n{render_text(found, source).rstrip()}")


def templates_beside(folder: Path) -> Callable[[str], Mission]:
    """Finds a document's template by name: in the document's own folder, else among the shipped missions and those that
    are shipped for documents alone (`scenarios/reset`).

    The function raises `KeyError` if there is none.
    """

    def find(name: str) -> Mission:
        if not name.isidentifier() or len(name) > LONGEST_NAME:
            raise KeyError(name)
        from lingjing.data import data_path

        shipped = (data_path("scenarios", f"{name}.ljs"), data_path("scenarios", "reset", f"{name}.ljs"))
        for file in (folder / f"{name}.ljs", *shipped):
            if file.is_file():
                return mission_of(compile_file(str(file)))
        raise KeyError(name)

    return find


def mission_of(compilation: Compilation) -> Mission:
    """The mission of a compilation, or a `MissionError` that shows all its errors."""
    if compilation.mission is not None:
        return compilation.mission
    path = compilation.source.path
    if not compilation.diagnostics:
        raise UsageError(f"`{path}` holds types and no mission", hint="name a file with `mission … { … }`")
    shown = render_text(compilation.diagnostics, compilation.source)
    raise MissionError(f"{summary(compilation.diagnostics)}\n\n{shown.rstrip()}")
