"""Any mission file → `Mission`: `.ljs`, `mission.json` or a `resetScenario` document."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from lingjing.dsl.compilation import Compilation
from lingjing.dsl.diagnostics.render import render_text, summary
from lingjing.dsl.loading.cache import compile_cached
from lingjing.dsl.loading.shipped import mission_file
from lingjing.dsl.source.text import SourceText, read_source, read_stream
from lingjing.errors import MissionError, UsageError
from lingjing.mission.model import Mission

if TYPE_CHECKING:
    from pathlib import Path

    from lingjing.mission.diagnostics import Diagnostic

STDIN = "-"
"""Name of standard input on the command line."""
LONGEST_NAME = 100
"""Most letters of a mission's name: file systems permit names of about 250 bytes."""


def load_mission(path: str | os.PathLike[str]) -> Mission:
    """Load the mission of a file, or a shipped one by name (`ssr`).

    >>> mission = lingjing.compile("ssr")
    >>> mission.name, mission.modes.default
    ('ssr', 'broadcast')

    Raises `UsageError` if it cannot be read or holds no mission, `MissionError` with the rendered diagnostics if it has
    errors.
    """
    mission, _ = load_with_notes(os.fspath(path))
    return mission


def load_with_notes(path: str) -> tuple[Mission, tuple[str, ...]]:
    """Load the mission of a file or of a shipped name. For a document, also return notes on its interpretation."""
    source = source_of(mission_file(path))
    if is_document(source):
        mission, notes = read_document(source)
        _check_winnable(mission, source)
        return mission, notes
    return mission_of(compile_cached(source)), ()


def source_of(path: str) -> SourceText:
    """The text of a file, or of standard input for `-`."""
    if path == STDIN:
        return read_stream(sys.stdin.buffer, "<stdin>")
    return read_source(path)


def is_document(source: SourceText) -> bool:
    """True for JSON: by the file's name, or for standard input by its first character."""
    if source.path == "<stdin>":
        return source.text.lstrip()[:1] in ("{", "[")
    return source.path.lower().endswith(".json")


def read_document(source: SourceText) -> tuple[Mission, tuple[str, ...]]:
    """The mission of a `mission.json` or a `resetScenario` document, and notes."""
    from pathlib import Path  # it takes 4 ms of a cold start

    from lingjing.mission.document import read

    return read(source.text, source.path, templates_beside(Path(source.path).parent))


def proofs(mission: Mission, source: SourceText) -> tuple[Diagnostic, ...]:
    """Errors and proofs about a document's mission, at the document's first line.

    These are the errors that its text would have, the proofs that it cannot be won, and the errors of building it.
    """
    from lingjing.mission.conditions.exposures import HINT, exposures
    from lingjing.mission.conditions.leaks import leaks
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.feasibility import prove
    from lingjing.mission.interactions import faults_of
    from lingjing.mission.trial import trial

    start = source.span(0, 0)
    errors = tuple(
        Diagnostic(fault.code, start, f"{path}: {fault.message}", fault.hint) for path, fault in faults_of(mission)
    )
    errors += tuple(Diagnostic("LJ0401", start, shown.message, HINT) for shown in exposures(mission))
    declared = {item.what for item in mission.declassified}
    errors += tuple(
        Diagnostic("LJ0404", start, leak.message, f"add `{leak.what}` to `declassified` if agents may know it")
        for leak in leaks(mission)
        if leak.what not in declared
    )
    if errors:
        return errors

    def located(message: str, path: str = "") -> str:
        place = place_of(mission, path, message)
        return f"{place}: {message}" if place else message

    proved = [
        Diagnostic(
            fault.code, start, located(fault.message), fault.hint, severity="warning" if fault.partly else "error"
        )
        for fault in prove(mission)
    ]
    tried = (Diagnostic(item.code, start, located(item.message, item.path), item.hint) for item in trial(mission))
    return (*proved, *tried)


def place_of(mission: Mission, path: str, message: str) -> str:
    """JSON path at which a document places the entity or group that a message names; "" without one."""
    places = mission.origin.places
    names = [*re.findall(r"[`']([^`']+)[`']", message), *path.split("/")[1:]]
    for name in names:
        if name in places:
            return places[name]
    groups = {path_name.partition("[")[0]: where for path_name, where in reversed(places.items())}
    return next((re.sub(r"\[\d+\](\.data)?$", "", groups[name]) for name in names if name in groups), "")


def _check_winnable(mission: Mission, source: SourceText) -> None:
    """Raise `MissionError` if a document's mission cannot be won, as for a mission in the language."""
    from lingjing.mission.diagnostics import has_errors

    diagnostics = proofs(mission, source)
    if has_errors(diagnostics):
        text = f"{summary(diagnostics)}\n\n{render_text(diagnostics, source).rstrip()}"
        raise MissionError(text, diagnostics=tuple(diagnostics))


def templates_beside(folder: Path) -> Callable[[str], Mission]:
    """Return a function that finds a document's template by name.

    It searches the document's own folder, then the shipped missions, then those that are shipped for documents alone
    (`scenarios/reset`). It raises `KeyError` if there is none.
    """

    def find(name: str) -> Mission:
        if not name.isidentifier() or len(name) > LONGEST_NAME:
            raise KeyError(name)
        from lingjing.data import data_path

        shipped = (data_path("scenarios", f"{name}.ljs"), data_path("scenarios", "reset", f"{name}.ljs"))
        for file in (folder / f"{name}.ljs", *shipped):
            if file.is_file():
                return mission_of(compile_cached(read_source(str(file))))
        raise KeyError(name)

    return find


def mission_of(compilation: Compilation) -> Mission:
    """The mission of a compilation. Raises `MissionError` with all errors if it has any."""
    if compilation.mission is not None:
        return compilation.mission
    path = compilation.source.path
    if not compilation.diagnostics:
        raise UsageError(f"`{path}` holds types and no mission", hint="name a file with `mission … { … }`")
    shown = render_text(compilation.diagnostics, compilation.source)
    text = f"{summary(compilation.diagnostics)}\n\n{shown.rstrip()}"
    raise MissionError(text, diagnostics=tuple(compilation.diagnostics))
