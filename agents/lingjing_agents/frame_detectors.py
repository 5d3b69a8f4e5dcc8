"""The detectors of `lingjing frames probe`: the colour rules, the trained detector, and a chat model.

Each is asked whether a picture shows a target of a class. Rules and network say yes if they are sure of a box by half.
A model answers the paper's binary question: one prompt a class, one fixed schema, and no box.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import msgspec

from lingjing.plugins.calls import UnrecordedCalls
from lingjing.plugins.frame_detector import FrameAnswer, FrameQuestion, UnitBox
from lingjing.plugins.options import Field, PluginOptions, read_options
from lingjing.plugins.policy import CameraPose
from lingjing_agents.llm.asking import open_model
from lingjing_agents.llm.chat import ChatMessage, ModelError
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

_OBJECT = re.compile(r"\{[^{}]*\}")
"""A JSON object without others in it; the last one of an answer counts, whatever was thought before it."""

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
"""What is added to the question about a class."""


class _Found(Protocol):
    @property
    def box(self) -> UnitBox: ...

    @property
    def confidence(self) -> float: ...


Finder = Callable[[ByteImage, CameraPose, float], Iterable[_Found]]

COLOUR_RULES: Mapping[str, Finder] = {
    "person_in_water": find_people,
    "building_fire": find_fires_from_above,
    "pipeline_leak": find_leaks,
    "bridge_fracture": find_gaps,
    "fire_source": find_fires_ahead,
}
"""The rules of the heuristic by the class of what they find."""


@dataclass(frozen=True, slots=True)
class FoundBoxes:
    """A detector of finders by class."""

    finders: Mapping[str, Finder]

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """Yes if a box is sure by half; the boxes that are."""
        found = self.finders[question.cls](question.rgb, question.pose, question.level_m)
        boxes = tuple(find.box for find in found if find.confidence >= SURE)
        return FrameAnswer(bool(boxes), boxes)


class _NoOptions(PluginOptions):
    """There are none."""


class ModelDetectorOptions(ModelOptions):
    """What the model can be told."""

    max_tokens: int = Field(2048, ge=16, le=1_000_000, description="the longest answer")
    deadline_s: float = Field(90.0, alias="deadline", ge=1.0, le=86_400.0, description="seconds for one answer")


class _Presence(msgspec.Struct):
    present: bool


class ModelDetector:
    """A chat model that is asked about one picture at a time."""

    def __init__(self, options: ModelDetectorOptions) -> None:
        self._options = options
        self._model = open_model(options, UnrecordedCalls())

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """The model's yes or no; a failed call and an answer that is neither are failures."""
        asked = ChatMessage("user", question_of(question.cls), (jpeg_of(question),))
        deadline = CallDeadline(self._options.deadline_s)
        try:
            answer = asyncio.run(self._model.ask(0, (asked,), deadline, schema=SCHEMA))
            objects = _OBJECT.findall(answer.text)
            return FrameAnswer(msgspec.json.decode(objects[-1] if objects else "", type=_Presence).present)
        except ModelError as error:
            return FrameAnswer(False, failure=str(error))
        except msgspec.DecodeError as error:
            return FrameAnswer(False, failure=f"the answer is no JSON object of the schema: {error}")


def question_of(cls: str) -> str:
    """The question about a class, in words."""
    return QUESTION.format(name=cls.replace("_", " "), hint=HINTS.get(cls, ""))


def jpeg_of(question: FrameQuestion) -> bytes:
    """The picture as JPEG: as it is if it is one, else coded, as both pictures of a pair must come alike to a model."""
    if question.jpeg.startswith(b"\xff\xd8"):
        return question.jpeg
    from lingjing_agents.perception.images import opencv

    cv2 = opencv()
    done, data = cv2.imencode(".jpg", question.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    assert done
    coded: bytes = data.tobytes()
    return coded


def colour_detector(given: Mapping[str, str]) -> FoundBoxes:
    """`colours`. Raises `UsageError` for any option."""
    read_options(_NoOptions, given, "detector colours")
    return FoundBoxes(COLOUR_RULES)


def trained_detector(given: Mapping[str, str]) -> FoundBoxes:
    """`learned`. Raises `UsageError` for any option."""
    read_options(_NoOptions, given, "detector learned")
    return FoundBoxes(learned_detectors())


def model_detector(given: Mapping[str, str]) -> ModelDetector:
    """`model`, of options such as `model=gpt-5.5`. Raises `UsageError` that tells every fault of them."""
    return ModelDetector(read_options(ModelDetectorOptions, given, "detector model"))


def colour_rules_know(cls: str) -> bool:
    """Whether there is a rule for a class."""
    return cls in COLOUR_RULES


def learned_knows(cls: str) -> bool:
    """Whether a detector ships for a class."""
    return cls in learned_detectors()
