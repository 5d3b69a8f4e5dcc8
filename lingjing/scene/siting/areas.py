"""Sites that are driven and flown over: a district with roads, flat roofs or ground."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Any

from lingjing.mission.geometry2d import Vector2, signed_area
from lingjing.mission.instance import Vector
from lingjing.scene.footing import Footing
from lingjing.scene.lines import point_at, project
from lingjing.scene.road_map import RoadSegment
from lingjing.scene.siting.city_view import CityView
from lingjing.scene.siting.layout import Layout
from lingjing.scene.siting.rewriting import Placement
from lingjing.scene.siting.routes import Router
from lingjing.scene.tiles import Tiles

SCALES = (1.0, 0.85, 0.7, 0.55, 0.45, 0.35)
"""Sizes of a district relative to the declared one, in the order of preference (chosen)."""
STEP_M = 100.0
"""Distance between the middles of the districts that are compared, metres (chosen)."""
LEAST_ROAD_M = 1200.0
"""Least length of connected roads in a district, metres (chosen)."""
NEAR_ROAD_M = 25.0
"""Largest distance of a roof from a road, metres: a fire truck reaches 30 m."""
LEAST_ROOFS = 8
"""Least number of such roofs in a district (chosen: six fires, and room for a draw)."""
LOOK_DOWN_M = 10.0
"""Least height of the top of an altitude band over the flat roofs of a district, metres (chosen)."""
ROOF_M2 = 60.0
"""Smallest roof that counts, square metres (chosen)."""
APART_M = 10.0
"""Distance between vehicles that begin on one road, metres (chosen)."""
DEPOT_M = 70.0
"""Least length of a road with a depot and its vehicles, metres (chosen)."""
MOST_DRIVE_S, LONGEST_DRIVE_S = 60.0, 75.0
"""Longest mean drive from the vehicles' start to the roads of a district, at permitted speeds, seconds: of a district
that is preferred, and of any (chosen: 71 and 74 in the made-up districts of `ufr` and `cd` with straight, wide streets;
so winding or slow streets get a smaller district)."""
GROUND_M = 60.0
"""Farthest move of a body to free ground, metres (chosen)."""


def area_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    """Yield placements, the best first: large ones with short drives, then those with longer drives, shortest first."""
    west, south, east, north = layout.extent()
    origin = (west + east) / 2.0, (south + north) / 2.0
    slow: list[tuple[float, int, Placement]] = []
    for scale in SCALES:
        size = (east - west) * scale, (north - south) * scale
        ranked = sorted(_ranked(layout, view, size), key=lambda item: (-item[0], item[1]))
        for _, middle in ranked[:3]:
            placement = placed(layout, view, origin, middle, scale)
            drive_s = _drive_s(layout, view, placement, middle, size)
            if drive_s <= MOST_DRIVE_S:
                yield placement
            elif drive_s <= LONGEST_DRIVE_S:
                slow.append((round(drive_s, 3), len(slow), placement))
    for _, _, placement in sorted(slow, key=lambda item: item[:2]):
        yield placement


def area_need(layout: Layout, view: CityView) -> str:
    """Return the need of such a site, with the city's numbers."""
    west, south, east, north = layout.extent()
    least = f"{(east - west) * SCALES[-1]:.0f} m by {(north - south) * SCALES[-1]:.0f} m"
    road_km = sum(segment.length_m for segment in view.segments) / 1000.0
    if layout.on("roof"):
        return (
            f"an area of {least} with {LEAST_ROOFS} flat roofs within {NEAR_ROAD_M:g} m of connected roads"
            f"{_below(layout)} (it has {len(_roofs(view))} flat roofs at roads and {road_km:.1f} km of connected roads)"
        )
    driven = f", reached within {LONGEST_DRIVE_S:g} s on average," if layout.assets("road") else ""
    return f"an area of {least} with {LEAST_ROAD_M:g} m of connected roads{driven} (it has {road_km:.1f} km)"


def _below(layout: Layout) -> str:
    """Return the bound on the roofs of a district, as a part of its need."""
    return f", and no flat roof above {layout.ceiling_m - LOOK_DOWN_M:g} m" if layout.ceiling_m < inf else ""


def placed(layout: Layout, view: CityView, origin: Vector2, middle: Vector2, scale: float) -> Placement:
    """The placement of a district with that middle and size: bodies on the nearest connected road or free ground."""

    def shift(place: Vector2) -> Vector2:
        return (
            round(middle[0] + (place[0] - origin[0]) * scale, 2),
            round(middle[1] + (place[1] - origin[1]) * scale, 2),
        )

    places: dict[str, Any] = {}
    headings: dict[str, tuple[float, ...]] = {}
    footing = Footing(view.city, Tiles(view.city))
    occupied: list[Vector2] = []
    drives = [g for g in layout.mission.groups if layout.surface(g) == "road" and layout.starts(g)]
    if drives:
        first = shift(layout.starts(drives[0])[0])
        line = min(view.segments, key=lambda segment: _departure_rank(segment, first))
        queue = list(_stops(line, first))
        for group in drives:
            many = len(layout.starts(group))
            if len(queue) < many:
                queue += list(_elsewhere(view.segments, line, first))
            places[group.name] = tuple(place for place, _ in queue[:many])
            headings[group.name] = tuple(heading for _, heading in queue[:many])
            queue = queue[many:]
    for group in layout.mission.groups:
        if group.name not in places and group.role == "asset" and layout.starts(group):
            spots = []
            for start in layout.starts(group):
                spot = footing.nearest_clear(*shift(start), 1.5, GROUND_M, off_road=True, apart=occupied, apart_m=3.0)
                spots.append(spot or shift(start))
                occupied.append(spots[-1])
            places[group.name] = tuple(spots)
    return Placement(shift=shift, across=scale, places=places, headings_deg=headings)


# -- private


def _drive_s(layout: Layout, view: CityView, placement: Placement, middle: Vector2, size: Vector2) -> float:
    """The mean driving time from the vehicles' start to the roads of a district, seconds; 0 without vehicles, and
    if the starts of all are drawn."""
    vehicles = [group for group in layout.assets("road") if group.name in placement.places]
    if not vehicles or view.roads is None:
        return 0.0
    router = Router(view)
    east, north = placement.places[vehicles[0].name][0][:2]
    near = view.roads.nearest((east, north))
    if near is None or near.segment not in router.segments:
        return inf
    came = router.search(router.spot(near.segment, near.at_m), frozenset(), most_s=1000.0)
    inside = [
        segment.id
        for segment in view.segments
        for x, y in (_middle(segment),)
        if abs(x - middle[0]) <= size[0] / 2 and abs(y - middle[1]) <= size[1] / 2
    ]
    times = [came[name][0] if name in came else 1000.0 for name in inside if name != near.segment]
    return sum(times) / max(len(times), 1)


def _ranked(layout: Layout, view: CityView, size: Vector2) -> Iterator[tuple[float, Vector2]]:
    """Yield a score and the middle of districts on a grid: the roofs or the road length in each, up to what is
    plenty."""
    import numpy as np

    if not view.segments:
        return
    west, south, east, north = view.city.bounds
    roads = np.array([(*_middle(s), s.length_m) for s in view.segments])
    roofs = np.array(_roofs(view)) if layout.on("roof") else None
    if roofs is not None and not len(roofs):
        return
    high = np.array(_high_roofs(view, layout.ceiling_m - LOOK_DOWN_M) if layout.on("roof") else ())
    for x in _grid(west + size[0] / 2, east - size[0] / 2):
        for y in _grid(south + size[1] / 2, north - size[1] / 2):
            length = float(roads[_near(roads, x, y, size), 2].sum())
            score = length if roofs is None else float(_near(roofs, x, y, size).sum())
            if len(high) and _near(high, x, y, size).any():
                continue
            if length >= LEAST_ROAD_M and (roofs is None or score >= LEAST_ROOFS):
                yield round(score), (round(x, 2), round(y, 2))


def _near(spots: Any, x: float, y: float, size: Vector2) -> Any:
    import numpy as np

    return (np.abs(spots[:, 0] - x) <= size[0] / 2) & (np.abs(spots[:, 1] - y) <= size[1] / 2)


def _grid(first: float, last: float) -> Iterator[float]:
    many = int((last - first) / STEP_M) + 1 if last >= first else 0
    for k in range(many):
        yield (first + last) / 2.0 + (k - (many - 1) / 2.0) * STEP_M


def _middle(segment: RoadSegment) -> Vector2:
    (x, y, _), _ = point_at([(*place, 0.0) for place in segment.shape], segment.length_m / 2.0)
    return x, y


def _roofs(view: CityView) -> list[Vector2]:
    """The middles of flat roofs near connected roads."""
    import shapely

    lines = [shapely.LineString(s.shape) for s in view.segments if len(s.shape) > 1]
    if not lines:
        return []
    tree = shapely.STRtree(lines)
    roofs = []
    for building in view.buildings:
        if building.roof_m == 0.0 and abs(signed_area(building.polygon)) >= ROOF_M2:
            shape = shapely.Polygon(building.polygon)
            if len(tree.query(shape, predicate="dwithin", distance=NEAR_ROAD_M / 2.0)):
                roofs.append((shape.centroid.x, shape.centroid.y))
    return roofs


def _high_roofs(view: CityView, above_m: float) -> list[Vector2]:
    """The corners of buildings with flat roofs above an elevation, which the flying assets could not look down on."""
    high = (building for building in view.buildings if building.roof_m == 0.0 and building.top_m > above_m)
    return [corner for building in high for corner in building.polygon]


def _stops(segment: RoadSegment, near: Vector2) -> Iterator[tuple[Vector2, float]]:
    """Yield places on a segment with their headings, from the one nearest to `near` outwards."""
    line: list[Vector] = [(*place, 0.0) for place in segment.shape]
    at = project(segment.shape, *near).at_m
    middle = min(max(at, APART_M), max(segment.length_m - APART_M, APART_M))
    for k in range(int(segment.length_m / APART_M) + 1):
        for offset in (k * APART_M, -k * APART_M) if k else (0.0,):
            if 8.0 <= middle + offset <= segment.length_m - 8.0:
                (x, y, _), heading = point_at(line, middle + offset)
                yield (round(x, 2), round(y, 2)), round(heading, 1)


def _departure_rank(segment: RoadSegment, near: Vector2) -> tuple[float, float, str]:
    """Order of the roads on which vehicles begin: long enough ones, then near ones."""
    return -min(segment.length_m, DEPOT_M), round(project(segment.shape, *near).off_m), segment.id


def _elsewhere(segments: tuple[RoadSegment, ...], line: RoadSegment, near: Vector2) -> Iterator[tuple[Vector2, float]]:
    """Yield further places on the segments around, nearest first."""
    order = sorted(segments, key=lambda s: (round(project(s.shape, *near).off_m, 1), s.id))
    for segment in order[:12]:
        if segment.id != line.id:
            yield from _stops(segment, near)
