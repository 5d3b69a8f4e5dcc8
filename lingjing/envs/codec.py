"""One agent's observations and actions as arrays of fixed shape, and back.

The spaces follow from the instance's observation channels and action schemas. Numbers are `float32` in the mission's
own units (metres, seconds, degrees), pictures are `uint8`, choices are `Discrete`. A value that is unknown or absent is
0; a flag before it is then 0 too. Numbers in actions lie in [-1, 1] and are scaled linearly to the declared bounds of
each argument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from lingjing.envs.choices import Choices, argument_range
from lingjing.envs.vocabulary import STATUSES, Vocabulary
from lingjing.errors import UsageError
from lingjing.mission.instance import (
    AgentSpec,
    ArgumentSpec,
    CameraSpec,
    Datum,
    Entity,
    Instance,
    MessageSpec,
    VerbSpec,
    Weather,
)
from lingjing.mission.kinds import admitted, engine_kind
from lingjing.mission.model import Field
from lingjing.plugins.policy import Inbox, Observation
from lingjing.trace.records import Action, Box, Decision, EntityView, Envelope, Outgoing
from lingjing.trace.request_ids import is_request_of

SpaceValue = npt.NDArray[Any]

INBOX = 8
"""Number of messages in an observation: the latest ones (chosen)."""

_BODY = 11
"""Numbers of an entity before its stocks: observed, position (3), velocity (3), sine and cosine of the heading, busy,
battery."""

_FIELD_WIDTH = {"position": 3, "box": 4, "number": 1, "flag": 1, "name": 1, "names": 1, "frame": 1, "text": 0}
"""Count of numbers for each type of message field. A text has none; a frame has a flag that is 1 if a frame is given.
"""


@dataclass(frozen=True, slots=True)
class ObservedCamera:
    """A camera with pictures that the agent receives, and the size of these pictures in observations."""

    entity: str
    """Id of the entity that carries the camera."""
    camera: CameraSpec
    """The camera as declared by the instance."""
    width: int
    """Width in pixels."""
    height: int
    """Height in pixels; the aspect ratio is that of the camera."""

    @property
    def name(self) -> str:
        """Key of the camera's pictures in an observation."""
        return f"{self.entity}/{self.camera.name}"


class Codec:
    """The conversion between one agent's observations and decisions and the members of its two spaces.

    `reach_m` is the largest absolute coordinate of a position in an action, metres. `picture_width` is the width of
    pictures in pixels, 0 for none.
    """

    def __init__(self, instance: Instance, agent: AgentSpec, reach_m: float, picture_width: int) -> None:
        self._instance = instance
        self._agent = agent
        self._reach_m = reach_m
        self._words = Vocabulary.of(instance)
        self._bodies = _visible(instance, agent)
        watched = {channel.name for channel in agent.observes if channel.source == "grid"}
        self._cells = tuple(cell.name for cell in instance.cells if cell.grid in watched and not cell.hidden)
        self._cameras = _observed_cameras(instance, agent, picture_width)
        self._commands = tuple(
            (entity, verb)
            for name in agent.commands
            for entity in instance.entities
            if entity.id == name
            for verb in (admitted(declared, engine_kind(entity.engine)) for declared in entity.verbs)
        )
        self._sendable = tuple(message for message in instance.messages if message.is_sent_by(agent.role))
        self._width = max([0, *(_width(message) for message in instance.messages)])
        self.observation_space = self._observation_space()
        self.action_space = self._action_space()

    def observe(self, observation: Observation, inbox: Inbox) -> dict[str, Any]:
        """Return an observation and an inbox as a member of `observation_space`."""
        views = {view.id: view for view in observation.entities}
        visited = {cell.name for cell in observation.cells if cell.visited_tick is not None}
        out: dict[str, Any] = {
            "time": np.array([observation.time_s, self._instance.budget.ticks - observation.tick], np.float32),
            "weather": np.array(msgspec.structs.astuple(observation.weather), np.float32),
            "events": self._events(observation),
            "inbox": self._inbox(inbox.messages),
            "receipt": np.int64(self._receipt(inbox)),
        }
        if self._bodies:
            out["entities"] = {entity.id: _body(entity, views.get(entity.id)) for entity in self._bodies}
        if self._cells:
            out["cells"] = np.array([name in visited for name in self._cells], np.int8)
        if self._cameras:
            out["pictures"] = {observed.name: _picture(observed, observation) for observed in self._cameras}
        return out

    def decide(self, action: Mapping[str, Any], observation: Observation) -> Decision:
        """Return the decision for a member of `action_space`: at most one command and one message.

        Numbers beyond [-1, 1] are clipped. Keys that the chosen command or message does not need may be missing. Raises
        `UsageError` for any other value that is no member.
        """
        if not isinstance(action, Mapping):
            raise self._invalid(f"it is {action!r}, not a dictionary")
        chosen = self._choice(action, "command")
        command = None
        if chosen:
            entity, verb = self._commands[chosen - 1]
            values = self._numbers(action, "arguments")
            numbers = zip(verb.arguments, values, strict=False)
            scaled = {spec.name: self._argument(verb, spec, entity, value) for spec, value in numbers}
            arguments: dict[str, Datum] = {name: value for name, value in scaled.items() if value is not None}
            command = Action(verb=verb.name, arguments=arguments, resource=entity.id)
        return Decision(command=command, messages=self._messages(action, observation))

    # -- what the flat form needs

    @property
    def commands(self) -> tuple[tuple[str, str], ...]:
        """The entity and the verb of each command, in the order of their numbers from 1."""
        return tuple((entity.id, verb.name) for entity, verb in self._commands)

    def choices(self) -> Choices:
        """Return the agent's decisions as a list."""
        visible = [entity.id for entity in self._bodies]
        return Choices(self._instance, self._agent, self._commands, self._sendable, self.camera_names, visible)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The cameras with pictures that the agent receives, as `entity/camera`."""
        return tuple(observed.name for observed in _observed_cameras(self._instance, self._agent, 1))

    @property
    def type_number(self) -> Mapping[str, int]:
        """A number from 1 for each type of entity."""
        types = dict.fromkeys(entity.type for entity in self._instance.entities)
        return {name: number for number, name in enumerate(types, 1)}

    @property
    def message_columns(self) -> tuple[tuple[str, tuple[tuple[str, bool], ...]], ...]:
        """For each kind of message, the names of its numbers, each with True for a part of a position."""
        return tuple(
            (
                message.kind,
                tuple(
                    (f"{field.name}/{number}", field.type == "position")
                    for field in message.fields
                    for number in range(_FIELD_WIDTH[field.type])
                ),
            )
            for message in self._instance.messages
        )

    def latest_by_kind(self, inbox: SpaceValue) -> list[list[float]]:
        """Return for each kind of message whether there is one, its sender, and the fields of the latest one."""
        slots = []
        for kind, columns in self.message_columns:
            rows = inbox[inbox[:, 0] == self._words.kinds.number(kind)]
            width = 1 + len(columns)
            slots.append([1.0, *rows[-1][1 : 1 + width].tolist()] if len(rows) else [0.0] * (1 + width))
        return slots

    def write_box(self, message: int, fields: SpaceValue, box: Box) -> None:
        """Write a box into the numbers of a chosen message's fields, if it has a field for one."""
        column = 0
        for field in self._sendable[message - 1].fields if message else ():
            width = _FIELD_WIDTH[field.type]
            if field.type == "box":
                fields[column : column + width] = 2.0 * np.array(box.box) - 1.0
            column += width

    # -- spaces

    def _observation_space(self) -> spaces.Dict:
        parts: dict[str, spaces.Space[Any]] = {
            "time": _box(2, low=0.0),
            "weather": _box(len(Weather.__struct_fields__)),
            "events": _box(len(self._words.events), low=0.0),
            "inbox": _box(INBOX, 2 + self._width),
            "receipt": spaces.Discrete(len(STATUSES) + 1),
        }
        if self._bodies:
            parts["entities"] = spaces.Dict({e.id: _box(_BODY + len(e.state)) for e in self._bodies})
        if self._cells:
            parts["cells"] = spaces.MultiBinary(len(self._cells))
        if self._cameras:
            shots: dict[str, spaces.Space[Any]] = {
                observed.name: spaces.Box(0, 255, (observed.height, observed.width, 3), np.uint8)
                for observed in self._cameras
            }
            parts["pictures"] = spaces.Dict(shots)
        return spaces.Dict(parts)

    def _action_space(self) -> spaces.Dict:
        most = max([1, *(len(verb.arguments) for _, verb in self._commands)])
        parts: dict[str, spaces.Space[Any]] = {
            "command": spaces.Discrete(len(self._commands) + 1),
            "arguments": spaces.Box(-1.0, 1.0, (most,), np.float32),
        }
        if self._sendable:
            parts["message"] = spaces.Discrete(len(self._sendable) + 1)
            parts["to"] = spaces.Discrete(len(self._words.agents) + 1)
            parts["fields"] = spaces.Box(-1.0, 1.0, (max(1, self._width),), np.float32)
        return spaces.Dict(parts)

    # -- observations

    def _events(self, observation: Observation) -> SpaceValue:
        counts = np.zeros(len(self._words.events), np.float32)
        for event in observation.events:
            number = self._words.events.number(event.kind)
            if number:
                counts[number - 1] += 1.0
        return counts

    def _inbox(self, messages: Sequence[Envelope]) -> SpaceValue:
        table = np.zeros((INBOX, 2 + self._width), np.float32)
        specs = {message.kind: message for message in self._instance.messages}
        for row, message in enumerate(messages[-INBOX:]):
            table[row, 0] = self._words.kinds.number(message.kind)
            table[row, 1] = self._words.agents.number(message.sender)
            column = 2
            for field in specs[message.kind].fields:
                width = _FIELD_WIDTH[field.type]
                table[row, column : column + width] = self._field_values(field, message.body.get(field.name), width)
                column += width
        return table

    def _field_values(self, field: Field, value: Datum, width: int) -> list[float]:
        if value is None or width == 0:
            return [0.0] * width
        if field.type in ("position", "box") and isinstance(value, tuple | list):
            numbers = [float(part) for part in value if isinstance(part, int | float)][:width]
            return numbers + [0.0] * (width - len(numbers))
        if field.type in ("number", "flag") and isinstance(value, int | float):
            return [float(value)]
        if field.type == "names" and isinstance(value, tuple | list):
            return [float(self._words.names.number(value[0] if value else None))]
        return [1.0] if field.type == "frame" else [float(self._words.names.number(value))]

    def _receipt(self, inbox: Inbox) -> int:
        """Return the number of the latest status of a command of the agent; 0 if there is no receipt."""
        mine = [receipt for receipt in inbox.receipts if is_request_of("command", receipt.request)]
        return STATUSES.index(mine[-1].status) + 1 if mine else 0

    # -- actions

    def _choice(self, action: Mapping[str, Any], key: str) -> int:
        space = self.action_space[key]
        chosen = action.get(key)
        if not isinstance(chosen, int | np.integer | np.ndarray) or not space.contains(int(chosen)):
            raise self._invalid(f"`{key}` is {chosen!r}, not one of {space}")
        return int(chosen)

    def _numbers(self, action: Mapping[str, Any], key: str) -> SpaceValue:
        space = self.action_space[key]
        try:
            values = np.asarray(action.get(key), np.float64)
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != space.shape or not np.isfinite(values).all():
            raise self._invalid(f"`{key}` is {action.get(key)!r}, not one of {space}")
        return np.clip(values, -1.0, 1.0)

    def _invalid(self, problem: str) -> UsageError:
        hint = "actions are members of its `action_space`"
        return UsageError(f"an action of `{self._agent.id}`: {problem}", hint=hint)

    def _argument(self, verb: VerbSpec, spec: ArgumentSpec, entity: Entity, value: float) -> Datum:
        if spec.unit == "name":
            cameras = entity.cameras
            return cameras[min(int((value + 1.0) / 2.0 * len(cameras)), len(cameras) - 1)].name if cameras else None
        low, high = argument_range(verb, spec, entity, self._reach_m)
        return float(low + (high - low) * (value + 1.0) / 2.0)

    def _messages(self, action: Mapping[str, Any], observation: Observation) -> tuple[Outgoing, ...]:
        if "message" not in action or not self._sendable or not (chosen := self._choice(action, "message")):
            return ()
        message = self._sendable[chosen - 1]
        values = self._numbers(action, "fields")
        body: dict[str, Datum] = {}
        column = 0
        for field in message.fields:
            width = _FIELD_WIDTH[field.type]
            body[field.name] = self._field(field, values[column : column + width], observation)
            column += width
        body = {name: value for name, value in body.items() if value is not None}
        to = self._words.agents.word(self._choice(action, "to"))
        return (Outgoing(kind=message.kind, body=body, to=() if to is None else (to,)),)

    def _field(self, field: Field, values: SpaceValue, observation: Observation) -> Datum:
        if field.type == "text":
            return ""
        if field.type == "position":
            return tuple(float(value) * self._reach_m for value in values)
        share = (values + 1.0) / 2.0
        if field.type == "box":
            left, right = sorted(float(value) for value in share[[0, 2]])
            top, bottom = sorted(float(value) for value in share[[1, 3]])
            return left, top, right, bottom
        if field.type == "frame":
            return observation.pictures[-1].frame if observation.pictures else None
        if field.type == "flag":
            return bool(share[0] >= 0.5)
        if field.type == "number":
            low = 0.0 if field.minimum is None else field.minimum
            high = low + 1.0 if field.maximum is None else field.maximum
            return float(low + (high - low) * share[0])
        words = self._words.names
        name = words.word(1 + min(int(share[0] * len(words)), len(words) - 1))
        return (name,) if field.type == "names" and name is not None else name


def _visible(instance: Instance, agent: AgentSpec) -> tuple[Entity, ...]:
    """Return the entities that the agent's channels may show, in the instance's order."""
    names = {channel.name for channel in agent.observes if channel.source == "entity"}
    if any(channel.source == "peers" for channel in agent.observes):
        names |= {name for peer in instance.agents if peer.id != agent.id for name in peer.controls}
    return tuple(entity for entity in instance.entities if entity.id in names and "position" not in entity.hidden)


def _observed_cameras(instance: Instance, agent: AgentSpec, width: int) -> tuple[ObservedCamera, ...]:
    return tuple(
        ObservedCamera(entity.id, camera, width, max(1, round(width * camera.height / camera.width)))
        for entity in instance.entities
        for camera in entity.cameras
        if width and agent.receives_pictures(entity.id, camera.name)
    )


def _width(message: MessageSpec) -> int:
    return sum(_FIELD_WIDTH[field.type] for field in message.fields)


def _box(*shape: int, low: float = -np.inf) -> spaces.Box:
    return spaces.Box(low, np.inf, shape, np.float32)


def _body(entity: Entity, view: EntityView | None) -> SpaceValue:
    numbers = np.zeros(_BODY + len(entity.state), np.float32)
    if view is None:
        return numbers
    heading = np.radians(view.heading_deg or 0.0)
    stocks = view.resources or {}
    numbers[0] = 1.0
    numbers[1:4] = view.position or 0.0
    numbers[4:7] = view.velocity or 0.0
    numbers[7:9] = (np.sin(heading), np.cos(heading)) if view.heading_deg is not None else (0.0, 0.0)
    numbers[9] = bool(view.busy)
    numbers[10] = stocks.get("battery", 0.0)
    for place, stock in enumerate(entity.state, _BODY):
        numbers[place] = stocks.get(stock.name, 0.0)
    return numbers


def _picture(observed: ObservedCamera, observation: Observation) -> SpaceValue:
    shape = (observed.height, observed.width, 3)
    for picture in observation.pictures:
        if (picture.entity, picture.camera) == (observed.entity, observed.camera.name):
            return _scaled(picture.rgb, observed.width, observed.height)
    return np.zeros(shape, np.uint8)


def _scaled(rgb: npt.NDArray[np.uint8], width: int, height: int) -> npt.NDArray[np.uint8]:
    if rgb.shape[:2] == (height, width):
        return rgb
    from PIL import Image

    return np.asarray(Image.fromarray(rgb).resize((width, height), Image.Resampling.BOX), np.uint8)
