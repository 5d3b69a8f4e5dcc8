"""Buildings from footprints: extruded by their heights, parts in place of their outlines, with roofs.

A height is *tagged* (in metres or storeys, on the building or on the outline around a part), *inferred* from tagged
neighbours, the *default* that the user sets, or *drawn* at random by use, footprint and place. `HeightCounts` counts
buildings by these sources.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from random import Random
from typing import Any, Literal

import msgspec

from lingjing.scene.city import Building
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.osm import looks
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.heights import HEIGHT_KEYS, LEVEL_KEYS, STANDING, heights, is_tagged, tagged_levels
from lingjing.scene.osm.neighbours import NearbyBuilding, NearbyBuildings, Neighbourhood
from lingjing.scene.osm.places import Places
from lingjing.scene.osm.stacking import LEFT, resolve_overlaps
from lingjing.scene.osm.storeys import (
    SMALL_INFERRED_M2,
    SMALL_M2,
    STOREY_M,
    BuildingSite,
    draw,
    is_single,
    limit_storeys,
    storey_m,
    tallest_m,
    usual_storeys,
)
from lingjing.scene.osm.tags import is_below, is_set
from lingjing.scene.osm.uses import is_tower, rises, use_of

COVERED = 0.2
"""Share of an outline from which its parts replace it (chosen). Below it they stand beside the remainder of the
outline."""

SMALLEST_M2 = 2.0
"""Smallest footprint, square metres (chosen)."""
LAND_USES = {"residential": "residential", "commercial": "office", "retail": "commercial", "industrial": "industrial",
             "port": "warehouse", "railway": "industrial", "garages": "warehouse", "farmyard": "house",
             "education": "school", "institutional": "public", "civil": "public"}  # fmt: skip
"""Value of `landuse` → use of the buildings on it."""

HeightSource = Literal["tagged", "inferred", "default", "drawn"]


class HeightCounts(msgspec.Struct, frozen=True, kw_only=True):
    """Number of buildings by the source of their heights."""

    tagged: int
    """Buildings with a height from tags."""
    inferred: int
    """Buildings with a height from tagged neighbours."""
    default: int
    """Buildings with storeys set by the user."""
    drawn: int
    """Buildings with storeys drawn at random."""
    tallest_inferred_m: float
    """Largest inferred height, metres; 0 without any."""
    tallest_drawn_m: float
    """Largest drawn height, metres; 0 without any."""


@dataclass(frozen=True, slots=True)
class RaisedBuildings:
    """The buildings of a map and the sources of their heights."""

    buildings: tuple[Building, ...]
    sources: Mapping[str, HeightSource]
    """Source of the height by the building's id."""

    def counts(self) -> HeightCounts:
        """The number of buildings by the source of their heights."""
        numbers = Counter(self.sources.values())
        tops = {
            source: [building.top_m for building in self.buildings if self.sources[building.id] == source]
            for source in numbers
        }
        return HeightCounts(
            tagged=numbers["tagged"],
            inferred=numbers["inferred"],
            default=numbers["default"],
            drawn=numbers["drawn"],
            tallest_inferred_m=max(tops.get("inferred", ()), default=0.0),
            tallest_drawn_m=max(tops.get("drawn", ()), default=0.0),
        )


@dataclass(frozen=True, slots=True)
class _Body:
    """A footprint to extrude."""

    ref: str
    """Id of the map's object."""
    tags: dict[str, str]
    """Its tags, completed by those of the outline around it."""
    shape: Any
    """A shapely geometry in metres."""


def buildings(features: Features, seed: int, default_levels: int | None = None) -> RaisedBuildings:
    """The buildings with their centre in the frame, complete even if they project from it.

    `default_levels`: storeys of buildings without tagged height or storeys; None to estimate them from the neighbours
    and the place.
    """
    around = _Around(features)
    raised: list[Building] = []
    sources: dict[str, HeightSource] = {}
    for body in _bodies(features):
        source, pieces = _raise(body, around, seed, default_levels)
        sources |= {piece.id: source for piece in pieces}
        raised += pieces
    whole = resolve_overlaps(raised)
    return RaisedBuildings(whole, {building.id: sources[building.id.partition(LEFT)[0]] for building in whole})


def is_building(tags: Mapping[str, str]) -> bool:
    """True if a footprint is that of a whole, visible building."""
    named = is_set(tags, "building") or tags.get("man_made") in STANDING
    return named and not is_below(tags)


def footprints(built: Iterable[Building]) -> Any:
    """The ground of buildings as one prepared shapely geometry."""
    import shapely

    whole = shapely.union_all([shapely.make_valid(shapely.Polygon(building.polygon)) for building in built])
    shapely.prepare(whole)
    return whole


# -- footprints


def _bodies(features: Features) -> Iterator[_Body]:
    """Yield outlines without parts, and the parts of the other outlines, in the map's order."""
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
        covered = shapely.union_all(own)
        if not own:
            yield _Body(outline.ref, outline.tags, outline.shape)
        elif shapely.intersection(covered, outline.shape).area < COVERED * outline.shape.area:
            yield _Body(outline.ref, outline.tags, shapely.difference(outline.shape, covered))
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
    """A part's tags, completed by those of the building around it.

    Looks and use are inherited; the height only if the part states none.
    """
    keys = ["building", "amenity", "office", "shop", "tourism", "name", "name:en", "building:colour",
            "building:material", "roof:colour"]  # fmt: skip
    if not is_tagged(tags):
        keys += [*HEIGHT_KEYS, *LEVEL_KEYS]
    return {key: outline[key] for key in keys if key in outline} | tags


class _Around:
    """The surroundings of a building: the land it is on, its neighbours, its settlement."""

    def __init__(self, features: Features) -> None:
        import shapely

        areas = (*features.areas, *features.outside)
        lands = [(f, LAND_USES[f.tags["landuse"]]) for f in areas if f.tags.get("landuse") in LAND_USES]
        lands += [(f, "school") for f in areas if f.tags.get("amenity") in ("school", "university", "college")]
        self._uses = [use for _, use in lands]
        self._areas = [f.shape.area for f, _ in lands]
        self._tree = shapely.STRtree([f.shape for f, _ in lands])
        self._neighbours = NearbyBuildings(self.neighbour(f.tags, f.shape) for f in areas if is_building(f.tags))
        named = [f for f in areas if "place" in f.tags]
        self._places = Places((*features.places, *named), metro=features.has_metro)
        self._pitched = looks.pitched_share(
            [f.tags for f in areas if is_building(f.tags) and f.shape.area < looks.SMALL_M2], features.frame.origin[0]
        )

    def neighbour(self, tags: Mapping[str, str], shape: Any) -> NearbyBuilding:
        """A building with its use and the smallest land use area around it."""
        spot = shape.representative_point()
        lands = (int(k) for k in self._tree.query(spot, predicate="within"))
        land = min(lands, key=lambda k: (self._areas[k], k), default=-1)
        return NearbyBuilding(tags, use_of(tags, self._uses[land] if land >= 0 else ""), land, shape)

    def pitched_share(self, building: NearbyBuilding) -> float:
        """The probability of a pitched roof on a building without a tagged one, 0..1."""
        return looks.pitched_by_size(building.tags, building.use, building.shape.area, self._pitched)

    def of(self, building: NearbyBuilding) -> tuple[Neighbourhood, BuildingSite]:
        """The neighbours of a building, and its ground and settlement."""
        shape = building.shape
        near = self._neighbours.around(building)
        people = self._places.people_at(shape.representative_point())
        return near, BuildingSite(shape.area, 2.0 * shape.area / shape.length, near.footprint_m2, people)


# -- heights


def _raise(
    body: _Body, around: _Around, seed: int, default_levels: int | None
) -> tuple[HeightSource, tuple[Building, ...]]:
    """The source of a footprint's height, and its prisms, one for each of its polygons."""
    chance = looks.stream(seed, f"building/{body.ref}")
    tags = body.tags
    building = around.neighbour(tags, body.shape)
    use = building.use
    near, site = around.of(building)
    pitched = around.pitched_share(building) if is_building(tags) else 0.0
    roof = looks.roof_of(tags, use, chance, pitched)
    storeys, source = _storeys(building, near, site, chance, default_levels)
    floor_m = storey_m(tags, use, site.area_m2)
    roof = looks.fitted_roof(tags, roof, body.shape, tagged_levels(tags) or storeys)
    base, top, roof_m, levels = heights(tags, floor_m, roof, storeys, _narrow(body.shape) if roof != "flat" else 0.0)
    around_m = tallest_m(site.people) if near.storeys is None else near.storeys * STOREY_M["residential"]
    kind = looks.kind_of(use, top, around_m)
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
    return source, tuple(_prisms(body, model))


def _prisms(body: _Body, model: Building) -> Iterator[Building]:
    """Yield the building's prism for each polygon of its footprint."""
    shape = body.shape.simplify(0.05)
    for number, polygon in enumerate(p for p in polygons(shape) if p.area >= SMALLEST_M2):
        for outline, *holes in filter(None, (rings(polygon),)):
            name = f"{body.ref}-{number}" if number else body.ref
            yield msgspec.structs.replace(model, id=name, polygon=outline, holes=(*holes,))


def _storeys(
    building: NearbyBuilding, near: Neighbourhood, site: BuildingSite, chance: Random, default_levels: int | None
) -> tuple[int, HeightSource]:
    """The storeys of a building and their source. For a tagged building they are not used."""
    tags, use = building.tags, building.use
    usual = usual_storeys(tags, use, site)
    expected, is_inferred = near.expected(usual, rises=rises(tags, use))
    drawn = draw(usual if is_tower(tags) else expected, chance)
    if is_tagged(tags):
        return drawn, "tagged"
    if is_single(tags, use, site) or tags.get("man_made") in STANDING:
        return 1, "drawn"
    if default_levels is not None:
        return default_levels, "default"
    if is_tower(tags):
        return drawn, "drawn"
    floor_m = storey_m(tags, use, site.area_m2)
    if is_inferred:
        return limit_storeys(drawn, site, floor_m, SMALL_INFERRED_M2), "inferred"
    return limit_storeys(drawn, site, floor_m, SMALL_M2), "drawn"


def _narrow(shape: Any) -> float:
    """The shorter side of the smallest rectangle around a shape, metres."""
    corners = list(shape.minimum_rotated_rectangle.exterior.coords)
    sides = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(corners[:3])]
    return float(min(sides))
