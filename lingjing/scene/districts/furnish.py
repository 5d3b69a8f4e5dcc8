"""Equipment of districts: sidewalks with trees and lamps, parking bays, lawns, benches, doorsteps, walls with gates."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from random import Random

from lingjing.mission.appearance import LinearRgb
from lingjing.mission.geometry2d import Polygon, signed_area
from lingjing.scene.camera_geometry import heading_vector
from lingjing.scene.city import Building, Slope
from lingjing.scene.districts.draft import KERB_M, Draft
from lingjing.scene.districts.palette import FACADES, WALLS, roof_colour, vary
from lingjing.scene.districts.rectangles import Rect, around, bounds

SIDEWALK_M = 3.5
"""Width of a sidewalk, metres (chosen)."""
CHAMFER_M = 5.0
"""Length cut off the corners of blocks, metres (chosen): they stay out of the crossings' rounded corners."""

STOREY_M = 3.0
"""Height of a storey, metres (chosen)."""
STEP_M = 0.12
"""Height of one step of a doorstep, metres (chosen)."""
BAY_M = (2.6, 5.2)
"""Width and length of a parking bay, metres (chosen)."""

CANOPY_M = (2.30, 1.15, 2.62, 2.76)
"""Width, depth and elevations of a canopy, metres: those of the one over the door of a house (`facade_meshes`)."""
SIDES = {"south": 180.0, "east": 90.0, "north": 0.0, "west": 270.0}
"""Outward bearing of each side of a box, degrees."""


def block_slab(draft: Draft, box: Rect, surface: str, chance: Random, tree_gap_m: float = 16.0) -> Rect:
    """Build the raised slab of a block with sidewalk, dropped kerbs, trees and lamps. Return the box inside the
    sidewalk.
    """
    corner = min(CHAMFER_M, box.width / 5.0, box.depth / 5.0)
    outline = box.chamfered(corner)
    draft.solid("kerb", outline, -0.2, KERB_M)
    draft.area(outline, "sidewalk", KERB_M + 0.005)
    inner = box.inset(SIDEWALK_M)
    draft.area(inner, surface)
    for k in (1, 3, 5, 7):
        _dropped_kerb(draft, outline[k], outline[(k + 1) % 8])
    _street_trees(draft, box, chance, tree_gap_m)
    return inner.inset(1.0)


def erect(
    draft: Draft, chance: Random, shape: Rect | Polygon, *, use: str, top_m: float, base_m: float = 0.0,
    roof: str = "flat", roof_m: float = 0.0, facade: str = "", colour: LinearRgb | None = None, side: str = "",
    name: str = "", door: tuple[float, float, float] | None = None,
) -> Building:  # fmt: skip
    """Build a building. `side`: side of its box with the entrance; `door`: entrance of any other outline."""
    outline = shape.polygon if isinstance(shape, Rect) else shape
    entrance = _entrance(shape, side) if isinstance(shape, Rect) and side else door
    building = Building(
        id=draft.name("building"),
        polygon=outline,
        base_m=round(base_m, 2),
        top_m=round(top_m + roof_m, 2),
        use=use,
        facade=facade or chance.choice(FACADES[use]),
        roof=roof,
        roof_m=round(roof_m, 2),
        colour=colour or vary(chance.choice(WALLS[use]), chance),
        roof_colour=roof_colour(use, roof, chance),
        levels=max(1, round((top_m - base_m) / STOREY_M)),
        name=name,
        seed=chance.randrange(1 << 30),
        entrance=entrance,
    )
    draft.building(building)
    return building


def canopies(draft: Draft, building: Building) -> None:
    """Build a canopy like that over the door in the middle of each side of a rectangular building without the door."""
    box = bounds(building.polygon)
    for side in SIDES:
        x, y, bearing = _entrance(box, side)
        if building.entrance is not None and bearing == building.entrance[2]:
            continue
        out, along = heading_vector(bearing), heading_vector(bearing + 90.0)
        outline = _quad(x, y, out, along, (0.0, CANOPY_M[1]), (-0.5 * CANOPY_M[0], 0.5 * CANOPY_M[0]))
        draft.solid("canopy", outline, building.base_m + CANOPY_M[2], building.base_m + CANOPY_M[3], "wood")


def doorstep(draft: Draft, entrance: tuple[float, float, float], chance: Random) -> None:
    """Build two steps up to a door and, with probability 1/2, a ramp beside them."""
    x, y, bearing = entrance
    out, along = heading_vector(bearing), heading_vector(bearing + 90.0)
    for step in (0, 1):
        near, far = 0.0, 1.1 - 0.4 * step
        outline = _quad(x, y, out, along, (near, far), (-1.4, 1.4))
        draft.solid("step", outline, 0.0, KERB_M + STEP_M * (step + 1))
    if chance.random() < 0.5:
        high = KERB_M + 2 * STEP_M
        corners = _quad(x, y, out, along, (0.0, 1.1), (1.4, 4.6))
        top = tuple((px, py, high if _along((px, py), x, y, along) < 3.0 else KERB_M) for px, py in corners)
        draft.slopes.append(Slope(id=draft.name("ramp"), top=top))


def trees(draft: Draft, box: Rect, many: int, chance: Random, base_m: float = KERB_M) -> None:
    """Plant up to `many` trees where nothing is built."""
    for _ in range(many):
        if box.width < 2.0 or box.depth < 2.0:
            return
        x, y = chance.uniform(box.west, box.east), chance.uniform(box.south, box.north)
        if draft.free(around(x, y, 4.0, 4.0)):
            tree(draft, x, y, chance, base_m)


def tree(draft: Draft, x: float, y: float, chance: Random, base_m: float = KERB_M) -> None:
    """Plant one tree."""
    model = "pine" if chance.random() < 0.2 else "tree"
    draft.prop("tree", x, y, base_m, chance.uniform(0, 360), chance.uniform(0.75, 1.3), model,
               variant=chance.randrange(8))  # fmt: skip


def bench(draft: Draft, x: float, y: float, chance: Random) -> None:
    """Place a bench with a lamp beside it."""
    draft.prop("bench", x, y, heading=90.0 * chance.randrange(4))
    draft.prop("lamp", x + 1.6, y)


def parking(draft: Draft, box: Rect, chance: Random, full: float = 0.6, cls: str = "parked_car") -> None:
    """Paint a row of bays along the longer side of a box. A share `full` of them is occupied."""
    draft.area(box, "parking", KERB_M + 0.015)
    flat = box.width >= box.depth
    length = box.width if flat else box.depth
    width = BAY_M[0] if cls == "parked_car" else 4.0
    for k in range(int(length // width)):
        if chance.random() >= full:
            continue
        at = (k + 0.5) * width
        x, y = (box.west + at, box.centre[1]) if flat else (box.centre[0], box.south + at)
        heading = (0.0 if flat else 90.0) + (180.0 if chance.random() < 0.4 else 0.0) + chance.uniform(-3.0, 3.0)
        draft.prop(cls, x, y, heading=heading, variant=chance.randrange(12))
        draft.take(around(x, y, width, 5.0))


def wall_ring(
    draft: Draft, box: Rect, gates: dict[str, float], height_m: float = 2.2, material: str = "plaster"
) -> None:
    """Build a wall around a box. `gates`: width of the gap in the middle of each named side, between pillars."""
    w, s, e, n = box
    for side, (x0, y0, x1, y1) in {
        "south": (w, s, e, s), "north": (w, n, e, n), "west": (w, s, w, n), "east": (e, s, e, n),
    }.items():  # fmt: skip
        gap = gates.get(side, 0.0)
        length = hypot(x1 - x0, y1 - y0)
        spans = ((0.0, 1.0),) if gap <= 0 else ((0.0, 0.5 - gap / 2 / length), (0.5 + gap / 2 / length, 1.0))
        for low, high in spans:
            part = Rect(x0 + low * (x1 - x0), y0 + low * (y1 - y0), x0 + high * (x1 - x0), y0 + high * (y1 - y0))
            draft.solid("wall", part.inset(-0.15), 0.0, height_m, material)
        for sign in (-1, 1) if gap > 0 else ():
            at = 0.5 + sign * (gap / 2 + 0.35) / length
            x, y = x0 + at * (x1 - x0), y0 + at * (y1 - y0)
            draft.solid("pillar", around(x, y, 0.9, 0.9), 0.0, height_m + 0.9, "brick")


def disc(x: float, y: float, radius: float, corners: int = 20) -> Polygon:
    """A circle as a polygon."""
    return tuple(
        (round(x + radius * cos(2 * pi * k / corners), 3), round(y + radius * sin(2 * pi * k / corners), 3))
        for k in range(corners)
    )


# -- private


def _entrance(box: Rect, side: str) -> tuple[float, float, float]:
    x, y = box.centre
    place = {"south": (x, box.south), "north": (x, box.north), "east": (box.east, y), "west": (box.west, y)}[side]
    return round(place[0], 3), round(place[1], 3), SIDES[side]


def _along(point: tuple[float, float], x: float, y: float, along: tuple[float, float]) -> float:
    return (point[0] - x) * along[0] + (point[1] - y) * along[1]


def _quad(
    x: float, y: float, out: tuple[float, float], along: tuple[float, float],
    depth: tuple[float, float], width: tuple[float, float],
) -> Polygon:  # fmt: skip
    """The rectangle at a wall, from `depth` outwards and `width` along it, anticlockwise."""
    corners = ((depth[0], width[0]), (depth[1], width[0]), (depth[1], width[1]), (depth[0], width[1]))
    points = [
        (round(x + d * out[0] + a * along[0], 3), round(y + d * out[1] + a * along[1], 3)) for d, a in corners
    ]  # fmt: skip
    return tuple(points if signed_area(points) > 0.0 else points[::-1])


def _dropped_kerb(draft: Draft, a: tuple[float, float], b: tuple[float, float]) -> None:
    """Build a ramp from the street up to a block's corner edge from `a` to `b`, with the street on its right."""
    length = hypot(b[0] - a[0], b[1] - a[1])
    out = ((b[1] - a[1]) / length, -(b[0] - a[0]) / length)
    low_a, low_b = ((p[0] + out[0], p[1] + out[1]) for p in (a, b))
    points = ((*low_a, 0.0), (*low_b, 0.0), (*b, KERB_M), (*a, KERB_M))
    top = tuple((round(x, 3), round(y, 3), z) for x, y, z in points)
    draft.slopes.append(Slope(id=draft.name("dropped-kerb"), top=top, thickness_m=0.2))


def _street_trees(draft: Draft, box: Rect, chance: Random, gap: float) -> None:
    rim = box.inset(1.3)
    for side in SIDES:
        flat = side in ("south", "north")
        length = rim.width if flat else rim.depth
        for k in range(int((length - 24.0) // gap) + 1):
            at = 12.0 + k * gap + chance.uniform(-1.5, 1.5)
            x = rim.west + at if flat else (rim.west if side == "west" else rim.east)
            y = rim.south + at if not flat else (rim.south if side == "south" else rim.north)
            if k % 3 == 1:
                draft.prop("lamp", x, y, heading=SIDES[side])
            elif chance.random() < 0.9:
                tree(draft, x, y, chance)
