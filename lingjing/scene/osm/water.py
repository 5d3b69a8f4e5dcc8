"""Waters: rivers, lakes and basins as mapped, waterways widened from their lines, and the sea behind the coastline.

All waters of a map lie at one level, below the ground. A coastline runs with the land on its left and the water on its
right (OpenStreetMap's rule); cut at the frame it divides it into faces, each of which is land or sea by what the lines
around it say.
"""

from __future__ import annotations

from itertools import pairwise
from math import hypot
from typing import Any

from lingjing.scene.city import Water
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.tags import is_set, layer, metres

LEVEL_M = -1.5
"""Elevation of the waters of a map unless somebody says otherwise; the ground is at 0."""

WIDTHS_M = {"river": 20.0, "canal": 10.0, "stream": 3.0, "fairway": 0.0}
LANDLOCKED = {"basin", "reservoir"}
SIMPLIFY_M = 0.1


def wet(features: Features) -> Any:
    """Everything that is water in the frame, as one shapely geometry."""
    import shapely

    bodies = [f.shape for f in features.areas if _is_water(f)]
    mapped = shapely.union_all([*bodies, *_sea(features)])
    strips = [strip for strip in _strips(features) if not _is_mapped(strip, mapped)]
    whole = shapely.union_all([mapped, *strips])
    return shapely.intersection(whole, features.box).simplify(SIMPLIFY_M)


def waters(area: Any, level_m: float) -> tuple[Water, ...]:
    """The bodies of a wet geometry, the largest first."""
    shapes = sorted(polygons(area), key=lambda part: (-part.area, part.bounds))
    found = []
    for shape in shapes:
        for outline, *holes in filter(None, (rings(shape),)):
            found.append(Water(polygon=outline, holes=(*holes,), level_m=level_m))
    return tuple(found)


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
    """Waterways that are mapped as lines, as wide as they say or as is usual."""
    found = []
    for line in features.lines:
        usual = WIDTHS_M.get(line.tags.get("waterway", ""), 0.0)
        if usual > 0.0 and not is_set(line.tags, "tunnel") and layer(line.tags) >= 0:
            width = metres(line.tags, "width", "est_width") or usual
            found.append(line.shape.buffer(min(width, 400.0) / 2.0, quad_segs=2, cap_style="flat"))
    return found


def _is_mapped(strip: Any, mapped: Any) -> bool:
    """Whether a widened line mostly runs through water that is mapped as an area."""
    import shapely

    return bool(shapely.intersection(strip, mapped).area > 0.5 * strip.area)


def _sea(features: Features) -> list[Any]:
    """The faces of the frame that lie on the right-hand side of the coastline."""
    import shapely

    coast = [
        part
        for line in features.lines
        if line.tags.get("natural") == "coastline"
        for part in shapely.get_parts(shapely.intersection(line.shape, features.box))
        if part.geom_type == "LineString" and part.length > 0.0
    ]
    coast += [
        f.shape.exterior
        for f in features.areas
        if f.tags.get("natural") == "coastline" and f.shape.geom_type == "Polygon"
    ]
    if not coast:
        return []
    noded = shapely.union_all([features.box.exterior, *coast])
    faces = list(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded))))
    balance = _votes(coast, faces)
    if sum(vote != 0.0 for vote in balance) == 0:
        features.skipped["coastlines that divide nothing"] += 1
    return [face for face, vote in zip(faces, balance, strict=True) if vote > 0.0]


def _votes(coast: list[Any], faces: list[Any]) -> list[float]:
    """For each face, metres of coast that say water less metres that say land."""
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
