"""`InstanceText`: expressions of an instance as text, with its parameters replaced by their values.

Names of fields have their units (`payload_kg`), as in an agent's brief. `lingjing.dsl.printing.phrases` writes the
author's spelling.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission import expression as ex
from lingjing.mission.expression_text import OPERAND, ExpressionWriter, LocalNames
from lingjing.mission.instance import Instance
from lingjing.mission.units import si_value
from lingjing.mission.wording import shown_datum, shown_number


class InstanceText(ExpressionWriter):
    """Writes the rules of one instance; it has no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._settings = {k: v for k, v in instance.settings.items() if k not in instance.hidden_settings}

    def number(self, value: float, unit: str) -> str:
        """The number with six decimals at most."""
        return shown_number(value, unit, si_value(1.0, unit) if unit else 1.0)

    def name(self, node: ex.Ref) -> str:
        """A public parameter's value, `time` for the clock, else the name."""
        if node.kind == "param" and node.name in self._settings:
            return shown_number(self._settings[node.name])
        return "time" if node.kind == "clock" else node.name

    def option(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        """The option with `=`, whatever its relation."""
        return f"{name}={self.text(value, 0, names)}"

    def quantified(self, node: ex.Quantified, body: str) -> tuple[str, int]:
        """The quantifier as a function of its body."""
        return f"{node.quantifier}({node.variable} in {node.domain}: {body})", OPERAND

    def aggregated(self, node: ex.Aggregate, body: str) -> str:
        """The aggregate in the form of a quantifier."""
        return f"{node.function}({node.variable} in {node.domain}: {body})"


def public_values(instance: Instance) -> Mapping[tuple[str, str], str]:
    """Property values of the instance's groups as text, by (group, property): those that are not hidden and the same
    for every member."""
    texts: dict[tuple[str, str], set[str]] = {}
    for entity in instance.entities:
        for name, value in entity.properties.items():
            text = "" if name in entity.hidden else shown_datum(value, _unit(name))
            texts.setdefault((entity.group, name), set()).add(text)
    return {key: next(iter(values)) for key, values in texts.items() if len(values) == 1 and "" not in values}


def _unit(name: str) -> str:
    """The unit at the end of a property's name; "" if it is none of the common ones."""
    return {"m": "m", "mps": "m/s", "kg": "kg", "s": "s", "deg": "deg"}.get(name.rpartition("_")[2], "")
