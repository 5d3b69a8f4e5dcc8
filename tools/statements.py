"""Write what is derived from the statements of `.ljs` and committed: `python tools/statements.py [--check]`.

These are the statements' alternatives and words in `ljs.lark`, the LALR(1) tables, the reference page of the
statements, the TextMate grammar and the schema of missions. `--check` writes nothing; it fails if the grammar or the
page differs (other tests compare the others).
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from lingjing.dsl.pages.statements import statements_page
from lingjing.dsl.syntax.statement_kinds import PatternElement, StatementKind
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.dsl.syntax.tables import FILE
from lingjing.dsl.syntax.tokens import INNER, OWN_WORDS

ROOT = Path(__file__).parents[1]
GRAMMAR = Path(FILE).with_name("ljs.lark")
PAGE = ROOT / "docs" / "statements.md"
_ALTERNATIVES = re.compile(r"(written by tools/statements\.py\nitem: ).*?(\n    // -- end of)", re.DOTALL)
_WORDS = re.compile(r"(the words below are written by tools/statements\.py\n).*\Z", re.DOTALL)
_WIDTH = 120
"""Columns of a line of the grammar."""


def grammar() -> str:
    """Return the grammar with the statements of the table."""
    alternatives = "\n    | ".join(line for kind in STATEMENTS for line in _productions(kind))
    text = _ALTERNATIVES.sub(lambda match: f"{match[1]}{alternatives}{match[2]}", GRAMMAR.read_text(encoding="utf-8"))
    words = [kind.token for kind in STATEMENTS]
    words += [token for token in (*INNER.values(), *OWN_WORDS.values()) if token not in words]
    return _WORDS.sub(lambda match: match[1] + "\n".join(_declared(words)) + "\n", text)


def _productions(kind: StatementKind) -> list[str]:
    return [
        f"{_symbols(form.subject_elements())} {kind.token}".lstrip()
        + f"{_symbols(form.elements())} -> {form.alias or kind.keyword}"
        for form in kind.forms
    ]


def _symbols(elements: tuple[PatternElement, ...]) -> str:
    text, group = "", 0
    for element in elements:
        if element.group != group:
            text += ("]" if group else "") + (" [" if element.group else " ")
            group = element.group
        else:
            text += " "
        text += element.symbol
    return text + ("]" if group else "")


def _declared(words: list[str]) -> list[str]:
    lines = ["%declare"]
    for word in words:
        if len(lines[-1]) + len(word) >= _WIDTH:
            lines.append("%declare")
        lines[-1] += f" {word}"
    return lines


def main(check: bool) -> int:
    """Write the files, or report those that differ. Return the exit code."""
    stale = []
    for file, text in ((GRAMMAR, grammar()), (PAGE, statements_page())):
        if file.read_text(encoding="utf-8") == text:
            continue
        stale.append(file.name)
        if not check:
            file.write_text(text, encoding="utf-8")
    if check:
        print("\n".join(f"{name}: run `python tools/statements.py`" for name in stale), end="\n" if stale else "")
        return 1 if stale else 0
    for tool in ("grammar_tables", "textmate"):
        subprocess.run([sys.executable, str(ROOT / "tools" / f"{tool}.py")], check=True)
    subprocess.run([sys.executable, "-m", "lingjing.mission.document", str(ROOT / "schemas")], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
