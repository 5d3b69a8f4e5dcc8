"""Write the TextMate grammar of `.ljs` from the compiler's tables: `python tools/textmate.py [FILE]`.

A test compares the committed grammar with the output, so that a new keyword, unit or function cannot be forgotten.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import AFTER_SUBJECT, INNER, STATEMENTS
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS
from lingjing.mission.units import UNITS

FILE = Path(__file__).parents[1] / "editors" / "vscode" / "syntaxes" / "ljs.tmLanguage.json"
"""The committed grammar."""
WORD_OPERATORS = ("and", "or", "not", "in", "exists", "forall")
"""Words that are operators."""
CONSTANTS = ("true", "false")
DECLARATIONS = tuple(
    kind.keyword
    for kind in KINDS.values()
    if kind.forms and kind.forms[0].elements()[0].label == "name" and kind.place("name").declares
)
"""Keywords of statements that declare the name behind them."""
ORDER = (
    "comment", "text", "declaration", "statement", "subject", "property", "number", "constant", "wordOperator", "inner",
    "distribution", "function", "operator",
)  # fmt: skip
"""The rules, in the order in which an editor tries them."""


def grammar() -> dict[str, object]:
    """Return the grammar as JSON values."""
    unit = "|".join(re.escape(name) for name in sorted(UNITS, key=lambda name: (-len(name), name)))
    factor = rf"(?:{unit})(?:\^-?\d|\d)?"
    number = r"(\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)"
    inner = sorted(set(INNER) - set(WORD_OPERATORS) - set(CONSTANTS))
    follows = r"(?=\s+[\p{L}\p{N}\"{.~-]|\s*\{)"
    begins = r"(?:^|(?<=[{,]))\s*"
    return {
        "$schema": "https://raw.githubusercontent.com/martinring/tmlanguage/master/tmlanguage.json",
        "name": "Lingjing mission",
        "scopeName": "source.ljs",
        "fileTypes": ["ljs"],
        "patterns": [{"include": f"#{name}"} for name in ORDER],
        "repository": {
            "comment": {"name": "comment.line.number-sign.ljs", "match": "#.*$"},
            "text": {
                "patterns": [
                    _text('"""', '"""', "string.quoted.triple.ljs"),
                    _text('"', '"|$', "string.quoted.double.ljs"),
                ]
            },
            "declaration": {
                "match": rf"{begins}({_words(DECLARATIONS)})\s+([\p{{L}}_][\p{{L}}\p{{N}}_]*)",
                "captures": {
                    "1": {"name": "keyword.declaration.ljs"},
                    "2": {"name": "entity.name.type.ljs"},
                },
            },
            "statement": {
                "match": rf"{begins}({_words(STATEMENTS)}){follows}(?!\s*(?:=(?!=)|~|:|<=))",
                "captures": {"1": {"name": "keyword.control.ljs"}},
            },
            "subject": {
                "match": rf"{begins}(\S+)[ \t]+({_words(AFTER_SUBJECT)})\b(?!\s*=)",
                "captures": {"2": {"name": "keyword.control.ljs"}},
            },
            "property": {
                "match": r"([\p{L}_][\p{L}\p{N}_]*)(?=\s*(?:=(?!=)|~))",
                "captures": {"1": {"name": "variable.other.property.ljs"}},
            },
            "number": {
                "match": rf"{number}(?:[ \t]*({factor}(?:[/*]{factor})*)(?![\p{{L}}\p{{N}}_]))?",
                "captures": {"1": {"name": "constant.numeric.ljs"}, "2": {"name": "keyword.other.unit.ljs"}},
            },
            "constant": {"name": "constant.language.ljs", "match": rf"\b({_words(CONSTANTS)})\b"},
            "wordOperator": {"name": "keyword.operator.word.ljs", "match": rf"\b({_words(WORD_OPERATORS)})\b"},
            "inner": {"name": "keyword.other.ljs", "match": rf"(?<!\.)\b({_words(inner)})\b(?!\s*(?:=(?!=)|~|:))"},
            "distribution": {"name": "support.function.ljs", "match": rf"\b({_words(DISTRIBUTIONS)})(?=\()"},
            "function": {
                "patterns": [
                    {"name": "support.function.ljs", "match": rf"\b({_words(FUNCTIONS)})(?=\()"},
                    {"name": "entity.name.function.ljs", "match": r"[\p{L}_][\p{L}\p{N}_]*(?=\()"},
                ]
            },
            "operator": {"name": "keyword.operator.ljs", "match": r"<->|->|<=|>=|==|!=|\.\.|\.\*|[-+*/<>=~]"},
        },
    }


def _words(words: object) -> str:
    return "|".join(sorted(words))  # type: ignore[call-overload]


def _text(begin: str, end: str, name: str) -> dict[str, object]:
    return {
        "name": name,
        "begin": begin,
        "end": end,
        "patterns": [
            {"name": "constant.character.escape.ljs", "match": r"\\."},
            {"name": "variable.other.hole.ljs", "match": r"\{[^{}\"]*\}"},
        ],
    }


def text() -> str:
    """Return the grammar as committed text."""
    return json.dumps(grammar(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else FILE).write_text(text(), encoding="utf-8")
