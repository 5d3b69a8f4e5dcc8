"""The detectors of `lingjing frames probe`: colour rules, the trained detector, and a chat model.

Each decides whether a picture shows a target of a class. Colour rules and network answer yes if a box has at least the
confidence `SURE`. A model answers the paper's binary question: one prompt per class, one fixed schema, and no box.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import UnrecordedCalls
from lingjing.plugins.frame_detector import FrameAnswer, FrameQuestion, UnitBox
from lingjing.plugins.options import Field, PluginOptions, read_options
from lingjing.plugins.policy import CameraPose
from lingjing_agents.llm.asking import open_model
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.perception.bridge_gaps import find_gaps
from lingjing_agents.perception.fires_ahead import find_fires_ahead
from lingjing_agents.perception.fires_from_above import find_fires_from_above
from lingjing_agents.perception.images import ByteImage
from lingjing_agents.perception.learned.detector import learned_detectors
from lingjing_agents.perception.people_at_sea import find_people
from lingjing_agents.perception.pipe_leaks import find_leaks

SURE = 0.5
"""The confidence from which on a box counts, 0 to 1. Chosen."""

_OBJECT = re.compile(r"\{[^{}]*\}")
"""A JSON object without nested objects. The last one of an answer counts: reasoning may precede it."""

SCHEMA = b"""{"type": "object", "properties": {"present": {"type": "boolean"}}, "required": ["present"], \
"additionalProperties": false}"""

QUESTION = """\
The picture was taken by the camera of a robot in a city. Say whether it shows at least one {name}. {hint}\
Answer with one JSON object and nothing else: {{"present": true}} if it does, {{"present": false}} if it does not."""

HINTS = {
    "person_in_water": "It is seen from above, small, in open water. Buoys, crates, rings and boats are none. ",
    "building_fire": "It is seen from above, with flames or smoke. Orange roofs are none. ",
    "pipeline_leak": "It is seen from above: a pipe that loses a spray of water or steam. ",
    "bridge_fracture": "It is seen from above: a part of the bridge's deck is missing or broken. ",
    "fire_source": "It is seen from the ground: open flames. Lamps and painted things are none. ",
}
"""The hint that follows the question about a class."""


class _Detection(Protocol):
    @property
    def box(self) -> UnitBox: ...

    @property
    def confidence(self) -> float: ...


Finder = Callable[[ByteImage, CameraPose, float], Iterable[_Detection]]

COLOUR_RULES: Mapping[str, Finder] = {
    "person_in_water": find_people,
    "building_fire": find_fires_from_above,
    "pipeline_leak": find_leaks,
    "bridge_fracture": find_gaps,
    "fire_source": find_fires_ahead,
}
"""The heuristic's rules by the class that they detect."""


@dataclass(frozen=True, slots=True)
class _FoundBoxes:
    """A detector of finders by class."""

    finders: Mapping[str, Finder]
    """The function that finds objects of each class."""

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """Return yes if a box has at least the confidence `SURE`, with these boxes."""
        candidates = self.finders[question.cls](question.rgb, question.pose, question.level_m)
        boxes = tuple(candidate.box for candidate in candidates if candidate.confidence >= SURE)
        return FrameAnswer(bool(boxes), boxes)


class _NoOptions(PluginOptions):
    """The options of a detector without options."""


class ModelDetectorOptions(ModelOptions):
    """The options of the detector `model`."""

    max_tokens: int = Field(2048, ge=16, le=1_000_000, description="the longest answer")
    deadline_s: float = Field(90.0, alias="deadline", ge=1.0, le=86_400.0, description="seconds for one answer")


class _Presence(msgspec.Struct):
    present: bool


class _ModelDetector:
    """A chat model that decides about one picture at a time."""

    def __init__(self, options: ModelDetectorOptions) -> None:
        self._options = options
        self._model = open_model(options, UnrecordedCalls())

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """Return the model's yes or no. A failed call or another answer is a failure."""
        message = ChatMessage("user", question_of(question.cls), (_jpeg_of(question),))
        deadline = CallDeadline(self._options.deadline_s)
        try:
            answer = asyncio.run(self._model.ask(0, (message,), deadline, schema=SCHEMA))
            objects = _OBJECT.findall(answer.text)
            return FrameAnswer(from_json(objects[-1] if objects else "", _Presence).present)
        except ModelError as error:
            return FrameAnswer(False, failure=str(error))
        except msgspec.DecodeError as error:
            return FrameAnswer(False, failure=f"the answer is no JSON object of the schema: {error}")


def question_of(cls: str) -> str:
    """Return the question about a class."""
    return QUESTION.format(name=cls.replace("_", " "), hint=HINTS.get(cls, ""))


def _jpeg_of(question: FrameQuestion) -> bytes:
    """Return the picture as JPEG.

    Other formats are encoded, because both pictures of a pair must reach a model in the same format.
    """
    if question.jpeg.startswith(b"\xff\xd8"):
        return question.jpeg
    from lingjing_agents.perception.images import opencv

    cv2 = opencv()
    is_encoded, data = cv2.imencode(".jpg", question.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    assert is_encoded
    jpeg: bytes = data.tobytes()
    return jpeg


def colour_detector(options: Mapping[str, str]) -> _FoundBoxes:
    """Build the detector `colours`. Raises `UsageError` for any option."""
    read_options(_NoOptions, options, "detector colours")
    return _FoundBoxes(COLOUR_RULES)


def trained_detector(options: Mapping[str, str]) -> _FoundBoxes:
    """Build the detector `learned`. Raises `UsageError` for any option."""
    read_options(_NoOptions, options, "detector learned")
    return _FoundBoxes(learned_detectors())


def model_detector(options: Mapping[str, str]) -> _ModelDetector:
    """Build the detector `model` from options such as `model=gpt-5.5`. Raises `UsageError` with every fault in them."""
    return _ModelDetector(read_options(ModelDetectorOptions, options, "detector model"))


def colour_rules_know(cls: str) -> bool:
    """Return whether there is a rule for a class."""
    return cls in COLOUR_RULES


def learned_knows(cls: str) -> bool:
    """Return whether a trained detector ships for a class."""
    return cls in learned_detectors()
