"""Sites of inspected routes: a start, goals some waypoints away, and jams at waypoints that can be driven around."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, dist
from typing import Any

from lingjing.mission import expression as ex
from lingjing.mission.geometry2d import Vector2, bounds
from lingjing.mission.instance import Vector
from lingjing.mission.model import Group
from lingjing.scene.camera_geometry import bearing_deg, turn_deg
from lingjing.scene.footing import Footing
from lingjing.scene.lines import point_at, project
from lingjing.scene.road_map import RoadSegment
from lingjing.scene.siting.city_view import CityView
from lingjing.scene.siting.grounds import ground_sites
from lingjing.scene.siting.layout import Layout, points, position_exprs
from lingjing.scene.siting.rewriting import Placement
from lingjing.scene.siting.walking import WalkGrid

SHORTEST_M, LONGEST_M, USUAL_M = 400.0, 950.0, 730.0
"""Bounds of a first route, and its preferred length, metres (chosen: four or five waypoints, ADR 0010)."""
LONGEST_AROUND_M = 1500.0
"""Longest route around a jam, metres (chosen: 7 waypoints)."""
STRAIGHT_S, RIGHT_S, LEFT_S, BACK_S = 1.0, 3.0, 6.0, 25.0
"""Times of the ways over a crossing, seconds: those of the road engine."""
BACK_DEG = 150.0
"""Change of heading from which a vehicle turns back, degrees (chosen)."""
TURN_DEG = 40.0
"""Change of heading from which a turn has a waypoint, degrees: as the road engine counts."""
SPACING_M, CLOSEST_M = 220.0, 80.0
"""Largest and least distance of waypoints, metres: those of the road engine."""
BEFORE_M = 24.0
"""Distance of a jam before the turn that it stands at, metres (chosen: on one arm of the crossing)."""
BLOCKED_M = 21.0
"""Radius within which a jam closes roads, metres."""
AVOIDED_M = 10.0
"""Radius around a jam within which the road engine avoids streets when another route is requested, metres."""
JAMS_APART_M = 90.0
"""Least distance between listed places of jams, metres (chosen)."""
MOST_JAMS, LEAST_JAMS = 7, 2
"""Numbers of places of jams (the shipped missions list four and seven)."""
PAIR_STEP_M, PAIR_END_M = 45.0, 80.0
"""Distance between tried places of a drawn jam along a route, and their distance from the goal, metres (chosen)."""
ASIDE_M = 8.0
"""Largest distance of a drawn jam from the straight line between waypoints, metres (chosen: it blocks 15 m)."""
MARGIN_S = 6.0
"""Least time that the way around a drawn jam takes more than the way with it, seconds (chosen: of two
ways that are nearly as fast either may be the route of the road engine, which also counts lengths of crossings)."""
MID_BLOCK_M = 15.0
"""Least distance of a drawn jam from the ends of its segment, metres (chosen: both queues stand on one street)."""
MOST_BESIDE, MOST_PAIRS, LEAST_PAIRS = 3, 12, 2
"""Most second jams for one first jam, and bounds of the number of pairs (chosen)."""
TRIED = 40
"""Most starts that are examined for one goal, and goals for one start (chosen)."""
CLEAR_OF_STOP_M, BESIDE_STOP_M = 6.0, 14.0
"""Least and usual greatest distance of a dog from the stop, metres (chosen: a vehicle of 6 m parks beside its lane
there, and should not stand between the dog and its ground)."""
STOP_M = 60.0
"""Farthest road from the middle of a compound's side at which a delivery vehicle stops, metres (chosen)."""
WALK_M = 30.0
"""Farthest place of a dog from the stop, metres (chosen)."""
MARGIN_M = 60.0
"""Margin of the district around the routes, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class RoadSpot:
    """A place on a segment."""

    segment: str
    at_m: float
    place: Vector2
    heading_deg: float


@dataclass(frozen=True, slots=True)
class Way:
    """A route between two spots."""

    segments: tuple[str, ...]
    length_m: float
    points: tuple[RoadSpot, ...]
    """Its waypoints in driving order; the last one is the goal."""
    time_s: float = 0.0
    """Driving time to the end of its last segment, seconds; 0 on a single segment."""


class Router:
    """Routes by driving time over the connected roads of a city, as the road engine plans them."""

    def __init__(self, view: CityView) -> None:
        import shapely

        assert view.roads is not None
        self.segments = {name: view.roads.segments[name] for name in sorted(view.roads.connected)}
        self._names = list(self.segments)
        self._kept_steps: dict[str, tuple[tuple[str, float], ...]] = {}
        self._tree = shapely.STRtree([shapely.LineString(self.segments[name].shape) for name in self._names])

    def near(self, place: Vector2, reach_m: float) -> frozenset[str]:
        """The segments within a distance of a place."""
        import shapely

        near = self._tree.query(shapely.Point(place), predicate="dwithin", distance=reach_m)
        return frozenset(self._names[int(k)] for k in near)

    def way(self, start: RoadSpot, goal: RoadSpot, avoid: frozenset[str] = frozenset()) -> Way | None:
        """The fastest way that avoids some segments; None without one."""
        if start.segment == goal.segment and goal.at_m > start.at_m:
            return self._way((start.segment,), start, goal)
        came = self.search(start, avoid, goal.segment)
        if goal.segment not in came:
            return None
        names = [goal.segment]
        while True:
            before = came[names[-1]][1]
            names.append(before)
            if before == start.segment:
                break
        return replace(self._way(tuple(reversed(names)), start, goal), time_s=came[goal.segment][0])

    def search(
        self, start: RoadSpot, avoid: frozenset[str], goal: str = "", most_s: float = 400.0
    ) -> Mapping[str, tuple[float, str]]:
        """Driving time to the end of each segment, and the segment before, from a start (Dijkstra)."""
        came: dict[str, tuple[float, str]] = {}
        done: set[str] = set()
        first = self.segments[start.segment]
        waiting = [((first.length_m - start.at_m) / max(first.speed_mps, 1.0), start.segment, "")]
        while waiting:
            cost, name, before = heapq.heappop(waiting)
            if name in done and before:
                continue
            if before:
                came.setdefault(name, (cost, before))
                done.add(name)
                if name == goal:
                    break
            if cost > most_s:
                continue
            for after, more in self._steps(name):
                if after not in avoid and after not in done:
                    heapq.heappush(waiting, (cost + more, after, name))
        return came

    def _steps(self, name: str) -> tuple[tuple[str, float], ...]:
        """The segments that follow one, with the time over the crossing and along them, seconds. They are kept: siting
        makes hundreds of searches, which pass each crossing.
        """
        steps = self._kept_steps.get(name)
        if steps is None:
            here = self.segments[name]
            known = [(after, self.segments[after]) for after in here.following if after in self.segments]
            steps = self._kept_steps[name] = tuple(
                (
                    after,
                    step.length_m / max(step.speed_mps, 1.0)
                    + self._crossing_s(name, after)
                    + (900.0 if here.through and not step.through else 0.0),
                )
                for after, step in known
            )
        return steps

    def spot(self, segment: str, at_m: float) -> RoadSpot:
        """The place at a length along a segment."""
        (x, y, _), heading = point_at(_line(self.segments[segment]), at_m)
        return RoadSpot(segment, at_m, (round(x, 2), round(y, 2)), round(heading, 1))

    def _turns(self, name: str, after: str) -> bool:
        return abs(self._turn_deg(name, after)) > TURN_DEG

    def _turn_deg(self, name: str, after: str) -> float:
        """The change of heading between two segments, degrees to the right."""
        leaving, entering = self.segments[name].shape, self.segments[after].shape
        return turn_deg(bearing_deg(*leaving[-2:]), bearing_deg(*entering[:2]))

    def _crossing_s(self, name: str, after: str) -> float:
        turn = self._turn_deg(name, after)
        if abs(turn) <= TURN_DEG:
            return STRAIGHT_S
        if abs(turn) >= BACK_DEG:
            return BACK_S
        return RIGHT_S if turn > 0.0 else LEFT_S

    def _way(self, names: tuple[str, ...], start: RoadSpot, goal: RoadSpot) -> Way:
        """The way with its waypoints, placed as the road engine does."""
        spans, passed = self._spans(names, start, goal)
        marks = [spans[k + 1][0] for k in range(len(names) - 1) if self._turns(names[k], names[k + 1])]
        stops, before = [], 0.0
        for mark in (*marks, passed):
            if mark < passed and (mark - before < CLOSEST_M or passed - mark < CLOSEST_M):
                continue
            parts = max(1, ceil((mark - before) / SPACING_M))
            stops += [before + (mark - before) * part / parts for part in range(1, parts + 1)]
            before = mark
        return Way(names, passed, tuple(self._spot_on(spans, stop) for stop in stops))

    def streets(self, way: Way, start: RoadSpot, goal: RoadSpot) -> Iterator[RoadSpot]:
        """Yield places along a way, each well inside of its segment and on the straight line between two waypoints."""
        spans, length = self._spans(way.segments, start, goal)
        first, line = way.points[0], [spot.place for spot in way.points]
        at = next(passed + first.at_m - low for passed, low, name in spans if name == first.segment)
        while at <= length - PAIR_END_M:
            spot = self._spot_on(spans, at)
            inside = MID_BLOCK_M <= spot.at_m <= self.segments[spot.segment].length_m - MID_BLOCK_M
            if inside and len(line) > 1 and project(line, *spot.place).off_m <= ASIDE_M:
                yield spot
            at += PAIR_STEP_M

    def before(self, way: Way, stop: RoadSpot, by_m: float) -> RoadSpot:
        """The place some metres before a waypoint, on its segment as far as possible."""
        return self.spot(stop.segment, max(stop.at_m - by_m, min(stop.at_m, 6.0)))

    def _spans(
        self, names: tuple[str, ...], start: RoadSpot, goal: RoadSpot
    ) -> tuple[list[tuple[float, float, str]], float]:
        """The length before each segment of a way, the length along it where the way begins, its name; the whole
        length."""
        spans, passed = [], 0.0
        for k, name in enumerate(names):
            low = start.at_m if k == 0 else 0.0
            high = goal.at_m if k == len(names) - 1 else self.segments[name].length_m
            spans.append((passed, low, name))
            passed += max(high - low, 0.0)
        return spans, passed

    def _spot_on(self, spans: Sequence[tuple[float, float, str]], at: float) -> RoadSpot:
        passed, low, name = next(span for span in reversed(spans) if span[0] < at or span is spans[0])
        return self.spot(name, min(low + at - passed, self.segments[name].length_m))


def route_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    """Yield placements, the best first."""
    if not view.segments:
        return
    router = Router(view)
    if layout.ground:
        for placement in ground_sites(layout, view):
            site = _delivery(layout, view, router, placement)
            if site is not None:
                yield site
    else:
        yield from _drives(layout, view, router)


def route_need(layout: Layout, view: CityView) -> str:
    """Return the need of such a site, with the city's numbers."""
    road_km = sum(segment.length_m for segment in view.segments) / 1000.0
    drawn = ", and streets for jams one after the other" if any(map(_is_drawn_along, _blocking(layout))) else ""
    walked = " that ends beside entrances which a dog reaches on foot" if layout.ground else ""
    return (
        f"a drive of {SHORTEST_M:g} m to {LONGEST_M:g} m{walked}, with {LEAST_JAMS} waypoints that have a way around"
        f"{drawn} (it has {road_km:.1f} km of connected roads and {len(view.doors)} entrances)"
    )


# -- a vehicle and goals


def _drives(layout: Layout, view: CityView, router: Router) -> Iterator[Placement]:
    """Routes from a start in a dense part of the network to the places of the destination's draw."""
    wanted = max((len(points(expr)) for group in _goals(layout) for expr in position_exprs(group)), default=1)
    for start in _starts(view, router)[:12]:
        came = router.search(start, frozenset())
        goals: list[RoadSpot] = []
        jams: list[RoadSpot] = []
        for name in _by_length(router, start, came)[:TRIED]:
            goal = _end_of(router, name)
            way = router.way(start, goal)
            apart = all(dist(goal.place, other.place) >= 120.0 for other in goals)
            if way is None or not SHORTEST_M <= way.length_m <= LONGEST_M or not apart or not _in_sight(view, goal):
                continue
            more = _jams(router, start, [*goals, goal], jams, way)
            if len(more) > len(jams) or (goals and len(jams) >= LEAST_JAMS):
                goals.append(goal)
                jams = more
            if len(goals) == wanted:
                break
        if goals and len(jams) >= LEAST_JAMS and max(dist(a.place, b.place) for a in jams for b in jams) >= 160.0:
            placed = _placement(layout, view, router, start, goals, jams, None)
            drawn = _with_pairs(layout, router, placed, start, goals)
            if drawn is not None:
                yield drawn


def _starts(view: CityView, router: Router) -> list[RoadSpot]:
    """Places of departure: on longer segments, those with the most road around first, well apart."""
    import numpy as np

    names = [s.id for s in view.segments if s.id in router.segments]
    middles = np.array([project(router.segments[n].shape, *router.segments[n].shape[0]).point for n in names])
    lengths = np.array([router.segments[n].length_m for n in names])
    west, south, east, north = view.city.bounds
    ranked = []
    for name, (x, y) in zip(names, middles.tolist(), strict=True):
        length = router.segments[name].length_m
        if length >= 40.0 and west + 40 <= x <= east - 40 and south + 40 <= y <= north - 40:
            around = float(lengths[np.hypot(middles[:, 0] - x, middles[:, 1] - y) <= 450.0].sum())
            ranked.append((-round(around), name))
    chosen: list[RoadSpot] = []
    for _, name in sorted(ranked):
        spot = router.spot(name, router.segments[name].length_m / 2.0)
        if all(dist(spot.place, other.place) >= 150.0 for other in chosen):
            chosen.append(spot)
    return chosen


def _by_length(router: Router, start: RoadSpot, came: Mapping[str, tuple[float, str]]) -> list[str]:
    """The segments about a usual route away, in the order of the difference in length."""
    candidates = [
        (abs(_length_to(router, start, came, name) - USUAL_M), name)
        for name in came
        if name != start.segment and router.segments[name].length_m >= 25.0
    ]
    return [name for off, name in sorted(candidates) if off <= USUAL_M - SHORTEST_M]


def _length_to(router: Router, start: RoadSpot, came: Mapping[str, tuple[float, str]], name: str) -> float:
    length = 0.0
    while name != start.segment and length < 2.0 * LONGEST_M:
        length += router.segments[name].length_m
        name = came[name][1]
    return length + router.segments[start.segment].length_m - start.at_m


def _end_of(router: Router, name: str) -> RoadSpot:
    length = router.segments[name].length_m
    return router.spot(name, max(length / 2.0, length - 20.0))


# -- jams


def _jams(
    router: Router, start: RoadSpot, goals: Sequence[RoadSpot], known: list[RoadSpot], way: Way
) -> list[RoadSpot]:
    """The known places of jams and those on a way, such that every goal can be reached around any two of them."""
    jams = list(known)
    if not all(_is_passable(router, start, goals, (jam,)) for jam in jams):
        return known
    for stop in way.points[:-1]:
        jam = router.before(way, stop, BEFORE_M if _is_turn(router, way, stop) else 0.0)
        apart = all(dist(jam.place, other.place) >= JAMS_APART_M for other in (start, *goals, *jams))
        if len(jams) == MOST_JAMS or not apart:
            continue
        if all(_is_passable(router, start, goals, pair) for pair in ((jam,), *((jam, other) for other in jams))):
            jams.append(jam)
    return jams


def _is_turn(router: Router, way: Way, stop: RoadSpot) -> bool:
    return stop.at_m > router.segments[stop.segment].length_m - 1.0


def _is_passable(router: Router, start: RoadSpot, goals: Sequence[RoadSpot], jams: Sequence[RoadSpot]) -> bool:
    """Return whether the road engine's way around some jams to each goal is short enough and passes none of them.

    The engine avoids the streets at a jam alone. A way past the next crossing can still lie within the jam's radius,
    and its waypoint there is never clear.
    """
    avoid, blocked = (_segments_at(router, jams, radius_m) for radius_m in (AVOIDED_M, BLOCKED_M))
    ways = (router.way(start, goal, avoid) for goal in goals)
    return start.segment not in blocked and all(
        way is not None and way.length_m <= LONGEST_AROUND_M and blocked.isdisjoint(way.segments) for way in ways
    )


def _segments_at(router: Router, jams: Sequence[RoadSpot], radius_m: float) -> frozenset[str]:
    """The segments within a distance of any of some jams."""
    return frozenset[str]().union(*(router.near(jam.place, radius_m) for jam in jams))


# -- jams that are drawn along streets


def _with_pairs(
    layout: Layout, router: Router, placed: Placement, start: RoadSpot, goals: Sequence[RoadSpot]
) -> Placement | None:
    """The placement with pairs of jams where the mission draws them along streets; None if the city has too few."""
    blocking = [group.name for group in _blocking(layout) if _is_drawn_along(group)]
    if not blocking:
        return placed
    for goal in goals:
        pairs = _pairs(router, start, goal)
        if len(pairs) >= LEAST_PAIRS:
            places = tuple(dict.fromkeys(place for pair in pairs for place in pair))
            goals_of = {group.name: (goal.place,) for group in _goals(layout)}
            listed: dict[str, tuple[Vector2, ...]] = {**goals_of, **dict.fromkeys(blocking, places)}
            return replace(placed, listed=listed, pairs=dict.fromkeys(blocking, pairs))
    return None


def _blocking(layout: Layout) -> list[Group]:
    """The groups of targets on roads, other than the goals."""
    goals = {group.name for group in _goals(layout)}
    return [group for group in layout.on("road") if group.name not in goals]


def _is_drawn_along(group: Group) -> bool:
    return any(isinstance(expr, ex.Draw) and expr.distribution == "sites_along" for expr in position_exprs(group))


def _pairs(router: Router, start: RoadSpot, goal: RoadSpot) -> tuple[tuple[Vector2, Vector2], ...]:
    """Places of two jams: on the first route, and on the way around that jam, not before it on the first route. Around
    both leads a way."""
    first = router.way(start, goal)
    if first is None:
        return ()
    pairs: list[tuple[Vector2, Vector2]] = []
    for met in router.streets(first, start, goal):
        around = _slower(router, start, goal, first, (met,))
        if around is None:
            continue
        before = first.segments[: first.segments.index(met.segment) + 1]
        beside = [
            spot.place
            for spot in router.streets(around, start, goal)
            if dist(spot.place, met.place) >= JAMS_APART_M
            and router.near(spot.place, BLOCKED_M).isdisjoint(before)
            and _slower(router, start, goal, around, (met, spot)) is not None
        ]
        pairs += [(met.place, place) for place in beside[:: max(1, len(beside) // MOST_BESIDE)][:MOST_BESIDE]]
    return tuple(pairs[:: max(1, ceil(len(pairs) / MOST_PAIRS))])


def _slower(router: Router, start: RoadSpot, goal: RoadSpot, way: Way, jams: Sequence[RoadSpot]) -> Way | None:
    """The way around jams, if there is one and every way that is about as fast as a known one has the last of them."""
    if not _is_passable(router, start, (goal,), jams):
        return None
    around = router.way(start, goal, _segments_at(router, jams, AVOIDED_M))
    return around if around is not None and around.time_s >= way.time_s + MARGIN_S else None


# -- a delivery with a walk at its end


def _delivery(layout: Layout, view: CityView, router: Router, ground: Placement) -> Placement | None:
    """A stop beside the dog's ground, and a route to it; None without one."""
    (dogs,) = layout.assets("quadruped")[:1] or (None,)
    if dogs is None:
        return None
    (dog, *_) = ground.places[dogs.name]
    here = (dog[0], dog[1])
    near = sorted(router.near(here, STOP_M) & {s.id for s in view.segments})
    stops = sorted(
        (place.off_m, name, place.at_m)
        for name in near
        if router.segments[name].length_m >= 30.0
        for place in (project(router.segments[name].shape, *here),)
    )
    for _, name, at in stops[:4]:
        goal = router.spot(name, min(max(at, 12.0), router.segments[name].length_m - 10.0))
        if not _in_sight(view, goal):
            continue
        candidates = []
        for spot in _starts_around(view, router, goal):
            way = router.way(spot, goal)
            if way is not None and SHORTEST_M <= way.length_m <= LONGEST_M and len(way.points) <= 7:
                candidates.append((round(abs(way.length_m - USUAL_M)), spot.segment, spot, way))
        for _, _, spot, way in sorted(candidates, key=lambda item: item[:2])[:10]:
            jams = _jams(router, spot, [goal], [], way)
            for jam in jams[:2]:
                around = router.way(spot, goal, router.near(jam.place, BLOCKED_M))
                if around is not None:
                    jams = _jams(router, spot, [goal], jams, around)
            if len(jams) >= LEAST_JAMS:
                return _placement(layout, view, router, spot, [goal], jams, ground)
    return None


def _starts_around(view: CityView, router: Router, goal: RoadSpot) -> Iterator[RoadSpot]:
    names = sorted(router.near(goal.place, 700.0) - router.near(goal.place, 250.0))
    shown = {segment.id for segment in view.segments}
    kept = [name for name in names if name in shown and router.segments[name].length_m >= 40.0]
    step = max(1, len(kept) // 120)
    for name in kept[::step]:
        spot = router.spot(name, router.segments[name].length_m / 2.0)
        if _in_sight(view, spot):
            yield spot


# -- both


def _goals(layout: Layout) -> list[Group]:
    """The groups that the inspections lead to."""
    names = {
        part.name
        for inspection in layout.mission.inspections
        if inspection.destination is not None
        for part in ex.parts(inspection.destination)
        if isinstance(part, ex.Ref)
    }
    return [group for group in layout.mission.groups if group.name in names]


def _in_sight(view: CityView, spot: RoadSpot) -> bool:
    """True if a place is well inside of the city."""
    west, south, east, north = view.city.bounds
    return west + 30 <= spot.place[0] <= east - 30 and south + 30 <= spot.place[1] <= north - 30


def _placement(
    layout: Layout, view: CityView, router: Router, start: RoadSpot, goals: Sequence[RoadSpot],
    jams: Sequence[RoadSpot], ground: Placement | None,
) -> Placement:  # fmt: skip
    goal_names, blocking = {group.name for group in _goals(layout)}, _blocking(layout)
    places: dict[str, Any] = dict(ground.places) if ground else {}
    headings: dict[str, tuple[float, ...]] = dict(ground.headings_deg) if ground else {}
    for group in layout.mission.groups:
        if group.name in goal_names:
            places[group.name] = tuple(goal.place for goal in goals)
        elif group in blocking:
            places[group.name] = tuple(jam.place for jam in jams)
        elif group.role == "asset" and layout.surface(group) == "road":
            places[group.name], headings[group.name] = (start.place,), (start.heading_deg,)
        elif group.role == "asset" and group.engine == "multirotor":
            footing = Footing(view.city)
            spot = footing.nearest_clear(*start.place, 1.5, 60.0, off_road=True)
            places[group.name] = (spot or start.place,)
    shift = ground.shift if ground else _about(start, layout)
    shown = [start.place, *(goal.place for goal in goals), *(jam.place for jam in jams)]
    regions = {} if ground is None else {layout.ground: _box([shift(corner) for corner in _corners(layout)], 0.0)}
    if ground is not None:
        shown += regions[layout.ground]
    others = {region.name: _box(shown, MARGIN_M) for region in layout.mission.regions if region.name not in regions}
    placed = Placement(shift=shift, regions={**regions, **others}, places=places, headings_deg=headings)
    if ground is None:
        return placed
    return _with_dog_at_stop(layout, view, placed, goals[0])


def _about(start: RoadSpot, layout: Layout) -> Any:
    """The move of places that puts the first one on a road at the start; the middle of the mission if all are drawn."""
    on_road = (group for group in layout.mission.groups if layout.surface(group) == "road")
    west, south, east, north = layout.extent()
    middle = (west + east) / 2.0, (south + north) / 2.0
    declared = next((places[0] for group in on_road if (places := layout.starts(group))), middle)

    def shift(place: Vector2) -> Vector2:
        return (
            round(start.place[0] + place[0] - declared[0], 2),
            round(start.place[1] + place[1] - declared[1], 2),
        )

    return shift


def _with_dog_at_stop(layout: Layout, view: CityView, placed: Placement, goal: RoadSpot) -> Placement:
    """Return the placement with the dog beside the stop, on the side of its ground, if it can walk to its own place."""
    (dogs,) = layout.assets("quadruped")[:1]
    dog = placed.places[dogs.name][0]
    box = _box([goal.place, (dog[0], dog[1])], 40.0)
    (west, south), (east, north) = box[0], box[2]
    grid = WalkGrid(view, (west, south, east, north))
    cell = grid.cell((dog[0], dog[1]))
    if cell is None or not grid.free[cell] or dist(goal.place, dog[:2]) <= WALK_M:
        return placed
    reached = grid.lengths_from(cell, 120.0)
    footing = Footing(view.city)
    away = {c: dist(grid.place(c), goal.place) for c in reached}
    clear = [c for c in reached if away[c] >= CLEAR_OF_STOP_M]
    near = sorted(clear, key=lambda c: (max(away[c], BESIDE_STOP_M), reached[c], c))
    spot = next((grid.place(c) for c in near[:400] if footing.is_clear(*grid.place(c), 0.8, off_road=True)), None)
    return placed if spot is None else replace(placed, places={**placed.places, dogs.name: (spot,)})


def _corners(layout: Layout) -> list[Vector2]:
    west, south, east, north = layout.region(layout.ground)
    return [(west, south), (east, north)]


def _box(places: Sequence[Vector2], margin: float) -> tuple[Vector2, ...]:
    west, south, east, north = bounds(places)
    west, south, east, north = (round(v, 2) for v in (west - margin, south - margin, east + margin, north + margin))
    return (west, south), (east, south), (east, north), (west, north)


def _line(segment: RoadSegment) -> list[Vector]:
    return [(x, y, 0.0) for x, y in segment.shape]
