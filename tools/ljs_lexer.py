"""A lexer of Pygments for `.ljs`, which colours missions on the site.

Its rules are those of the grammar for editors (`editors/vscode`), which `tools/statements.py` writes, so a new
statement is coloured without a change here. `register` makes Pygments find it by the name of a block's language.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pygments import lexers
from pygments.lexer import RegexLexer
from pygments.token import Comment, Keyword, Name, Number, Operator, String, Text, _TokenType

GRAMMAR = Path(__file__).resolve().parents[1] / "editors" / "vscode" / "syntaxes" / "ljs.tmLanguage.json"
TOKENS = (
    ("comment", Comment),
    ("string", String),
    ("constant.numeric", Number),
    ("constant", Keyword.Constant),
    ("keyword.declaration", Keyword.Declaration),
    ("keyword.operator", Operator),
    ("keyword.other.unit", Keyword.Type),
    ("keyword", Keyword),
    ("entity.name.type", Name.Class),
    ("entity.name.function", Name.Function),
    ("support.function", Name.Builtin),
    ("support", Name.Builtin),
    ("variable", Name.Attribute),
)
"""Tokens by the beginning of a scope of the grammar; the first that fits counts."""

_Callback = Callable[[Any, "re.Match[str]"], Iterator[tuple[int, _TokenType, str]]]


def token(scope: str) -> _TokenType:
    """The token of a scope."""
    return next((token for start, token in TOKENS if scope.startswith(start)), Text)


def captured(captures: dict[str, Any]) -> _Callback:
    """A rule's action that gives each captured group its token, and the text between them none."""

    def split(_: Any, match: re.Match[str]) -> Iterator[tuple[int, _TokenType, str]]:
        at = match.start()
        for number, capture in sorted(captures.items()):
            start, end = match.span(int(number))
            if start >= at:
                yield at, Text, match.string[at:start]
                yield start, token(capture["name"]), match.string[start:end]
                at = end
        yield at, Text, match.string[at : match.end()]

    return split


def rules() -> list[tuple[str, Any]]:
    """The rules of the grammar for Pygments, and a rule for everything else."""
    grammar = json.loads(GRAMMAR.read_text(encoding="utf-8"))
    listed: list[tuple[str, Any]] = []
    for include in grammar["patterns"]:
        entry = grammar["repository"][include["include"].lstrip("#")]
        for rule in entry.get("patterns", [entry]):
            if "begin" in rule:
                listed.append((rf"{rule['begin']}(?:\\.|[\s\S])*?(?:{rule['end']})", token(rule["name"])))
            else:
                action = captured(rule["captures"]) if "captures" in rule else token(rule["name"])
                listed.append((_python(rule["match"]), action))
    return [*listed, (r"[^\W\d]\w*", Name), (r"\n", Text), (r"[^\S\n]+", Text), (r".", Text)]


def _python(pattern: str) -> str:
    """A pattern of the grammar with the classes of letters that Python's `re` has."""
    return (
        pattern.replace(r"[\p{L}_]", r"[^\W\d]")
        .replace(r"[\p{L}\p{N}_]", r"\w")
        .replace(r"\p{L}\p{N}", r"\w")
        .replace(r"\p{L}", "a-zA-Z")
    )


class LjsLexer(RegexLexer):
    """The lexer of mission files."""

    name = "Lingjing mission"
    aliases = ["ljs"]
    filenames = ["*.ljs"]
    flags = re.MULTILINE
    tokens = {"root": rules()}


__all__ = ["LjsLexer"]


def register() -> None:
    """Make Pygments find the lexer by the name `ljs`, without an installed plug-in."""
    sys.path.append(str(Path(__file__).parent))
    lexers.LEXERS["LjsLexer"] = ("ljs_lexer", LjsLexer.name, ("ljs",), ("*.ljs",), ())
