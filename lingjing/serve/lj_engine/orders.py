"""The commands of a foreign backend, read as verbs of our engines."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from lingjing.engines.remote.messages import Document
from lingjing.engines.remote.poses import number_of, position_of
from lingjing.errors import LingjingError
from lingjing.mission.instance import Entity
from lingjing.serve.lj_engine.hosted_world import CLIMB_M, HostedWorld, Step
from lingjing.trace.records import GROUNDED

_FORWARD_M = 50.0
"""Distance of a car's `forward` that gives no distance, metres (chosen)."""
_TURN_M = 4.0
"""Length of the move by which a multirotor turns, metres: beyond the 3 m below which it keeps its heading."""


def read_offsets(world: HostedWorld, action: Document, agent: str) -> list[tuple[Entity, tuple[float, float]]]:
    """Return the bodies of an offset action with their offsets. Raises `LingjingError`."""
    rows: list[tuple[str, object]] = []
    for group in ("drones", "agents", "fleet"):
        bodies = action.get(group)
        if isinstance(bodies, dict):
            rows += [(name, body.get("offset") if isinstance(body, dict) else body) for name, body in bodies.items()]
    if "offset" in action:
        first = world.assets[0]
        rows.append((agent or first.label or first.id, action["offset"]))
    if not rows:
        raise LingjingError("the action has no offset")
    moved = []
    for name, offset in rows:
        entity = world.entity(name)
        if entity is None:
            raise LingjingError(f"there is no body `{name[:60]}`")
        numbers = offset if isinstance(offset, list) else []
        pair = [value for value in numbers[:2] if isinstance(value, int | float) and math.isfinite(value)]
        if len(pair) != 2:
            raise LingjingError(f"the offset of `{name[:60]}` is not two numbers")
        moved.append((entity, (float(pair[0]), float(pair[1]))))
    return moved


def read_orders(world: HostedWorld, data: Document) -> list[tuple[Entity, str, list[Step]]]:
    """Return the bodies of a long command with their verbs and steps. Raises `LingjingError`."""
    orders: list[tuple[Entity, str, list[Step]]] = []
    for group, names, read in _FORMS:
        rows = data.get(group)
        for row in rows if isinstance(rows, list) else ():
            if not isinstance(row, dict):
                continue
            name = next((str(row[key]) for key in names if row.get(key)), "")
            entity = world.entity(name)
            if entity is None:
                raise LingjingError(f"there is no body `{name[:60]}`")
            verb, steps = read(world, entity, row)
            if not steps:
                raise LingjingError(f"`{verb[:40]}` of `{name[:60]}` is not understood")
            orders.append((entity, verb, steps))
    if not orders:
        raise LingjingError("the action names no body")
    return orders


def _place(world: HostedWorld, entity: Entity, *places: object) -> list[Step]:
    """Return the steps to the last of some places."""
    steps: list[Step] = []
    for place in places:
        target = (
            position_of(place, world.instance, world.state(entity.id).position) if isinstance(place, dict) else None
        )
        if target is not None:
            has_height = number_of(place, "Z", "z", "alt") is not None if isinstance(place, dict) else False
            steps += world.approach(entity, target[0], target[1], target[2] if has_height else None)
    return steps


def _drone_order(world: HostedWorld, entity: Entity, row: Document) -> tuple[str, list[Step]]:
    verb = str(row.get("instructionType"))
    command = row.get("command")
    content: Document = command if isinstance(command, dict) else {}
    mile, raw = number_of(content, "mile"), number_of(content, "raw")
    if verb == "takeoff":
        if world.state(entity.id).status != GROUNDED:  # documents often begin in the air
            return verb, [("up", {"distance": CLIMB_M if mile is None else mile})]
        return verb, [("takeoff", {} if mile is None else {"altitude": mile})]
    if verb in ("forward", "backword", "backward", "down"):
        return verb, [("backward" if verb == "backword" else verb, {"distance": mile or 0.0})]
    if verb in ("left", "right"):  # a turn, which our multirotors carry out by a short move in the new direction
        turned = world.state(entity.id).heading_deg + (raw or 0.0) * (1.0 if verb == "right" else -1.0)
        east, north, up = world.state(entity.id).position
        course = math.radians(turned)
        return verb, world.approach(entity, east + _TURN_M * math.sin(course), north + _TURN_M * math.cos(course), up)
    if verb in ("setDestination", "setDestinationLoc"):
        return verb, _place(world, entity, content)
    return verb, [("stop", {})] if verb == "stop" else []


def _car_order(world: HostedWorld, entity: Entity, row: Document) -> tuple[str, list[Step]]:
    verb = str(row.get("instructionType"))
    if verb == "setDestination":
        return verb, _place(world, entity, row.get("location"))
    raw = number_of(row, "raw")
    if verb == "forward":
        return verb, [("forward", {"distance": raw if raw else 50.0})]
    return verb, [(verb, {})] if verb in ("left", "right", "stop") else []


def _dog_order(world: HostedWorld, entity: Entity, row: Document) -> tuple[str, list[Step]]:
    finding = row.get("Pathfinding")
    inner: Document = finding if isinstance(finding, dict) else {}
    verb = str(inner.get("instructionType"))
    command = inner.get("command")
    content: Document = command if isinstance(command, dict) else {}
    if verb == "forward":
        return verb, [("forward", {"distance": number_of(content, "mile", "distance") or 1.0})]
    if verb in ("left", "right"):
        return verb, [(verb, {"angle": number_of(content, "raw", "angle") or 90.0})]
    return verb, [("stop", {})] if verb == "stop" else []


def _sailing_order(world: HostedWorld, entity: Entity, row: Document) -> tuple[str, list[Step]]:
    places = row.get("locationArray")
    return str(row.get("instructionType")), _place(world, entity, *(places if isinstance(places, list) else ()))


class _Form(NamedTuple):
    """A long command."""

    field: str
    names: tuple[str, ...]
    """The fields of a row that name a body."""
    read: Callable[[HostedWorld, Entity, Document], tuple[str, list[Step]]]
    """Returns the verb of a row and the steps to carry out."""


_FORMS = (
    _Form("dronesAction", ("dronesId", "droneId"), _drone_order),
    _Form("autocarAction", ("autocarId", "carId"), _car_order),
    _Form("unmannedDogAction", ("unmannedDogId", "dogId"), _dog_order),
    _Form("shipAction", ("shipId",), _sailing_order),
    _Form("plane", ("planeId",), _sailing_order),
)
"""The long commands of the protocol."""
