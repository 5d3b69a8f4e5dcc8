"""The driver of an environment client: each tick an offset for each body that moves, then poses.

The protocol has one motion, a displacement in the plane. A destination is approached by offsets that the body's speed
allows in a tick, so a foreign body is not faster than one of ours. Heights, turns and landings have no message.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.engines.remote.link import Link, Request
from lingjing.engines.remote.messages import Document, Profile, failure_of
from lingjing.engines.remote.poses import Bodies, Names, poses_in
from lingjing.errors import InfrastructureError
from lingjing.mission.frames import to_unreal
from lingjing.mission.instance import Entity
from lingjing.plugins.engine import Boundary
from lingjing.plugins.requests import STOP, Refusal, Requests, number
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent

ARRIVED_M = 1.0
"""A body counts as arrived within this distance in the plane, metres (chosen)."""
_USUAL_MPS = 10.0
"""Speed of a body with a type that declares none, m/s (chosen)."""
_SPEEDS = ("cruise_mps", "speed_mps")
_MOST_STUCK = 5
"""Offsets without progress after which a request ends (chosen)."""
_PROGRESS_M = 0.05
"""Least approach of an offset that counts as progress, metres (chosen)."""
_COURSES = {"forward": 0.0, "right": 90.0, "backward": 180.0, "left": 270.0}
"""Angle of each move from the heading, degrees clockwise."""
_HEIGHTS = ("up", "down")


@dataclass
class _Goal:
    """The goal of a body's request."""

    place: tuple[float, float]
    length_m: float
    """The distance at its start."""
    stuck: int = 0


class OffsetsDriver:
    """Moves bodies by offsets."""

    def __init__(
        self, link: Link, engine: str, profile: Profile, bodies: Bodies, names: Names, *, reply_s: float, act_s: float
    ) -> None:
        """`reply_s`, `act_s`: the deadlines of observations and of actions, wall-clock seconds."""
        self._link, self._engine, self._profile = link, engine, profile
        self._bodies, self._names = bodies, names
        self._reply_s, self._act_s = reply_s, act_s
        self._requests = Requests(engine)
        self._goals: dict[str, _Goal] = {}
        self._events: list[TaskEvent] = []
        self._time_s = 0.0

    def reset(self) -> Boundary:
        """Return boundary 0, from the first observation."""
        seen = self._observe("reset", 0.0)
        missing = [entity.id for entity in self._bodies.entities if entity.id not in seen]
        if missing:
            alone = not self._profile.bodies and len(self._bodies.entities) > 1
            hint = "its profile reports one body: an engine for several answers as delivery or fire_rescue"
            message = f"the session's first observation has no pose of {', '.join(missing)}"
            raise InfrastructureError(message, hint=hint if alone else "")
        return self._boundary(0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit the commands that offsets can express."""
        return tuple(self._admit(command) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState], *, observes: bool) -> Boundary:
        """Advance to `until`. With `observes`, offsets are sent and poses requested; else bodies stand."""
        if observes:
            passed = until - self._time_s
            self._act(passed)
            self._link.pause(until)
            self._observe("step", until)
            self._judge(until, passed)
            self._time_s = until
        return self._boundary(until)

    def _admit(self, command: Command) -> Receipt:
        if command.verb == STOP:
            self._goals.pop(command.resource, None)
            return self._stop(command)
        return self._requests.admit(command, self._time_s, self._examine)

    def _stop(self, command: Command) -> Receipt:
        self._requests.fail(command.resource, self._time_s, "preempted", f"`stop` {command.id} took over")
        return self._requests.answer(command, self._time_s, lambda _: None)

    def _examine(self, command: Command) -> None:
        """Set the goal of a command. Raises `Refusal`."""
        state = self._bodies.states[command.resource]
        east, north = state.position[0], state.position[1]
        if command.verb in ("setDestination", "moveTo"):
            goal = number(command, "x"), number(command, "y")
        elif command.verb in _COURSES and "distance" in command.arguments:
            course = math.radians(state.heading_deg + _COURSES[command.verb])
            distance = number(command, "distance")
            goal = east + distance * math.sin(course), north + distance * math.cos(course)
        elif command.verb == "takeoff":
            raise Refusal("airborne", f"`{command.resource}` flies at the height that its engine keeps")
        else:
            what = "a change of height" if command.verb in _HEIGHTS else f"`{command.verb}`"
            raise Refusal("unsupported", f"the session moves bodies by offsets in the plane, which cannot say {what}")
        length = math.hypot(goal[0] - east, goal[1] - north)
        self._goals[command.resource] = _Goal(goal, length)

    def _act(self, passed_s: float) -> None:
        """Send the offsets of this tick."""
        moving = [entity for entity in self._bodies.entities if entity.id in self._goals]
        offsets = {entity.id: self._offset(entity, passed_s) for entity in moving}
        if not offsets:
            return
        bodies = {self._names.of(entity): {"offset": offset} for entity, offset in offsets.items()}
        task: Document = {"task_id": self._link.task_id}
        if len(self._bodies.entities) == 1 and not self._profile.bodies:
            action: Document = {**task, "offset": next(iter(offsets.values()))}
        else:
            action = {**task, self._profile.bodies or "agents": bodies}
        (reply,) = self._link.exchange([Request(self._profile.act, {"action": action})], self._act_s).replies
        failure = "the action was not acknowledged in time" if reply is None else failure_of(reply)
        if failure:
            for entity in offsets:
                self._end(entity, "timed_out" if reply is None else "engine", failure)

    def _offset(self, entity: Entity, passed_s: float) -> list[float]:
        """Return the displacement towards the goal that the body's speed allows, in the document's centimetres."""
        goal, position = self._goals[entity.id].place, self._bodies.states[entity.id].position
        east, north = goal[0] - position[0], goal[1] - position[1]
        distance = math.hypot(east, north)
        share = min(1.0, _speed_mps(entity) * passed_s / distance) if distance > 0.0 else 0.0
        x, y, _ = to_unreal(round(east * share, 4), round(north * share, 4), 0.0)
        return [x, y]

    def _observe(self, phase: str, time_s: float) -> set[str]:
        """Take over poses from telemetry and from an observation. Returns the bodies that the observation shows."""
        query: Document = {"task_id": self._link.task_id, "phase": phase, "modalities": ["pose"]}
        exchange = self._link.exchange([Request(self._profile.observe, {"query": query})], self._reply_s)
        (reply,) = exchange.replies
        if reply is None:
            raise InfrastructureError(f"the session has not answered `{self._profile.observe}` in {self._reply_s:g} s")
        if failure := failure_of(reply):
            raise InfrastructureError(f"the session reports a failure of `{self._profile.observe}`: {failure}")
        seen: set[str] = set()
        for name, pose in poses_in(reply):
            entity = self._names.entity(name)
            if entity and self._bodies.take(entity, pose, time_s):
                seen.add(entity)
        for entity_spec in self._bodies.entities:
            if entity_spec.id not in seen:
                self._bodies.hold(entity_spec.id)
        return seen

    def _judge(self, time_s: float, passed_s: float) -> None:
        """Complete the requests of bodies that have arrived, and end those of bodies that do not move."""
        for entity, goal in tuple(self._goals.items()):
            position = self._bodies.states[entity].position
            left = math.hypot(goal.place[0] - position[0], goal.place[1] - position[1])
            if left <= ARRIVED_M:
                del self._goals[entity]
                self._requests.complete(entity, time_s)
                self._events.append(TaskEvent(kind="arrived", entities=(entity,), time_s=time_s))
                continue
            self._requests.run(entity, time_s, min(max(1.0 - left / max(goal.length_m, ARRIVED_M), 0.0), 1.0))
            state = self._bodies.states[entity]
            approach = math.hypot(state.velocity[0], state.velocity[1]) * passed_s
            goal.stuck = goal.stuck + 1 if approach < _PROGRESS_M else 0
            if goal.stuck >= _MOST_STUCK:
                self._end(entity, "stuck", f"{goal.stuck} offsets have not moved the body")

    def _end(self, entity: str, reason: str, detail: str) -> None:
        self._goals.pop(entity, None)
        self._requests.fail(entity, self._time_s, reason, detail)

    def _boundary(self, time_s: float) -> Boundary:
        events, self._events = tuple(self._events), []
        states = tuple(self._bodies.states[entity.id] for entity in self._bodies.entities)
        return Boundary(
            engine=self._engine, time_s=time_s, states=states, receipts=self._requests.drain(), events=events
        )


def _speed_mps(entity: Entity) -> float:
    for name in _SPEEDS:
        value = entity.properties.get(name)
        if isinstance(value, int | float) and value > 0:
            return float(value)
    return _USUAL_MPS
