"""Surfaces painted on the ground: land uses, parks, woods, squares, car parks, footpaths.

Large areas are painted before small ones, and coarse kinds (a residential quarter) before fine ones (a pitch). Water is
subtracted from all of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from lingjing.scene.city import PaintedArea
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.tags import is_below, is_set, layer, metres

SURFACES: dict[str, dict[str, str]] = {
    "landuse": {
        "residential": "residential", "commercial": "commercial", "retail": "commercial", "industrial": "industrial",
        "port": "industrial", "railway": "industrial", "construction": "sand", "brownfield": "sand", "quarry": "sand",
        "greenfield": "grass", "garages": "parking", "grass": "grass", "meadow": "grass", "orchard": "grass",
        "farmland": "grass", "allotments": "grass", "vineyard": "grass", "cemetery": "park", "village_green": "grass",
        "recreation_ground": "park", "forest": "forest", "flowerbed": "grass", "greenery": "park",
        "plant_nursery": "grass", "education": "residential", "institutional": "residential", "civil": "commercial",
    },
    "natural": {
        "wood": "forest", "scrub": "forest", "grassland": "grass", "heath": "grass", "wetland": "grass",
        "beach": "sand", "sand": "sand", "shingle": "sand", "bare_rock": "concrete", "scree": "concrete",
    },
    "leisure": {
        "park": "park", "garden": "park", "pitch": "pitch", "playground": "pitch", "golf_course": "grass",
        "common": "grass", "nature_reserve": "", "dog_park": "grass", "track": "pitch", "outdoor_seating": "plaza",
    },
    "amenity": {
        "parking": "parking", "school": "residential", "university": "residential", "hospital": "residential",
        "college": "residential", "kindergarten": "residential", "marketplace": "plaza", "bus_station": "asphalt",
        "fuel": "asphalt", "bicycle_parking": "sidewalk",
    },
    "place": {"square": "plaza"},
    "aeroway": {"apron": "concrete", "runway": "asphalt", "taxiway": "asphalt", "helipad": "concrete"},
    "railway": {"platform": "sidewalk"},
    "highway": {"pedestrian": "plaza", "footway": "sidewalk", "platform": "sidewalk", "service": "asphalt",
                "residential": "asphalt", "path": "sidewalk", "steps": "sidewalk"},
}  # fmt: skip
"""Tag → surface; the last match counts."""

ORDER = ("residential", "commercial", "industrial", "grass", "park", "sand", "concrete", "forest", "plaza", "parking",
         "asphalt", "sidewalk", "pitch")  # fmt: skip
"""Painting order of surfaces, coarse to fine."""

PATHS_M = {"footway": 2.2, "pedestrian": 5.0, "path": 1.6, "cycleway": 2.4, "steps": 2.4, "corridor": 0.0, "track": 2.6}
"""Usual widths of ways that the road network leaves out, metres (chosen)."""

SIMPLIFY_M = 0.15
"""Tolerance of simplified outlines, metres (chosen)."""


def areas(features: Features, wet: Any) -> tuple[PaintedArea, ...]:
    """The painted surfaces of the frame, in painting order. `wet`: shapely geometry of the waters."""
    import shapely

    shapely.prepare(wet)
    box = features.box
    painted: list[tuple[int, float, str, Any]] = []
    for feature in features.areas:
        surface = surface_of(feature.tags)
        if surface:
            shape = shapely.intersection(feature.shape, box)
            if feature.tags.get("man_made") != "pier" and wet.intersects(shape):
                shape = shapely.difference(shape, wet)
            painted.append((ORDER.index(surface), -shape.area, surface, shape.simplify(SIMPLIFY_M)))
    paths = shapely.difference(shapely.intersection(shapely.union_all(_paths(features.lines)), box), wet)
    painted.append((ORDER.index("sidewalk"), 0.0, "sidewalk", paths.simplify(SIMPLIFY_M)))
    painted.sort(key=lambda item: (item[0], item[1], item[3].bounds))
    return tuple(
        PaintedArea(polygon=outline, surface=surface, holes=(*holes,))
        for _, _, surface, shape in painted
        for part in polygons(shape)
        for outline, *holes in filter(None, (rings(part),))
    )


def surface_of(tags: dict[str, str]) -> str:
    """The surface of an area by its tags; empty for none."""
    if is_set(tags, "building") or is_set(tags, "building:part") or tags.get("natural") == "water":
        return ""
    if _is_hidden(tags):
        return ""
    surfaces = [table[tags[key]] for key, table in SURFACES.items() if tags.get(key) in table]
    return surfaces[-1] if surfaces else ""


# -- private


def _is_hidden(tags: dict[str, str]) -> bool:
    """True for underground car parks and platforms, and for squares on bridges."""
    if tags.get("parking") in ("underground", "multi-storey", "rooftop"):
        return True
    moves = any(key in tags for key in ("highway", "railway", "amenity"))
    return moves and (is_below(tags) or layer(tags) > 0 or is_set(tags, "bridge"))


def _paths(lines: Iterable[Feature]) -> list[Any]:
    """Paths on the ground as polygons."""
    shapes = []
    for line in lines:
        width = PATHS_M.get(line.tags.get("highway", ""), 0.0)
        hidden = is_below(line.tags) or layer(line.tags) != 0 or is_set(line.tags, "bridge")
        if width > 0.0 and not hidden and line.tags.get("footway") != "crossing":
            stated = metres(line.tags, "width") or width
            shapes.append(line.shape.buffer(min(max(stated, 0.6), 30.0) / 2.0, quad_segs=1))
    return shapes
