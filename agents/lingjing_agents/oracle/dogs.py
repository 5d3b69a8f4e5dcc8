"""Dogs: paths around obstacles to the targets that dogs serve, step by step."""

from __future__ import annotations

import math

from lingjing.plugins.geometry import bearing_deg, offset_xy, turn_deg
from lingjing.plugins.policy import DEAD, PHOTO, Action, Brief, CameraSpec, Datum, Entity, Outgoing, VerbSpec
from lingjing.plugins.tasks import Task, entry_regions
from lingjing.plugins.terrain import ObstacleMap, obstacle_map
from lingjing_agents.capability import first_argument_bounds, walks
from lingjing_agents.ground_plane import GroundPoint, distance_to_segment_m, inside
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.reporting import ReportAbility
from lingjing_agents.paths.clearance_paths import find_path
from lingjing_agents.paths.visiting_order import shares, shortest

AROUND_M = 50.0
"""Distance in metres by which a detour may leave the straight line. Chosen."""

REACHED_M = 0.8
"""Distance in metres at which a corner of a path counts as reached. Chosen."""
SEEN_M = (4.0, 14.0)
"""Nearest and farthest distance in metres from which a dog photographs a target. Chosen."""

AIMED_DEG = 12.0
"""Largest bearing error in degrees for a picture. Chosen."""
_LOOKS = 3
"""Number of pictures of one target from one place. Chosen."""
_BEFORE_M = 6.0
"""Distance in metres before a target's front from which a dog photographs it after pictures in vain. Chosen."""
_FINEST_DEG, _COARSEST_DEG, _STRAY_M = 1.6, 12.0, 0.4
"""Bounds in degrees of the tolerated heading error, and the tolerated deviation at the end of a step in metres.
Chosen.
"""
_GAINED_M = 0.3
"""Progress in metres below which a step counts as blocked. Chosen."""
_WITHIN_M = 1.0
"""Distance in metres behind the edge of a required region at which a dog stops. Chosen."""


class DogPath:
    """The path of one dog. It is planned again when the task changes or an obstacle is met."""

    def __init__(self, dog: Entity, plan: InstanceIndex) -> None:
        self.dog, self._plan = dog, plan
        self._map: tuple[GroundPoint, ObstacleMap] | None = None
        self._path: list[GroundPoint] = []
        self._goal = ""
        self._shut: list[GroundPoint] = []
        self._last: tuple[GroundPoint, float] | None = None
        self._inner_m: dict[str, float] = {}
        self._beyond: list[GroundPoint] = []

    def task(self, truth: PrivilegedState) -> Task | None:
        """Return the task of this dog, or None."""
        tasks = {task.target: task for task in truth.tasks_of(self.dog.id) if not task.moves_goods}
        if not tasks:
            return None
        places = {name: truth.place(name) for name in tasks}
        bodies = {body.id: truth.place(body.id) for body in self._plan.able(*tasks.values())}
        bodies = {name: place for name, place in bodies.items() if truth.states[name].status != DEAD}
        if len(bodies) < 2:
            return tasks[shortest(truth.place(self.dog.id), places)[0]]
        order = sorted(places, key=lambda name: min(math.dist(places[name], place) for place in bodies.values()))
        mine = shares(bodies, order, places).get(self.dog.id, [])
        if mine:
            return tasks[mine[0]]
        return tasks[min(places, key=lambda name: math.dist(places[name], truth.place(self.dog.id)))]

    def step(self, truth: PrivilegedState, task: Task) -> tuple[str, float] | None:
        """Return `left` or `right` with degrees, or `forward` with metres; None if the dog is near enough."""
        here, goal = truth.place(self.dog.id), truth.place(task.target)
        near = self._near_m(task)
        if math.dist(here, goal) <= near + 0.3 and (task.target in self._inner_m or not self._is_outside(task, here)):
            return None
        self._look_back(truth, here)
        if self._goal != task.target or not self._path:
            self._goal = task.target
            self._path = self._way(truth, task, here, goal)
        while len(self._path) > 1 and math.dist(here, self._path[0]) <= REACHED_M:
            self._path.pop(0)
        return self._towards(truth, here, self._path[0])

    def step_to(self, truth: PrivilegedState, place: GroundPoint, near_m: float) -> tuple[str, float] | None:
        """Return the next step to a place without a task there; None on arrival."""
        here = truth.place(self.dog.id)
        if math.dist(here, place) <= near_m:
            return None
        self._look_back(truth, here)
        if self._goal != f"{place}" or not self._path:
            self._goal = f"{place}"
            self._path = self._find(truth, here, place, near_m) or [place]
        while len(self._path) > 1 and math.dist(here, self._path[0]) <= REACHED_M:
            self._path.pop(0)
        return self._towards(truth, here, self._path[0])

    def _near_m(self, task: Task) -> float:
        """Return the distance from the target at which the dog stops, in metres."""
        return self._inner_m.get(task.target, max(0.6 * task.within_m, task.within_m - 4.0))

    def _way(self, truth: PrivilegedState, task: Task, here: GroundPoint, goal: GroundPoint) -> list[GroundPoint]:
        """Return the path to a place where the task can be done.

        The dog may have to be in a region. A path that ends near the target but outside the region (behind its wall) is
        replaced by a path into the region.
        """
        path = self._find(truth, here, goal, self._near_m(task))
        if task.target not in self._inner_m and self._is_outside(task, path[-1] if path else here):
            self._inner_m[task.target] = min(self._near_m(task), self._depth_m(task, goal))
            rims = [region.polygon for region in entry_regions(task, self._plan.instance)]
            self._beyond = [corner for rim in rims for corner in rim]
            self._map = None
            path = self._find(truth, here, goal, self._near_m(task))
        return path or [goal]

    def _is_outside(self, task: Task, here: GroundPoint) -> bool:
        """Return whether a place is outside a region in which the dog must be for its task."""
        return any(not inside(region.polygon, here) for region in entry_regions(task, self._plan.instance))

    def _depth_m(self, task: Task, goal: GroundPoint) -> float:
        """Return the distance in metres from the target within which the dog is in those regions; 0 if the target is
        outside.
        """
        rims = [region.polygon for region in entry_regions(task, self._plan.instance)]
        if not all(inside(rim, goal) for rim in rims):
            return 0.0
        edges = (pair for rim in rims for pair in zip(rim, (*rim[1:], rim[0]), strict=True))
        return max(min(distance_to_segment_m(goal, *edge) for edge in edges) - _WITHIN_M, 0.0)

    def _towards(self, truth: PrivilegedState, here: GroundPoint, there: GroundPoint) -> tuple[str, float] | None:
        length = math.dist(here, there)
        if length < 0.2:
            self._path = []
            return None
        least, most = first_argument_bounds(self.dog.verbs, "forward")
        step = min(length, most)
        turn = turn_deg(truth.states[self.dog.id].heading_deg, bearing_deg(here, there))
        if abs(turn) > min(max(math.degrees(math.atan(_STRAY_M / step)), _FINEST_DEG), _COARSEST_DEG):
            verb = "right" if turn > 0.0 else "left"
            return verb, min(abs(turn), first_argument_bounds(self.dog.verbs, verb)[1])
        return "forward", max(step, least)

    def command(self, truth: PrivilegedState, step: tuple[str, float]) -> Action:
        """Return a step as a command."""
        verb, amount = step
        if verb == "forward":
            here = truth.place(self.dog.id)
            self._last = here, math.radians(truth.states[self.dog.id].heading_deg)
        else:
            self._last = None
        spec = self._verb(verb)
        name = spec.arguments[0].name if spec is not None and spec.arguments else "distance"
        arguments: dict[str, Datum] = {name: round(amount, 3)}
        return Action(verb=verb, arguments=arguments, resource=self.dog.id)

    def _look_back(self, truth: PrivilegedState, here: GroundPoint) -> None:
        """Check the progress of the last step. A step without progress met an obstacle that no map shows: close its
        place.
        """
        if self._last is None:
            return
        (x, y), heading = self._last
        self._last = None
        gained = math.dist((x, y), here)
        if gained < _GAINED_M:
            self._shut = [*self._shut[-7:], (here[0] + 1.3 * math.sin(heading), here[1] + 1.3 * math.cos(heading))]
            self._path = []
        elif self._path and math.dist(here, self._path[0]) > REACHED_M and len(self._path) > 1:
            self._goal = ""  # the dog deviated or was stopped half-way: plan again from here

    def _find(self, truth: PrivilegedState, here: GroundPoint, goal: GroundPoint, within_m: float) -> list[GroundPoint]:
        ground = self._ground(truth, here, goal)
        if ground is None:
            return []
        return find_path(ground, here, goal, within_m, self._shut) or find_path(ground, here, goal, within_m)

    def _ground(self, truth: PrivilegedState, here: GroundPoint, goal: GroundPoint) -> ObstacleMap | None:
        if truth.known.city is None:
            return None
        if self._map is None or self._map[0] != goal:
            eastings, northings = zip(here, goal, *self._beyond, strict=True)
            west, east, south, north = min(eastings), max(eastings), min(northings), max(northings)
            bounds = west - AROUND_M, south - AROUND_M, east + AROUND_M, north + AROUND_M
            self._map = goal, obstacle_map(truth.known.city, bounds)
        return self._map[1]

    def _verb(self, name: str) -> VerbSpec | None:
        return next((verb for verb in self.dog.verbs if verb.name == name), None)


class _DogAbility(Ability):
    """Commands one dog: by its own path, or by guidance if the dog has no camera."""

    def __init__(
        self, walk: DogPath, plan: InstanceIndex, composer: MessageComposer, reports: ReportAbility | None
    ) -> None:
        self._walk, self._plan, self._composer, self._reports = walk, plan, composer, reports
        self._camera = _front(walk.dog)
        self._looks: dict[str, int] = {}
        self._fronts: set[str] = set()
        self._heard = 0

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return a status message whenever the dog's task changes."""
        task = self._walk.task(truth)
        position = truth.states[self._walk.dog.id].position
        return self._composer.progress(self._walk.dog.id, task, {"position": position})

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return a picture of a target that must be reported, else the next step."""
        dog = self._walk.dog
        task = self._walk.task(truth)
        self.aim = task.target if task is not None else ""
        guidance = _guidance(truth)
        if guidance is not None:
            self._heard = truth.tick
        if task is None or truth.busy(dog.id) or truth.forbidden(dog.id, "forward"):
            return None
        photo = self._photo(truth, task.target)
        if photo is not None:
            return photo
        if self._led(truth):
            return self._walk.command(truth, guidance) if guidance is not None else None
        step = self._walk.step(truth, task) or self._view_step(truth, task.target)
        return self._walk.command(truth, step) if step is not None else None

    def _view_step(self, truth: PrivilegedState, target: str) -> tuple[str, float] | None:
        """Return the next step of a dog that is near enough to a target, of which it still needs a picture.

        It turns to the target. After pictures that did not show the target it goes before the target's front.
        """
        if self._camera is None or self._reports is None or target not in self._reports.open(truth):
            return None
        state, dog = truth.states[target], truth.states[self._walk.dog.id]
        if self._looks.get(target, 0) >= _LOOKS and target not in self._fronts:
            step = self._walk.step_to(truth, offset_xy(state.position, state.heading_deg, _BEFORE_M), 1.0)
            if step is not None:
                return step
            self._fronts.add(target)
            self._looks[target] = 0
        off = turn_deg(dog.heading_deg, bearing_deg(dog.position, state.position))
        if abs(off) <= AIMED_DEG:
            return None
        verb = "right" if off > 0.0 else "left"
        return verb, min(abs(off), first_argument_bounds(self._walk.dog.verbs, verb)[1])

    def _led(self, truth: PrivilegedState) -> bool:
        """Return whether another agent still guides this dog, which has no camera."""
        if self._walk.dog.cameras:
            return False
        kinds = [spec for spec in truth.brief.messages if _is_guidance({field.name for field in spec.fields})]
        led = [spec.kind for spec in kinds if spec.is_for(truth.brief.role)]
        return any(_left(truth, kind) > 0 for kind in led) or (bool(led) and truth.tick - self._heard < _WAIT_TICKS)

    def _photo(self, truth: PrivilegedState, target: str) -> Action | None:
        if self._camera is None or self._reports is None or target not in self._reports.open(truth):
            return None
        dog = truth.states[self._walk.dog.id]
        far = truth.distance(dog.id, target)
        off = turn_deg(dog.heading_deg, bearing_deg(dog.position, truth.place(target)))
        if not SEEN_M[0] <= far <= SEEN_M[1] or abs(off) > AIMED_DEG or self._looks.get(target, 0) >= _LOOKS:
            return None
        self._looks[target] = self._looks.get(target, 0) + 1
        return Action(verb=PHOTO, arguments={"camera": self._camera.name}, resource=dog.id)


class _GuidanceAbility(Ability):
    """Sends the next step to a dog of another agent."""

    def __init__(self, walk: DogPath, plan: InstanceIndex, composer: MessageComposer, kind: str) -> None:
        self._walk, self._plan, self._composer, self._kind = walk, plan, composer, kind
        self._sent = -_EVERY_TICKS
        self._said: tuple[str, float] | None = None

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return the next step as soon as the last one has been carried out."""
        dog, task = self._walk.dog, self._walk.task(truth)
        standing = truth.states[dog.id].status == "standing"
        if task is None or not standing or truth.forbidden(dog.id, "forward"):
            return []
        if truth.tick - self._sent < _EVERY_TICKS or _left(truth, self._kind) <= 0:
            return []
        step = self._walk.step(truth, task)
        if step is None:
            return []
        self._walk.command(truth, step)  # stores the step, so that `_look_back` can check its progress
        self._sent, self._said = truth.tick, step
        owner = self._plan.owners[dog.id].id
        place = truth.states[task.target].position
        body: dict[str, Datum] = {
            "assignee": owner, "step": step[0], "amount": round(step[1], 2), "position": place,
        }  # fmt: skip
        return self._composer.say(self._kind, body, (owner,))


_EVERY_TICKS = 2
"""Least ticks between two messages of guidance. Chosen."""
_WAIT_TICKS = 4
"""Ticks without guidance after which a dog walks by itself. Chosen."""


def dog_abilities(
    brief: Brief, plan: InstanceIndex, composer: MessageComposer, reports: ReportAbility | None
) -> list[Ability]:
    """Return an ability for each embodied dog, and guidance for dogs of others if the agent may send it."""
    abilities: list[Ability] = []
    own = {resource.id for resource in brief.resources if resource.embodied}
    message = composer.with_fields("assignee", "step")
    for entity in plan.instance.entities:
        if entity.role != "asset" or not walks(entity.verbs) or entity.id not in plan.owners:
            continue
        if entity.id in own:
            abilities.append(_DogAbility(DogPath(entity, plan), plan, composer, reports))
        elif message is not None and brief.resources:
            abilities.append(_GuidanceAbility(DogPath(entity, plan), plan, composer, message.kind))
    return abilities


def _guidance(truth: PrivilegedState) -> tuple[str, float] | None:
    """Return the step in the latest message of guidance, or None."""
    for message in reversed(truth.inbox.messages):
        step, amount = message.body.get("step"), message.body.get("amount")
        if isinstance(step, str) and isinstance(amount, int | float):
            return step, float(amount)
    return None


def _is_guidance(fields: set[str]) -> bool:
    return fields.issuperset({"assignee", "step"})


def _left(truth: PrivilegedState, kind: str) -> int:
    """Return how many more messages of a kind the mission's limits allow."""
    bounds = [
        limit.most - truth.known.used.get(limit.name, 0)
        for limit in truth.plan.instance.limits
        if any(counted.kind == "message" and counted.name == kind for counted in limit.counts)
    ]
    return min(bounds, default=1)


def _front(dog: Entity) -> CameraSpec | None:
    able = any(verb.name == PHOTO for verb in dog.verbs)
    return next((camera for camera in dog.cameras if camera.view == "front"), None) if able else None
