"""`Arrivals`: the moments of commands and of motion.

Facts: `command` (body, verb), `motion` and `climb` (body). `near` and its kin answer from them when a body can be at a
place, at the top speeds of all bodies concerned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from lingjing.mission import geometry2d
from lingjing.mission.conditions.motion import moving_verbs, roaming_verbs
from lingjing.mission.conditions.outline import Body
from lingjing.mission.conditions.spread import PossiblePlaces, extent, farthest, gap, point
from lingjing.mission.feasibility.condition_values import AXIS_NAMES
from lingjing.mission.feasibility.moments import Moments, shown
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.steps import NEVER
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    YES,
    Extent,
    Extents,
    Moment,
    Quantity,
    Reason,
    Truth,
    conjunction,
    earliest,
    in_words,
    latest,
    since,
)
from lingjing.mission.instance import LimitSpec
from lingjing.mission.intervals import Bounds
from lingjing.mission.kinds import engine_kind
from lingjing.mission.values import Place, Value
from lingjing.mission.vocabulary import STOP

_SWAY_MPS = 1.0
"""The speed of a body that no command moves, m/s (chosen): it sways or turns on the spot."""

_FALL_MPS = 60.0
"""The speed that a fall or a push can add, m/s (chosen: a fall from 180 m without drag)."""


class _Motion(msgspec.Struct, frozen=True):
    """Upper bounds of the motion of a body."""

    start_s: float
    """The first command that moves it, seconds; infinity if there is none."""
    idle_mps: float
    """Its speed before, and after its battery is empty."""
    full_mps: float
    tether_m: float
    """The largest distance that its commands can bring it; infinity if they take it away."""
    lasts_s: float
    """The longest time under way, seconds."""
    moment: Moment
    """The moment of the first command."""

    @property
    def turns(self) -> tuple[float, float]:
        """The times at which its speed changes, seconds."""
        return self.start_s, self.start_s + self.lasts_s

    def covered(self, time_s: float) -> float:
        """The distance that it can have covered, metres."""
        after = max(0.0, time_s - self.start_s)
        if math.isfinite(self.tether_m):
            return _times(self.idle_mps, time_s) + (self.tether_m if time_s >= self.start_s else 0.0)
        under_way = min(after, self.lasts_s)
        return _times(self.idle_mps, time_s - under_way) + _times(self.full_mps, under_way)


class Arrivals(Moments):
    """Commands, motion and distances."""

    def _command(self, body: str, verb: str) -> Moment:
        """An agent can give the command."""
        if body not in self._commanded:
            return self._never(f"no agent may command `{body}`", "LJ0607", self.outline.bodies[body].path)
        permits: list[Truth] = []
        path = ""
        for limit in self.outline.instance.limits:
            if limit.most <= 0 and counts(limit, body, verb):
                if not limit.stage:
                    return self._never(f"`{limit.name}` allows no `{body}.{verb}`", "LJ0610", f"limit/{limit.name}")
                permits.append(since(self._stage_over(limit.stage), self.clock))
            if self._is_uncounted(limit, self._steady) and counts(limit, body, verb):
                return Moment(NEVER, self._barred(("used", limit.name)))
        for permit in self.outline.instance.permits:
            if permit.resource == body and permit.verb in ("", verb) and verb != STOP:
                permits.append(self.truth(permit.condition, {}, early=True))
                path = path or f"permit/{self.outline.bodies[body].entity.group}/{permit.verb}"
        moment = self._at_boundary(conjunction(permits, self.clock), path)
        if moment.reason is None:
            return moment
        return Moment(moment.step, moment.reason.behind(shown(("command", body, verb))))

    @staticmethod
    def _is_uncounted(limit: LimitSpec, extents: Extents) -> bool:
        """True if the count of a limit must stay zero."""
        used = extents.get(("used", limit.name))
        return isinstance(used, Bounds) and used.high < 1.0

    def _stage_over(self, name: str) -> Moment:
        """The stage's limits no longer count: it is done for all subjects. At once if it begins after another one."""
        stage = next((stage for stage in self.outline.instance.stages if stage.name == name), None)
        relations = self.outline.instance.relations
        if stage is None or any(each.kind == "dependency" and name in (each.target, each.source) for each in relations):
            return AT_ONCE
        truths = [self.truth(stage.condition, names) for names in self.subjects(stage.variable, stage.domain)]
        return latest(self._at_boundary(truth, f"stage/{name}") for truth in truths)

    def _motion(self, body: str) -> Moment:
        """The body can begin to move by a command."""
        entity = self.outline.bodies[body].entity
        if any(inspection.asset == body for inspection in self.outline.instance.inspections):
            return AT_ONCE
        verbs = roaming_verbs(entity) or moving_verbs(entity)
        if not verbs:
            path = self.outline.bodies[body].path
            return self._never(f"`{body}` has no action that moves it", "LJ0607", path)
        return earliest(self.moment(("command", body, verb)) for verb in verbs)

    def _climb(self, body: str) -> Moment:
        """The body can begin to move by any command."""
        verbs = moving_verbs(self.outline.bodies[body].entity)
        return earliest(self.moment(("command", body, verb)) for verb in verbs)

    def near(self, first: Value, second: Value, radius: float, slack_m: float = 0.0) -> Moment:
        """The moment at which two bodies or places can be within the radius."""
        places = self._places(first), self._places(second)
        if places[0] is None or places[1] is None or self._frozen:
            return AT_ONCE
        body_1, body_2 = _body_of(first), _body_of(second)
        if body_1 is not None and body_2 is not None:
            body_1, body_2 = _met(body_1, body_2), _met(body_2, body_1)
            radius = max((radius, *(met.aboard_m for met in (body_1, body_2) if not met.aboard)))
        for body, goal, where in ((body_1, body_2, places[1]), (body_2, body_1, places[0])):
            barred = self._keeps_out(body, goal, where, radius + slack_m)
            if barred is not None:
                return barred
        bodies = [body for body in (body_1, body_2) if body is not None]
        metres = gap(places[0], places[1]) - radius - sum(_loose_m(body) for body in bodies)
        if metres <= 1e-6 or not bodies:
            return AT_ONCE if metres <= 1e-6 else self._never("two places are too far apart", "LJ0612")
        return self._closing(bodies, metres)

    def inside(self, body: Body, places: PossiblePlaces) -> Moment:
        """The moment at which a body can be in a region."""
        return self.near(body, places, 0.0)

    def apart(self, first: Value, second: Value) -> float:
        """Upper bound of the distance between two bodies or places during the episode, metres."""
        places = self._places(first), self._places(second)
        if places[0] is None or places[1] is None:
            return math.inf
        reach = sum(self.knowledge.reach_m(body) for body in (_body_of(first), _body_of(second)) if body is not None)
        return farthest(places[0], places[1]) + reach

    def _crossing(self, body: Body, axis: int, low: float, high: float) -> Moment:
        start = extent(body.where, axis)
        metres = max(low - start.high, start.low - high) - self.knowledge.aside_m(body) - _loose_m(body)
        return AT_ONCE if not metres > 1e-6 else self._closing([body], metres)

    def _rising(self, body: Body, low: float) -> Moment:
        """The moment at which a body can be above an elevation. An aircraft on the ground must climb first."""
        if low <= self.knowledge.start_top_m(body):
            return AT_ONCE
        return self.moment(("climb", body.id))

    def _speeding(self, body: Body, low: float) -> Moment:
        """The moment at which a body can be faster than a speed. Nothing pushes the only body that moves."""
        alone = sum(each.driven or each.speed_mps > 0 for each in self.outline.bodies.values()) == 1
        stays = engine_kind(body.entity.engine).stays and engine_kind(body.entity.engine).landbound
        if not (alone and stays and not body.aboard) or low <= 2.0 * body.idle_mps + _SWAY_MPS:
            return AT_ONCE
        return self.moment(("climb", body.id))

    def top_speed(self, body: Body) -> float:
        """Upper bound of the speed of a body in space, m/s: twice its ceiling over ground, and a fall or a push."""
        carriers = [self.outline.bodies[name].speed_mps for name in body.aboard]
        return 2.0 * max((body.speed_mps, *carriers)) + _FALL_MPS

    def _places(self, value: Value) -> PossiblePlaces | None:
        if isinstance(value, PossiblePlaces):
            return value
        if isinstance(value, Place):
            return point(value.east, value.north)
        body = _body_of(value)
        return None if body is None or not body.where.outlines else body.where

    def _closing(self, bodies: list[Body], metres: float) -> Moment:
        """The moment at which the bodies together can have covered a distance."""
        motions = [self._motion_of(body) for body in bodies]
        turns = sorted({0.0, *(time for motion in motions for time in motion.turns if math.isfinite(time))})
        reached = math.inf
        for begin, end in zip(turns, (*turns[1:], math.inf), strict=True):
            covered = sum(motion.covered(begin) for motion in motions)
            probe = min(end, begin + 1.0)
            speed = (sum(motion.covered(probe) for motion in motions) - covered) / (probe - begin)
            if covered < metres:
                begin = begin + (metres - covered) / speed if speed > 0 else math.inf
            if begin < end or (begin == end and math.isfinite(end)):
                reached = begin
                break
        return self._arrival(reached, [motion.moment for motion in motions], bodies, metres)

    def _arrival(
        self,
        seconds: float,
        moments: list[Moment],
        bodies: list[Body],
        metres: float,
    ) -> Moment:
        step = self.clock.after(0, seconds)
        still = next((body for body in bodies if math.isfinite(body.tether_m) and not body.aboard), None)
        if math.isinf(seconds) and still is not None:
            words = f"`{still.id}` has no action that takes it {spelled(round(metres, 3))} m nearer"
            return self._never(words, "LJ0607", still.path)
        late = latest(moments)
        moving = [body for body in bodies if body.speed_mps > 0] or bodies
        names = " and ".join(f"`{body.id}`" for body in moving)
        if late.step > 0 and late.reason is not None and (math.isinf(seconds) or late.step > step // 4):
            return Moment(step, late.reason.behind(f"the motion of {names}"))
        way = f"{spelled(round(metres, 3))} m"
        if math.isinf(seconds):
            batteries = any(math.isfinite(body.flight_s) for body in bodies)
            why = ", farther than the battery lasts" if batteries else ""
            return self._never(f"{names} cannot cover {way}{why}", "LJ0603" if batteries else "LJ0607", bodies[0].path)
        takes = spelled(round(seconds, 3))
        return Moment(step, Reason(lambda: f"{names} must cover {way}, which takes at least {takes} s", "LJ0613"))

    def _motion_of(self, body: Body) -> _Motion:
        carriers = [self.outline.bodies[name] for name in body.aboard]
        full = max((body.speed_mps, *(carrier.speed_mps for carrier in carriers)))
        if body.entity.role == "target":
            boarding = [spec.name for spec in body.entity.interactions if spec.aboard and carriers]
            moment = earliest(self.moment(("performed", name, body.id)) for name in boarding) if boarding else AT_ONCE
            idle, tether = body.speed_mps, math.inf
        else:
            moment = earliest(self.moment(("motion", each.id)) for each in (body, *carriers))
            idle = max((body.idle_mps, *(carrier.idle_mps for carrier in carriers)))
            tether = math.inf if carriers else body.tether_m
        start = self.clock.time_s(moment.step) if moment.step < NEVER else math.inf
        lasts = body.flight_s if body.entity.role == "asset" and not carriers else math.inf
        return _Motion(start, min(idle, full) if math.isinf(tether) else idle, full, tether, lasts, moment)

    def _keeps_out(self, body: Body | None, goal: Body | None, places: PossiblePlaces, radius: float) -> Moment | None:
        """Never, if a hard constraint keeps the body farther than the radius from all possible places of the goal, or a
        failure keeps it there at each boundary but the last, from which one tick is too short."""
        if body is None or not (self._steady or self._before_end) or not places.outlines:
            return None
        reach = radius + places.loose_m + (self.knowledge.reach_m(goal) if goal is not None else 0.0)
        if math.isinf(reach):
            return None
        for key, bounds in self._of_body(self._steady, body.id):
            if self._bars(key, bounds, places, reach):
                return self._never(f"a hard constraint on {in_words(key)} keeps `{body.id}` away", "LJ0614")
        carriers = (self.outline.bodies[name].speed_mps for name in body.aboard)
        speed = max((body.speed_mps, *carriers))
        last_tick_m = speed * self.outline.instance.clock.tick_s + _loose_m(body)
        for key, bounds in self._of_body(self._before_end, body.id):
            if self._bars(key, bounds, places, reach + last_tick_m):
                return Moment(NEVER, self._barred(key))
        return None

    def _of_body(self, extents: Extents, body: str) -> Sequence[tuple[Quantity, Extent]]:
        """The bounds about the place of a body, in their order."""
        known = self._by_body.get(id(extents))
        if known is None or known[0] is not extents:
            of: dict[object, list[tuple[Quantity, Extent]]] = {}
            for key, bounds in extents.items():
                if len(key) > 1 and (key[0] == "in" or key[0] in AXIS_NAMES[:2]):
                    of.setdefault(key[1], []).append((key, bounds))
            known = self._by_body[id(extents)] = extents, of
        return known[1].get(body, ())

    def _bars(self, key: Quantity, bounds: Bounds | frozenset[str], places: PossiblePlaces, reach: float) -> bool:
        if key[0] in AXIS_NAMES[:2] and isinstance(bounds, Bounds):
            whole = extent(places, AXIS_NAMES.index(str(key[0])))
            return whole.low - reach > bounds.high or whole.high + reach < bounds.low
        area = self.outline.scope.areas.get(str(key[2])) if key[0] == "in" else None
        if area is None or len(area.polygon) < 3:
            return False
        if bounds == YES:
            return gap(PossiblePlaces((area.polygon,)), places) > reach
        return all(_deep_inside(area.polygon, outline, reach) for outline in places.outlines)


def _body_of(value: Value) -> Body | None:
    return value if isinstance(value, Body) else getattr(value, "body", None)


def _met(goal: Body, mover: Body) -> Body:
    """The goal of a mover. A goal that only the mover can take along stays until the mover meets it."""
    return msgspec.structs.replace(goal, aboard=frozenset()) if goal.aboard == {mover.id} else goal


def counts(limit: LimitSpec, body: str, verb: str) -> bool:
    """True if a limit counts a command."""
    return any(item.kind == "command" and item.resource == body and item.name in ("", verb) for item in limit.counts)


def _loose_m(body: Body) -> float:
    """The distance by which a body can be displaced without the time of a way: by its carrier, or as it climbs."""
    return (body.aboard_m if body.aboard else 0.0) + body.sway_m


def _times(speed: float, seconds: float) -> float:
    return 0.0 if seconds <= 0.0 else speed * seconds


def _deep_inside(polygon: geometry2d.Polygon, outline: geometry2d.Polygon, metres: float) -> bool:
    """True if every point of the outline lies in the polygon, farther than `metres` from its edges."""
    if not all(geometry2d.contains(polygon, *corner) for corner in outline):
        return False
    nearest = min(geometry2d.edge_distance(polygon, *corner) for corner in outline)
    if len(outline) >= 3:
        if any(geometry2d.contains(outline, *corner) for corner in polygon):
            return False
        nearest = min(nearest, *(geometry2d.edge_distance(outline, *corner) for corner in polygon))
    return nearest > metres
