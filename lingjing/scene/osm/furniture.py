"""Furniture of streets where the map has it: lamps, benches, bus stops, and cars in mapped car parks.

What a map places on a carriageway stands beside it. Nothing stands in water or in a building. Lamps, benches and stops
face the nearest carriageway. The seed decides which bays of a car park are taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, ceil, degrees, hypot, sqrt
from typing import Any

from lingjing.scene.city import Prop
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.looks import stream

SPOTS = {("highway", "street_lamp"): ("lamp", 0.6), ("highway", "bus_stop"): ("bus_stop", 1.4),
         ("amenity", "bench"): ("bench", 0.8)}  # fmt: skip
"""Tag of a node → prop, and its distance from the edge of a carriageway on which the map has it, metres (chosen)."""
NEAR_M = 40.0
"""Distance up to which a thing faces a carriageway, metres (chosen)."""
BAY_M, AISLE_M = (2.6, 5.2), 6.0
"""Width and length of a bay and width of an aisle between two rows, metres (chosen: usual values of car parks)."""
CAR_M = (2.0, 4.8)
"""Width and length that a car needs in its bay, metres."""
TAKEN = 0.6
"""Share of bays with a car (chosen: that of districts)."""
MOST_BAYS = 4000
"""Most bays of one car park (chosen). A larger one gets fewer rows."""
CLOSED = ("underground", "multi-storey", "rooftop", "garage_boxes")
"""Values of `parking` of car parks without cars in the open."""
_LOOKS = 12


@dataclass(frozen=True, slots=True)
class Obstruction:
    """Prepared geometries in which furniture must not stand."""

    lanes: Any
    """Carriageways with a margin."""
    built: Any
    """Water, buildings and carriageways, with margins."""


def furniture(features: Features, blocked: Obstruction, seed: int) -> Iterator[Prop]:
    """Yield the props of lamps, benches, stops and parked cars."""
    for spot in features.spots:
        for (key, value), (prop, beside_m) in SPOTS.items():
            if spot.tags.get(key) == value:
                yield from _standing(spot, prop, beside_m, blocked)
    for area in features.areas:
        if area.tags.get("amenity") == "parking" and area.tags.get("parking") not in CLOSED:
            yield from _parked(area, blocked, seed)


def _standing(spot: Feature, prop: str, beside_m: float, blocked: Obstruction) -> Iterator[Prop]:
    """Yield the prop of a node, moved off the carriageway, unless something else is there."""
    import shapely

    x, y, heading = spot.shape.x, spot.shape.y, 0.0
    if not blocked.lanes.is_empty:
        edge = shapely.shortest_line(blocked.lanes.boundary, spot.shape).coords[0]
        east, north = edge[0] - x, edge[1] - y
        away = hypot(east, north)
        if blocked.lanes.contains(spot.shape):
            if away < 0.01:
                return
            x, y = edge[0] + beside_m * east / away, edge[1] + beside_m * north / away
            east, north = -east, -north
        heading = degrees(atan2(east, north)) % 360.0 if 0.01 < away < NEAR_M else 0.0
    if not blocked.built.contains(shapely.Point(x, y)):
        yield Prop(id=f"{prop}-{spot.ref}", cls=prop, model=prop, position=(round(x, 2), round(y, 2), 0.0),
                   heading_deg=round(heading, 1))  # fmt: skip


def _parked(area: Feature, blocked: Obstruction, seed: int) -> Iterator[Prop]:
    """Yield cars in rows along the longer side of a car park."""
    import shapely

    if area.shape.area < BAY_M[0] * BAY_M[1]:
        return
    chance = stream(seed, f"parked/{area.ref}")
    corners = list(area.shape.minimum_rotated_rectangle.exterior.coords)[:4]
    sides = [(b[0] - a[0], b[1] - a[1]) for a, b in ((corners[0], corners[1]), (corners[0], corners[3]))]
    along, across = sorted(sides, key=lambda side: -hypot(*side))
    length, depth = hypot(*along), hypot(*across)
    if depth < CAR_M[1]:
        return
    (ax, ay), (cx, cy) = (along[0] / length, along[1] / length), (across[0] / depth, across[1] / depth)
    heading = degrees(atan2(cx, cy))
    bays, wide = int(length // BAY_M[0]), max(1.0, sqrt(area.shape.area / (MOST_BAYS * BAY_M[0] * BAY_M[1])))
    shapely.prepare(area.shape)
    for row in range(ceil(depth / (BAY_M[1] * wide))):
        middle = 0.5 * BAY_M[1] + wide * (row * BAY_M[1] + (row + 1) // 2 * AISLE_M)
        for bay in range(0, bays, ceil(wide)):
            is_taken, turned, look = chance.random() < TAKEN, chance.random() < 0.4, chance.randrange(_LOOKS)
            out = (bay + 0.5) * BAY_M[0]
            x, y = (corners[0][k] + out * (ax, ay)[k] + middle * (cx, cy)[k] for k in (0, 1))
            halves = [(i * CAR_M[0] / 2, j * CAR_M[1] / 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            room = shapely.Polygon([(x + i * ax + j * cx, y + i * ay + j * cy) for i, j in halves])
            if is_taken and area.shape.contains(room) and not blocked.built.intersects(room):
                turn = heading + (180.0 if turned else 0.0)
                yield Prop(id=f"parked-{area.ref}-{row}-{bay}", cls="parked_car", model="parked_car",
                           position=(round(x, 2), round(y, 2), 0.0), heading_deg=round(turn % 360.0, 1),
                           options={"variant": look})  # fmt: skip


__all__ = ["CLOSED", "Obstruction", "furniture"]
