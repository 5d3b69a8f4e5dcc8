"""`upgrade_source`: a text of an earlier version of the language in the newest one, formatted, with the same meaning.

Version 2 added `declassify`. The upgraded text declares every leak of the mission with the reason `as in ljs 1`, for
the author to replace. Libraries change their version alone.
"""

from __future__ import annotations

from lingjing.dsl.checking.leaks import declassified_name
from lingjing.dsl.compilation import compile_source
from lingjing.dsl.formatting.formatter import Formatted, format_source
from lingjing.dsl.printing.phrases import quoted
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.dsl.syntax.statements import LANGUAGE_VERSION
from lingjing.mission.conditions.leaks import AS_BEFORE
from lingjing.mission.diagnostics import has_errors


def upgrade_source(source: SourceText) -> Formatted:
    """Upgrade and format a source. A file with errors is left unchanged, because its leaks are not known."""
    report = Reporter(source)
    tree = parse(report)
    version = tree.items[0] if tree.items else None
    number = version.number if isinstance(version, s.Version) else None
    if not isinstance(number, s.NumberLiteral) or number.value >= LANGUAGE_VERSION:
        return format_source(source)
    compilation = compile_source(source)
    if has_errors(compilation.diagnostics):
        return Formatted(None, compilation.diagnostics)
    edits = [(number.start, number.end, str(LANGUAGE_VERSION))]
    mission = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if mission is not None and compilation.mission is not None:
        lines = [item for item in mission.block.items if isinstance(item, s.DeclassifyLine)]
        written = {declassified_name(channel) for line in lines for channel in line.what}
        implied = [item.what for item in compilation.mission.declassified if item.reason == AS_BEFORE]
        implied = [what for what in implied if what not in written]
        closing = mission.block.end - 1
        if implied:
            edits.append((closing, closing, f"\ndeclassify {', '.join(implied)} because {quoted(AS_BEFORE)}\n"))
    text = source.text
    for start, end, new in reversed(edits):
        text = text[:start] + new + text[end:]
    return format_source(SourceText(text, source.path))
