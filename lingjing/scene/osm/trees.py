"""Trees: those on the map, along mapped rows, and scattered in parks and woods by the seed.

No tree stands in water, in a building, on a road or on a pitch. A mapped one that would is set aside by up to
`ASIDE_M`, because maps draw streets as lines, else left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil, floor, sqrt
from random import Random
from typing import Any

import msgspec

from lingjing.scene.city import Building, PaintedArea, Prop, Road
from lingjing.scene.osm.features import Features
from lingjing.scene.osm.looks import stream
from lingjing.scene.osm.tags import metres

ROW_M = 8.0
"""Distance between the trees of a row, metres (chosen)."""

SOWN_M = {"park": (14.0, 0.6), "forest": (7.0, 0.85), "grass": (26.0, 0.35)}
"""Surface → side of the square with at most one tree, metres, and the probability of that tree (chosen)."""

FIELDS = ("pitch", "plaza", "parking", "asphalt", "sidewalk", "sand", "concrete")
"""Surfaces without trees."""

ASIDE_M = 4.0
"""Farthest move of a mapped tree off a road or a wall, metres (chosen: a lane's width and a little)."""

CLEAR_M = 0.2
"""Distance of a moved tree from the edge that it was moved over, metres (chosen)."""

USUAL_M = 8.0
"""Height of a tree of scale 1, metres; mapped heights are scaled by it."""

MOST_PER_AREA = 10_000
"""Most trees of one area (chosen). A larger wood gets a wider spacing."""

_MOST_SPOTS = 1_000_000
"""Most squares of one area (chosen)."""


def trees(features: Features, areas: tuple[PaintedArea, ...], built: Any, seed: int) -> Iterator[Prop]:
    """The trees of the frame. `built`: geometry without trees (see `occupied_area`)."""
    yield from _aside(_mapped(features, seed), built)
    yield from _sown(areas, built, seed)


def occupied_area(wet: Any, buildings: Iterable[Building], pavement: Any) -> Any:
    """Water, buildings with a margin and the pavement, as a prepared geometry."""
    import shapely

    houses = [shapely.Polygon(building.polygon).buffer(1.5, quad_segs=1) for building in buildings]
    whole = shapely.union_all([wet, *houses, pavement])
    shapely.prepare(whole)
    return whole


def pavement(roads: Iterable[Road]) -> Any:
    """The area of lanes with a margin of 0.5 m, as a prepared geometry."""
    import shapely

    lanes = [
        shapely.LineString([point[:2] for point in lane.shape]).buffer(lane.width_m / 2.0 + 0.5, quad_segs=1)
        for road in roads
        for lane in road.lanes
        if len(lane.shape) > 1
    ]
    whole = shapely.union_all(lanes)
    shapely.prepare(whole)
    return whole


# -- private


def _mapped(features: Features, seed: int) -> Iterator[Prop]:
    """Yield the single trees of the map, and those of its rows."""
    box = features.box
    for spot in features.spots:
        if spot.tags.get("natural") == "tree":
            yield _tree(spot.ref, spot.shape.x, spot.shape.y, spot.tags, stream(seed, f"tree/{spot.ref}"))
    for line in features.lines:
        if line.tags.get("natural") == "tree_row":
            yield from _row(line.ref, line.shape, line.tags, box, stream(seed, f"row/{line.ref}"))


def _aside(planted: Iterable[Prop], built: Any) -> Iterator[Prop]:
    """Yield trees at places outside of `built`, moved by at most `ASIDE_M`; a tree farther inside is left out."""
    import shapely

    trees = list(planted)
    inside = shapely.contains_xy(built, [tree.position[0] for tree in trees], [tree.position[1] for tree in trees])
    edge = built.boundary if inside.any() else None
    for tree, is_inside in zip(trees, inside.tolist(), strict=True):
        if not is_inside:
            yield tree
            continue
        spot = shapely.Point(tree.position[:2])
        near = shapely.shortest_line(spot, edge).coords[-1]
        reach = spot.distance(shapely.Point(near))
        if reach <= ASIDE_M:
            beyond = 1.0 + CLEAR_M / max(reach, CLEAR_M)
            x, y = (spot.x + (near[0] - spot.x) * beyond, spot.y + (near[1] - spot.y) * beyond)
            if not shapely.contains_xy(built, x, y):
                yield msgspec.structs.replace(tree, position=(round(x, 2), round(y, 2), tree.position[2]))


def _row(ref: str, line: Any, tags: dict[str, str], box: Any, chance: Random) -> Iterator[Prop]:
    import shapely

    for number, part in enumerate(shapely.get_parts(line)):
        count = max(1, round(part.length / ROW_M))
        for k in range(count + 1):
            spot = part.interpolate(k / count, normalized=True)
            tree = _tree(f"{ref}-{number}-{k}", spot.x, spot.y, tags, chance)
            if box.contains(spot):
                yield tree


def _sown(areas: tuple[PaintedArea, ...], built: Any, seed: int) -> Iterator[Prop]:
    """Trees of green areas, at most one in each square of a grid. Where areas overlap, the one painted last decides."""
    import shapely

    shapes = [shapely.Polygon(area.polygon, area.holes) for area in areas]
    index = shapely.STRtree(shapes)
    for number, (area, shape) in enumerate(zip(areas, shapes, strict=True)):
        if area.surface not in SOWN_M:
            continue
        west, south, *_ = shape.bounds
        chance = stream(seed, f"sown/{area.surface}/{west:.1f}/{south:.1f}")
        _, share = SOWN_M[area.surface]
        spots = list(_spots(shape.bounds, _side(shape, area.surface), share, chance))
        if not spots:
            continue
        xs, ys = [x for x, _ in spots], [y for _, y in spots]
        inside = shapely.contains_xy(shape, xs, ys) & ~shapely.contains_xy(built, xs, ys)
        over = [k for k in index.query(shape) if k > number and areas[k].surface in (*SOWN_M, *FIELDS)]
        for k in over:
            inside &= ~shapely.contains_xy(shapes[k], xs, ys)
        for k, ((x, y), stands) in enumerate(zip(spots, inside.tolist(), strict=True)):
            tree = _tree(f"{area.surface}-{number}-{k}", x, y, {}, chance)
            if stands:
                yield tree


def _side(shape: Any, surface: str) -> float:
    """Side of the square with at most one tree: the surface's, wider if there would be too many trees."""
    side, share = SOWN_M[surface]
    west, south, east, north = shape.bounds
    many, spots = shape.area * share / side**2, (east - west) * (north - south) / side**2
    return side * sqrt(max(1.0, many / MOST_PER_AREA, spots / _MOST_SPOTS))


def _spots(bounds: tuple[float, ...], side: float, share: float, chance: Random) -> Iterator[tuple[float, float]]:
    west, south, east, north = bounds
    for column in range(floor(west / side), ceil(east / side)):
        for row in range(floor(south / side), ceil(north / side)):
            x, y = (column + chance.uniform(0.1, 0.9)) * side, (row + chance.uniform(0.1, 0.9)) * side
            if chance.random() < share:
                yield round(x, 2), round(y, 2)


def _tree(ref: str, x: float, y: float, tags: dict[str, str], chance: Random) -> Prop:
    size, heading, variant = chance.uniform(0.75, 1.35), chance.uniform(0.0, 360.0), chance.randrange(1000)
    height = metres(tags, "height")
    scale = min(max(height / USUAL_M, 0.3), 4.0) if height else size
    pine = tags.get("leaf_type") == "needleleaved"
    return Prop(id=f"tree-{ref}", cls="tree", model="pine" if pine else "tree", position=(x, y, 0.0),
                scale=round(scale, 3), heading_deg=round(heading, 1), options={"variant": variant})  # fmt: skip
