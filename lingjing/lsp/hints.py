"""Inlay hints for units: the SI value of a quantity in another unit, and the unit of a param where it is used."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax.lexer import lex
from lingjing.lsp.analysis import Analysis
from lingjing.mission.units import NONE, dimension_unit, si_value, unit_of

_PLAIN = ("%", "tick", "ticks", "px", "token", "tokens", "USD")
"""Units that every reader knows and that need no hint."""


class UnitHint(NamedTuple):
    """A text that an editor shows after an offset."""

    offset: int
    label: str
    tooltip: str


def unit_hints(analysis: Analysis, start: int, end: int) -> list[UnitHint]:
    """The hints between two offsets, in order."""
    return sorted({*_quantities(analysis, start, end), *_params(analysis, start, end)})


def _quantities(analysis: Analysis, start: int, end: int) -> Iterator[UnitHint]:
    for token in lex(analysis.source.text, Reporter(analysis.source)) or ():
        if token.type != "QUANTITY" or not start <= token.end <= end or token.unit in _PLAIN:
            continue
        unit = unit_of(token.unit)
        base = dimension_unit(unit.dimension) if unit is not None else ""
        if unit is None or not base or unit.factor == 1.0:
            continue
        value = si_value(float(token.text), token.unit)
        yield UnitHint(token.end, f" = {value:.6g} {base}", "the value in SI units")


def _params(analysis: Analysis, start: int, end: int) -> Iterator[UnitHint]:
    symbols = analysis.scope.symbols
    for occurrence in analysis.names.occurrences:
        space, name, _ = occurrence.key
        symbol = symbols.get(name) if space == "symbol" and not occurrence.declares else None
        if symbol is None or symbol.kind != "param" or not start <= occurrence.end <= end:
            continue
        if symbol.type.dimension is not None and symbol.type.dimension != NONE:
            yield UnitHint(occurrence.end, f": {dimension_unit(symbol.type.dimension)}", f"`{name}` has this unit")
