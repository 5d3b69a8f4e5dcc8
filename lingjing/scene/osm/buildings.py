"""Buildings from footprints: extruded by height or storeys, parts in place of their outlines, roofs on top.

Follows OpenStreetMap's Simple 3D Buildings: `height` and `building:levels` include what is under `min_height` and
`building:min_level`; `height` includes the roof and levels do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, degrees, hypot
from typing import Any

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.scene.city import Building
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.osm import looks
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.neighbours import NearbyBuildings
from lingjing.scene.osm.stacking import settled
from lingjing.scene.osm.tags import is_below, is_set, metres, number

COVERED = 0.2
"""Parts that cover this share of an outline stand in its place; fewer stand beside what they leave of it."""

SMALLEST_M2 = 2.0
TALLEST_M = 1000.0
LAND_USES = {"residential": "residential", "commercial": "office", "retail": "commercial", "industrial": "industrial",
             "port": "warehouse", "railway": "industrial", "garages": "warehouse", "farmyard": "house",
             "education": "school", "institutional": "public", "civil": "public"}  # fmt: skip
STANDING = {"storage_tank": 12.0, "silo": 18.0, "chimney": 40.0, "tower": 20.0, "water_tower": 30.0, "gasometer": 25.0,
            "communications_tower": 100.0, "lighthouse": 20.0, "cooling_tower": 60.0}  # fmt: skip
"""Things of `man_made` that are buildings, and their heights where untagged."""


@dataclass(frozen=True, slots=True)
class _Body:
    """A footprint to extrude: `tags` are its own over those it inherits from the outline around it."""

    ref: str
    tags: dict[str, str]
    shape: Any


def buildings(features: Features, seed: int) -> tuple[Building, ...]:
    """The buildings whose middle is in the frame; whole even where they stick out of it."""
    around = _Around(features)
    whole = [f for f in features.areas if is_building(f.tags)]
    neighbours = NearbyBuildings((f.tags, looks.use_of(f.tags, around.use(f.shape)), f.shape) for f in whole)
    found: list[Building] = []
    for body in _bodies(features):
        found += _raise(body, around, neighbours, seed)
    doors = _doors(features)
    return tuple(_with_door(building, features, doors) for building in settled(found))


def is_building(tags: Mapping[str, str]) -> bool:
    """Whether a footprint is that of a whole building that is seen."""
    named = is_set(tags, "building") or tags.get("man_made") in STANDING
    return named and not is_below(tags)


# -- footprints


def _bodies(features: Features) -> Iterator[_Body]:
    """Outlines without parts as they are, and the parts of the others, in the map's order."""
    import shapely

    box = features.box
    inside = [f for f in features.areas if is_building(f.tags) or _is_part(f.tags)]
    inside = [f for f in inside if f.shape.area >= SMALLEST_M2 and box.contains(f.shape.representative_point())]
    parts = [f for f in inside if _is_part(f.tags)]
    outlines = [f for f in inside if not _is_part(f.tags)]
    tree = shapely.STRtree([f.shape for f in outlines])
    owners = [_owner(part, outlines, tree) for part in parts]
    for k, outline in enumerate(outlines):
        own = [part.shape for part, owner in zip(parts, owners, strict=True) if owner == k]
        taken = shapely.union_all(own)
        if not own:
            yield _Body(outline.ref, outline.tags, outline.shape)
        elif shapely.intersection(taken, outline.shape).area < COVERED * outline.shape.area:
            yield _Body(outline.ref, outline.tags, shapely.difference(outline.shape, taken))
    for part, owner in zip(parts, owners, strict=True):
        yield _Body(part.ref, _inherited(part.tags, outlines[owner].tags if owner is not None else {}), part.shape)


def _is_part(tags: Mapping[str, str]) -> bool:
    return is_set(tags, "building:part") and not is_set(tags, "building") and not is_below(tags)


def _owner(part: Feature, outlines: list[Feature], tree: Any) -> int | None:
    """The smallest outline around a part."""
    middle = part.shape.representative_point()
    around = [int(k) for k in tree.query(middle, predicate="within")]
    return min(around, key=lambda k: (outlines[k].shape.area, outlines[k].ref), default=None)


def _inherited(tags: dict[str, str], outline: dict[str, str]) -> dict[str, str]:
    """A part's tags over what the building around it says about looks and use, and about its height if the part says
    nothing."""
    keys = ["building", "amenity", "office", "shop", "tourism", "name", "name:en", "building:colour",
            "building:material", "roof:colour"]  # fmt: skip
    if not any(key in tags for key in ("height", "building:levels", "building:height")):
        keys += ["height", "building:levels", "building:height"]
    return {key: outline[key] for key in keys if key in outline} | tags


class _Around:
    """The land use around a place, for buildings that do not say what they are for."""

    def __init__(self, features: Features) -> None:
        import shapely

        lands = [f for f in features.areas if f.tags.get("landuse") in LAND_USES]
        self._uses = [LAND_USES[f.tags["landuse"]] for f in lands]
        self._uses += ["school" for f in features.areas if f.tags.get("amenity") in ("school", "university", "college")]
        lands += [f for f in features.areas if f.tags.get("amenity") in ("school", "university", "college")]
        self._areas = [f.shape.area for f in lands]
        self._tree = shapely.STRtree([f.shape for f in lands])

    def use(self, shape: Any) -> str:
        """The use of the smallest land around a shape, or an empty word."""
        found = [int(k) for k in self._tree.query(shape.representative_point(), predicate="within")]
        return self._uses[min(found, key=lambda k: (self._areas[k], k))] if found else ""


# -- heights


def _raise(body: _Body, around: _Around, neighbours: NearbyBuildings, seed: int) -> Iterator[Building]:
    """The prisms of a footprint: one for each of its polygons."""
    chance = looks.stream(seed, f"building/{body.ref}")
    tags = body.tags
    use = looks.use_of(tags, around.use(body.shape))
    roof = looks.roof_of(tags, use, chance)
    near = neighbours.near(use, body.shape)
    area, rim = body.shape.area, body.shape.length
    storeys = looks.storeys_of(tags, use, area, chance, near, 2.0 * area / rim)
    base, top, roof_m, levels = heights(tags, use, roof, storeys, _narrow(body.shape) if roof != "flat" else 0.0)
    kind = looks.kind_of(use, top, near)
    facade = looks.facade_of(tags, use, kind, top - base, chance)
    model = Building(
        id=body.ref,
        polygon=(),
        base_m=base,
        top_m=top,
        use=use,
        facade=facade,
        roof=roof if roof_m > 0.0 else "flat",
        roof_m=roof_m,
        colour=looks.wall_colour(tags, kind, facade, chance),
        roof_colour=looks.roof_colour(tags, roof, chance),
        levels=levels,
        name=tags.get("name:en", tags.get("name", "")),
        seed=chance.getrandbits(31),
    )
    shape = body.shape.simplify(0.05)
    for number_, polygon in enumerate(p for p in polygons(shape) if p.area >= SMALLEST_M2):
        for outline, *holes in filter(None, (rings(polygon),)):
            name = f"{body.ref}-{number_}" if number_ else body.ref
            yield msgspec.structs.replace(model, id=name, polygon=outline, holes=(*holes,))


def heights(
    tags: Mapping[str, str], use: str, roof: str, storeys: int, narrow_m: float
) -> tuple[float, float, float, int]:
    """Base, top, height of the roof (metres, within the top) and storeys of a building.

    `storeys` count where neither a height nor levels are said; `narrow_m` is the shorter side of the footprint, which
    an unsaid roof's pitch goes by.
    """
    storey = looks.KINDS[use].storey_m
    said, levels = metres(tags, "height", "building:height"), number(tags, "building:levels")
    standing = STANDING.get(tags.get("man_made", ""))
    roof_m = _roof_height(tags, roof, narrow_m)
    if said is not None and 0.0 < said <= TALLEST_M:
        top = said
    elif levels is not None and 0.0 <= levels <= 200.0 and levels * storey + roof_m > 0.0:
        top = levels * storey + roof_m
    elif standing is not None:
        top = standing
    else:
        top = storeys * storey + roof_m
    base = metres(tags, "min_height", "building:min_height")
    if base is None:
        lowest = number(tags, "building:min_level")
        base = 0.0 if lowest is None else _floor_height(lowest, levels, top - roof_m, storey)
    if tags.get("building") in ("roof", "carport") and base == 0.0 and "building:part" not in tags:
        base = max(0.0, top - roof_m - 0.5)  # a canopy: nothing under it
    base = base if 0.0 <= base < top else 0.0
    roof_m = min(roof_m, top - base)
    count = levels if levels is not None and 1.0 <= levels <= 200.0 else (top - base - roof_m) / storey
    return round(base, 2), round(top, 2), round(roof_m, 2), max(1, round(count))


def _floor_height(lowest: float, levels: float | None, walls_m: float, storey: float) -> float:
    """Where a level begins; by the building's own storeys where it says how many it has."""
    return lowest * (walls_m / levels if levels and levels >= lowest else storey)


def _roof_height(tags: Mapping[str, str], roof: str, narrow_m: float) -> float:
    if roof == "flat":
        return 0.0
    said = metres(tags, "roof:height", "building:roof:height")
    if said is not None and said >= 0.0:
        return said
    levels = number(tags, "roof:levels")
    if levels is not None and 0.0 < levels <= 20.0:
        return 2.7 * levels
    if roof == "dome":
        return narrow_m / 2.0
    return min(0.35 * narrow_m, 6.0)


def _narrow(shape: Any) -> float:
    """The shorter side of the smallest rectangle around a shape."""
    corners = list(shape.minimum_rotated_rectangle.exterior.coords)
    sides = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(corners[:3])]
    return float(min(sides))


# -- entrances


def _doors(features: Features) -> Any:
    """The entrances as a tree of points; `kind` of each by place."""
    import shapely

    return shapely.STRtree([shapely.Point(place) for place in features.entrances])


def _with_door(building: Building, features: Features, doors: Any) -> Building:
    """The building with its entrance on the ground, the main one first, if the map has one on its outline."""
    import shapely

    if building.base_m > 0.0 or not features.entrances:
        return building
    outline = shapely.LinearRing(building.polygon)
    places = list(features.entrances.items())
    near = [places[int(k)] for k in doors.query(outline, predicate="dwithin", distance=0.2)]
    if not near:
        return building
    (x, y), _ = min(near, key=lambda item: (item[1] != "main", item[0]))
    return msgspec.structs.replace(building, entrance=(x, y, _outward(building.polygon, x, y)))


def _outward(outline: Polygon, x: float, y: float) -> float:
    """The bearing away from an anticlockwise outline at a point on it, in degrees: square to the nearest wall."""
    import shapely

    walls = zip(outline, (*outline[1:], outline[0]), strict=True)
    spot = shapely.Point(x, y)
    (ax, ay), (bx, by) = min(walls, key=lambda wall: float(shapely.LineString(wall).distance(spot)))
    return round((degrees(atan2(bx - ax, by - ay)) + 90.0) % 360.0, 1)
