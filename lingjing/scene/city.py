"""`City`: one static world that every engine shares, as plain values.

Built once per episode by a scene provider (`lingjing.plugins.hookspecs.lingjing_scenes`), before the reset barrier,
and sent to the worker processes as it is. What moves is not here: it is an `Entity` of the mission and belongs to an
engine. Frame: east, north, elevation over the datum's zero, metres; polygons anticlockwise without closing repeat.

A small city holds its pieces itself. A large one names a folder (`store`) that holds them in square tiles, and its
own piece fields are empty but for what is everywhere (the sea). Readers that go through `lingjing.scene.tiles.Tiles`
need not know which of the two they have.
"""

from __future__ import annotations

import hashlib

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Datum, Vector


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """A body of water at a level; land polygons on top of it are islands or the shore. `holes` are dry."""

    polygon: Polygon
    level_m: float
    holes: tuple[Polygon, ...] = ()


class Land(msgspec.Struct, frozen=True, kw_only=True):
    """Solid ground with a top elevation and a surface (`sand`, `grass`, `rock`, `concrete`)."""

    polygon: Polygon
    top_m: float
    surface: str = "grass"


class PaintedArea(msgspec.Struct, frozen=True, kw_only=True):
    """A surface painted on the ground at its height, nothing to bump into.

    `surface` is one of `park`, `grass`, `forest`, `plaza`, `sidewalk`, `parking`, `asphalt`, `industrial`,
    `residential`, `commercial`, `sand`, `concrete`, `pitch`. Later areas are painted over earlier ones.
    """

    polygon: Polygon
    surface: str
    top_m: float = 0.0
    holes: tuple[Polygon, ...] = ()


class Solid(msgspec.Struct, frozen=True, kw_only=True):
    """A prism that is both seen and hit: pier decks, piles, huts, walls, kerbs, steps of stairs."""

    id: str
    polygon: Polygon
    base_m: float
    top_m: float
    material: str = "concrete"


class Slope(msgspec.Struct, frozen=True, kw_only=True):
    """A convex slab with an inclined flat top that legs can walk on; `top` is planar, `thickness_m` hangs under it."""

    id: str
    top: tuple[Vector, ...]
    thickness_m: float = 0.3
    material: str = "concrete"


class Building(msgspec.Struct, frozen=True, kw_only=True):
    """A building or a part of one: a prism from `base_m` to `top_m` with a roof on it and windows in its walls.

    `use` is `residential`, `commercial`, `office`, `industrial`, `warehouse`, `school`, `public` or `house`; `roof` is
    `flat`, `bare` (flat, nothing on it and no parapet: built upon), `gabled`, `hipped`, `pyramidal`, `dome`; its height
    `roof_m` is part of `top_m`. `colour` (linear RGB 0..1) is the wall's, `facade` one of `punched`, `ribbon`,
    `curtain`, `blank`, `industrial`; `seed` feeds what is left to chance in drawing. `levels` counts storeys.
    `entrance` is a point on the outline with the wall's outward bearing in degrees, if there is one to show.
    """

    id: str
    polygon: Polygon
    base_m: float
    top_m: float
    holes: tuple[Polygon, ...] = ()
    use: str = "residential"
    facade: str = "punched"
    roof: str = "flat"
    roof_m: float = 0.0
    colour: tuple[float, float, float] = (0.6, 0.57, 0.52)
    roof_colour: tuple[float, float, float] = (0.35, 0.34, 0.33)
    levels: int = 3
    name: str = ""
    seed: int = 0
    entrance: tuple[float, float, float] | None = None


class Lane(msgspec.Struct, frozen=True, kw_only=True):
    """One lane of a road: its centre line in driving direction and its width. `id` is the traffic network's."""

    id: str
    shape: tuple[Vector, ...]
    width_m: float
    kind: str = "car"
    """`car`, `bus`, `bicycle`, `foot`, or `closed`: a street that the public may not drive on."""


class Road(msgspec.Struct, frozen=True, kw_only=True):
    """One direction of a street between two junctions: an edge of the traffic network. Lanes from right to left."""

    id: str
    lanes: tuple[Lane, ...]
    name: str = ""
    kind: str = "residential"
    speed_mps: float = 13.9
    bridge: bool = False
    tunnel: bool = False


class Junction(msgspec.Struct, frozen=True, kw_only=True):
    """Where roads meet: its paved outline at its height."""

    id: str
    polygon: Polygon
    elevation_m: float = 0.0
    lights: bool = False


class Bridge(msgspec.Struct, frozen=True, kw_only=True):
    """The structure under a raised way: deck centre line, deck width and thickness, spacing of its piers (0: none).

    The way itself is a `Road` with `bridge` set where vehicles use it.
    """

    id: str
    path: tuple[Vector, ...]
    width_m: float
    thickness_m: float = 1.2
    pier_spacing_m: float = 40.0
    name: str = ""


class Pipe(msgspec.Struct, frozen=True, kw_only=True):
    """A pipeline along a path (centre line), on supports where it runs above the ground."""

    id: str
    path: tuple[Vector, ...]
    radius_m: float = 0.4


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


class Pieces(msgspec.Struct, frozen=True, kw_only=True):
    """What a part of a city consists of."""

    waters: tuple[Water, ...] = ()
    lands: tuple[Land, ...] = ()
    areas: tuple[PaintedArea, ...] = ()
    solids: tuple[Solid, ...] = ()
    slopes: tuple[Slope, ...] = ()
    buildings: tuple[Building, ...] = ()
    roads: tuple[Road, ...] = ()
    junctions: tuple[Junction, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    pipes: tuple[Pipe, ...] = ()
    props: tuple[Prop, ...] = ()


class City(Pieces, frozen=True, kw_only=True):
    """The static world. `bounds` is (west, south, east, north) in metres; `origin` (latitude, longitude) degrees.

    `network` is the path of the SUMO network (`.net.xml`, its XY are this frame's) or "" where there are no roads.
    `store` is the folder of tiles of `tile_m` side, named by column and row (`tiles` lists them), or "". `sha256`
    identifies the content whatever the paths are; "" means that the content is all here.
    """

    id: str
    origin: tuple[float, float]
    bounds: tuple[float, float, float, float]
    datum_m: float = 0.0
    attribution: str = ""
    network: str = ""
    store: str = ""
    tile_m: float = 250.0
    tiles: tuple[tuple[int, int], ...] = ()
    sha256: str = ""


class Tile(Pieces, frozen=True, kw_only=True):
    """The pieces of one square: a piece is in the one tile that holds its first point (`key` is column and row)."""

    key: tuple[int, int]


def content_sha256(city: City) -> str:
    """SHA-256 over a city's content, by which a trace knows it again."""
    return city.sha256 or hashlib.sha256(msgspec.json.encode(city)).hexdigest()
