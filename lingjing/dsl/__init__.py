"""The mission language `.ljs`: text in, `Mission` and diagnostics out.

Phases, each a plain function, in the order a text passes them:

- `source`: read and decode; where an offset stands. `reporter`: where phases put their diagnostics.
- `tokens`, `lexer`: text → tokens; newlines only at statement boundaries, braces balanced.
- `ljs.lark`, `tables`, `builder`, `parser`: tokens → `syntax` tree; lark's LALR(1) tables, recovery at statements.
  `confusable`: names whose letters look like others.
- `toplevel`, `library`: the top of a file and what `use` finds; `inherit`: what `extends` brings.
  `scope`: what names mean; `unknown`: names nobody declared.
- `elaborate`, `calls`, `aggregates`, `typenames`: expressions, typed, with the way hidden values take.
- `blocks`, `types`, `interactions`, `settings`, `entities`, `equipment`, `agents`, `wording`, `rules`, `conduct`,
  `events`, `studies`, `checker`: declarations → `Checked`.
- `properties`, `lower`: `Checked` → `lingjing.mission.model.Mission`. `refused`: what playing it would refuse.
  `infeasible`: why it cannot be won, if proved.
  `absent`: what it names and nobody here offers.
- `render`, `sarif`, `codes`, `suggest`, `fixes`: diagnostics for people and programs, and what mends them.
- `shipped`, `load`, `cache`: a file or a shipped name → `Mission`, kept by content. `collector`: speed for big trees.
- `layout`, `spacing`, `columns`, `format`: text → the same text laid out the one way.
- `phrases`, `imports`, `print`: `Mission` → text that compiles to it.
- `words`, `judging`, `page`: `Mission` → expressions in words, the table of what is adjudicated, a page for readers.

Invariants: every error of a file is reported in one run, in source order; a faulty part is never looked at again, its
good neighbours are; nothing but `UsageError` (unreadable input) and `PluginError` is ever raised for a bad text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from lingjing.dsl.source import Source

if TYPE_CHECKING:
    from lingjing.dsl.absent import Offers
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.model import Mission

__all__ = ["Compilation", "Source", "compile_file", "compile_source", "compile_text"]


class Compilation(msgspec.Struct, frozen=True):
    """The outcome of one compilation: `mission` is None if there is an error, or if the file holds types only."""

    mission: Mission | None
    diagnostics: tuple[Diagnostic, ...]
    source: Source


def compile_text(text: str, *, path: str = "<string>") -> Compilation:
    """Compile a mission's text. Never raises for what the text says."""
    return compile_source(Source(text, path))


def compile_file(path: str) -> Compilation:
    """Compile a mission file; `UsageError` if it cannot be read as text."""
    from lingjing.dsl.source import read_source

    return compile_source(read_source(path))


def compile_source(source: Source, *, offers: Offers | None = None) -> Compilation:
    """Compile a source: parse, check, lower if there was no error, and look whether the mission can be won.

    With `offers` (the names that plug-ins offer) a scene or an engine that is not installed is a warning.
    """
    from lingjing.dsl.collector import collector_at_rest

    with collector_at_rest():
        return _compile(source, offers)


def _compile(source: Source, offers: Offers | None) -> Compilation:
    from lingjing.dsl.checker import check
    from lingjing.dsl.infeasible import infeasible
    from lingjing.dsl.lower import lower
    from lingjing.dsl.parser import parse
    from lingjing.dsl.refused import refused
    from lingjing.dsl.reporter import Reporter
    from lingjing.mission.diagnostics import has_errors, in_source_order

    report = Reporter(source)
    if not source.text.strip():
        report("LJ0007", 0, 0, "the file is empty", "begin with `ljs 1`; the shipped mission `ssr` is an example")
        return Compilation(None, tuple(report.diagnostics), source)
    tree = parse(report)
    checked = check(tree, report)
    diagnostics = in_source_order(tuple(report.diagnostics))
    if checked is None or has_errors(diagnostics):
        return Compilation(None, diagnostics, source)
    mission = lower(checked, report.source)
    infeasible(mission, tree, report)
    refused(mission, tree, report)
    if offers is not None:
        from lingjing.dsl.absent import absent

        absent(mission, tree, report, offers)
    diagnostics = in_source_order(tuple(report.diagnostics))
    return Compilation(None if has_errors(diagnostics) else mission, diagnostics, source)
