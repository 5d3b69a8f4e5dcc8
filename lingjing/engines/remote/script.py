"""The driver of a simulator that carries out long commands, as the paper's run scripts use it.

A command is sent without a request id. `executionCompleted` ends it, `collision` ends it as rejected. The state of a
boundary is the last pose that telemetry, an event or an observation has brought.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from lingjing.engines.remote.link import Exchange, Link, Request
from lingjing.engines.remote.messages import (
    CARLA_ROUTE,
    COLLISION,
    COMPLETED,
    SHIP_COMPLETED,
    Document,
    command_type,
    failure_of,
    task_of,
)
from lingjing.engines.remote.poses import (
    Bodies,
    Names,
    centimetres,
    engine_of,
    name_in,
    poses_in,
    position_of,
)
from lingjing.mission.frames import to_geodetic
from lingjing.mission.instance import Entity, Vector
from lingjing.plugins.engine import Boundary
from lingjing.plugins.requests import STOP, Refusal, Requests, number, optional_number
from lingjing.trace.records import BodyState, Command, Receipt, Route, TaskEvent

_COURSES = {"forward": 0.0, "right": 90.0, "backward": 180.0, "left": 270.0}
_OBSERVE = "getObservation"
_ACT = "executeAction"
_TAKEOFF_M = 10.0
"""Altitude of a `takeoff` that gives no altitude, metres: that of our own engine."""


class ScriptDriver:
    """Sends long commands and reads events."""

    def __init__(self, link: Link, engine: str, bodies: Bodies, names: Names, *, reply_s: float, asks: bool) -> None:
        """`asks`: request an observation at each boundary; else the last pose is held. `reply_s`: its deadline."""
        self._link, self._engine, self._bodies, self._names = link, engine, bodies, names
        self._reply_s, self._asks = reply_s, asks
        self._requests = Requests(engine)
        self._events: list[TaskEvent] = []
        self._routes: list[Route] = []
        self._planned: dict[str, str] = {}
        """The entity and the request of a route that is awaited."""
        self._router = ""
        """The car that was sent to a destination last: a route without a name is its."""
        self._numbers: dict[str, int] = {}
        self._time_s = 0.0
        self._entities = {entity.id: entity for entity in bodies.entities}

    def reset(self, events: Sequence[Document]) -> Boundary:
        """Return boundary 0: the poses that the session has sent so far, else those of the document. `events` came
        with the acknowledgement of the scenario."""
        self._read(Exchange((), tuple(events)), 0.0)
        self._take(0.0)
        return self._boundary(0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Send commands; a command that was sent is accepted."""
        return tuple(self._admit(command) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState], *, observes: bool) -> Boundary:
        """Wait until `until` has passed, and read what the session has sent."""
        self._link.pause(until)
        self._take(until, asks=observes and self._asks)
        self._time_s = until
        return self._boundary(until)

    # -- commands

    def _admit(self, command: Command) -> Receipt:
        if command.verb == STOP:
            self._requests.fail(command.resource, self._time_s, "preempted", f"`stop` {command.id} took over")
            return self._requests.answer(command, self._time_s, self._send)
        if command.verb in ("route", "replan"):
            return self._requests.answer(command, self._time_s, self._refuse_route)
        return self._requests.admit(command, self._time_s, self._send)

    def _refuse_route(self, command: Command) -> None:
        raise Refusal("unsupported", "the session plans routes by itself; it reports them after `setDestination`")

    def _send(self, command: Command) -> None:
        """Send a command in the form of its body's kind. Raises `Refusal`."""
        entity = self._entities[command.resource]
        fields = _FORMS[engine_of(entity)](self, entity, command)
        self._planned[entity.id] = command.id
        if engine_of(entity) == "road" and command.verb == "setDestination":
            self._router = entity.id
        exchange = self._link.exchange([Request(_ACT, fields, wants_reply=False)], 0.0)
        self._read(exchange, self._time_s)

    def _goal(self, command: Command) -> Vector:
        """Return the destination of a command in metres. Raises `Refusal`."""
        state = self._bodies.states[command.resource]
        east, north, up = state.position
        if command.verb in ("setDestination", "moveTo"):
            height = optional_number(command, "z")
            return number(command, "x"), number(command, "y"), up if height is None else height
        if command.verb in ("up", "down"):
            rise = number(command, "distance")
            return east, north, up + (rise if command.verb == "up" else -rise)
        course = math.radians(state.heading_deg + _COURSES[command.verb])
        distance = number(command, "distance")
        return east + distance * math.sin(course), north + distance * math.cos(course), up

    def _drone(self, entity: Entity, command: Command) -> Document:
        speed = _speed_mps(entity)
        if command.verb == "takeoff":
            altitude = optional_number(command, "altitude")
            body: Document = {"mile": _TAKEOFF_M if altitude is None else altitude, "raw": 0.0, "speed": speed}
            kind = "takeoff"
        elif command.verb == STOP:
            kind, body = STOP, {"speed": speed}
        elif command.verb in ("forward", "backward", "down"):
            kind = "backword" if command.verb == "backward" else command.verb  # the protocol's spelling
            body = {"mile": number(command, "distance"), "speed": speed}
        elif command.verb in ("setDestination", "left", "right", "up"):
            # `left` and `right` of the protocol turn; ours move sideways, and `up` has no word
            x, y, z = (centimetres(self._goal(command))[axis] for axis in "XYZ")
            kind, body = "setDestination", {"x": x, "y": y, "z": z}
        else:
            raise _unknown(command)
        return {"dronesAction": [{"dronesId": self._names.of(entity.id), "instructionType": kind, "command": body}]}

    def _car(self, entity: Entity, command: Command) -> Document:
        action: dict[str, object] = {"autocarId": self._names.of(entity.id), "instructionType": command.verb}
        if command.verb == "setDestination":
            action["location"] = centimetres(self._goal(command))
        elif command.verb in ("forward", "left", "right", STOP):
            action["raw"] = optional_number(command, "distance") or optional_number(command, "angle") or 0.0
        else:
            raise _unknown(command)
        return {"autocarAction": [action]}

    def _dog(self, entity: Entity, command: Command) -> Document:
        if command.verb not in ("forward", "left", "right", STOP):
            raise _unknown(command)
        body: dict[str, object] = {"speed": _speed_mps(entity)}
        if command.verb == "forward":
            body["mile"] = number(command, "distance")
        elif command.verb != STOP:
            body["raw"] = number(command, "angle")
        step = {"instructionType": command.verb, "command": body}
        name = self._names.of(entity.id)
        return {"unmannedDogAction": [{"unmannedDogId": name, "NavigationType": "Pathfinding", "Pathfinding": step}]}

    def _ship(self, entity: Entity, command: Command) -> Document:
        if command.verb not in ("moveTo", "setDestination"):
            raise _unknown(command)
        action = {
            "instructionType": "EntityMoveToS", "shipId": self._names.of(entity.id),
            "locationArray": [self._geodetic(self._goal(command))],
        }  # fmt: skip
        return {"instructionType": "ship", "shipAction": [action]}

    def _plane(self, entity: Entity, command: Command) -> Document:
        if command.verb != "setDestination":
            raise _unknown(command)
        action = {
            "instructionType": "EntityMoveTo", "planeId": self._names.of(entity.id),
            "locationArray": [self._geodetic(self._goal(command))],
        }  # fmt: skip
        return {"instructionType": "plane", "plane": [action]}

    def _satellite(self, entity: Entity, command: Command) -> Document:
        raise _unknown(command)

    def _geodetic(self, place: Vector) -> Document:
        latitude, longitude = to_geodetic(place[0], place[1], self._bodies.instance.scene.origin)
        return {"lon": longitude, "lat": latitude, "alt": place[2]}

    # -- events

    def _take(self, time_s: float, *, asks: bool = False) -> None:
        query: Document = {"task_id": self._link.task_id, "phase": "step", "modalities": ["pose"]}
        requests = [Request(_OBSERVE, {"query": query})] if asks else []
        seen = self._read(self._link.exchange(requests, self._reply_s), time_s)
        for entity in self._bodies.entities:
            if entity.id not in seen:
                self._bodies.hold(entity.id)

    def _read(self, exchange: Exchange, time_s: float) -> set[str]:
        """Take over the poses and the verdicts of an exchange. Returns the bodies with a new pose."""
        seen: set[str] = set()
        for event in exchange.events:
            if task_of(event) in ("", self._link.task_id):
                seen |= self._take_event(event, time_s)
        for reply in exchange.replies:
            if reply is not None and not failure_of(reply):
                seen |= self._take_poses(reply, time_s)
        return seen

    def _take_event(self, event: Document, time_s: float) -> set[str]:
        kind, data = command_type(event), event.get("data")
        content = {**event, **data} if isinstance(data, dict) else event
        seen = self._take_poses(content, time_s)
        entity = self._names.entity(name_in(content))
        if not entity and kind == CARLA_ROUTE and not name_in(content):
            entity = self._router  # the protocol's event names no car
        if not entity:
            return seen
        if kind in (COMPLETED, SHIP_COMPLETED):
            self._complete(entity, content, time_s)
        elif kind == COLLISION:
            self._requests.fail(entity, time_s, "collided", "the session reports a collision")
            self._events.append(TaskEvent(kind="collided", entities=(entity,), time_s=time_s))
        elif kind == CARLA_ROUTE:
            self._take_route(entity, content, time_s)
        return seen

    def _complete(self, entity: str, content: Document, time_s: float) -> None:
        judgment = content.get("judgment")
        verdict = judgment if isinstance(judgment, dict) else {}
        if verdict.get("action") == "initialize_scenario":
            return
        if self._requests.pending(entity) is not None:
            self._events.append(TaskEvent(kind="arrived", entities=(entity,), time_s=time_s))
        self._requests.complete(entity, time_s)

    def _take_poses(self, content: Document, time_s: float) -> set[str]:
        seen = set()
        for name, pose in poses_in(content):
            entity = self._names.entity(name)
            if entity and self._bodies.take(entity, pose, time_s):
                seen.add(entity)
        return seen

    def _take_route(self, entity: str, content: Document, time_s: float) -> None:
        rows = content.get("locationArray")
        before = self._bodies.states[entity].position
        places = [
            place
            for row in (rows if isinstance(rows, list) else ())
            if isinstance(row, dict) and (place := position_of(row, self._bodies.instance, before)) is not None
        ]
        if not places:
            return
        self._numbers[entity] = self._numbers.get(entity, 0) + 1
        length = math.fsum(math.dist(a[:2], b[:2]) for a, b in zip([before, *places[:-1]], places, strict=True))
        speed = _speed_mps(self._entities[entity])
        route = Route(
            entity=entity, number=self._numbers[entity], waypoints=tuple(places), length_m=length,
            duration_s=length / speed, time_s=time_s, request=self._planned.get(entity, ""),
        )  # fmt: skip
        self._routes.append(route)

    def _boundary(self, time_s: float) -> Boundary:
        events, self._events = tuple(self._events), []
        routes, self._routes = tuple(self._routes), []
        states = tuple(self._bodies.states[entity.id] for entity in self._bodies.entities)
        receipts = self._requests.drain()
        return Boundary(
            engine=self._engine, time_s=time_s, states=states, receipts=receipts, events=events, routes=routes
        )


_Form = Callable[[ScriptDriver, Entity, Command], Document]

_FORMS: dict[str, _Form] = {
    "multirotor": ScriptDriver._drone,
    "road": ScriptDriver._car,
    "quadruped": ScriptDriver._dog,
    "vessel": ScriptDriver._ship,
    "plane": ScriptDriver._plane,
    "satellite": ScriptDriver._satellite,
}
"""The form of the commands of each kind of body."""


def _unknown(command: Command) -> Refusal:
    return Refusal("unsupported", f"the protocol has no command for `{command.verb}` of `{command.resource}`")


def _speed_mps(entity: Entity) -> float:
    for name in ("cruise_mps", "speed_mps"):
        value = entity.properties.get(name)
        if isinstance(value, int | float) and value > 0:
            return float(value)
    return 10.0
