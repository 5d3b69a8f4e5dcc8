"""`City`: one static world that every engine shares, as plain values.

A scene provider (`lingjing.plugins.hookspecs.lingjing_scenes`) builds it once per episode, before the reset barrier. It
is sent unchanged to the worker processes. Moving things are not in it: they are `Entity`s of the mission and belong to
engines. Frame: east, north, elevation over the datum's zero, in metres. Polygons are anticlockwise and do not repeat
the first point.

A small city holds its pieces itself. A large one names a folder (`store`) that holds them in square tiles; its own
piece fields hold only the waters and lands. Readers that use `lingjing.scene.tiles.Tiles` work with both.
"""

from __future__ import annotations

import hashlib

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Datum, Vector


class Water(msgspec.Struct, frozen=True, kw_only=True):
    """A body of water with a still surface. A land polygon over it is an island or the shore."""

    polygon: Polygon
    """Outline, metres."""
    level_m: float
    """Elevation of the still surface, metres."""
    holes: tuple[Polygon, ...] = ()
    """Dry areas inside the outline."""


class Land(msgspec.Struct, frozen=True, kw_only=True):
    """Solid ground with a flat top."""

    polygon: Polygon
    """Outline, metres."""
    top_m: float
    """Elevation of the top, metres."""
    surface: str = "grass"
    """`sand`, `grass`, `rock` or `concrete`."""


class PaintedArea(msgspec.Struct, frozen=True, kw_only=True):
    """A surface painted on the ground at its elevation; bodies do not collide with it.

    Later areas are painted over earlier ones.
    """

    polygon: Polygon
    """Outline, metres."""
    surface: str
    """`park`, `grass`, `forest`, `plaza`, `sidewalk`, `parking`, `asphalt`, `industrial`, `residential`, `commercial`,
    `sand`, `concrete` or `pitch`."""
    top_m: float = 0.0
    """Elevation, metres."""
    holes: tuple[Polygon, ...] = ()
    """Unpainted areas inside the outline."""


class Solid(msgspec.Struct, frozen=True, kw_only=True):
    """A prism that cameras see and bodies collide with: pier decks, piles, huts, walls, kerbs, steps of stairs."""

    id: str
    """Unique among the solids of a city; parts of a cut structure may share it."""
    polygon: Polygon
    """Outline, metres."""
    base_m: float
    """Elevation of the underside, metres."""
    top_m: float
    """Elevation of the top, metres."""
    material: str = "concrete"
    """Name of the drawn material."""


class Slope(msgspec.Struct, frozen=True, kw_only=True):
    """A convex slab with an inclined, planar top that legged robots can walk on."""

    id: str
    top: tuple[Vector, ...]
    """Corners of the planar top: east, north, elevation in metres."""
    thickness_m: float = 0.3
    """Thickness of the slab under the top, metres."""
    material: str = "concrete"


class Building(msgspec.Struct, frozen=True, kw_only=True):
    """A building or a part of one: a prism from `base_m` to `top_m`, which includes its roof, with windows in the
    walls.
    """

    id: str
    polygon: Polygon
    """Outline, metres."""
    base_m: float
    """Elevation of the base, metres."""
    top_m: float
    """Elevation of the highest point, the roof included, metres."""
    holes: tuple[Polygon, ...] = ()
    """Courtyards."""
    use: str = "residential"
    """`residential`, `commercial`, `office`, `industrial`, `warehouse`, `school`, `public` or `house`."""
    facade: str = "punched"
    """Pattern of the windows: `punched`, `ribbon`, `curtain`, `blank` or `industrial`."""
    roof: str = "flat"
    """`flat`, `bare` (flat without parapet and equipment, because another part is built on it), `gabled`, `hipped`,
    `pyramidal` or `dome`."""
    roof_m: float = 0.0
    """Height of the roof, metres; a part of `top_m`."""
    colour: tuple[float, float, float] = (0.6, 0.57, 0.52)
    """Wall, linear RGB, 0..1."""
    roof_colour: tuple[float, float, float] = (0.35, 0.34, 0.33)
    """Roof, linear RGB, 0..1."""
    levels: int = 3
    """Number of storeys."""
    name: str = ""
    """Name on the map; "" without one."""
    seed: int = 0
    """Seed of the random details in drawing."""
    entrance: tuple[float, float, float] | None = None
    """A point on the outline (east, north; metres) and the wall's outward bearing there (degrees); None without an
    entrance."""


class Lane(msgspec.Struct, frozen=True, kw_only=True):
    """One lane of a road."""

    id: str
    """The lane's id in the traffic network."""
    shape: tuple[Vector, ...]
    """Centre line in driving direction."""
    width_m: float
    """Width, metres."""
    kind: str = "car"
    """`car`, `bus`, `bicycle`, `foot`, or `closed` (a street that is closed to public traffic)."""


class Road(msgspec.Struct, frozen=True, kw_only=True):
    """One direction of a street between two junctions: an edge of the traffic network."""

    id: str
    """The edge's id in the traffic network. Sections of a cut road share it."""
    lanes: tuple[Lane, ...]
    """Lanes from right to left."""
    name: str = ""
    """Name of the street; "" without one."""
    kind: str = "residential"
    """OpenStreetMap's class of the street: `primary`, `residential`, …"""
    speed_mps: float = 13.9
    """Permitted speed, m/s."""
    bridge: bool = False
    tunnel: bool = False


class Junction(msgspec.Struct, frozen=True, kw_only=True):
    """The paved area where roads meet."""

    id: str
    polygon: Polygon
    """Outline, metres."""
    elevation_m: float = 0.0
    """Elevation, metres."""
    lights: bool = False
    """True if traffic lights control it."""


class Bridge(msgspec.Struct, frozen=True, kw_only=True):
    """The structure under a raised way. The way itself is a `Road` with `bridge` set, if vehicles use it."""

    id: str
    path: tuple[Vector, ...]
    """Centre line of the deck's top."""
    width_m: float
    """Width of the deck, metres."""
    thickness_m: float = 1.2
    """Thickness of the deck, metres."""
    pier_spacing_m: float = 40.0
    """Largest distance between piers, metres; 0 for a bridge without piers."""
    name: str = ""
    """Name of the bridge; "" without one."""


class Pipe(msgspec.Struct, frozen=True, kw_only=True):
    """A pipeline along a path (centre line), on supports where it runs above the ground."""

    id: str
    path: tuple[Vector, ...]
    """Centre line, metres."""
    radius_m: float = 0.4
    """Outer radius, metres."""


class Prop(msgspec.Struct, frozen=True, kw_only=True):
    """A static or floating object: decoration, or a distractor in the search for targets."""

    id: str
    cls: str
    """Semantic class in the camera's masks: `buoy`, `debris`, `rock`, `tree`, `moored_boat`, …"""
    model: str
    """Name of the drawn model."""
    position: Vector
    """East, north and elevation of its base, metres."""
    heading_deg: float = 0.0
    scale: float = 1.0
    """Factor on the model's size."""
    floating: bool = False
    """True if it follows the water's surface."""
    options: dict[str, Datum] = {}
    """Options of the model, such as `variant`."""


class Pieces(msgspec.Struct, frozen=True, kw_only=True):
    """The pieces of a city or of a part of it."""

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
    """The static world of a scene."""

    id: str
    """Name of the city, for messages."""
    origin: tuple[float, float]
    """Latitude and longitude of the frame's origin, degrees."""
    bounds: tuple[float, float, float, float]
    """West, south, east, north; metres."""
    datum_m: float = 0.0
    """Elevation of the water's datum, metres."""
    attribution: str = ""
    """Credit of the data's source, shown with pictures."""
    network: str = ""
    """Path of the SUMO network (`.net.xml`) in this frame's coordinates; "" without roads."""
    store: str = ""
    """Path of the folder that holds the tiles; "" if the city holds all pieces itself."""
    tile_m: float = 250.0
    """Side of a tile, metres."""
    tiles: tuple[tuple[int, int], ...] = ()
    """Column and row of each tile in `store`."""
    sha256: str = ""
    """SHA-256 of the content, independent of paths; "" if the hash is to be computed from the value itself."""


class Tile(Pieces, frozen=True, kw_only=True):
    """The pieces of one square of the grid: those with their first point in it."""

    key: tuple[int, int]
    """Column and row."""


def content_sha256(city: City) -> str:
    """SHA-256 of a city's content. Traces identify the city by it."""
    return city.sha256 or hashlib.sha256(msgspec.json.encode(city)).hexdigest()
