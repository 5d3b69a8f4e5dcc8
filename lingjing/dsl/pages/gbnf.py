"""`gbnf`: the grammar of `.ljs` for services that keep the answers of a language model to a grammar.

GBNF is the notation of llama.cpp, which vLLM's and SGLang's constrained decoding read too. The rules are those of
`ljs.lark`, with characters in the place of tokens. They permit one layout of a text, about that of the formatter, and
are wider than the language: which statement may stand where, names and types remain the compiler's business.

GBNF permits no left recursion, so `x: a | x b` becomes `x ::= a b*`. The alternatives for faulty statements are left
out.
"""

from __future__ import annotations

import re
from pathlib import Path

from lingjing.dsl.syntax.tables import FILE
from lingjing.dsl.syntax.tokens import AFTER_SUBJECT, INNER, OWN_WORDS, STATEMENTS, SYMBOLS
from lingjing.mission.units import UNITS

_RULE = re.compile(r"^(\w+): (.*?)(?=^\w+: |\Z)", re.MULTILINE | re.DOTALL)
_SYMBOL = re.compile(r"\[|\]|\w+")
_LEFT_OUT = ("faulty", "unknown_block")
_TIGHT_AFTER = frozenset(("LPAR", "LSQB", "DOT", "RANGE", "LBRACE", "LSET", "SEP", "COMMA", "NL"))
_TIGHT_BEFORE = frozenset((
    "RPAR", "RSQB", "RSET", "RBRACE", "COMMA", "SEP", "NL", "DOT", "DOTSTAR", "RANGE", "params", "index", "LSQB"
))  # fmt: skip
_TIGHT_COLON = ("typed", "operand")
"""Rules with a colon directly behind a name."""
_FIXED = {
    "NAME": "[A-Za-z_] [A-Za-z0-9_]*",
    "NUMBER": '"-"? [0-9]+ ("." [0-9]+)?',
    "STRING": r'"\"" [^"\\\n]* "\"" | "\"\"\"" [^"]* "\"\"\""',
    "NL": r'" "? "\n" [ \n]* | ", "',
    "SEP": '", "',
    "COMMA": '", "',
    "LBRACE": r'"{" [ \n]*',
    "RBRACE": r'[ \n]* "}"',
    "LSET": '"{ "',
    "RSET": '" }"',
    "MINUS": '"-"',
}  # fmt: skip
"""Tokens that are not one text."""


def gbnf() -> str:
    """Return the grammar; its first rule is `root`."""
    text = "\n".join(
        line for line in Path(FILE).with_name("ljs.lark").read_text(encoding="utf-8").splitlines()
        if not line.lstrip().startswith(("//", "%"))
    )  # fmt: skip
    rules = {name: _alternatives(body) for name, body in _RULE.findall(text)}
    lines = [r"root ::= [ \n]* file [ \n]*", *(f"{_name(name)} ::= {_body(name, rules[name])}" for name in rules)]
    used = {symbol for rule in rules.values() for alternative in rule for symbol in alternative}
    lines += [f"{_name(token)} ::= {_terminal(token)}" for token in sorted(used) if token.isupper()]
    units = " | ".join(f'"{unit}"' for unit in sorted(UNITS, key=len, reverse=True))
    lines.append(f'unit ::= ({units}) (("/" | "*") ({units}))* ("^" "-"? [0-9])?')
    return "\n".join(lines) + "\n"


def _alternatives(body: str) -> list[list[str]]:
    """The symbols of each alternative, with `[` and `]` around optional ones."""
    alternatives = []
    for line in re.split(r"\n\s*\|", body):
        symbols, _, alias = line.partition("->")
        if alias.strip() not in _LEFT_OUT:
            alternatives.append(_SYMBOL.findall(symbols))
    return alternatives


def _body(name: str, alternatives: list[list[str]]) -> str:
    """The right side of a rule without left recursion."""
    tight = name in _TIGHT_COLON
    first = [_sequence(each, tight_colon=tight) for each in alternatives if each[:1] != [name]]
    more = [_sequence(each[1:], before=name, tight_colon=tight) for each in alternatives if each[:1] == [name]]
    start = " | ".join(each or '""' for each in first)
    return f"({start}) ({' | '.join(more)})*" if more else start


def _sequence(symbols: list[str], before: str = "", *, tight_colon: bool = False) -> str:
    """Symbols with the blanks between them. An optional group brings its own blank: behind it at the beginning, else
    before it."""
    parts: list[str] = []
    leads = not before
    for place, symbol in enumerate(symbols):
        if symbol == "[":
            parts.append("(")
        elif symbol == "]":
            following = symbols[place + 1] if place + 1 < len(symbols) else ""
            parts.append(f"{_gap(before, following) if leads and following else ''})?")
            before = "" if leads else "word"
        else:
            gap = "" if tight_colon and symbol == "COLON" else _gap(before, symbol)
            parts += [gap, _name(symbol)]
            before = symbol
            leads = leads and "[" in symbols[:place] and symbols[:place].count("[") > symbols[:place].count("]")
    return re.sub(r"\( +", "(", " ".join(part for part in parts if part))


def _gap(before: str, symbol: str) -> str:
    if not before or before in _TIGHT_AFTER or symbol in _TIGHT_BEFORE:
        return ""
    if symbol == "LPAR":
        return "" if before == "NAME" else '" "'
    return "" if before == "MINUS" else '" "'


def _name(symbol: str) -> str:
    return symbol.lower().replace("_", "-") if symbol.islower() else f"t-{symbol.lower()}"


def _terminal(kind: str) -> str:
    if kind == "QUANTITY":
        return f'{_name("NUMBER")} " " unit'
    if kind == "OP":
        return " | ".join(f'"{sign}"' for sign, symbol in SYMBOLS.items() if symbol == "OP")
    if kind in _FIXED:
        return _FIXED[kind]
    words = {
        symbol: word
        for word, symbol in (*STATEMENTS.items(), *AFTER_SUBJECT.items(), *INNER.items(), *OWN_WORDS.items())
    }
    signs = {symbol: sign for sign, symbol in SYMBOLS.items() if symbol != "OP"}
    return f'"{words.get(kind) or signs[kind]}"'
