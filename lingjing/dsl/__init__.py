"""The mission language `.ljs`: text in, `Mission` and diagnostics out.

A text becomes *tokens*, then a *syntax tree* of statements and expressions, then a `Mission`, which is the typed
mission graph. Each error is a *diagnostic*: a code, a place in the text (*span*), a message, a hint, and perhaps a
*fix*.

The packages are phases. Each uses only those before it, in the order in which a text passes them:

- `source`: a text, the line and column of an offset, and the collector of diagnostics.
- `syntax`: text → tokens → syntax tree, with recovery after errors.
- `checking`: syntax tree → `lingjing.mission.model.Mission`: names, types, dimensions, hidden values.
- `feasibility`: proofs that a mission without errors cannot be won, or cannot be played, or not on this machine.
- `compilation`: these four as one function (`compile_text`, `compile_file`, `compile_source`).
- `formatting`: text → the same text in the standard layout.
- `printing`: `Mission` → text that compiles to it. `pages`: `Mission` → documentation page.
- `diagnostics`: diagnostics for users and programs, and the application of fixes.
- `upgrade`: a text of an earlier version of the language → one of the newest.
- `loading`: a file or the name of a shipped mission → `Mission`, cached by content.

Invariants: one run reports every error of a file, in source order. A faulty part is left out of later checks; the parts
around it are checked. A bad text raises nothing but `UsageError` (unreadable input) and `PluginError`.
"""

from __future__ import annotations

from lingjing.dsl.compilation import Compilation, compile_file, compile_source, compile_text
from lingjing.dsl.source.text import SourceText

__all__ = ["Compilation", "SourceText", "compile_file", "compile_source", "compile_text"]
