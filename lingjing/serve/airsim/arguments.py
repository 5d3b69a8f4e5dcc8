"""The arguments of a call, read one after another and checked.

Each error names the method and the argument, for the client that called.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from lingjing.mission.instance import Vector
from lingjing.serve.airsim.frames import Quaternion


class CallError(Exception):
    """A call that is answered with an error, in words for the client."""


class YawMode(NamedTuple):
    """AirSim's `YawMode`."""

    is_rate: bool
    """True if `value` is a rate, degrees a second; false if it is a heading, degrees."""
    value: float
    """Degrees a second, or degrees clockwise from north."""


LARGEST = 1e7
"""Largest absolute value of a number (chosen): no place, speed or time is larger."""


class Arguments:
    """A cursor over the arguments of one call. Every method raises `CallError`."""

    def __init__(self, method: str, values: Sequence[Any]) -> None:
        self._method, self._values, self._next = method, values, 0

    @property
    def left(self) -> int:
        """Number of arguments that were not read."""
        return len(self._values) - self._next

    def number(self, name: str) -> float:
        """Read a finite number."""
        return self._number(name, self._take(name))

    def seconds(self, name: str) -> float:
        """Read a time-out or a duration, at least 0 s and limited to `LARGEST` (AirSim's default is 3e38)."""
        value = self._take(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise self._wrong(name, "a number", value)
        return float(min(max(value, 0.0), LARGEST))

    def flag(self, name: str) -> bool:
        """Read a truth value."""
        value = self._take(name)
        if not isinstance(value, bool | int):
            raise self._wrong(name, "true or false", value)
        return bool(value)

    def text(self, name: str, default: str | None = None) -> str:
        """Read a text; an absent one is the default."""
        if default is not None and not self.left:
            return default
        value = self._take(name)
        if not isinstance(value, str) or len(value) > 1000:
            raise self._wrong(name, "a text", value)
        return value

    def vector(self, name: str) -> Vector:
        """Read a `Vector3r`."""
        return self._vector(name, self._take(name))

    def pose(self, name: str) -> tuple[Vector, Quaternion]:
        """Read a `Pose`: a place, and a turn of unit length."""
        value = self._take(name)
        if not isinstance(value, dict) or not isinstance(value.get("orientation"), dict):
            raise self._wrong(name, "a Pose", value)
        axes = ("w_val", "x_val", "y_val", "z_val")
        w, x, y, z = (self._number(f"{name}.orientation.{axis}", value["orientation"].get(axis)) for axis in axes)
        length = math.hypot(w, x, y, z)
        if not math.isclose(length, 1.0, abs_tol=1e-3):
            raise CallError(f"`{name}.orientation` of `{self._method}` has the length {length:g}, not 1")
        turn = (w / length, x / length, y / length, z / length)
        return self._vector(f"{name}.position", value.get("position")), turn

    def vectors(self, name: str, most: int) -> tuple[Vector, ...]:
        """Read a list of `Vector3r`."""
        value = self._take(name)
        if not isinstance(value, list) or not 1 <= len(value) <= most:
            raise self._wrong(name, f"a list of 1 to {most} places", value)
        return tuple(self._vector(f"{name}[{index}]", item) for index, item in enumerate(value))

    def yaw_mode(self, name: str) -> YawMode:
        """Read a `YawMode`."""
        value = self._take(name)
        if not isinstance(value, dict):
            raise self._wrong(name, "a YawMode", value)
        return YawMode(bool(value.get("is_rate")), self._number(f"{name}.yaw_or_rate", value.get("yaw_or_rate")))

    def records(self, name: str, most: int) -> list[dict[str, Any]]:
        """Read a list of records."""
        value = self._take(name)
        if not isinstance(value, list) or len(value) > most or not all(isinstance(item, dict) for item in value):
            raise self._wrong(name, f"a list of at most {most} records", value)
        return value

    def record(self, name: str) -> dict[str, Any]:
        """Read a record."""
        value = self._take(name)
        if not isinstance(value, dict):
            raise self._wrong(name, "a record", value)
        return value

    def skip(self, name: str) -> None:
        """Pass over an argument without an effect here."""
        self._take(name)

    def skip_external(self) -> None:
        """Pass over `external`, the last argument of methods of cameras in the client `airsim`. There are no cameras
        without a vehicle here."""
        if self.left and isinstance(self._values[self._next], bool) and self.flag("external"):
            raise CallError(f"`{self._method}` has no `external` cameras: cameras belong to vehicles here")

    def end(self) -> None:
        """Check that nothing is left."""
        if self.left:
            raise CallError(f"`{self._method}` has {self._next} arguments here, not {len(self._values)}")

    def _take(self, name: str) -> Any:
        if not self.left:
            raise CallError(f"`{self._method}` needs `{name}` as argument {self._next + 1}")
        self._next += 1
        return self._values[self._next - 1]

    def _vector(self, name: str, value: object) -> Vector:
        if not isinstance(value, dict):
            raise self._wrong(name, "a Vector3r", value)
        x, y, z = (self._number(f"{name}.{axis}", value.get(axis)) for axis in ("x_val", "y_val", "z_val"))
        return x, y, z

    def _number(self, name: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._wrong(name, "a number", value)
        if not math.isfinite(value) or abs(value) > LARGEST:
            raise self._wrong(name, f"a finite number of at most {LARGEST:g}", value)
        return float(value)

    def _wrong(self, name: str, wanted: str, value: object) -> CallError:
        return CallError(f"`{name}` of `{self._method}` is {wanted}, not {repr(value)[:60]}")
