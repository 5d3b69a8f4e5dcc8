"""`oracle`: plays with the truth, to show that a mission can be won and how fast. Privileged; the trace says so.

Searchers share the targets out, fly straight above them, take a picture and report the exact box and position. The
vessel sails the shortest tour at once, without waiting for the reports. Which agent does what follows from its
abilities, as in `heuristic`.
"""

from __future__ import annotations

import math
from itertools import islice, pairwise, permutations

from lingjing.plugins.policy import (
    Action,
    BodyState,
    Brief,
    Datum,
    Decision,
    Entity,
    EntityView,
    FrameInfo,
    Inbox,
    Observation,
    Outgoing,
    Privileged,
    Resource,
    UsageError,
)
from lingjing_agents.capability import compose, flying_camera, may_send, nadir_camera, team, vessel

Place = tuple[float, float]

HEIGHT_M = 40.0
"""Above the water: low enough for a clear box, high enough for a target that drifts while the vehicle flies."""
NEAR_M = 8.0
STOP_SHORT_M = 30.0
"""A rescue works from 50 m: the vessel need not go all the way."""
MAX_TOURS = 720
PATIENCE_TICKS = 3
"""A report is adjudicated one boundary after it was sent and seen to be one later; after that it is sent again."""


class OraclePolicy:
    """One mind for every role; what is left to do is read from the truth at each tick."""

    async def reset(self, brief: Brief) -> None:
        """Look up what this agent can do."""
        self._brief = brief
        self._camera, self._boat = flying_camera(brief), vessel(brief)
        self._report, self._assignment = may_send(brief, "report"), may_send(brief, "assignment")
        self._first: dict[str, tuple[Place, float]] = {}
        self._told: dict[str, int] = {}

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Search, sail or keep still. `UsageError` if the truth was not handed over."""
        truth = observation.privileged
        if truth is None:
            raise UsageError("policy `oracle` was given no privileged observation", hint="declare it as privileged")
        for state in truth.states:
            self._first.setdefault(state.id, (state.position[:2], observation.time_s))
        if self._camera is not None:
            return self._search(observation, truth, self._camera)
        if self._boat is not None:
            return Decision(command=self._sail(observation, truth, self._boat))
        return Decision()

    # -- searchers

    def _search(self, observation: Observation, truth: Privileged, body: Resource) -> Decision:
        matched, now = _matched(truth), observation.tick
        told = {name for name, tick in self._told.items() if now - tick < PATIENCE_TICKS}
        targets = tuple(entity for entity in _targets(truth) if entity.id not in matched | told)
        messages: tuple[Outgoing, ...] = ()
        for frame in truth.frames:
            if frame.entity == body.id:
                messages += self._tell(frame, truth, targets, now)
        own = _state(truth, body.id)
        mine = [entity for entity in self._share(truth, targets) if self._told.get(entity.id) != now]
        if own is None or _busy(observation, body.id) or not mine:
            return Decision(messages=messages)
        return Decision(command=self._above(observation, truth, body, own, mine[0]), messages=messages)

    def _tell(
        self, frame: FrameInfo, truth: Privileged, targets: tuple[Entity, ...], tick: int
    ) -> tuple[Outgoing, ...]:
        messages: list[Outgoing] = []
        wanted = {entity.id for entity in targets}
        for box in frame.boxes:
            state = _state(truth, box.entity)
            if box.entity not in wanted or state is None or self._report is None:
                continue
            self._told[box.entity] = tick
            body: dict[str, Datum] = {
                "frame": frame.id,
                "class": box.cls,
                "box": box.box,
                "position": state.position,
                "confidence": 1.0,
            }
            messages.append(compose(self._report, body))
            messages.extend(self._hand_over(truth, state))
        return tuple(messages)

    def _hand_over(self, truth: Privileged, state: BodyState) -> tuple[Outgoing, ...]:
        rescuers = [peer.id for peer in self._brief.peers if any(_can_sail(truth, name) for name in peer.resources)]
        if self._assignment is None or not rescuers:
            return ()
        body: dict[str, Datum] = {"assignee": rescuers[0], "task": "rescue", "position": state.position}
        return (compose(self._assignment, body),)

    def _share(self, truth: Privileged, targets: tuple[Entity, ...]) -> tuple[Entity, ...]:
        """The targets this searcher looks at: each, in the vessel's order, goes to who would be there first."""
        peers = {peer.id: peer.resources for peer in self._brief.peers}
        bodies = {name: peers.get(name, (self._camera.id,) if self._camera else ()) for name in team(self._brief)}
        starts = {name: _state(truth, resources[0]) for name, resources in bodies.items() if resources}
        free = {name: (0.0, state.position[:2]) for name, state in starts.items() if state is not None}
        mine: list[Entity] = []
        for entity in self._tour(truth, targets):
            there = _place(truth, entity)
            name = min(free, key=lambda name: (free[name][0] + math.dist(free[name][1], there), name))
            free[name] = free[name][0] + math.dist(free[name][1], there), there
            if name == self._brief.agent:
                mine.append(entity)
        return tuple(mine)

    def _above(
        self, observation: Observation, truth: Privileged, body: Resource, own: BodyState, target: Entity
    ) -> Action:
        x, y = _place(truth, target)
        z = max(self._brief.water_level_m + HEIGHT_M, _lowest(body))
        camera = nadir_camera(body)
        assert camera is not None
        if math.dist(own.position, (x, y, z)) <= NEAR_M:
            return Action(verb="takePhoto", arguments={"camera": camera.name}, resource=body.id)
        east, north = self._drift(truth, target, observation.time_s)
        lead_s = min(60.0, math.dist(own.position[:2], (x, y)) / 8.0)
        arguments: dict[str, Datum] = {"x": x + lead_s * east, "y": y + lead_s * north, "z": z}
        return Action(verb="setDestination", arguments=arguments, resource=body.id)

    # -- the vessel

    def _sail(self, observation: Observation, truth: Privileged, body: Resource) -> Action | None:
        own = _state(truth, body.id)
        waiting = tuple(entity for entity in _targets(truth) if not _rescued(truth, entity))
        if own is None or _busy(observation, body.id) or not waiting:
            return None
        here = own.position[:2]
        tour = self._tour(truth, waiting)
        east, north = self._drift(truth, tour[0], observation.time_s)
        x, y = _place(truth, tour[0])
        lead_s = max(0.0, math.dist(here, (x, y)) - STOP_SHORT_M) / _speed(body)
        there = x + lead_s * east, y + lead_s * north
        onward = _place(truth, tour[1]) if len(tour) > 1 else here
        goal = _stop(here, there, onward)
        if math.dist(here, (x, y)) <= STOP_SHORT_M + NEAR_M:
            return None  # close enough: the report or the engine's next step is what is missing
        return Action(verb="moveTo", arguments={"x": goal[0], "y": goal[1]}, resource=body.id)

    def _tour(self, truth: Privileged, targets: tuple[Entity, ...]) -> tuple[Entity, ...]:
        """The shortest open tour of the vessel over the targets; the first `MAX_TOURS` orders are tried."""
        boats = [state for state in truth.states if _can_sail(truth, state.id)]
        if not boats:
            return targets
        start = boats[0].position[:2]

        def length(order: tuple[Entity, ...]) -> float:
            places = [start, *(_place(truth, entity) for entity in order)]
            return sum(math.dist(a, b) for a, b in pairwise(places))

        return min(islice(permutations(targets), MAX_TOURS), key=length)

    def _drift(self, truth: Privileged, entity: Entity, time_s: float) -> Place:
        """Mean velocity (east, north; m/s) since the episode began; the water's current before anything has moved."""
        (x, y), since = self._first[entity.id]
        if time_s - since < self._brief.tick_s:
            bearing = math.radians(self._brief.weather.current_to_deg)
            return self._brief.weather.current_mps * math.sin(bearing), self._brief.weather.current_mps * math.cos(
                bearing
            )
        here = _place(truth, entity)
        return (here[0] - x) / (time_s - since), (here[1] - y) / (time_s - since)


def _targets(truth: Privileged) -> tuple[Entity, ...]:
    return tuple(entity for entity in truth.instance.entities if entity.role == "target")


def _state(truth: Privileged, entity: str) -> BodyState | None:
    return next((state for state in truth.states if state.id == entity), None)


def _place(truth: Privileged, entity: Entity) -> Place:
    state = _state(truth, entity.id)
    return state.position[:2] if state is not None else entity.position[:2]


def _matched(truth: Privileged) -> frozenset[str]:
    """Targets that a report has been matched with, by whatever rule of the mission does that."""
    rules = {rule.name for rule in truth.instance.rules if rule.matching}
    return frozenset(name for rule, binding in truth.achieved if rule in rules for name in binding)


def _rescued(truth: Privileged, entity: Entity) -> bool:
    state = _state(truth, entity.id)
    return (state is not None and state.status == "rescued") or any(
        rule.startswith("rescue") and entity.id in binding for rule, binding in truth.achieved
    )


def _can_sail(truth: Privileged, entity: str) -> bool:
    return any(
        each.id == entity and any(verb.name == "moveTo" for verb in each.verbs) for each in truth.instance.entities
    )


def _busy(observation: Observation, entity: str) -> bool:
    view: EntityView | None = next((view for view in observation.entities if view.id == entity), None)
    return view is not None and bool(view.busy)


def _stop(here: Place, there: Place, onward: Place) -> Place:
    """Where within `STOP_SHORT_M` of `there` the way from `here` to `onward` is shortest."""
    rim = [math.tau * step / 24 for step in range(24)]
    options = [(there[0] + STOP_SHORT_M * math.cos(a), there[1] + STOP_SHORT_M * math.sin(a)) for a in rim]
    return min(options, key=lambda point: math.dist(here, point) + math.dist(point, onward))


def _speed(body: Resource) -> float:
    speed = body.properties.get("speed_mps")
    return float(speed) if isinstance(speed, (int, float)) and speed > 0 else 3.0


def _lowest(body: Resource) -> float:
    low = body.properties.get("band_low_m")
    return float(low) if isinstance(low, (int, float)) else 0.0
