"""Lowering of properties: SI values under names with their unit (`speed_mps`, `band_low_m`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.values import TypedExpression
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import Type
from lingjing.mission.units import BY_DIMENSION, NONE, Dimension

PropertyMaker = Callable[..., model.Property]


def suffix_of(dimension: Dimension | None) -> str:
    """Suffix of a name for a dimension: `_m`, `_mps`, …; empty for a bare number and for an unnamed dimension."""
    known = BY_DIMENSION.get(dimension or NONE)
    return known.suffix if known else ""


def lowered(
    entry: PropertyEntry, *, inherited: bool = False, hidden: bool = False, state: bool = False
) -> tuple[model.Property, ...]:
    """The mission's properties for one entry."""
    name, kind = entry.node.name.text, entry.key.type
    hides = hidden or entry.node.hidden
    changes = state or entry.node.state
    relation = entry.relation

    def made(suffix: str, value: ex.Expr, unit: str = "") -> model.Property:
        drawn: Literal["=", "~", "<="] = "~" if isinstance(value, ex.Draw) else "<=" if relation == "<=" else "="
        return model.Property(
            name=name + suffix, value=value, relation=drawn, hidden=hides, inherited=inherited, state=changes, unit=unit
        )

    if kind.kind == "directed":
        return (made("_mps", entry.parts[0].ir), made(f"_{kind.of}_deg", entry.parts[1].ir))
    if kind.kind == "size":
        return (made("_rows", entry.parts[0].ir), made("_columns", entry.parts[1].ir))
    if kind.kind == "level":
        return (made("_m", entry.value.ir, "m"),)
    return _of_value(made, entry.value)


def _of_value(made: PropertyMaker, value: TypedExpression) -> tuple[model.Property, ...]:
    kind: Type = value.type
    if kind.kind == "quantity":
        suffix = suffix_of(kind.dimension)
        return (made(suffix, value.ir, suffix.removeprefix("_")),)
    if kind.kind == "range" and isinstance(value.ir, ex.Range):
        unit = suffix_of(kind.dimension)
        return (made(f"_low{unit}", value.ir.low), made(f"_high{unit}", value.ir.high))
    return (made("", value.ir),)
