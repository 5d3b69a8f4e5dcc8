"""`InstanceText`: expressions of an instance as text, with its parameters as their values.

Names of fields are the lowered ones (`payload_kg`), which a policy's brief uses too. The author's spelling is written
by `lingjing.dsl.printing.phrases`.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission import expression as ex
from lingjing.mission.expression_text import OPERAND, ExpressionWriter, LocalNames
from lingjing.mission.instance import Instance
from lingjing.mission.units import si_value
from lingjing.mission.wording import shown_datum, shown_number


class InstanceText(ExpressionWriter):
    """Writes the rules of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._settings = instance.settings

    def number(self, value: float, unit: str) -> str:
        """To six digits."""
        return shown_number(value, unit, si_value(1.0, unit) if unit else 1.0)

    def name(self, node: ex.Ref) -> str:
        """A parameter as its value, the clock as the time."""
        if node.kind == "param" and node.name in self._settings:
            return shown_number(self._settings[node.name])
        return "time" if node.kind == "clock" else node.name

    def option(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        """Without a relation of its own."""
        return f"{name}={self.text(value, 0, names)}"

    def quantified(self, node: ex.Quantified, body: str) -> tuple[str, int]:
        """As a function of its body."""
        return f"{node.quantifier}({node.variable} in {node.domain}: {body})", OPERAND

    def aggregated(self, node: ex.Aggregate, body: str) -> str:
        """As a quantifier."""
        return f"{node.function}({node.variable} in {node.domain}: {body})"


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
