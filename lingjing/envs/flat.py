"""The flat form of one agent's spaces: one vector of numbers in [-1, 1], and one action of a chosen form.

The entries of the vector have names (`FlatCodec.entries`) and a fixed order. A bounded quantity is scaled linearly, an
unbounded one by x / (|x| + c) with the scale c of its entry. An absent value is 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from lingjing.envs.choices import Sight
from lingjing.envs.codec import Codec
from lingjing.envs.vocabulary import STATUSES
from lingjing.errors import UsageError
from lingjing.suggest import nearest_or
from lingjing.trace.records import Box, Decision, FrameInfo

Vector = npt.NDArray[np.float32]

LEVELS = 9
"""Number of levels of an argument or field in a flat action (chosen): -1, -0.75, …, 1."""

SEEN = 3
"""Number of detections of each camera in an observation: those with the largest boxes (chosen)."""

SPEED_MPS = 20.0
"""Scale of velocities, metres per second (chosen)."""

WEATHER_SCALE = 100.0
"""Scale of the quantities of the weather, in their own units (chosen)."""

STOCK_SCALE = 100.0
"""Scale of stocks and of the battery, in their own units (chosen)."""


Actions = Literal["multidiscrete", "discrete", "box"]
"""The form of an action: one number for each part of a decision, the number of a whole decision, or an array in
[-1, 1] with one value for each part."""

FORMS: tuple[Actions, ...] = ("multidiscrete", "discrete", "box")


class Entry(NamedTuple):
    """One entry of a flat observation."""

    name: str
    """Its name, such as `entities/boat/x`."""
    scale: float
    """The value c of the scale, in the unit of the quantity; 0 for a value that already lies in [-1, 1]."""


class FlatCodec:
    """The flat spaces of one agent, on top of its `Codec`. `reach_m` is the scale of positions, metres.

    Raises `UsageError` for an unknown form of actions.
    """

    def __init__(
        self, codec: Codec, reach_m: float, ticks: int, tick_s: float, actions: Actions = "multidiscrete"
    ) -> None:
        if actions not in FORMS:
            hint = nearest_or(str(actions), FORMS, f"there are: {', '.join(FORMS)}")
            raise UsageError(f"actions={actions!r}", hint=hint)
        self._codec = codec
        self._ticks, self._tick_s = ticks, tick_s
        space = codec.observation_space
        self.cameras = codec.camera_names
        self.entries: tuple[Entry, ...] = tuple(self._entries(space, reach_m))
        """The entries of an observation, in order."""
        self._scales = np.array([entry.scale for entry in self.entries], np.float64)
        self.observation_space = spaces.Box(-1.0, 1.0, (len(self.entries),), np.float32)
        self._parts = tuple(self._choices(codec.action_space))
        self._form = actions
        self._list = codec.choices()
        self.action_space: spaces.Space[Any] = self._space()
        self.choices = self._list.names if actions == "discrete" else tuple(name for name, _ in self._parts)
        """The names of the numbers of an action, in order; for `discrete` the names of all decisions."""

    def observe(self, observation: Mapping[str, Any], frames: Sequence[FrameInfo]) -> Vector:
        """Return an observation of the `Codec`, and the boxes of its pictures, as a member of `observation_space`."""
        values: list[float] = [
            observation["time"][0] / (self._ticks * self._tick_s),
            observation["time"][1] / self._ticks,
            *observation["weather"],
            *observation["events"],
            *(float(observation["receipt"] == number) for number in range(len(STATUSES) + 1)),
        ]
        for body in observation.get("entities", {}).values():
            values += body.tolist()
        values += observation["cells"].tolist() if "cells" in observation else []
        for row in self._codec.latest_by_kind(observation["inbox"]):
            values += row
        for camera in self.cameras:
            values += _detections(camera, frames, self._codec.type_number)
        numbers = np.asarray(values, np.float64)
        squashed = np.where(self._scales > 0.0, numbers / (np.abs(numbers) + np.maximum(self._scales, 1e-9)), numbers)
        return np.clip(squashed, -1.0, 1.0).astype(np.float32)

    def decide(self, flat: Any, sight: Sight) -> Decision:
        """Return the decision of a member of `action_space`.

        A box field receives the largest box of the agent's latest pictures. Raises `UsageError` for no member.
        """
        chosen = np.asarray(flat)
        if not self.action_space.contains(self._typed(chosen)):
            raise UsageError(f"{flat!r} is no action of {self.action_space}", hint="sample `action_space`")
        if self._form == "discrete":
            return self._list.decide(int(chosen), sight)
        if self._form == "box":
            values = dict(zip(self.choices, np.clip(chosen, -1.0, 1.0).tolist(), strict=True))
            return self._decision(values, {n: _interval(values[n], of) for n, of in self._parts}, sight)
        numbers = dict(zip(self.choices, (int(part) for part in chosen), strict=True))
        return self._decision({n: 2.0 * level / (LEVELS - 1) - 1.0 for n, level in numbers.items()}, numbers, sight)

    def mask(self, sight: Sight) -> npt.NDArray[np.bool_]:
        """Return the admissible values of each number of an action, one after another, as MaskablePPO expects them.

        The commands of an entity that carries out another command are masked, except `stop`. Raises `UsageError` for
        the form `box`, which has no masks.
        """
        if self._form == "discrete":
            return self._list.mask(sight)
        if self._form == "box":
            hint = 'actions="discrete" and actions="multidiscrete" have masks'
            raise UsageError("an action that is a Box has no mask", hint=hint)
        parts = []
        for name, number in self._parts:
            allowed = np.ones(number, np.bool_)
            if name == "command":
                for index, (entity, verb) in enumerate(self._codec.commands, 1):
                    view = sight.view(entity)
                    allowed[index] = verb == "stop" or view is None or not view.busy
            parts.append(allowed)
        return np.concatenate(parts)

    @property
    def has_masks(self) -> bool:
        """True if the form of actions has masks."""
        return self._form != "box"

    def _space(self) -> spaces.Space[Any]:
        if self._form == "discrete":
            return spaces.Discrete(len(self._list.names))
        if self._form == "box":
            return spaces.Box(-1.0, 1.0, (len(self._parts),), np.float32)
        return spaces.MultiDiscrete([number for _, number in self._parts])

    def _typed(self, chosen: npt.NDArray[Any]) -> Any:
        """Return an action in the type that its space holds; anything else unchanged."""
        if self._form == "box":
            return chosen.astype(np.float32) if chosen.dtype.kind in "iuf" else chosen
        if chosen.dtype.kind not in "iu":
            return chosen
        return chosen.astype(np.int64) if self._form == "multidiscrete" or chosen.shape else np.int64(chosen)

    def _decision(self, values: Mapping[str, float], numbers: Mapping[str, int], sight: Sight) -> Decision:
        """Return the decision with these values in [-1, 1] of arguments and fields, and these numbers of choices."""
        action: dict[str, Any] = {"command": numbers["command"], "arguments": _array("arguments", values)}
        if "message" in numbers:
            fields = _array("fields", values)
            largest = _largest(sight.frames, self.cameras)
            if largest is not None:
                self._codec.write_box(numbers["message"], fields, largest)
            action |= {"message": numbers["message"], "to": numbers["to"], "fields": fields}
        return self._codec.decide(action, sight.observation)

    def _choices(self, space: spaces.Dict) -> list[tuple[str, int]]:
        parts: list[tuple[str, int]] = []
        for key in ("command", "arguments", "message", "to", "fields"):
            part = space.spaces.get(key)
            if isinstance(part, spaces.Discrete):
                parts.append((key, int(part.n)))
            elif isinstance(part, spaces.Box):
                parts += [(f"{key}/{number}", LEVELS) for number in range(part.shape[0])]
        return parts

    def _entries(self, space: spaces.Dict, reach_m: float) -> list[Entry]:
        entries = [Entry("time/elapsed", 0.0), Entry("time/left", 0.0)]
        entries += [Entry(f"weather/{number}", WEATHER_SCALE) for number in range(_size(space["weather"]))]
        entries += [Entry(f"events/{number}", 1.0) for number in range(_size(space["events"]))]
        entries += [Entry(f"receipt/{status}", 0.0) for status in ("none", *STATUSES)]
        for name, part in space.spaces.get("entities", spaces.Dict()).spaces.items():
            stocks = [Entry(f"stock/{number}", STOCK_SCALE) for number in range(_size(part) - len(_BODY_ENTRIES))]
            for entry in (*_BODY_ENTRIES, *stocks):
                scale = reach_m if entry.name in ("x", "y", "z") else entry.scale
                entries.append(Entry(f"entities/{name}/{entry.name}", scale))
        if "cells" in space.spaces:
            entries += [Entry(f"cells/{number}", 0.0) for number in range(_size(space["cells"]))]
        for kind, columns in self._codec.message_columns:
            entries.append(Entry(f"inbox/{kind}/present", 0.0))
            entries.append(Entry(f"inbox/{kind}/sender", 1.0))
            entries += [
                Entry(f"inbox/{kind}/{field}", reach_m if is_position else 1.0) for field, is_position in columns
            ]
        for camera in self.cameras:
            for number in range(SEEN):
                entries += [Entry(f"seen/{camera}/{number}/{part}", 1.0 if part == "type" else 0.0) for part in _SEEN]
        return entries


_BODY_ENTRIES = (
    Entry("observed", 0.0), Entry("x", 0.0), Entry("y", 0.0), Entry("z", 0.0),
    Entry("vx", SPEED_MPS), Entry("vy", SPEED_MPS), Entry("vz", SPEED_MPS),
    Entry("heading_sine", 0.0), Entry("heading_cosine", 0.0), Entry("busy", 0.0), Entry("battery", STOCK_SCALE),
)  # fmt: skip
_SEEN = ("present", "type", "left", "top", "right", "bottom")


def _array(key: str, values: Mapping[str, float]) -> Vector:
    return np.array([value for name, value in values.items() if name.startswith(f"{key}/")], np.float32)


def _interval(value: float, count: int) -> int:
    """Return the number of the interval of [-1, 1], in `count` equal parts, that holds a value."""
    return min(int((value + 1.0) / 2.0 * count), count - 1)


def _size(space: spaces.Space[Any]) -> int:
    return int(np.prod(space.shape or (1,)))


def _detections(camera: str, frames: Sequence[FrameInfo], type_number: Mapping[str, int]) -> list[float]:
    """Return the largest boxes of the latest picture of a camera, with zeros for missing ones."""
    boxes: Sequence[Box] = next(
        (info.boxes for info in reversed(frames) if f"{info.entity}/{info.camera}" == camera), ()
    )
    largest = sorted(boxes, key=lambda box: (-box.pixels, box.entity))[:SEEN]
    values = [part for box in largest for part in (1.0, float(type_number.get(box.cls, 0)), *box.box)]
    return values + [0.0] * (SEEN * len(_SEEN) - len(values))


def _largest(frames: Sequence[FrameInfo], cameras: Sequence[str]) -> Box | None:
    boxes = [box for info in frames if f"{info.entity}/{info.camera}" in cameras for box in info.boxes]
    return max(boxes, key=lambda box: (box.pixels, box.entity), default=None)
