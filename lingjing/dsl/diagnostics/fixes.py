"""Application of the fixes that diagnostics offer: only the safe ones, or all on request.

A fix is *safe* if it is certainly the author's intention; the others are guesses that a user should check. Fixes are
applied in rounds, because one may uncover another. A round that does not reduce the errors is discarded. Only
`write_text` writes a file, which it replaces in one step.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import msgspec

from lingjing.dsl.source.text import SourceText
from lingjing.errors import UsageError
from lingjing.mission.diagnostics import Diagnostic, Edit, Fix

if TYPE_CHECKING:
    from lingjing.dsl.compilation import Compilation

ROUNDS = 10
"""Most rounds of fixing (chosen)."""


class Applied(msgspec.Struct, frozen=True):
    """One applied fix."""

    line: int
    """Line of the diagnostic."""
    code: str
    """Code of the diagnostic."""
    title: str
    """Description of the fix."""


class FixedText(msgspec.Struct, frozen=True):
    """A text after its fixes."""

    text: str
    """The fixed text."""
    applied: tuple[Applied, ...]
    """The applied fixes, in order."""
    compilation: Compilation
    """The compilation of the fixed text."""


def fix_source(
    source: SourceText, compile_it: Callable[[SourceText], Compilation], *, unsafe: bool = False
) -> FixedText:
    """Compile, apply the fixes that do not touch each other, and repeat until none is left."""
    compilation = compile_it(source)
    applied: list[Applied] = []
    for _ in range(ROUNDS):
        chosen = choose(compilation.diagnostics, source.path, unsafe=unsafe)
        if not chosen:
            break
        text = apply_edits(source.text, [edit for _, fix in chosen for edit in fix.edits])
        changed = SourceText(text, source.path)
        after = compile_it(changed)
        if _errors(after) >= _errors(compilation) and text != source.text:
            break
        source, compilation = changed, after
        applied += [Applied(item.span.line, item.code, fix.title) for item, fix in chosen]
    return FixedText(source.text, tuple(applied), compilation)


def choose(diagnostics: Iterable[Diagnostic], path: str, *, unsafe: bool) -> list[tuple[Diagnostic, Fix]]:
    """The fixes of this file that may be applied together. Of two that touch, the first is taken."""
    chosen: list[tuple[Diagnostic, Fix]] = []
    occupied: list[tuple[int, int]] = []
    for item in diagnostics:
        fix = item.fix
        if fix is None or not (fix.safe or unsafe) or any(edit.span.path != path for edit in fix.edits):
            continue
        places = [(edit.span.start, edit.span.end) for edit in fix.edits]
        if any(
            start <= other_end and other_start <= end for start, end in places for other_start, other_end in occupied
        ):
            continue
        occupied += places
        chosen.append((item, fix))
    return chosen


def apply_edits(text: str, edits: Iterable[Edit]) -> str:
    """The text after edits that do not overlap."""
    for edit in sorted(edits, key=lambda edit: edit.span.start, reverse=True):
        text = text[: edit.span.start] + edit.text + text[edit.span.end :]
    return text


def unified_diff(before: str, after: str, path: str) -> str:
    """The difference in the format of `diff -u`; empty without changes."""
    from difflib import unified_diff as differ

    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    lines = differ(old, new, path, path)
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


def write_text(path: str, text: str) -> None:
    """Replace a file's text in one step, keeping its mode and a byte-order mark. Raises `UsageError` on failure."""
    import tempfile

    target = os.path.realpath(path)
    try:
        with open(target, "rb") as file:  # noqa: PTH123 - with `os.path` throughout
            mark = "\ufeff" if file.read(3) == b"\xef\xbb\xbf" else ""
            mode = os.fstat(file.fileno()).st_mode
        handle, temporary = tempfile.mkstemp(dir=os.path.dirname(target), prefix=".ljs-")  # noqa: PTH120
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="--diff shows the fixes instead") from None
    try:
        with os.fdopen(handle, "wb") as out:
            out.write((mark + text).encode("utf-8", "surrogatepass"))
        os.chmod(temporary, mode & 0o7777)  # noqa: PTH101
        os.replace(temporary, target)  # noqa: PTH105
    except OSError as error:
        os.unlink(temporary)  # noqa: PTH108
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="--diff shows the fixes instead") from None


def _errors(compilation: Compilation) -> int:
    return sum(item.severity == "error" for item in compilation.diagnostics)
