"""Checks of command arguments and message bodies, compiled from the specifications of a mission's verbs and messages.

`lingjing.plugins.decisions` generates the JSON Schema of a decision from the same specifications; a property test holds
that both agree. Checks stop at the first fault, because a receipt has one reason.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping

from lingjing.mission.instance import ArgumentSpec, Datum, MessageSpec, VerbSpec
from lingjing.mission.model import Field
from lingjing.mission.spec_schema import REACH_M
from lingjing.mission.values import is_finite

ValueCheck = Callable[[Datum, Container[str]], str]
"""A check of one value. Receives the value and the ids of the pictures taken so far; returns a description of the fault
or "".
"""


class NamedValuesCheck:
    """The check of a mapping of named values: no unknown name, no missing name, every value valid."""

    def __init__(
        self,
        items: Iterable[tuple[str, bool, ValueCheck]],
        unknown: Callable[[str, str], str],
        missing: Callable[[str], str],
    ) -> None:
        """`items`: name, whether it is required, and check of each value. `unknown` and `missing` word the two faults;
        `unknown` receives the name and the list of known names.
        """
        self._items = tuple(items)
        self._names = frozenset(name for name, _, _ in self._items)
        self._listed = ", ".join(name for name, _, _ in self._items)
        self._unknown = unknown
        self._missing = missing

    def fault(self, values: Mapping[str, Datum], frames: Container[str] = ()) -> str:
        """Return the description of the first fault, or ""."""
        for name in values:
            if name not in self._names:
                return self._unknown(name, self._listed)
        for name, required, check in self._items:
            value = values.get(name)
            if value is None:
                if required:
                    return self._missing(name)
            elif fault := check(value, frames):
                return f"`{name}` {fault}"
        return ""


def arguments_check(verb: VerbSpec) -> NamedValuesCheck:
    """Compile the check of a command's arguments."""
    return NamedValuesCheck(
        ((spec.name, not spec.optional and spec.default is None, _argument(spec)) for spec in verb.arguments),
        lambda name, known: f"`{verb.name}` has no argument `{name}`; it takes {known or 'none'}",
        lambda name: f"`{verb.name}` needs `{name}`",
    )


def body_check(message: MessageSpec) -> NamedValuesCheck:
    """Compile the check of a message's body."""
    return NamedValuesCheck(
        ((field.name, not field.optional, _field(field)) for field in message.fields),
        lambda name, known: f"`{name}` is not a field of `{message.type}`; fields: {known}",
        lambda name: f"`{name}` is missing",
    )


def _argument(spec: ArgumentSpec) -> ValueCheck:
    return _name if spec.unit == "name" else _quantity


def _field(field: Field) -> ValueCheck:
    return _bounded(field.minimum, field.maximum) if field.type == "number" else _FIELDS[field.type]


def _name(value: Datum, frames: Container[str]) -> str:
    return "" if isinstance(value, str) else "must be a name"


def _quantity(value: Datum, frames: Container[str]) -> str:
    if not is_finite(value):
        return "must be a finite number"
    return "" if abs(value) <= REACH_M else f"must lie within {REACH_M:g}"


def _bounded(low: float | None, high: float | None) -> ValueCheck:
    def check(value: Datum, frames: Container[str]) -> str:
        if not is_finite(value):
            return "must be a finite number"
        outside = (low is not None and value < low) or (high is not None and value > high)
        return f"must lie in {low}..{high}" if outside else ""

    return check


def _frame(value: Datum, frames: Container[str]) -> str:
    return "" if isinstance(value, str) and value in frames else "names no picture taken so far"


def _text(value: Datum, frames: Container[str]) -> str:
    return "" if isinstance(value, str) else "must be a text"


def _flag(value: Datum, frames: Container[str]) -> str:
    return "" if isinstance(value, bool) else "must be true or false"


def _names(value: Datum, frames: Container[str]) -> str:
    fine = isinstance(value, tuple | list) and all(isinstance(name, str) for name in value)
    return "" if fine else "must be a list of names"


def _box(value: Datum, frames: Container[str]) -> str:
    """Check a normalised box with 0 ≤ min < max ≤ 1 (the paper's section on adjudication)."""
    if not isinstance(value, tuple | list) or not all(is_finite(number) for number in value):
        return "must be a list of finite numbers"
    if len(value) != 4:
        return "must have four numbers"
    left, top, right, bottom = value
    fine = 0 <= left < right <= 1 and 0 <= top < bottom <= 1  # type: ignore[operator]
    return "" if fine else "must be x0, y0, x1, y1 with 0 ≤ min < max ≤ 1"


def _position(value: Datum, frames: Container[str]) -> str:
    if not isinstance(value, tuple | list) or not all(is_finite(number) for number in value):
        return "must be a list of finite numbers"
    if len(value) not in (2, 3):
        return "must have two or three numbers"
    far = any(abs(number) > REACH_M for number in value)  # type: ignore[arg-type]
    return f"must lie within {REACH_M:g} m" if far else ""


_FIELDS: Mapping[str, ValueCheck] = {
    "box": _box,
    "flag": _flag,
    "frame": _frame,
    "name": _text,
    "names": _names,
    "position": _position,
    "text": _text,
}
"""The checks by type of message field. Numbers are missing here: their bounds belong to the single field."""
