"""One agent's actions as a list of whole decisions: `actions="discrete"` of the flat preset.

A choice is a command with all its arguments, or a message about what the agent's cameras saw last. Learners find such
choices much faster than single arguments. Their names and order depend on the mission and its mode, not on the seed:

- `uav.takeoff/0.5`: a command with one number, at a share of the number's range;
- `uav.setDestination/north`, `…/seen`, `…/cell/A1`, `…/entity/boat`, `…/message/detection`: a command to a place, which
  is `STRIDE_M` away in a direction, below the largest box of the latest pictures, or one that the agent knows; the
  elevation is the present one, within the band;
- `uav.takePhoto/nadir`: a command with a name;
- `say/finding`: a message. Its box is the largest one of the latest pictures, its class is that of the box, and its
  position lies on the ground below the box. A message without a box names the place of the agent's own body.

A choice that is not possible now is masked, and does nothing: a place that the agent does not know, a busy body, a
message about a picture without a box.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import AgentSpec, ArgumentSpec, Datum, Entity, Instance, MessageSpec, Vector, VerbSpec
from lingjing.mission.kinds import engine_kind
from lingjing.mission.model import Field
from lingjing.mission.spec_schema import ELEVATION, altitude_band, argument_bounds
from lingjing.plugins.policy import Inbox, Observation
from lingjing.scene.camera_geometry import box_to_plane
from lingjing.trace.records import Action, Box, Decision, EntityView, FrameInfo, Outgoing

STRIDE_M = 50.0
"""Distance of the eight places around a body, metres (chosen)."""

SHARES = (0.25, 0.5, 1.0)
"""Shares of the range of a command's only number (chosen)."""

_WAYS = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")

_SEEN = "seen"
"""The place below the largest box."""

_PLANE = ("x", "y")
"""The arguments that make a command one to a place."""

_GROUND_M = 0.0
"""Elevation at which the place below a box is assumed, metres over the scene's datum."""

_ELEVATIONS_M = (0.0, 120.0)
"""Range of `z` in actions for a body that declares no altitude band, metres (chosen)."""

Plane = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sight:
    """All that the choices of an agent depend on at a boundary."""

    observation: Observation
    """The agent's observation."""
    inbox: Inbox
    """Its received messages and receipts."""
    frames: Sequence[FrameInfo] = ()
    """The pictures of the boundary, of all agents."""

    def view(self, entity: str) -> EntityView | None:
        """Return what is seen of an entity, if anything."""
        return next((view for view in self.observation.entities if view.id == entity), None)


@dataclass(frozen=True, slots=True)
class _Choice:
    """A decision of the list."""

    name: str
    """Its name."""
    entity: Entity | None = None
    """The body that is commanded."""
    verb: str = ""
    """The command."""
    arguments: tuple[tuple[str, Datum], ...] = ()
    """Arguments that are always the same."""
    place: str = ""
    """The place that the command leads to, empty for none."""
    has_elevation: bool = False
    """True if the place needs an elevation."""
    message: MessageSpec | None = None
    """The message that is sent."""


class Choices:
    """The list of one agent's choices. `names` are in the order of their numbers; number 0 does nothing."""

    def __init__(
        self,
        instance: Instance,
        agent: AgentSpec,
        commands: Sequence[tuple[Entity, VerbSpec]],
        messages: Sequence[MessageSpec],
        cameras: Sequence[str],
        visible: Sequence[str],
    ) -> None:
        self._agent = agent
        self._cells = {cell.name: cell.centre for cell in instance.cells if not cell.hidden}
        self._cameras = cameras
        watched = {channel.name for channel in agent.observes if channel.source == "grid"}
        cells = [f"cell/{cell.name}" for cell in instance.cells if cell.grid in watched and not cell.hidden]
        kinds = [f"message/{spec.kind}" for spec in instance.messages if _field(spec, "position") is not None]
        known = [*_WAYS, *([_SEEN] if cameras else []), *cells, *(f"entity/{name}" for name in visible), *kinds]
        choices = [_Choice("none")]
        for entity, verb in commands:
            choices += _commands(entity, verb, [place for place in known if place != f"entity/{entity.id}"])
        choices += [_Choice(f"say/{spec.kind}", message=spec) for spec in messages]
        self._choices = tuple(choices)
        self.names = tuple(choice.name for choice in choices)

    def decide(self, number: int, sight: Sight) -> Decision:
        """Return the decision of a choice; one that is not possible now is none."""
        choice = self._choices[number]
        if choice.message is not None:
            body = self._body(choice.message, sight)
            return Decision() if body is None else Decision(messages=(Outgoing(kind=choice.message.kind, body=body),))
        if choice.entity is None:
            return Decision()
        arguments = dict(choice.arguments)
        if choice.place:
            goal = self._goal(choice, choice.entity, sight)
            if goal is None:
                return Decision()
            arguments |= goal
        return Decision(command=Action(verb=choice.verb, arguments=arguments, resource=choice.entity.id))

    def mask(self, sight: Sight) -> npt.NDArray[np.bool_]:
        """Return True for each choice that is possible now."""
        return np.array([self._is_possible(choice, sight) for choice in self._choices], np.bool_)

    # -- private

    def _is_possible(self, choice: _Choice, sight: Sight) -> bool:
        if choice.message is not None:
            return self._body(choice.message, sight) is not None
        if choice.entity is None:
            return True
        view = sight.view(choice.entity.id)
        if view is not None and view.busy and choice.verb != "stop":
            return False
        return not choice.place or self._goal(choice, choice.entity, sight) is not None

    def _goal(self, choice: _Choice, entity: Entity, sight: Sight) -> dict[str, Datum] | None:
        view = sight.view(entity.id)
        here = entity.position if view is None or view.position is None else view.position
        place = self._place(choice.place, here, sight)
        if place is None:
            return None
        goal: dict[str, Datum] = dict(zip(_PLANE, place, strict=True))
        if choice.has_elevation:
            low, high = altitude_band(entity.properties) or (-math.inf, math.inf)
            goal[ELEVATION] = min(max(here[2], low), high)
        return goal

    def _place(self, name: str, here: Vector, sight: Sight) -> Plane | None:
        if name in _WAYS:
            angle = math.tau * _WAYS.index(name) / len(_WAYS)
            return here[0] + STRIDE_M * math.sin(angle), here[1] + STRIDE_M * math.cos(angle)
        if name == _SEEN:
            return _plane(self._reported(self._largest(sight), sight, own=False))
        kind, _, rest = name.partition("/")
        if kind == "cell":
            return self._cells[rest]
        if kind == "entity":
            view = sight.view(rest)
            return None if view is None or view.position is None else view.position[:2]
        bodies = [message.body for message in sight.inbox.messages if message.kind == rest]
        position = bodies[-1].get("position") if bodies else None
        return _plane(position)

    def _body(self, spec: MessageSpec, sight: Sight) -> dict[str, Datum] | None:
        """Return the body of a message; None if it needs a box and no picture shows one."""
        largest = self._largest(sight)
        if largest is None and _field(spec, "box") is not None:
            return None
        body = {field.name: self._value(field, largest, sight) for field in spec.fields}
        return {name: value for name, value in body.items() if value is not None}

    def _largest(self, sight: Sight) -> tuple[Box, FrameInfo] | None:
        """Return the largest box of the agent's latest pictures, with its picture."""
        boxed = [
            (box, frame)
            for frame in sight.frames
            if f"{frame.entity}/{frame.camera}" in self._cameras
            for box in frame.boxes
        ]
        return max(boxed, key=lambda pair: (pair[0].pixels, pair[0].entity), default=None)

    def _value(self, field: Field, seen: tuple[Box, FrameInfo] | None, sight: Sight) -> Datum:
        if field.type == "position":
            return self._reported(seen, sight)
        if field.type == "box":
            return None if seen is None else seen[0].box
        if field.type == "frame":
            return None if seen is None else seen[1].id
        if field.type == "number":
            return 1.0 if field.maximum is None else field.maximum
        if field.type == "flag":
            return False
        if field.type in ("name", "names"):
            name = self._named(field, seen)
            return name if field.type == "name" or name is None else (name,)
        return "" if field.type == "text" else None

    def _named(self, field: Field, seen: tuple[Box, FrameInfo] | None) -> str | None:
        """Return the class of the box; without one, what the agent controls, or itself."""
        if field.optional:
            return None
        if seen is not None:
            return seen[0].cls
        return next(iter(self._agent.controls), self._agent.id)

    def _reported(self, seen: tuple[Box, FrameInfo] | None, sight: Sight, *, own: bool = True) -> Datum:
        """Return the place below a box; without one, and if `own`, that of the agent's body."""
        if seen is not None:
            return box_to_plane(seen[1].pose, seen[0].box, _GROUND_M)
        if not own:
            return None
        views = (sight.view(name) for name in self._agent.controls)
        return next((view.position for view in views if view is not None and view.position is not None), None)


def _commands(entity: Entity, verb: VerbSpec, places: Sequence[str]) -> Iterator[_Choice]:
    """Yield the choices of one command."""
    names = [spec.name for spec in verb.arguments]
    whole = f"{entity.id}.{verb.name}"
    plain = _Choice(whole, entity=entity, verb=verb.name)
    if set(_PLANE) <= set(names):
        for place in places:
            yield replace(plain, name=f"{whole}/{place}", place=place, has_elevation=ELEVATION in names)
    elif not verb.arguments:
        yield plain
    elif verb.arguments[0].unit == "name":
        for camera in entity.cameras:
            yield replace(plain, name=f"{whole}/{camera.name}", arguments=((names[0], camera.name),))
    else:
        for share in SHARES:
            numbers = tuple(
                (spec.name, _at(verb, spec, entity, share)) for spec in verb.arguments if spec.unit != "name"
            )
            yield replace(plain, name=f"{whole}/{share:g}", arguments=numbers)


def argument_range(verb: VerbSpec, spec: ArgumentSpec, entity: Entity, reach_m: float) -> tuple[float, float]:
    """Return the range over which an argument's values in actions are spread.

    It is the declared one, with the altitude band as the limit of a height above the start. Where the declared one has
    no bound, elevations have `_ELEVATIONS_M`, and all others have `reach_m` to each side of 0.
    """
    low, high = argument_bounds(spec, entity.properties)
    band = altitude_band(entity.properties)
    if band is not None and engine_kind(entity.engine).is_above_start(verb.name, spec.name):
        high = max(low, min(high, band[1] - entity.position[2]))
    widest = _ELEVATIONS_M if spec.name == ELEVATION else (-reach_m, reach_m)
    return low if math.isfinite(low) else widest[0], high if math.isfinite(high) else widest[1]


def _at(verb: VerbSpec, spec: ArgumentSpec, entity: Entity, share: float) -> float:
    """Return the value of an argument at a share of its range."""
    low, high = argument_range(verb, spec, entity, STRIDE_M)
    return low + share * (high - low)


def _field(spec: MessageSpec, kind: str) -> Field | None:
    return next((field for field in spec.fields if field.type == kind), None)


def _plane(position: Datum) -> Plane | None:
    if not isinstance(position, tuple | list) or len(position) < 2:
        return None
    x, y = position[0], position[1]
    return (float(x), float(y)) if isinstance(x, int | float) and isinstance(y, int | float) else None


__all__ = ["SHARES", "STRIDE_M", "Choices", "Sight"]
