"""`Milestones`: the earliest moment of every fact that a condition may wait for.

Facts are commands, motion, pictures, messages, unlocked and performed interactions, and the events of rules. Each has
preconditions, of which the moments are computed in turn, as in planning with the deletions left out: a fact that has
happened stays. The moments begin at *never* and fall until nothing changes, so that facts that wait for each other stay
at *never* (Bonet and Geffner 2001, the heuristic h_max; ADR 0039). Whatever is unknown is possible at once. A moment is
therefore never later than in any run.

Two sets of bounds hold besides: those of hard constraints at every macro-step, and those of an episode that has not
failed yet at every boundary before its last.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import geometry2d
from lingjing.mission.conditions.episode import EVENT, EpisodeKnowledge
from lingjing.mission.conditions.motion import moving_verbs, roaming_verbs
from lingjing.mission.conditions.outline import Body, Outline, able_agents
from lingjing.mission.conditions.spread import PossiblePlaces, extent, farthest, gap, point
from lingjing.mission.feasibility.condition_values import AXIS_NAMES, SENT, Gauge, Message, Occurrences, truth_of
from lingjing.mission.feasibility.message_size import least_bytes
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.readings import Readings
from lingjing.mission.feasibility.seeing import as_drawn, sight_m
from lingjing.mission.feasibility.steps import NEVER, StepClock, Steps, first, step_clock
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    NO,
    YES,
    Extents,
    Moment,
    Quantity,
    Reason,
    Truth,
    conjunction,
    constant,
    contradiction,
    disjunction,
    earliest,
    in_words,
    lasting,
    latest,
    merged,
    since,
    unknown,
)
from lingjing.mission.fold import Meanings
from lingjing.mission.instance import CameraSpec, InteractionSpec, LimitSpec, MessageSpec
from lingjing.mission.intervals import Bounds
from lingjing.mission.kinds import engine_kind
from lingjing.mission.model import Rule, Unlock
from lingjing.mission.values import Place, Value
from lingjing.mission.vocabulary import ENGINE_EVENTS, PHOTO, STOP

_MAX_NODES = 40_000
"""Nodes of conditions that one pass evaluates (chosen); the rest is unknown."""

_MAX_PASSES = 40
"""Passes until the moments no longer change (chosen). If they still do, nothing is proved."""

_MIRROR_S = 2.0
"""Seconds of motion by which an engine may know the place of another engine's body too late, besides a macro-step."""

_SWAY_MPS = 1.0
"""The speed of a body that no command moves, m/s (chosen): it sways or turns on the spot."""

_FALL_MPS = 60.0
"""The speed that a fall or a push can add, m/s (chosen: a fall from 180 m without drag)."""

_LEVELS = ("heat", "flow")
"""States that an interaction works off from their present value, so that it may take less than its declared time."""

_UNDER_WAY = {"vessel": ("moving",), "quadruped": ("walking", "turning")}
"""Engine → its status words that only a command gives, if the body has no `stop`."""

Fact = tuple[str, ...]
"""A fact that can happen: its kind, and the names that it is about."""


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


class Milestones:
    """The moments of the facts of one outline; the world of `Readings`."""

    def __init__(self, outline: Outline, barred: tuple[ex.Expr, dict[str, Value]] | None = None) -> None:
        """`barred` is a condition, with its bound names, that has never held in the episodes of this analysis."""
        self.outline = outline
        self._barred_condition = barred
        self._without: dict[tuple[object, ...], Truth] = {}
        self.clock: StepClock = step_clock(outline.instance)
        self.knowledge = EpisodeKnowledge(outline)
        self.settled = True
        self._meanings = Meanings(Readings())
        self._rules: dict[str, Rule] = {rule.name: rule for rule in outline.instance.rules}
        self._able = {agent.id for agent in able_agents(outline.instance)}
        self._commanded = {
            name for agent in outline.instance.agents if agent.id in self._able for name in agent.commands
        }
        self._moments: dict[Fact, Moment] = {}
        self._certain: dict[Fact, int] = {}
        self._implied: dict[Fact, Extents] = {}
        self._done: set[Fact] = set()
        self._stack: list[Fact] = []
        self._defined: dict[int, tuple[ex.Expr, bool]] = {}
        self._waited = self._frozen = False
        self._left = _MAX_NODES
        self._marks = 0
        self._steady: Extents = {}
        self._before_end: Extents = {}
        self._steady = self._extents_of_constraints()
        self._before_end = self._extents_before_failure()

    # -- conditions

    def settle(self, roots: Callable[[], None]) -> None:
        """Evaluate the roots until the moments of all facts no longer change. Without success, `settled` is False."""
        for _ in range(_MAX_PASSES):
            before = self._times()
            self._done.clear()
            self._waited, self._left = False, _MAX_NODES
            roots()
            if not self._waited or before == self._times():
                return
        self.settled = False

    def _times(self) -> tuple[dict[Fact, int], dict[Fact, int]]:
        return {fact: moment.step for fact, moment in self._moments.items()}, dict(self._certain)

    def truth(self, condition: ex.Expr, names: dict[str, Value], *, early: bool = False) -> Truth:
        """The truth of a condition at one instant; with `early`, at a boundary before the last one."""
        truth = truth_of(self._meanings.of(condition)(names, self), self)
        assumed = self._before_end if early else self._steady
        clash = contradiction(_of_any_message(truth.if_true), assumed) if truth.may and assumed else ()
        return Truth((), (), reason=self._barred(clash)) if clash else truth

    def _barred(self, clash: Quantity) -> Reason:
        if clash in self._steady:
            return Reason(lambda: f"a hard constraint forbids what it needs of {in_words(clash)}", "LJ0614")
        return Reason(lambda: f"{in_words(clash)} would be failure, which ends the mission first", "LJ0613", "failure")

    def exhausted(self) -> bool:
        """True if too many nodes were evaluated."""
        self._left -= 1
        return self._left < 0

    def defined(self, node: ex.Expr) -> bool:
        """True if every value in the expression exists at all times."""
        known = self._defined.get(id(node))
        if known is None:
            known = self._defined[id(node)] = node, self.knowledge.defined(node)
        return known[1]

    def fresh_mark(self) -> str:
        """A mark for the messages of one quantifier."""
        self._marks += 1
        return f"#{self._marks}"

    def _extents_of_constraints(self) -> Extents:
        """The bounds that hold at every macro-step of a winning episode."""
        kept = (
            self.subject_truth(constraint.condition, names).if_true
            for constraint in self.outline.instance.constraints
            if constraint.kind == "hard"
            for names in self.subjects(constraint.variable, constraint.domain)
        )
        known = () if self._barred_condition is None else (self._barred_condition,)
        return self._static(itertools.chain(kept, (self.subject_truth(*each).if_false for each in known)))

    def _extents_before_failure(self) -> Extents:
        """The bounds that hold at every boundary of a winning episode before its last."""
        failure = self.outline.instance.failure
        if failure is None:
            return self._steady
        before = (self.subject_truth(each, {}).if_false for each in (failure,))
        return self._static(itertools.chain((self._steady,), before))

    def subject_truth(self, condition: ex.Expr, names: dict[str, Value]) -> Truth:
        """The truth of a condition without further assumptions."""
        return truth_of(self._meanings.of(condition)(names, self), self)

    def _static(self, each: Iterable[Extents]) -> Extents:
        """The common bounds of several conditions, with every fact possible at once. Contradictory ones are left out.

        `each` is lazy: a moment that is computed before all bounds are known would be kept.
        """
        self._frozen = True
        whole: Extents = {}
        for extents in each:
            whole = merged(whole, extents) or whole
        self._frozen, self._left = False, _MAX_NODES
        return whole

    def without(self, barred: ex.Expr, wanted: ex.Expr, names: Mapping[str, Value]) -> Truth:
        """The truth of a condition in an episode in which another one has never held."""
        nested = self._frozen or self._barred_condition is not None
        if nested or any(isinstance(value, Message) for value in names.values()):
            return unknown(self.clock)
        bound = tuple((name, _id_of(value)) for name, value in sorted(names.items(), key=lambda pair: pair[0]))
        key = (id(barred), id(wanted), bound)
        if key not in self._without:
            self._without[key] = self._alone(barred, wanted, dict(names))
        return self._without[key]

    def _alone(self, barred: ex.Expr, wanted: ex.Expr, names: dict[str, Value]) -> Truth:
        other = Milestones(self.outline, (barred, names))
        truths: list[Truth] = []
        other.settle(lambda: truths.append(other.truth(wanted, names)))
        return truths[-1] if other.settled else unknown(self.clock)

    def subjects(self, variable: str | None, domain: str | None) -> Iterable[dict[str, Value]]:
        """The bound names of a declaration that is stated per member of a group."""
        if variable is None or domain is None:
            return ({},)
        return ({variable: body} for body in self.outline.groups.get(domain, ()))

    # -- facts

    def moment(self, fact: Fact) -> Moment:
        """The earliest moment of a fact."""
        if self._frozen:
            return AT_ONCE
        if fact in self._done:
            return self._moments[fact]
        if fact in self._stack:
            self._waited = True
            again = f"that for {_shown(fact)} again"
            return self._moments.get(fact) or Moment(NEVER, Reason(lambda: again, "LJ0606"))
        self._stack.append(fact)
        moment: Moment = getattr(self, f"_{fact[0]}")(*fact[1:])
        self._stack.pop()
        before = self._moments.get(fact)
        if before is not None and before.step < moment.step:
            moment = before
        self._moments[fact] = moment
        self._done.add(fact)
        return moment

    def _never(self, words: str, code: str, at: str = "") -> Moment:
        return Moment(NEVER, Reason(lambda: words, code, at))

    def _at_boundary(self, truth: Truth, at: str, *, at_least: int = 0) -> Moment:
        """The first boundary at which a condition may hold."""
        step = self.clock.first_boundary(truth.may, at_least)
        reason = truth.reason or truth.ends
        if reason is not None and not reason.at:
            reason = msgspec.structs.replace(reason, at=at)
        return Moment(step, reason)

    # commands and motion

    def _command(self, body: str, verb: str) -> Moment:
        """An agent can give the command."""
        if body not in self._commanded:
            return self._never(f"no agent may command `{body}`", "LJ0607", self.outline.bodies[body].path)
        permits: list[Truth] = []
        path = ""
        for limit in self.outline.instance.limits:
            if limit.most <= 0 and _counts(limit, body, verb):
                if not limit.stage:
                    return self._never(f"`{limit.name}` allows no `{body}.{verb}`", "LJ0610", f"limit/{limit.name}")
                permits.append(since(self._stage_over(limit.stage), self.clock))
            if self._is_uncounted(limit, self._steady) and _counts(limit, body, verb):
                return Moment(NEVER, self._barred(("used", limit.name)))
        for permit in self.outline.instance.permits:
            if permit.resource == body and permit.verb in ("", verb) and verb != STOP:
                permits.append(self.truth(permit.condition, {}, early=True))
                path = path or f"permit/{self.outline.bodies[body].entity.group}/{permit.verb}"
        moment = self._at_boundary(conjunction(permits, self.clock), path)
        if moment.reason is None:
            return moment
        return Moment(moment.step, moment.reason.behind(_shown(("command", body, verb))))

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

    # places

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

    def entering(self, gauge: Gauge, low: float, high: float) -> Moment:
        """The moment at which a number can lie between two bounds."""
        kind, name = str(gauge.key[0]), str(gauge.key[1])
        body = self.outline.bodies.get(name)
        if self._frozen or body is None:
            return AT_ONCE
        if kind in AXIS_NAMES[:2]:
            return self._crossing(body, AXIS_NAMES.index(kind), low, high)
        if kind == AXIS_NAMES[2]:
            return self._rising(body, low)
        if kind == "speed":
            return self._speeding(body, low)
        return self._changing(body, str(gauge.key[2]), low, high) if kind == "value" else AT_ONCE

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

    def is_always_there(self, body: Body) -> bool:
        """True if the body is present during the whole episode."""
        return body.entity.role == "asset" and not engine_kind(body.entity.engine).orbits

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
        for key, bounds in self._steady.items():
            if len(key) > 1 and key[1] == body.id and self._bars(key, bounds, places, reach):
                return self._never(f"a hard constraint on {in_words(key)} keeps `{body.id}` away", "LJ0614")
        carriers = (self.outline.bodies[name].speed_mps for name in body.aboard)
        speed = max((body.speed_mps, *carriers))
        last_tick_m = speed * self.outline.instance.clock.tick_s + _loose_m(body)
        for key, bounds in self._before_end.items():
            if len(key) > 1 and key[1] == body.id and self._bars(key, bounds, places, reach + last_tick_m):
                return Moment(NEVER, self._barred(key))
        return None

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

    # pictures and messages

    def reported_picture(self, body: Body) -> Moment:
        """The moment of the first message that names a picture of the body."""
        moment = self.moment(("picture", body.id))
        return Moment(moment.step + self.clock.per_tick if moment.step < NEVER else NEVER, moment.reason)

    def _picture(self, target: str) -> Moment:
        body = self.outline.bodies[target]
        present = self.present(target)
        mounts = [(carrier, camera) for carrier in self.outline.bodies.values() for camera in carrier.entity.cameras]
        moment = earliest(self._shot(carrier, camera, body, present) for carrier, camera in mounts)
        return Moment(moment.step, moment.reason and moment.reason.behind(_shown(("picture", target))))

    def _shot(self, carrier: Body, camera: CameraSpec, target: Body, present: Steps) -> Moment:
        if self._before_end.get(("photographed", carrier.id)) == NO:
            return Moment(NEVER, self._barred(("photographed", carrier.id)))
        for limit in self.outline.instance.limits if camera.capture != "each_tick" else ():
            if self._is_uncounted(limit, self._before_end) and _counts(limit, carrier.id, PHOTO):
                return Moment(NEVER, self._barred(("used", limit.name)))
        shot = self.moment(("photo", carrier.id, camera.name))
        radius = sight_m(carrier, camera, target, self.knowledge, self._ceiling_m(carrier))
        seen = AT_ONCE if math.isinf(radius) else self.near(carrier, as_drawn(target), radius)
        late = latest((shot, seen))
        step = self.clock.first_boundary(present, late.step) if late.step < NEVER else NEVER
        on_time = step == self.clock.boundary(late.step) or late.step > self.clock.last
        return Moment(step, late.reason) if on_time else self._absent(target.id, step)

    def _ceiling_m(self, body: Body) -> float:
        """The highest elevation that hard constraints allow a body, metres."""
        extent_of_body = self._steady.get(("elevation", body.id))
        return extent_of_body.high if isinstance(extent_of_body, Bounds) else math.inf

    def _photo(self, carrier: str, camera: str) -> Moment:
        """The camera can take a picture."""
        spec = next(each for each in self.outline.bodies[carrier].entity.cameras if each.name == camera)
        if spec.capture == "each_tick":
            return AT_ONCE
        if not any(verb.name == PHOTO for verb in self.outline.bodies[carrier].entity.verbs):
            return self._never(f"`{carrier}` has no `{PHOTO}`", "LJ0609", self.outline.bodies[carrier].path)
        ordered = self.moment(("command", carrier, PHOTO))
        return Moment(ordered.step + self.clock.per_tick if ordered.step < NEVER else NEVER, ordered.reason)

    def photographed(self, asset: Body) -> Truth:
        """The truth of a picture taken by a camera of the asset."""
        cameras = asset.entity.cameras
        moment = earliest(self.moment(("photo", asset.id, camera.name)) for camera in cameras)
        return since(moment, self.clock, ("photographed", asset.id))

    def message(self, kind: str) -> Moment:
        """The moment of the first message of a kind."""
        return self.moment(("report", kind))

    def _report(self, kind: str) -> Moment:
        instance = self.outline.instance
        spec = next((each for each in instance.messages if each.kind == kind), None)
        senders = [agent for agent in instance.agents if spec is not None and spec.is_sent_by(agent.role)]
        path = f"message/{kind}"
        if spec is None or not any(agent.id in self._able for agent in senders):
            return self._never(f"no agent can send a `{kind}`", "LJ0605", path)
        if instance.budget.messages == 0 or all(agent.budget and agent.budget.messages == 0 for agent in senders):
            return self._never(f"no agent with a budget of messages can send a `{kind}`", "LJ0610", path)
        least, most = least_bytes(spec, instance), instance.comms.payload_bytes
        if least > most:
            words = f"a `{kind}` has at least {least} bytes, and the payload of a message is {most} bytes"
            return self._never(words, "LJ0605", path)
        moment = latest((Moment(self.clock.per_tick), self._delivered(spec)))
        for limit in instance.limits:
            if limit.most <= 0 and any(item.kind == "message" and item.name == kind for item in limit.counts):
                if not limit.stage:
                    return self._never(f"`{limit.name}` allows no `{kind}`", "LJ0610", f"limit/{limit.name}")
                over = self._stage_over(limit.stage)
                moment = latest(
                    (moment, Moment(over.step, over.reason and over.reason.behind(_shown(("report", kind)))))
                )
        return moment

    def _delivered(self, spec: MessageSpec) -> Moment:
        """The moment from which on the radio may deliver a message. Rules receive reports that are lost, too."""
        if spec.category == "report":
            return AT_ONCE
        changes = [
            (event, radio.loss) for event in self.outline.instance.events for radio in event.radio if not radio.region
        ]
        silent = any(
            event.tick == 0 and event.name not in self.outline.first_ticks and loss == 1.0
            for event, loss in changes
            if event.condition is None
        )
        if (self.outline.instance.comms.loss < 1.0 and not silent) or any(event.until for event, _ in changes):
            return AT_ONCE
        lowered = [event.name for event, loss in changes if loss is not None and loss < 1.0]
        if not lowered:
            return self._never(
                f"the radio loses every message, and a rule never receives a `{spec.kind}`",
                "LJ0605",
                f"message/{spec.kind}",
            )
        return earliest(self.moment(("event", name)) for name in lowered)

    # events

    def _event(self, name: str) -> Moment:
        """An event of the mission can have occurred."""
        event = next(each for each in self.outline.instance.events if each.name == name)
        if event.condition is not None:
            moment = self._at_boundary(self.truth(event.condition, {}), f"event/{name}")
        else:
            tick = self.outline.first_ticks.get(name, event.tick or 0)
            step = tick * self.clock.per_tick
            words = f"it occurs at {spelled(self.clock.time_s(step))} s"
            moment = Moment(step, Reason(lambda: words, "LJ0613", f"event/{name}") if step else None)
        return Moment(moment.step, moment.reason and moment.reason.behind(_shown(("event", name))))

    def occurrences(self, name: str, body: Body | None) -> Occurrences | None:
        """The times of an event of the mission, or of an interaction of the engine `city`."""
        key: Quantity = ("count", name, body.id if body is not None else "*")
        event = next((each for each in self.outline.instance.events if each.name == name), None)
        if event is not None:
            moment = AT_ONCE if self._frozen else self.moment(("event", name))
            per_tick = self.clock.per_tick
            pause = (
                None
                if event.pause_s is None
                else max(per_tick, self.clock.boundary(self.clock.after(0, event.pause_s)))
            )
            timed = event.tick is not None and name not in self.outline.first_ticks
            certain = (event.tick or 0) * per_tick + per_tick if timed else NEVER
            return Occurrences(key, (moment,), pause, certain=certain)
        owners = self._owners(name, body)
        if owners is None:
            return None
        fact = ("emitted", *key[1:])
        moments = sorted(
            (AT_ONCE if self._frozen else self.moment(("performed", name, owner.id)) for owner in owners),
            key=lambda moment: moment.step,
        )
        once = all(self._is_done_once(name, owner) for owner in owners)
        return Occurrences(key, tuple(moments), None if once else 0, fact)

    def _owners(self, name: str, body: Body | None) -> list[Body] | None:
        """The targets that have an interaction; None if another engine may report an event of this name."""
        if name in ENGINE_EVENTS or (body is not None and body.entity.role != "target"):
            return None
        targets = [body] if body is not None else list(self.outline.bodies.values())
        owners = [each for each in targets if any(spec.name == name for spec in each.entity.interactions)]
        return None if not owners or any(owner.entity.engine != "city" for owner in owners) else owners

    def _is_done_once(self, name: str, owner: Body) -> bool:
        """True if an interaction is finished for good as soon as it was performed: it moves no goods, and works nothing
        off that an event may raise again."""
        specs = [spec for spec in owner.entity.interactions if spec.name == name]
        plain = not any(spec.carried or spec.own or spec.takes or spec.gives for spec in specs)
        return plain and len(specs) == 1

    # interactions

    def status(self, body: Body, word: str) -> Truth:
        """The truth of `body.status == word`."""
        words, key = self.knowledge.status_words(body), ("status", body.id)
        if words is None:
            return Truth(self.clock.always, (), {key: frozenset((word,))})
        if word not in words:
            what = f"nothing gives `{body.id}` the status `{word}`"
            return constant(False, self.clock, Reason(lambda: what, "LJ0612"))
        moment = AT_ONCE
        if words[word]:
            moment = earliest(
                self.moment(
                    ("event", name.removeprefix(EVENT)) if name.startswith(EVENT) else ("performed", name, body.id)
                )
                for name in words[word]
            )
        if word in _UNDER_WAY.get(body.entity.engine, ()) and not any(verb.name == STOP for verb in body.entity.verbs):
            moment = self.moment(("climb", body.id))
        wanted, others = frozenset((word,)), frozenset(words) - {word}
        return Truth(self.clock.since(moment.step), (), {key: wanted}, {key: others}, moment.reason)

    def present(self, target: str) -> Steps:
        """The macro-steps at which a target can be there."""
        body, events = self.outline.bodies[target], self.outline.instance.events
        concerned = [event for event in events if target in event.appear or target in event.vanish]
        if not self._is_timetabled(target):
            return self.clock.since(self._appearance(target).step) if body.entity.dormant else self.clock.always
        there, since_step, steps = not body.entity.dormant, 0, []
        for event in sorted(concerned, key=lambda each: each.tick or 0):
            now = (there or target in event.appear) and target not in event.vanish
            step = (event.tick or 0) * self.clock.per_tick
            if there and not now and step > since_step:
                steps.append((since_step, step - 1))
            if now and not there:
                since_step = step
            there = now
        if there:
            steps.append((since_step, max(since_step, self.clock.last)))
        return tuple(steps)

    def _is_timetabled(self, target: str) -> bool:
        """True if the times at which a target appears and vanishes are known."""
        return all(
            event.is_fixed and event.name not in self.outline.first_ticks
            for event in self.outline.instance.events
            if target in event.appear or target in event.vanish
        )

    def _appearance(self, target: str) -> Moment:
        """The moment at which an absent target can appear."""
        events = [event for event in self.outline.instance.events if target in event.appear]
        return AT_ONCE if self._frozen else earliest(self.moment(("event", event.name)) for event in events)

    def _absent(self, target: str, step: int) -> Moment:
        """The moment of a fact that its target's absence delays to `step`."""
        steps = self.present(target)
        appearance = AT_ONCE if self._is_timetabled(target) else self._appearance(target)
        if appearance.reason is not None and self.outline.bodies[target].entity.dormant:
            return Moment(step, appearance.reason.behind(f"the appearance of `{target}`"))
        appears = next((low for low, _ in steps if low > 0), None)
        if steps and appears is None:
            end = spelled(self.clock.time_s(steps[-1][1] + 1))
            words = f"`{target}` vanishes at {end} s"
        else:
            words = (
                f"`{target}` appears at {spelled(self.clock.time_s(appears or 0))} s"
                if steps
                else (f"`{target}` never appears")
            )
        return Moment(step, Reason(lambda: words, "LJ0613", self.outline.bodies[target].path))

    def emitted(self, name: str, body: Body | None) -> Truth:
        """The truth of a performed interaction."""
        key: Quantity = ("emitted", name, body.id if body is not None else "*")
        owners = self._owners(name, body)
        if owners is None:
            return Truth(self.clock.always, (), {key: YES}, {key: NO})
        truth = since(earliest(self.moment(("performed", name, owner.id)) for owner in owners), self.clock, key)
        return msgspec.structs.replace(truth, if_true={key: YES, ("emitted", name, "*"): YES})

    def _performed(self, name: str, target: str) -> Moment:
        specs = [spec for spec in self.outline.bodies[target].entity.interactions if spec.name == name]
        return earliest(self._finished(spec, target) for spec in specs)

    def _finished(self, spec: InteractionSpec, target: str) -> Moment:
        reached = self.moment(("reached", spec.name, target))
        words = self._steady.get(("status", target))
        if isinstance(words, frozenset) and spec.done_word not in words and not (spec.own or spec.carried):
            return Moment(NEVER, self._barred(("status", target)))
        levelled = spec.works_off or any(state.name in _LEVELS for state in self.outline.bodies[target].entity.state)
        lasting = 0.0 if levelled or spec.lasting_s is None else spec.lasting_s
        step = self.clock.after(reached.step, lasting)
        if step <= self.clock.last and not any(step <= high for _, high in self.present(target)):
            return self._absent(target, NEVER)
        return Moment(step, reached.reason)

    def _reached(self, name: str, target: str) -> Moment:
        """An actor can be within reach of a target with an unlocked interaction."""
        body = self.outline.bodies[target]
        unlocked = self.moment(("unlock", name, target))
        opened = Moment(unlocked.step + 1 if unlocked.step < NEVER else NEVER, unlocked.reason)
        specs = [spec for spec in body.entity.interactions if spec.name == name]
        arrived = earliest(self._visit(spec, body) for spec in specs)
        late = latest((opened, arrived))
        present = self.present(target)
        step = next((max(low, late.step) for low, high in present if late.step <= high), NEVER)
        on_time = step == late.step or late.step > self.clock.last
        moment = Moment(step, late.reason) if on_time else self._absent(target, step)
        return Moment(moment.step, moment.reason and moment.reason.behind(_shown(("reached", name, target))))

    def _visit(self, spec: InteractionSpec, target: Body) -> Moment:
        actors = self.outline.actors(spec)
        if not actors:
            words = f"no asset has the engine or role `{spec.by}`"
            return self._never(words, "LJ0612", target.path)
        return earliest(self.near(actor, target, spec.within_m, self._mirror_m(actor)) for actor in actors)

    def _mirror_m(self, actor: Body) -> float:
        """The largest error of an actor's place in the engine of its target, metres."""
        return actor.speed_mps * (_MIRROR_S + self.clock.sync_s)

    def _unlock(self, name: str, target: str) -> Moment:
        group = self.outline.bodies[target].entity.group
        unlocks = [each for each in self.outline.instance.unlocks if each.interaction == name]
        concerned = [each for each in unlocks if each.parameters and each.parameters[0].domain == group]
        if not concerned:
            return AT_ONCE
        return earliest(self._unlocked(unlock, target) for unlock in concerned)

    def _unlocked(self, unlock: Unlock, target: str) -> Moment:
        names: dict[str, Value] = {unlock.parameters[0].name: self.outline.bodies[target]}
        choices = [names]
        for place, parameter in enumerate(unlock.parameters[1:]):
            members: Iterable[Value] = self.outline.groups.get(parameter.domain, ())
            if parameter.domain in self.outline.kinds:
                members = (Message(parameter.domain, f"*{place}"),)
            choices = [{**each, parameter.name: member} for each in choices for member in members]
        truths = [self.truth(unlock.condition, each, early=True) for each in choices]
        return self._at_boundary(disjunction(truths, self.clock), f"unlock/{unlock.interaction}")

    def _changing(self, body: Body, field: str, low: float, high: float) -> Moment:
        """The moment at which a state can lie between two bounds."""
        state, start = body.entity.state_of(field), body.bounds(field)
        if state is None or (start.high >= low and start.low <= high):
            return AT_ONCE
        raised = low > start.high
        if raised and state.name in _LEVELS:
            return AT_ONCE
        ways = [
            self.moment(("reached", spec.name, body.id))
            for spec in body.entity.interactions
            if not raised and spec.own == state.name
        ]
        for owner in self.outline.bodies.values():
            for spec in owner.entity.interactions:
                changes = spec.gives == state.name if raised else spec.takes and spec.source == state.name
                if changes and any(actor.id == body.id for actor in self.outline.actors(spec)):
                    ways.append(self.moment(("reached", spec.name, owner.id)))
        if not raised and state.name in _LEVELS:
            ways += [
                self.moment(("reached", spec.name, body.id)) for spec in body.entity.interactions if not spec.carried
            ]
        if (body.id, field) in self.outline.set_fields:
            ways += [
                self.moment(("event", event.name))
                for event in self.outline.instance.events
                if any((change.entity, change.field) == (body.id, field) for change in event.changes)
            ]
        return earliest(ways) if ways else AT_ONCE

    # rules and assignments

    def rule(self, call: ex.Call, values: list[Value]) -> Truth:
        """The truth of a rule's event."""
        rule = self._rules.get(call.function)
        ids = [_id_of(value) for value in values]
        if rule is None or len(rule.parameters) != len(values) or None in ids:
            return unknown(self.clock)
        key: Quantity = ("achieved", rule.name, *ids)
        if self._frozen:
            return Truth(self.clock.always, (), {key: YES}, {key: NO})
        general = ("achieved", rule.name, *("" if isinstance(value, Message) else str(value.id) for value in values))
        moment = self.moment(general)
        truth = since(moment, self.clock, key)
        certain = self._certain.get(general, NEVER)
        implied = {_with_marks(of, values): extent for of, extent in self._implied.get(general, {}).items()}
        return msgspec.structs.replace(truth, must=self.clock.since(certain), if_true={**implied, key: YES})

    def _achieved(self, name: str, *ids: str) -> Moment:
        rule = self._rules[name]
        names: dict[str, Value] = {}
        sent: list[Moment] = []
        for place, (parameter, entity) in enumerate(zip(rule.parameters, ids, strict=True)):
            if entity:
                names[parameter.name] = self.outline.bodies[entity]
            else:
                names[parameter.name] = Message(parameter.domain, f"*{place}")
                sent.append(self.message(parameter.domain))
        truth = self.truth(rule.condition, names)
        truth = conjunction((truth, *(since(each, self.clock) for each in sent)), self.clock)
        lasts = lasting(truth.if_true)  # the fields of a message never change
        self._implied["achieved", name, *ids] = {
            key: extent
            for key, extent in truth.if_true.items()
            if (key[0] in ("field", SENT) if _is_of_message(key) else key in lasts)
        }
        too_long = self._too_long(truth)
        if too_long is not None:
            return too_long
        if all(ids) and not rule.matching:
            self._certain[("achieved", name, *ids)] = self.clock.first_boundary(truth.must)
        reason = truth.reason or truth.ends
        if reason is not None and not reason.at:
            reason = msgspec.structs.replace(reason, at=f"rule/{name}")
        return Moment(first(truth.may), reason and reason.behind(_shown(("achieved", name, *ids))))

    def _too_long(self, truth: Truth) -> Moment | None:
        """Never, if a message with the texts that a rule requires exceeds the payload."""
        lengths: dict[tuple[object, str], dict[str, int]] = {}
        for key, words in truth.if_true.items():
            if key[0] == "field" and isinstance(words, frozenset):
                lengths.setdefault((key[1], str(key[2])), {})[str(key[3])] = min(len(word.encode()) for word in words)
        instance = self.outline.instance
        for (_, kind), texts in lengths.items():
            spec = next((each for each in instance.messages if each.kind == kind), None)
            least = 0 if spec is None else least_bytes(spec, instance, texts)
            if least > instance.comms.payload_bytes:
                words_of = f"such a `{kind}` has at least {least} bytes"
                payload = f"the payload of a message is {instance.comms.payload_bytes} bytes"
                return self._never(f"{words_of}, and {payload}", "LJ0605", f"message/{kind}")
        return None

    def assigned(self, asset: Body, target: Body) -> Truth:
        """The truth of an assignment."""
        return since(self.moment(("handover", asset.id)), self.clock, ("assigned", asset.id, target.id))

    def _handover(self, asset: str) -> Moment:
        """A destination of the asset can have been commanded or sent."""
        body = self.outline.bodies[asset]
        ways = [
            self.moment(("command", asset, verb.name))
            for verb in body.entity.verbs
            if {"x", "y"} <= {argument.name for argument in verb.arguments}
        ]
        ordered = earliest(ways)
        sent = [self.message(spec.kind) for spec in self.outline.instance.messages if spec.category == "assignment"]
        commanded = Moment(ordered.step + self.clock.per_tick if ordered.step < NEVER else NEVER, ordered.reason)
        moment = earliest((commanded, *sent))
        return Moment(moment.step, moment.reason and moment.reason.behind(_shown(("handover", asset))))


def _body_of(value: Value) -> Body | None:
    return value if isinstance(value, Body) else getattr(value, "body", None)


def _met(goal: Body, mover: Body) -> Body:
    """The goal of a mover. A goal that only the mover can take along stays until the mover meets it."""
    return msgspec.structs.replace(goal, aboard=frozenset()) if goal.aboard == {mover.id} else goal


def _of_any_message(extents: Extents) -> Extents:
    """The extents, with each event that has happened for a certain message as one that has happened for some."""
    general = {
        tuple("*" if str(part)[:1] in ("#", "*") else part for part in key): extent
        for key, extent in extents.items()
        if extent == YES
    }
    return {**general, **extents}


def _is_of_message(key: Quantity) -> bool:
    """True if a quantity is about one certain message."""
    return any(str(part)[:1] in ("#", "*") and part != "*" for part in key)


def _with_marks(key: Quantity, values: list[Value]) -> Quantity:
    """A field of the message of a rule's parameter (`*1`) as that of the message that a call names."""
    if not _is_of_message(key):
        return key
    of, mark, kind, name = key
    message = values[int(str(mark)[1:])]
    return of, message.mark if isinstance(message, Message) else mark, kind, name


def _shown(fact: Fact) -> str:
    """A fact in a message."""
    kind, *of = fact
    if kind == "command":
        return f"`{of[0]}.{of[1]}`"
    if kind in ("performed", "reached", "unlock"):
        return f"`{of[0]}` of `{of[1]}`"
    if kind == "achieved":
        return f"`{of[0]}({', '.join(name for name in of[1:] if name)})`"
    if kind == "event":
        return f"the event `{of[0]}`"
    nouns = {
        "motion": "the motion of",
        "climb": "the motion of",
        "picture": "a picture of",
        "photo": "a picture by",
        "report": "a",
    }
    return f"{nouns.get(kind, 'an assignment of')} `{of[0]}`"


def _counts(limit: LimitSpec, body: str, verb: str) -> bool:
    """True if a limit counts a command."""
    return any(item.kind == "command" and item.resource == body and item.name in ("", verb) for item in limit.counts)


def _loose_m(body: Body) -> float:
    """The distance by which a body can be displaced without the time of a way: by its carrier, or as it climbs."""
    return (body.aboard_m if body.aboard else 0.0) + body.sway_m


def _id_of(value: Value) -> str | None:
    """The id of a body, or the mark of a message; None for other values."""
    match value:
        case Body():
            return value.id
        case Message(mark=mark):
            return mark
    return None


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
