"""LALR(1) tables of the grammar, built by lark and cached.

lark is imported here and only when no cached table fits: the tables are plain integers, so the parser drives them
without it and a cold start pays a millisecond instead of lark's import (65 ms)
and its table construction (100 ms and more). They are looked up beside this file (`ljs.tables`, written after the
grammar changed), then in the user's cache folder, and else made by lark. The key is the SHA-256 of the grammar and of
this module's format number.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import msgspec

from lingjing.data import cache_folder

FORMAT = 1
"""Raised when the shape of `Tables` changes."""

GRAMMAR_FILE = Path(__file__).with_name("ljs.lark")
PACKAGED_FILE = Path(__file__).with_name("ljs.tables")


class Reduction(msgspec.Struct, frozen=True, array_like=True):
    """A reduction: pop `size` values, call the builder's `action`, go on with `origin`.

    `missing` lists where absent optional symbols leave a gap in the action's arguments.
    """

    origin: str
    size: int
    action: str
    missing: tuple[int, ...] = ()


class Tables(msgspec.Struct, frozen=True, array_like=True):
    """`states[s][symbol]` is the next state if it is >= 0, else `~rule`; `start` and `end` are state numbers."""

    key: str
    start: int
    end: int
    states: tuple[dict[str, int], ...]
    rules: tuple[Reduction, ...]


def load_tables() -> Tables:
    """The tables of the grammar as it is now; never fails because a cache is missing, broken or not writable."""
    grammar = GRAMMAR_FILE.read_bytes()
    key = hashlib.sha256(grammar + b"\0%d" % FORMAT).hexdigest()
    cached = Path(cache_folder()) / f"ljs-{key[:16]}.tables"
    for path in (PACKAGED_FILE, cached):
        tables = _read(path, key)
        if tables is not None:
            return tables
    tables = build_tables(grammar.decode(), key)
    _write_quietly(tables, cached)
    return tables


def build_tables(grammar: str, key: str) -> Tables:
    """Tables made by lark from the grammar's text."""
    from lark import Lark
    from lark.lexer import Lexer

    class NoLexer(Lexer):
        """The tokens come from elsewhere."""

        def __init__(self, *_: object) -> None:
            pass

        def lex(self, *_: object) -> Any:
            raise NotImplementedError

    parser = Lark(grammar, parser="lalr", lexer=NoLexer, start="file", maybe_placeholders=True, keep_all_tokens=True)
    table = parser.parser.parser._parse_table
    return _numbered(key, table.states, table.start_states["file"], table.end_states["file"])


def _numbered(key: str, states: dict[int, dict[str, tuple[Any, Any]]], start: int, end: int) -> Tables:
    """Number states and rules in the order a walk from the start meets them: lark's own numbers vary with the hash
    seed, and equal grammars should give equal files."""
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
    return Tables(key, 0, numbers[end], tuple(rows), tuple(kept))


def _rule(rule: object) -> Reduction:
    gaps = rule.options.empty_indices  # type: ignore[attr-defined]
    missing = [position for position, gap in enumerate(gaps) if gap]
    name = str(rule.alias or rule.origin.name)  # type: ignore[attr-defined]
    return Reduction(str(rule.origin.name), len(rule.expansion), name, tuple(missing))  # type: ignore[attr-defined]


def write_tables(path: Path = PACKAGED_FILE) -> None:
    """Write the tables of the package, after the grammar changed: `python -m lingjing.dsl.syntax.tables`."""
    grammar = GRAMMAR_FILE.read_bytes()
    key = hashlib.sha256(grammar + b"\0%d" % FORMAT).hexdigest()
    _write(build_tables(grammar.decode(), key), path)
    path.chmod(0o644)


def _read(path: Path, key: str) -> Tables | None:
    try:
        tables = msgspec.msgpack.decode(path.read_bytes(), type=Tables)
    except (OSError, msgspec.DecodeError):
        return None  # no cache, or a broken one: the tables are made again
    return tables if tables.key == key else None


def _write_quietly(tables: Tables, path: Path) -> None:
    """A cache that cannot be written costs time, nothing else."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(tables, path)
    except (OSError, RuntimeError):
        return  # RuntimeError: no home folder


def _write(tables: Tables, path: Path) -> None:
    import tempfile  # not needed when the tables are there

    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".ljs-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(msgspec.msgpack.encode(tables))
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink()
        raise


if __name__ == "__main__":
    write_tables()
