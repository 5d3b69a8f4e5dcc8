"""Sites that are walked in: a compound of dwellings, or a factory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, dist, hypot
from typing import Any

from lingjing.mission import expression as ex
from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.siting.city_view import CityView, Door
from lingjing.scene.siting.layout import Layout, points, position_exprs
from lingjing.scene.siting.rewriting import Placement
from lingjing.scene.siting.walking import CELL_M, WalkGrid

SCALES = (1.0, 0.8, 0.65, 0.5)
"""Sizes of a site relative to the declared one, in the order of preference (chosen)."""
TRIED = 4
"""Most boxes that are examined for each size (chosen)."""
AROUND_M = 70.0
"""Ground around a box that is examined too, metres (chosen: bodies begin outside of it)."""
DETOUR, DETOUR_M = 1.5, 25.0
"""Longest path to a door: times the straight line, and metres beyond that (chosen: a policy sees what is near)."""
MOST_WALK_M = 400.0
"""Longest path to a door, metres (chosen: within the time of the shipped missions)."""
NEAR_M = 45.0
"""Least distance of doors from the start, metres (chosen: beyond the radius of arrival)."""
SHARE = 0.9
"""Share of the doors, or of the free ground, of a site that must be reached (chosen)."""
INSIDE_M = 6.0
"""Distance of doors from the edge of a site, metres (chosen)."""
WORKS = ("industrial", "warehouse")
"""Uses of the buildings of a factory."""
WORKS_SHARE = 0.04
"""Least share of a factory's ground under such buildings (chosen)."""
FREE_SHARE = 0.2
"""Least share of walkable ground in a site (chosen)."""


@dataclass(frozen=True, slots=True)
class GroundSite:
    """A box in the city with its reachable ground."""

    box: Extent
    scale: float
    origin: Vector2
    """The middle of the declared region."""
    starts: tuple[Vector2, ...]
    """Places at which the dogs begin, metres."""
    doors: tuple[Door, ...]
    """Doors that they reach, well apart first."""

    def shift(self, place: Vector2) -> Vector2:
        """A place of the mission in the city."""
        middle = (self.box[0] + self.box[2]) / 2.0, (self.box[1] + self.box[3]) / 2.0
        return (
            round(middle[0] + (place[0] - self.origin[0]) * self.scale, 2),
            round(middle[1] + (place[1] - self.origin[1]) * self.scale, 2),
        )


def ground_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    """Yield placements, the best first."""
    dogs = layout.assets("quadruped")
    for site in sites(layout, view):
        queue, places = list(site.starts), {}
        for group in dogs:
            many = len(layout.starts(group)) or 1
            places[group.name] = tuple(queue[:many])
            queue = queue[many:]
        homes = layout.on("facade")
        listed: dict[str, Any] = {group.name: tuple(door.place for door in site.doors) for group in homes}
        yield Placement(shift=site.shift, places={**places, **listed})


def ground_need(layout: Layout, view: CityView) -> str:
    """Return the need of such a site, with the city's numbers."""
    west, south, east, north = layout.region(layout.ground)
    least = f"{(east - west) * SCALES[-1]:.0f} m by {(north - south) * SCALES[-1]:.0f} m"
    if layout.on("facade"):
        return (
            f"an area of {least} in which a dog reaches {_wanted(layout)} entrances on foot "
            f"(it has {len(view.doors)} entrances)"
        )
    works = sum(building.use in WORKS for building in view.buildings)
    return (
        f"an area of {least} between industrial buildings or warehouses with connected free ground "
        f"(it has {works} such buildings)"
    )


def sites(layout: Layout, view: CityView) -> Iterator[GroundSite]:
    """Yield boxes that fit, the largest and the most suitable first."""
    west, south, east, north = layout.region(layout.ground)
    origin = (west + east) / 2.0, (south + north) / 2.0
    offsets = [(x - origin[0], y - origin[1]) for group in layout.assets("quadruped") for x, y in layout.starts(group)]
    for scale in SCALES:
        size = (east - west) * scale, (north - south) * scale
        middles = sorted(_ranked(layout, view, size), key=lambda item: (-item[0], item[1]))[:TRIED]
        examined = []
        for score, middle in middles:
            box = (middle[0] - size[0] / 2, middle[1] - size[1] / 2, middle[0] + size[0] / 2, middle[1] + size[1] / 2)
            site = _examined(layout, view, box, scale, origin, [(x * scale, y * scale) for x, y in offsets])
            if site is not None:
                examined.append((-len(site.doors), -score, site))
        for _, _, site in sorted(examined, key=lambda item: item[:2]):
            yield site


# -- private


def _wanted(layout: Layout) -> int:
    """The least number of doors: half of those that the mission lists, at least 3."""
    many = max(
        (len(points(expr)) for group in layout.on("facade") for expr in position_exprs(group)
         if isinstance(expr, ex.Draw)), default=0,
    )  # fmt: skip
    return max(3, ceil(many / 2))


def _ranked(layout: Layout, view: CityView, size: Vector2) -> Iterator[tuple[float, Vector2]]:
    """Yield a score and the middle of boxes on a grid: the doors, or the share of works, in each."""
    import numpy as np

    west, south, east, north = view.city.bounds
    margin = 15.0
    step = max(25.0, min(size) / 4.0)
    by_doors = bool(layout.on("facade"))
    if by_doors:
        spots = np.array([door.place for door in view.doors if door.building.use in ("residential", "house")] or
                         [door.place for door in view.doors])  # fmt: skip
        weights = np.ones(len(spots))
    else:
        works = [b for b in view.buildings if b.use in WORKS]
        spots = np.array([_middle(b.polygon) for b in works])
        weights = np.array([_area(b.polygon) for b in works])
    if not len(spots):
        return
    for x in _grid(west + margin + size[0] / 2, east - margin - size[0] / 2, step):
        for y in _grid(south + margin + size[1] / 2, north - margin - size[1] / 2, step):
            inside = (np.abs(spots[:, 0] - x) <= size[0] / 2) & (np.abs(spots[:, 1] - y) <= size[1] / 2)
            score = float(weights[inside].sum())
            if score >= (_wanted(layout) if by_doors else WORKS_SHARE * size[0] * size[1]):
                yield min(score, 40.0 if by_doors else 0.35 * size[0] * size[1]), (round(x, 2), round(y, 2))


def _grid(first: float, last: float, step: float) -> Iterator[float]:
    for k in range(int((last - first) / step) + 1 if last >= first else 0):
        yield first + k * step


def _examined(
    layout: Layout, view: CityView, box: Extent, scale: float, origin: Vector2, offsets: list[Vector2]
) -> GroundSite | None:
    """The site of a box, if its ground is connected and enough doors are reached; else None."""
    bounds = view.city.bounds
    around = (
        max(bounds[0], box[0] - AROUND_M), max(bounds[1], box[1] - AROUND_M),
        min(bounds[2], box[2] + AROUND_M), min(bounds[3], box[3] + AROUND_M),
    )  # fmt: skip
    grid = WalkGrid(view, around)
    middle = (box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0
    starts: list[Vector2] = []
    lengths: dict[tuple[int, int], float] = {}
    for x, y in offsets:
        wanted = min(max(middle[0] + x, around[0] + 3), around[2] - 3), min(max(middle[1] + y, around[1] + 3),
                                                                            around[3] - 3)  # fmt: skip
        cell = grid.nearest_free(wanted, 20.0, lengths or None)
        if cell is None:
            return None
        if not lengths:
            lengths = grid.lengths_from(cell, 2.0 * (box[2] - box[0] + box[3] - box[1]))
        starts.append(grid.place(cell))
    inside = _inside(grid, box)
    free = [cell for cell in inside if grid.free[cell]]
    if len(free) < FREE_SHARE * len(inside) or sum(cell in lengths for cell in free) < SHARE * len(free):
        return None
    if not layout.on("facade"):
        return GroundSite(box, scale, origin, tuple(starts), ())
    doors = [d for d in view.doors if _is_within(box, d.place, INSIDE_M)]
    reached = [d for d in doors if _is_reached(d, grid, lengths, starts[0])]
    if len(reached) < max(_wanted(layout), SHARE * sum(dist(d.place, starts[0]) >= NEAR_M for d in doors)):
        return None
    return GroundSite(box, scale, origin, tuple(starts), tuple(_spread(reached, 8)))


def _inside(grid: WalkGrid, box: Extent) -> list[tuple[int, int]]:
    low, high = grid.cell((box[0] + CELL_M, box[1] + CELL_M)), grid.cell((box[2] - CELL_M, box[3] - CELL_M))
    if low is None or high is None:
        return []
    return [(i, j) for i in range(low[0], high[0] + 1) for j in range(low[1], high[1] + 1)]


def _is_within(box: Extent, place: Vector2, margin: float) -> bool:
    return box[0] + margin <= place[0] <= box[2] - margin and box[1] + margin <= place[1] <= box[3] - margin


def _is_reached(door: Door, grid: WalkGrid, lengths: dict[tuple[int, int], float], start: Vector2) -> bool:
    from lingjing.scene.camera_geometry import offset_xy

    front = offset_xy((*door.place, 0.0), door.bearing_deg, 3.0)
    cell = grid.nearest_free((front[0], front[1]), 3.0, lengths)
    straight = dist(start, door.place)
    return cell is not None and straight >= NEAR_M and lengths[cell] <= min(MOST_WALK_M, DETOUR * straight + DETOUR_M)


def _spread(doors: list[Door], many: int) -> list[Door]:
    """Some doors of different buildings, each the farthest from those before."""
    left = sorted(doors, key=lambda door: (door.place, door.building.id))
    chosen: list[Door] = []
    while left and len(chosen) < many:
        best = max(left, key=lambda d: min((dist(d.place, c.place) for c in chosen), default=-hypot(*d.place) / 1e6))
        chosen.append(best)
        left = [door for door in left if door.building.id != best.building.id]
    return chosen


def _middle(polygon: tuple[Vector2, ...]) -> Vector2:
    return sum(x for x, _ in polygon) / len(polygon), sum(y for _, y in polygon) / len(polygon)


def _area(polygon: tuple[Vector2, ...]) -> float:
    from lingjing.mission.geometry2d import signed_area

    return abs(signed_area(polygon))
