"""`InstanceText`: expressions of an instance as text, with its parameters as their values.

Names of fields are the lowered ones (`payload_kg`), which a policy's brief uses too. The author's spelling is written
by `lingjing.dsl.printing.phrases`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lingjing.mission import expression as ex
from lingjing.mission.functions import RANKS
from lingjing.mission.instance import Instance
from lingjing.mission.units import si_value
from lingjing.mission.wording import shown_datum, shown_number

_OPERAND = 1 + max(RANKS.values())
"""How tightly a sign binds, and what needs no brackets."""


class InstanceText:
    """Writes the rules of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._settings = instance.settings

    def __call__(self, node: ex.Expr) -> str:
        """The expression, in brackets where its parts bind less than the operator before them."""
        match node:
            case ex.Number(value=value, unit=unit):
                return shown_number(value, unit, si_value(1.0, unit) if unit else 1.0)
            case ex.Text(value=text):
                return f'"{text}"'
            case ex.Flag(value=flag):
                return "true" if flag else "false"
            case ex.Symbol(name=name):
                return name
            case ex.Ref():
                return self._name(node)
            case ex.Quantified(quantifier=word) | ex.Aggregate(function=word):
                return f"{word}({node.variable} in {node.domain}: {self(node.body)})"
        return self._composite(node)

    def _name(self, node: ex.Ref) -> str:
        if node.kind == "param" and node.name in self._settings:
            return shown_number(self._settings[node.name])
        return "time" if node.kind == "clock" else node.name

    def _composite(self, node: Any) -> str:
        match node:
            case ex.Attr(base=base, name=name):
                return f"{self(base)}.{name}"
            case ex.Index(base=base, index=index):
                return f"{self(base)}[{self(index)}]"
            case ex.Range(low=low, high=high):
                return f"{self(low)}..{self(high)}"
            case ex.Unary(operator="not", operand=operand):
                return f"not {self._side(operand, RANKS['not'])}"
            case ex.Unary(operand=operand):
                return f"-{self._side(operand, _OPERAND)}"
            case ex.Binary(operator=operator, left=left, right=right):
                rank = RANKS[operator]
                return f"{self._side(left, rank)} {operator} {self._side(right, rank + 1)}"
            case ex.Point(items=items):
                return f"({self._listed(items)})"
            case ex.Sequence(items=items):
                return f"[{self._listed(items)}]"
        name = node.function if isinstance(node, ex.Call) else node.distribution
        named = [f"{key}={self(value)}" for key, value in node.named]
        return f"{name}({', '.join([*map(self, node.arguments), *named])})"

    def _side(self, node: ex.Expr, rank: int) -> str:
        text, binds = self(node), _OPERAND
        if isinstance(node, ex.Binary) or (isinstance(node, ex.Unary) and node.operator == "not"):
            binds = RANKS[node.operator]
        return f"({text})" if binds < rank else text

    def _listed(self, items: tuple[ex.Expr, ...]) -> str:
        return ", ".join(map(self, items))


def public_values(instance: Instance) -> Mapping[tuple[str, str], str]:
    """What the properties of the instance's groups say, by (group, property): those that are not hidden and the same
    for every member."""
    found: dict[tuple[str, str], set[str]] = {}
    for entity in instance.entities:
        for name, value in entity.properties.items():
            said = "" if name in entity.hidden else shown_datum(value, _unit(name))
            found.setdefault((entity.group, name), set()).add(said)
    return {key: next(iter(said)) for key, said in found.items() if len(said) == 1 and "" not in said}


def _unit(name: str) -> str:
    """The unit at the end of a lowered name that a reader would not miss."""
    return {"m": "m", "mps": "m/s", "kg": "kg", "s": "s", "deg": "deg"}.get(name.rpartition("_")[2], "")
