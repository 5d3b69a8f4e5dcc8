"""The seaside of a district: sea and shore, promenade, harbour with quays and moored boats, a long bridge.

Land lies to the left of the shore line and water to its right, as in OpenStreetMap. The sea extends far beyond the
district, so that it reaches the horizon.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import cos, dist, hypot, pi, sin
from random import Random

import msgspec

from lingjing.mission.geometry2d import Polygon, Vector2, left_of
from lingjing.mission.instance import Vector
from lingjing.scene.camera_geometry import bearing_deg
from lingjing.scene.city import Bridge, Land, Road, Water
from lingjing.scene.districts.draft import Draft, stream
from lingjing.scene.districts.furnish import disc, erect
from lingjing.scene.districts.options import DistrictPlan
from lingjing.scene.districts.rectangles import Rect, around
from lingjing.scene.lines import project
from lingjing.scene.network import StreetEdge, StreetNode
from lingjing.scene.outlines import inside

SEA_M = 6000.0
"""Distance that the sea extends beyond the district, metres (chosen)."""
DECK_M = 16.0
"""Width of the bridge's deck, metres: two lanes each way, a kerb and a railing on either side."""

RAMP = "bridge-ramp"
"""Id of the ramp."""
FAR_END = "bridge-end"
"""Id of the street node at the bridge's far end. The ids of roads to it contain both node ids."""

LAP_M = 0.1
"""Length by which the ramp's slab overlaps the bridge, metres (chosen): an angle between the two leaves no gap."""
RAMP_GRADE = 0.05
"""Rise of the ramp per metre (chosen)."""
SNAP_M = 60.0
"""Farthest distance of a street crossing to which the ramp's foot is moved, metres (chosen)."""

STRAND_M = 35.0
"""Distance that streets and blocks keep from the water, metres (chosen)."""


def seaside(draft: Draft, plan: DistrictPlan, chance: Random) -> None:
    """Build sea, land, promenade, harbour and floating objects."""
    reach = plan.half_m + SEA_M
    draft.waters.append(Water(polygon=around(0.0, 0.0, 2 * reach, 2 * reach).polygon, level_m=plan.datum_m))
    draft.lands.append(Land(polygon=left_of(plan.shore, reach), top_m=0.0, surface="grass"))
    _promenade(draft, plan, chance)
    _harbour(draft, plan, chance)
    _afloat(draft, plan, stream(plan.seed, "afloat"))
    if plan.bridge:
        _island(draft, plan)
        _bridge(draft, plan)


def bridge_foot(plan: DistrictPlan) -> tuple[float, float]:
    """The point at which the bridge's ramp begins on the ground, behind its first point in the direction of its first
    span.
    """
    (ax, ay), (bx, by) = plan.bridge[:2]
    length, run = hypot(bx - ax, by - ay), plan.deck_m / RAMP_GRADE
    foot = round(ax - (bx - ax) / length * run, 3), round(ay - (by - ay) / length * run, 3)
    crossing = tuple(round(value / gap) * gap for value, gap in zip(foot, plan.spacing, strict=True))
    return (crossing[0], crossing[1]) if hypot(crossing[0] - foot[0], crossing[1] - foot[1]) < SNAP_M else foot


def bridge_streets(plan: DistrictPlan, foot: str) -> tuple[list[StreetNode], list[StreetEdge]]:
    """The carriageway from the node `foot` up the ramp and over the bridge to its far end."""
    start, *inner, end = ((x, y, plan.deck_m) for x, y in plan.bridge)
    far = StreetNode(id=FAR_END, east=end[0], north=end[1], elevation=plan.deck_m, control="priority")
    there = StreetEdge(id=f"{foot}_to_{FAR_END}", start=foot, end=far.id, lanes=2, speed_mps=16.7, kind="primary",
                       name="Sea Bridge", priority=3, shape=(start, *inner), bridge=True)  # fmt: skip
    back = StreetEdge(id=f"{FAR_END}_to_{foot}", start=far.id, end=foot, lanes=2, speed_mps=16.7, kind="primary",
                      name="Sea Bridge", priority=3, shape=(*reversed(inner), start), bridge=True)  # fmt: skip
    return [far], [there, back]


def fit_ramp(draft: Draft, plan: DistrictPlan, roads: Sequence[Road]) -> None:
    """Move the foot of the ramp's slab to the beginning of its lanes, which begin behind the crossing."""
    foot = bridge_foot(plan)
    starts = [road.lanes[0].shape[0] for road in roads if road.bridge and road.id.endswith(f"_to_{FAR_END}")]
    top = plan.bridge[0]
    length = hypot(top[0] - foot[0], top[1] - foot[1])
    for x, y, _ in starts:
        share = ((x - foot[0]) * (top[0] - foot[0]) + (y - foot[1]) * (top[1] - foot[1])) / length**2
        first = foot[0] + share * (top[0] - foot[0]), foot[1] + share * (top[1] - foot[1]), 0.0
        draft.bridges = [
            msgspec.structs.replace(bridge, path=(first, *bridge.path[1:])) if bridge.id == RAMP else bridge
            for bridge in draft.bridges
        ]


def under_ramp(plan: DistrictPlan, start: Vector2, end: Vector2) -> bool:
    """True if a street would run along the ramp, not across it."""
    if not plan.bridge:
        return False
    foot, top = bridge_foot(plan), plan.bridge[0]
    middle = (start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0
    beside = project((foot, top), *middle).off_m < 14.0
    street, ramp = (end[0] - start[0], end[1] - start[1]), (top[0] - foot[0], top[1] - foot[1])
    aligned = abs(street[0] * ramp[0] + street[1] * ramp[1]) > 0.9 * hypot(*street) * hypot(*ramp)
    return beside and aligned


# -- private


def _stations(line: Polygon, gap: float) -> Iterator[tuple[float, float, float]]:
    """Yield points every `gap` metres along a line, with the bearing of the line there in degrees."""
    left = gap / 2.0
    for (ax, ay), (bx, by) in pairwise(line):
        length = hypot(bx - ax, by - ay)
        while left < length:
            share = left / length
            yield ax + share * (bx - ax), ay + share * (by - ay), bearing_deg((ax, ay), (bx, by))
            left += gap
        left -= length


def _promenade(draft: Draft, plan: DistrictPlan, chance: Random) -> None:
    """Build a paved strip behind the quay wall, with trees, lamps and benches."""
    inland = tuple(_aside((x, y), bearing, -14.0) for x, y, bearing in _stations(plan.shore, 40.0))
    seaward = tuple(_aside((x, y), bearing, -0.8) for x, y, bearing in _stations(plan.shore, 40.0))
    if len(inland) >= 2:
        draft.area((*seaward, *reversed(inland)), "plaza", 0.006)
    for k, (x, y, bearing) in enumerate(_stations(plan.shore, 14.0)):
        place = _aside((x, y), bearing, -9.0)
        if k % 4 == 1:
            draft.prop("lamp", *place, 0.0, bearing)
        elif k % 4 == 3:
            draft.prop("bench", *_aside((x, y), bearing, -3.0), 0.0, bearing + 90.0)
        elif chance.random() < 0.8:
            draft.prop("tree", *place, 0.0, scale=chance.uniform(0.8, 1.2), variant=k % 8)
    for x, y, bearing in _stations(plan.shore, 6.0):
        place = _aside((x, y), bearing, -chance.uniform(18.0, 0.9 * plan.spacing[0] / 2.0))
        bridge = plan.bridge and project((bridge_foot(plan), *plan.bridge), *place).off_m < 14.0
        if chance.random() < 0.6 and project(plan.shore, *place).off_m < STRAND_M and not bridge:
            draft.prop("tree", *place, 0.0, scale=chance.uniform(0.7, 1.3), variant=chance.randrange(8))


def _harbour(draft: Draft, plan: DistrictPlan, chance: Random) -> None:
    """Build a quay in the north that projects into the water, with sheds and containers, and a jetty in the south."""
    level, half = plan.datum_m, plan.half_m
    x, y, _ = min(_stations(plan.shore, 10.0), key=lambda at: abs(at[1] - 0.55 * half))
    quay = Rect(x - 30.0, y - 0.2 * half, x + 70.0, y + 0.2 * half)
    draft.lands.append(Land(polygon=quay.polygon, top_m=0.0, surface="concrete"))
    shed = Rect(quay.west + 36.0, quay.south + 8.0, quay.west + 60.0, quay.south + 58.0)
    erect(draft, chance, shed, use="warehouse", top_m=9.0, roof="gabled", roof_m=2.5, side="east")
    for row in range(int((quay.depth - 80.0) // 10.0)):
        for column in range(2):
            if chance.random() < 0.7:
                north = quay.south + 68.0 + 10.0 * row
                draft.prop("container", quay.west + 44.0 + 15.0 * column, north, 0.0, 90.0, variant=chance.randrange(8))
                draft.take(around(quay.west + 44.0 + 15.0 * column, north, 12.2, 2.44))
    for k in range(int(quay.depth // 26.0)):
        model = chance.choice(("fishing_boat", "sailboat", "dinghy", "rowing_boat"))
        draft.prop("moored_boat", quay.east + 5.0, quay.south + 13.0 + 26.0 * k, level, chance.choice((0.0, 180.0)),
                   model=model, floating=True, variant=k)  # fmt: skip
    x, y, _ = min(_stations(plan.shore, 10.0), key=lambda at: abs(at[1] + 0.5 * half))
    draft.solid("jetty", Rect(x - 4.0, y - 2.0, x + 90.0, y + 2.0), -0.4, 0.0, "wood")
    for k in range(9):
        for side in (-1.7, 1.7):
            draft.solid("pile", around(x + 6.0 + 10.0 * k, y + side, 0.4, 0.4), level - 6.0, -0.4, "wood")
        if k % 2:
            draft.prop(
                "moored_boat", x + 6.0 + 10.0 * k, y + 5.0, level, 90.0, model="dinghy", floating=True, variant=k
            )


def _afloat(draft: Draft, plan: DistrictPlan, chance: Random) -> None:
    """Place buoys and anchored boats on open water."""
    land = left_of(plan.shore, plan.half_m + SEA_M)
    for k in range(int(26 * (plan.extent_m / 1600.0) ** 2) + 6):
        for _ in range(40):
            x, y = chance.uniform(-plan.half_m, 1.3 * plan.half_m), chance.uniform(-plan.half_m, plan.half_m)
            bridge = plan.bridge and project(plan.bridge, x, y).off_m < 35.0
            if not inside(land, x, y) and project(plan.shore, x, y).off_m > 80.0 and not bridge:
                break
        else:
            continue
        if k % 3:
            model = ("buoy_orange", "buoy_red", "buoy_yellow")[chance.randrange(3)]
            draft.prop("buoy", x, y, plan.datum_m, model=model, floating=True, variant=k)
        else:
            draft.prop("moored_boat", x, y, plan.datum_m, chance.uniform(0, 360), floating=True,
                       model=chance.choice(("fishing_boat", "sailboat")), variant=k)  # fmt: skip


def _island(draft: Draft, plan: DistrictPlan) -> None:
    """Build the rock that carries the bridge's far end."""
    x, y = plan.bridge[-1]
    for radius, top in ((95.0, plan.datum_m + 1.5), (72.0, 0.55 * plan.deck_m), (52.0, plan.deck_m - 0.15)):
        outline = tuple(
            (round(x + 34.0 + r * cos(a), 2), round(y + r * sin(a), 2))
            for a, r in (
                (2 * pi * k / 24, radius * (1.0 + 0.08 * sin(3.0 * k) + 0.05 * sin(7.0 * k))) for k in range(24)
            )
        )
        draft.lands.append(Land(polygon=outline, top_m=top, surface="rock" if top < plan.deck_m - 1 else "grass"))
    tower = (x + 55.0, y + 18.0)
    base = plan.deck_m - 0.2
    draft.solid("lighthouse", disc(*tower, 3.0, 14), base, base + 14.0, "white")
    draft.solid("lighthouse", disc(*tower, 3.7, 14), base + 14.0, base + 15.0, "red")
    draft.solid("lighthouse", disc(*tower, 2.2, 14), base + 15.0, base + 18.0, "white")


def _bridge(draft: Draft, plan: DistrictPlan) -> None:
    """Build deck, ramp and railings. The piers are part of the `Bridge`."""
    foot = bridge_foot(plan)
    deck = tuple((x, y, plan.deck_m) for x, y in plan.bridge)
    draft.bridges.append(Bridge(id="bridge", path=deck, width_m=DECK_M, name="Sea Bridge"))
    ramp = (*foot, 0.0), deck[0], _ahead(deck[0], deck[1], LAP_M)
    draft.bridges.append(Bridge(id=RAMP, path=ramp, width_m=DECK_M, pier_spacing_m=30.0))
    for side in (-1.0, 1.0):
        for (ax, ay), (bx, by) in pairwise(plan.bridge):
            for a, b in _pieces((ax, ay), (bx, by), 60.0):
                outline = _rail(a, b, side * (DECK_M / 2.0 - 0.2))
                draft.solid("railing", outline, plan.deck_m, plan.deck_m + 1.1, "metal")


def _pieces(a: Vector2, b: Vector2, most: float) -> Iterator[tuple[Vector2, Vector2]]:
    many = max(1, round(hypot(b[0] - a[0], b[1] - a[1]) / most))
    for k in range(many):
        yield (
            (a[0] + (b[0] - a[0]) * k / many, a[1] + (b[1] - a[1]) * k / many),
            (a[0] + (b[0] - a[0]) * (k + 1) / many, a[1] + (b[1] - a[1]) * (k + 1) / many),
        )


def _ahead(a: Vector, b: Vector, metres: float) -> Vector:
    share = metres / dist(a, b)
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


def _rail(a: Vector2, b: Vector2, aside: float) -> Polygon:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = hypot(dx, dy)
    x, y = dy / length, -dx / length
    low, high = aside - 0.12, aside + 0.12
    corners = ((a, high), (b, high), (b, low), (a, low))
    return tuple((round(p[0] + x * d, 3), round(p[1] + y * d, 3)) for p, d in corners)


def _aside(place: Vector2, bearing: float, right: float) -> Vector2:
    angle = (bearing + 90.0) * pi / 180.0
    return round(place[0] + right * sin(angle), 3), round(place[1] + right * cos(angle), 3)
