"""Translation of a city's pieces: every point is moved by the same east and north (ADR 0025)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import msgspec

from lingjing.mission.geometry2d import Vector2
from lingjing.scene.city import Lane, Pieces

P = TypeVar("P", bound=Pieces)

_LINES = ("polygon", "shape", "path", "top")
"""Fields of pieces that are sequences of points."""
_POINTS = ("position", "entrance")
"""Fields of pieces that are one point. In both, only the first two numbers are coordinates in plan; a third is an
elevation or a bearing."""

_DECIMALS = 6
"""Decimals of the sums (micrometres), so that round coordinates stay round."""


def translate(pieces: P, by: Vector2) -> P:
    """Return the pieces, `by` metres farther east and north; the same object if both are 0."""
    if by == (0.0, 0.0):
        return pieces
    changed = {kind: tuple(_piece(piece, by) for piece in getattr(pieces, kind)) for kind in Pieces.__struct_fields__}
    return msgspec.structs.replace(pieces, **changed)


def _piece(piece: Any, by: Vector2) -> Any:
    return msgspec.structs.replace(piece, **dict(_fields(piece, by)))


def _fields(piece: msgspec.Struct, by: Vector2) -> Mapping[str, object]:
    changed: dict[str, object] = {}
    for name in piece.__struct_fields__:
        value = getattr(piece, name)
        if name in _LINES:
            changed[name] = _line(value, by)
        elif name in _POINTS and value is not None:
            changed[name] = _point(value, by)
        elif name == "holes":
            changed[name] = tuple(_line(hole, by) for hole in value)
        elif name == "lanes":
            changed[name] = tuple(_lane(lane, by) for lane in value)
    return changed


def _lane(lane: Lane, by: Vector2) -> Lane:
    return msgspec.structs.replace(lane, shape=_line(lane.shape, by))


def _line(points: Sequence[Sequence[float]], by: Vector2) -> Any:
    return tuple(_point(point, by) for point in points)


def _point(point: Sequence[float], by: Vector2) -> tuple[float, ...]:
    return (round(point[0] + by[0], _DECIMALS), round(point[1] + by[1], _DECIMALS), *point[2:])
