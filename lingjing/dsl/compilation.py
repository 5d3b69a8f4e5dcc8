"""Compilation: a text → `Mission` and diagnostics, by parsing, checking and proofs about feasibility."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from lingjing.dsl.source.text import SourceText

if TYPE_CHECKING:
    from lingjing.dsl.feasibility.providers import Offers
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.model import Mission


class Compilation(msgspec.Struct, frozen=True):
    """The outcome of one compilation."""

    mission: Mission | None
    """The compiled mission; None if the file has an error or holds types only."""
    diagnostics: tuple[Diagnostic, ...]
    """The diagnostics, in source order."""
    source: SourceText


def compile_text(text: str, *, path: str = "<string>") -> Compilation:
    """Compile a mission's text. Errors in the text become diagnostics, never exceptions."""
    return compile_source(SourceText(text, path))


def compile_file(path: str) -> Compilation:
    """Compile a mission file. Raises `UsageError` if it cannot be read as text."""
    from lingjing.dsl.source.text import read_source

    return compile_source(read_source(path))


def compile_source(source: SourceText, *, offers: Offers | None = None) -> Compilation:
    """Compile a source: parse it, check it, and test whether the mission can be won.

    `offers`: the names that plug-ins offer; with it, a missing scene, engine or map is a warning.
    """
    from lingjing.collector import collector_at_rest

    with collector_at_rest():
        return _compile(source, offers)


def _compile(source: SourceText, offers: Offers | None) -> Compilation:
    from lingjing.dsl.checking.checker import check
    from lingjing.dsl.checking.leaks import check_leaks
    from lingjing.dsl.feasibility.infeasibility import report_infeasibility
    from lingjing.dsl.feasibility.playability import check_playability
    from lingjing.dsl.source.reporter import Reporter
    from lingjing.dsl.syntax.parser import parse
    from lingjing.mission.diagnostics import has_errors, in_source_order

    report = Reporter(source)
    if not source.text.strip():
        report("LJ0007", 0, 0, "the file is empty", "begin with `ljs 2`; the shipped mission `ssr` is an example")
        return Compilation(None, tuple(report.diagnostics), source)
    tree = parse(report)
    mission = check(tree, report)
    if mission is None:
        return Compilation(None, in_source_order(tuple(report.diagnostics)), source)
    mission = check_leaks(mission, tree, report)
    report_infeasibility(mission, tree, report)
    check_playability(mission, tree, report)
    if offers is not None:
        from lingjing.dsl.feasibility.providers import check_providers

        check_providers(mission, tree, report, offers)
    diagnostics = in_source_order(tuple(report.diagnostics))
    return Compilation(None if has_errors(diagnostics) else mission, diagnostics, source)
