"""`City`: one static world that every engine shares, as plain values.

Built once per episode by a scene provider (`lingjing.plugins.hookspecs.lingjing_scenes`), before the reset barrier,
and sent to the worker processes as it is. What moves is not here: it is an `Entity` of the mission and belongs to an
engine. Frame: east, north, elevation over the datum's zero, metres; polygons anticlockwise without closing repeat.
"""

from __future__ import annotations

import msgspec

from lingjing.mission.instance import Datum, Vector

Polygon = tuple[tuple[float, float], ...]


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """A body of water at a level; land polygons on top of it are islands or the shore."""

    polygon: Polygon
    level_m: float


class Land(msgspec.Struct, frozen=True, kw_only=True):
    """Solid ground with a top elevation and a surface (`sand`, `grass`, `rock`, `concrete`)."""

    polygon: Polygon
    top_m: float
    surface: str = "grass"


class Solid(msgspec.Struct, frozen=True, kw_only=True):
    """A prism that is both seen and hit: pier decks, piles, huts, buildings."""

    id: str
    polygon: Polygon
    base_m: float
    top_m: float
    material: str = "concrete"


class Prop(msgspec.Struct, frozen=True, kw_only=True):
    """A static or floating decoration and distractor: `buoy`, `debris`, `rock`, `tree`, `moored_boat`.

    `cls` is its semantic class in the camera's masks. Floating props follow the water's surface.
    """

    id: str
    cls: str
    model: str
    position: Vector
    heading_deg: float = 0.0
    scale: float = 1.0
    floating: bool = False
    options: dict[str, Datum] = {}


class City(msgspec.Struct, frozen=True, kw_only=True):
    """The static world. `bounds` is (west, south, east, north) in metres; `origin` (latitude, longitude) degrees."""

    id: str
    origin: tuple[float, float]
    bounds: tuple[float, float, float, float]
    datum_m: float = 0.0
    waters: tuple[Water, ...] = ()
    lands: tuple[Land, ...] = ()
    solids: tuple[Solid, ...] = ()
    props: tuple[Prop, ...] = ()
    attribution: str = ""
