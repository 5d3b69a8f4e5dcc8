"""Values of a mission's parameters as text: `80`, `80 m` or `0.08 km`; without a unit they are in SI units."""

from __future__ import annotations

import math
import re

from lingjing.errors import UsageError
from lingjing.mission.expression import Expr, Number
from lingjing.mission.model import Mission
from lingjing.mission.tiers import RESERVED_SWITCHES, reserved_switch_error
from lingjing.mission.units import NONE, Dimension, dimension_name, unit_of
from lingjing.patterns import pattern

_QUANTITY = pattern(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)", re.ASCII)
"""A number, then its unit."""
SWITCH_WORDS = {"true": 1.0, "on": 1.0, "1": 1.0, "false": 0.0, "off": 0.0, "0": 0.0}
"""The words for the values of a switch."""


def read_setting(mission: Mission | None, name: str, text: str) -> float:
    """The SI value of a text for the parameter of that name. A unit must have the parameter's dimension; without a
    mission any unit is accepted.

    Raises `UsageError`. Existence and bounds of the parameter are checked when the mission is instantiated.
    """
    if _is_switch(mission, name):
        if text not in SWITCH_WORDS:
            raise UsageError(f"`{name}` is true or false, not `{text}`", hint=f"write `{name}=true`")
        return SWITCH_WORDS[text]
    if name in RESERVED_SWITCHES and mission is not None and all(each.name != name for each in mission.parameters):
        raise reserved_switch_error(name)
    match = _QUANTITY.fullmatch(text)
    value = float(match[1]) if match else math.nan
    if match is None or not math.isfinite(value):
        raise UsageError(f"`{text}` is not a number", hint="write a number, then its unit")
    if not match[2]:
        return value
    unit = unit_of(match[2])
    if unit is None:
        raise UsageError(f"there is no unit `{match[2]}`", hint="without a unit it is in SI units")
    parameters = mission.parameters if mission is not None else ()
    expected = next((_dimension_of(parameter.default) for parameter in parameters if parameter.name == name), None)
    if expected is not None and unit.dimension != expected:
        raise UsageError(f"{dimension_name(unit.dimension)} where {dimension_name(expected)} is due")
    return value * unit.factor


def _is_switch(mission: Mission | None, name: str) -> bool:
    parameters = mission.parameters if mission is not None else ()
    return any(parameter.name == name and parameter.is_switch for parameter in parameters)


def _dimension_of(default: Expr) -> Dimension | None:
    """The dimension of a parameter with a plain quantity as default; None for a computed default."""
    if not isinstance(default, Number):
        return None
    unit = unit_of(default.unit) if default.unit else None
    return unit.dimension if unit is not None else NONE
