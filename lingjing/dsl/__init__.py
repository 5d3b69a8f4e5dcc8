"""The mission language `.ljs`: text in, `Mission` and diagnostics out.

Packages, each a phase that knows those before it, in the order a text passes them:

- `source`: a text, where an offset stands in it, and where phases put their diagnostics.
- `syntax`: text → tokens → syntax tree, with recovery.
- `checking`: syntax tree → `lingjing.mission.model.Mission`: names, types, dimensions, hidden values.
- `feasibility`: why a mission without errors cannot be won, cannot be played, or not here.
- `compilation`: these four as one function. A text is compiled by `compile_text`, `compile_file`, `compile_source`.
- `formatting`: text → the same text laid out the one way.
- `printing`: `Mission` → text that compiles to it. `pages`: `Mission` → what a reader is told of it.
- `diagnostics`: diagnostics for people and programs, and what mends them.
- `loading`: a file or a shipped name → `Mission`, kept by content.

Invariants: every error of a file is reported in one run, in source order; a faulty part is never looked at again, its
good neighbours are; nothing but `UsageError` (unreadable input) and `PluginError` is ever raised for a bad text.
"""

from __future__ import annotations

from lingjing.dsl.compilation import Compilation, compile_file, compile_source, compile_text
from lingjing.dsl.source.text import SourceText

__all__ = ["Compilation", "SourceText", "compile_file", "compile_source", "compile_text"]
