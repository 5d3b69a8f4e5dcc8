"""Write the LALR(1) tables of `.ljs` after a change of its grammar: `python tools/grammar_tables.py [FILE]`.

lark proves that the grammar is LALR(1) and generates its tables; the parser uses them without lark. A test compares the
committed tables with the output, so that a change of the grammar cannot be forgotten.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import msgspec
from lark import Lark
from lark.lexer import Lexer

from lingjing.dsl.syntax.tables import FILE, Reduction, Tables

GRAMMAR = Path(FILE).with_name("ljs.lark")


class NoLexer(Lexer):
    """A lexer without function: lark requires one, and only its tables are used."""

    def __init__(self, *_: object) -> None:
        pass

    def lex(self, *_: object) -> Any:
        """Never called."""
        raise NotImplementedError


def tables() -> bytes:
    """Return the tables of the present grammar in the format of their file."""
    text = GRAMMAR.read_text(encoding="utf-8")
    parser = Lark(text, parser="lalr", lexer=NoLexer, start="file", maybe_placeholders=True, keep_all_tokens=True)
    table = parser.parser.parser._parse_table
    made = _numbered(table.states, table.start_states["file"], table.end_states["file"])
    return msgspec.msgpack.encode(made)


def _numbered(states: dict[int, dict[str, tuple[Any, Any]]], start: int, end: int) -> Tables:
    """Number states and rules in the order of a walk from the start.

    lark's own numbers vary with the hash seed, and equal grammars must give equal files.
    """
    order, numbers = [start], {start: 0}
    rules: dict[object, int] = {}
    kept: list[Reduction] = []
    rows: list[dict[str, int]] = []
    for state in order:
        row: dict[str, int] = {}
        for symbol, (action, target) in sorted(states[state].items()):
            if action.name == "Shift":
                if target not in numbers:
                    numbers[target] = len(order)
                    order.append(target)
                row[str(symbol)] = numbers[target]
                continue
            if target not in rules:
                rules[target] = len(kept)
                kept.append(_rule(target))
            row[str(symbol)] = ~rules[target]
        rows.append(row)
    return Tables(0, numbers[end], tuple(rows), tuple(kept))


def _rule(rule: Any) -> Reduction:
    missing = [position for position, gap in enumerate(rule.options.empty_indices) if gap]
    name = str(rule.alias or rule.origin.name)
    return Reduction(str(rule.origin.name), len(rule.expansion), name, tuple(missing))


def main() -> None:
    """Write the tables to the file in the arguments, by default the one that the parser reads."""
    (Path(sys.argv[1]) if len(sys.argv) > 1 else Path(FILE)).write_bytes(tables())


if __name__ == "__main__":
    main()
