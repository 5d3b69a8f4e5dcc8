"""Waters: rivers, lakes and basins as mapped, waterways widened from their lines, and the sea behind the coastline.

All waters of a map lie at one level below the ground. A coastline has land on its left and water on its right
(OpenStreetMap's rule). Clipped to the frame, coastlines divide it into faces; the lines around a face decide whether it
is land or sea.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from math import dist, hypot
from typing import Any

from lingjing.scene.city import Building, Water
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.tags import is_set, layer, metres

LEVEL_M = -1.5
"""Default elevation of a map's waters, metres (chosen); the ground is at 0."""

WIDTHS_M = {"river": 20.0, "canal": 10.0, "stream": 3.0, "fairway": 0.0}
"""Usual widths of waterways that are mapped as lines, metres (chosen)."""
LANDLOCKED = {"basin", "reservoir"}
"""Values of `landuse` that are waters."""
ON_PILES = 0.5
"""Share of a footprint in the water above which a building stands on piles, and below which on a quay (chosen)."""
QUAY_M = 1.5
"""Width of the quay around a building, metres (chosen)."""
SIMPLIFY_M = 0.1
"""Tolerance of simplified outlines, metres (chosen)."""


def wet(features: Features) -> Any:
    """All water in the frame, as one shapely geometry."""
    import shapely

    bodies = [f.shape for f in features.areas if _is_water(f)]
    mapped = shapely.union_all([*bodies, *_sea(features)])
    strips = [strip for strip in _strips(features) if not _is_mapped(strip, mapped)]
    whole = shapely.union_all([mapped, *strips])
    return shapely.intersection(whole, features.box).simplify(SIMPLIFY_M)


def waters(area: Any, level_m: float) -> tuple[Water, ...]:
    """The bodies of a wet geometry, the largest first."""
    shapes = sorted(polygons(area), key=lambda part: (-part.area, part.bounds))
    bodies = []
    for shape in shapes:
        for outline, *holes in filter(None, (rings(shape),)):
            bodies.append(Water(polygon=outline, holes=(*holes,), level_m=level_m))
    return tuple(bodies)


def with_banks(area: Any, buildings: Iterable[Building]) -> tuple[Any, tuple[Any, ...]]:
    """The waters with dry ground under buildings that stand partly in them, and the outlines of those that stand all
    but wholly in them, which need a pier. Both are shapely geometries.

    Maps draw banks to a few metres. So a wall in the water at a bank is a quay wall, and a boathouse stands on piles.
    """
    import shapely

    shapely.prepare(area)
    shapes = [shapely.make_valid(shapely.Polygon(building.polygon)) for building in buildings if building.base_m <= 0.0]
    touched = [shape for shape in shapes if area.intersects(shape)]
    shares = [shapely.intersection(shape, area).area / max(shape.area, 1.0) for shape in touched]
    afloat = tuple(shape for shape, share in zip(touched, shares, strict=True) if share > ON_PILES)
    quays = [
        shape.buffer(QUAY_M, quad_segs=1)
        for shape, share in zip(touched, shares, strict=True)
        if 0.0 < share <= ON_PILES
    ]
    return shapely.difference(area, shapely.union_all(quays)) if quays else area, afloat


# -- private


def _is_water(feature: Feature) -> bool:
    tags = feature.tags
    if is_set(tags, "tunnel") or is_set(tags, "covered") or tags.get("intermittent") == "yes":
        return False
    return (
        tags.get("natural") == "water"
        or tags.get("waterway") in ("riverbank", "dock", "basin")
        or tags.get("landuse") in LANDLOCKED
    )


def _strips(features: Features) -> list[Any]:
    """Waterways that are mapped as lines, widened to their tagged or usual width."""
    strips = []
    for line in features.lines:
        usual = WIDTHS_M.get(line.tags.get("waterway", ""), 0.0)
        if usual > 0.0 and not is_set(line.tags, "tunnel") and layer(line.tags) >= 0:
            width = metres(line.tags, "width", "est_width") or usual
            strips.append(line.shape.buffer(min(width, 400.0) / 2.0, quad_segs=2, cap_style="flat"))
    return strips


def _is_mapped(strip: Any, mapped: Any) -> bool:
    """True if a widened line mostly runs through water that is mapped as an area."""
    import shapely

    return bool(shapely.intersection(strip, mapped).area > 0.5 * strip.area)


def _sea(features: Features) -> list[Any]:
    """The faces of the frame on the right-hand side of the coastline."""
    import shapely

    coast = [
        part
        for line in features.lines
        if line.tags.get("natural") == "coastline"
        for part in shapely.get_parts(shapely.intersection(line.shape, features.box))
        if part.geom_type == "LineString" and part.length > 0.0
    ]
    coast += [
        part.exterior for f in features.areas if f.tags.get("natural") == "coastline" for part in polygons(f.shape)
    ]
    if not coast:
        return []
    mended = _mended(coast, features)
    noded = shapely.union_all([features.box.exterior, *coast, *mended])
    faces = list(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded))))
    balance = _votes(coast, faces)
    return [face for face, vote in zip(faces, balance, strict=True) if vote > 0.0 and not _drowns(face, features)]


def _mended(coast: list[Any], features: Features) -> list[Any]:
    """Straight lines that close the gaps of a coast inside the frame, which extracts leave.

    They connect an end with a beginning that are nearer to each other than to the edge, else an end with the edge.
    """
    import shapely

    rim = features.box.exterior
    starts, ends = Counter(line.coords[0] for line in coast), Counter(line.coords[-1] for line in coast)
    inner = {point: shapely.Point(point).distance(rim) for point in sorted(starts + ends)}
    begins = [point for point in sorted(starts - ends) if inner[point] > 0.01]
    stops = [point for point in sorted(ends - starts) if inner[point] > 0.01]
    pairs = sorted((dist(stop, begin), stop, begin) for stop in stops for begin in begins)
    closures: list[Any] = []
    done: set[tuple[float, ...]] = set()
    for length, stop, begin in pairs:
        if length < min(inner[stop], inner[begin]) and done.isdisjoint((stop, begin)):
            closures.append(shapely.LineString([stop, begin]))
            done |= {stop, begin}
    closures += [_led_on(point, inner[point], rim) for point in (*begins, *stops) if point not in done]
    if closures:
        features.skipped["gaps of the coastline, closed with straight lines"] += len(closures)
    return closures


def _led_on(point: tuple[float, ...], distance: float, rim: Any) -> Any:
    """The line from a point to the nearest point of the edge and 1 m beyond, so that rounding cannot leave a gap."""
    import shapely

    nearest = rim.interpolate(rim.project(shapely.Point(point)))
    beyond = 1.0 + 1.0 / distance
    there = (point[0] + beyond * (nearest.x - point[0]), point[1] + beyond * (nearest.y - point[1]))
    return shapely.LineString([point, there])


def _drowns(face: Any, features: Features) -> bool:
    """True if the face would put most buildings into the sea. Then the coastline is invalid, and the face stays
    land."""
    import shapely

    houses = [f.shape.representative_point() for f in features.areas if is_set(f.tags, "building")]
    shapely.prepare(face)
    wet_ones = int(shapely.contains(face, houses).sum()) if houses else 0
    if wet_ones <= max(10, len(houses) // 2):
        return False
    features.skipped["coastlines that would drown the city"] += 1
    return True


def _votes(coast: list[Any], faces: list[Any]) -> list[float]:
    """Return for each face the metres of coast that have it on their water side, less those on their land side."""
    import shapely

    tree = shapely.STRtree(faces)
    votes = [0.0] * len(faces)
    for line in coast:
        points = list(line.coords)
        for (ax, ay), (bx, by) in pairwise(points):
            length = hypot(bx - ax, by - ay)
            if length < 0.01:
                continue
            east, north = (by - ay) / length * 0.02, -(bx - ax) / length * 0.02  # to the right of the line
            for sign in (1.0, -1.0):
                spot = shapely.Point((ax + bx) / 2.0 + sign * east, (ay + by) / 2.0 + sign * north)
                for k in tree.query(spot, predicate="within"):
                    votes[int(k)] += sign * length
    return votes
