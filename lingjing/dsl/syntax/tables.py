"""LALR(1) tables of the grammar `ljs.lark`, read from the file `ljs.tables` beside it.

They are plain integers that lark generated (`tools/grammar_tables.py`). So the parser works without lark: a cold start
takes 1 ms instead of lark's import (65 ms) and table construction (100 ms and more) (ADR 0006).
"""

from __future__ import annotations

import os

import msgspec

from lingjing.decoding import from_msgpack

FILE = os.path.join(os.path.dirname(__file__), "ljs.tables")  # noqa: PTH118, PTH120 - pathlib is not imported cold
"""Path of the tables."""


class Reduction(msgspec.Struct, frozen=True, array_like=True):
    """A reduction: pop `size` values, call the builder's `action`, continue with `origin`."""

    origin: str
    """Name of the rule's left-hand side."""
    size: int
    """Number of symbols on the right-hand side."""
    action: str
    """Name of the builder's action."""
    missing: tuple[int, ...] = ()
    """Positions of absent optional symbols, which become None in the action's arguments."""


class Tables(msgspec.Struct, frozen=True, array_like=True):
    """The tables of the grammar."""

    start: int
    """Number of the first state."""
    end: int
    """Number of the accepting state."""
    states: tuple[dict[str, int], ...]
    """The table of each state: symbol → next state if >= 0, else `~rule`."""
    rules: tuple[Reduction, ...]
    """The reductions."""


def load_tables() -> Tables:
    """Load the tables of the grammar."""
    with open(FILE, "rb") as file:  # noqa: PTH123 - as above
        start, end, states, rules = from_msgpack(file.read())
    # without a typed decoder: to describe the types to it takes longer than this
    return Tables(start, end, tuple(states), tuple(Reduction(*rule[:3], *map(tuple, rule[3:])) for rule in rules))
