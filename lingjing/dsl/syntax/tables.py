"""LALR(1) tables of the grammar `ljs.lark`, read from the file `ljs.tables` beside it.

They are plain integers that lark has made (`tools/grammar_tables.py`), so that the parser drives them without lark and
a cold start pays a millisecond instead of lark's import (65 ms) and its table construction (100 ms and more).
"""

from __future__ import annotations

from pathlib import Path

import msgspec

FILE = Path(__file__).with_name("ljs.tables")


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

    start: int
    end: int
    states: tuple[dict[str, int], ...]
    rules: tuple[Reduction, ...]


def load_tables() -> Tables:
    """The tables of the grammar."""
    return msgspec.msgpack.decode(FILE.read_bytes(), type=Tables)
