"""`StepFormat`: the form of an answer: a decision, lines to keep, or a part of a picture to see enlarged."""

from __future__ import annotations

from typing import Any

from lingjing.decoding import converted
from lingjing.plugins.decisions import DecisionFormat, JsonSchema
from lingjing.plugins.policy import Brief, UnreadBox
from lingjing.plugins.scaffold import Crop, ModelStep, UnitBox

LINES, LETTERS = 8, 240
"""Bounds of the memory: lines of a field, and letters of a line; the rest is cut off. Chosen."""

MEMORY = {"commitments": "what you have promised or taken on, and to whom", "plan": "what you will do next, in order"}
MEMORY_TOLD = """\
Your answer may also have "commitments" (a list: what you have promised or taken on, to whom, what is done of it) and \
"plan" (a list: what you will do next). At most 8 short lines each. You are given them back at every tick until you \
write them anew; nothing else of what you thought is sure to be."""

CROP = "crop"
CROPS_TOLD = """\
Before you decide you may ask {crops} times a tick to see a part of a picture enlarged: answer with "crop": {{"frame": \
id of a picture, "box": [x_min, y_min, x_max, y_max] of the whole picture}}, "command": null, "messages": []."""


class StepFormat:
    """The JSON Schema of an agent's answers, and their faults."""

    def __init__(self, brief: Brief, *, memory: bool, crops: bool) -> None:
        self._memory = tuple(MEMORY) if memory else ()
        fields = {name: _lines(MEMORY[name]) for name in self._memory}
        self._form = DecisionFormat(brief, {**fields, CROP: _CROP} if crops else fields)

    @property
    def schema(self) -> JsonSchema:
        """The JSON Schema of an answer."""
        return self._form.schema

    def completed(self, answer: object) -> object:
        """Return the answer with omitted parts filled in."""
        return self._form.completed(answer)

    def faults(self, answer: Any) -> tuple[str, ...]:
        """Return every fault of a completed answer, with its path."""
        faults = self._form.faults(answer)
        if not faults and CROP in answer:
            x0, y0, x1, y1 = answer[CROP]["box"]
            return () if x0 < x1 and y0 < y1 else ("crop.box: x_min < x_max and y_min < y_max are due",)
        return faults

    def unread_boxes(self, answer: object) -> tuple[UnreadBox, ...]:
        """Return the boxes of the reports in an answer with faults, as they are written."""
        return self._form.unread_boxes(answer)

    def step(self, answer: Any) -> ModelStep:
        """Return the step of a completed answer without faults."""
        memory = {
            name: tuple(line[:LETTERS] for line in answer[name][:LINES]) for name in self._memory if name in answer
        }
        wanted = answer.get(CROP)
        crop = None if wanted is None else Crop(wanted["frame"], converted(wanted["box"], UnitBox))
        return ModelStep(self._form.decision(answer), memory, crop)


def _lines(description: str) -> JsonSchema:
    return {"type": "array", "items": {"type": "string"}, "description": description}


_CROP: JsonSchema = {
    "type": ["object", "null"],
    "description": "a part of a picture to see enlarged before you decide; null to decide now",
    "properties": {
        "frame": {"type": "string", "description": "id of a picture that you have"},
        "box": {"type": "array", "items": {"type": "number", "minimum": 0, "maximum": 1}, "minItems": 4, "maxItems": 4},
    },
    "required": ["frame", "box"],
    "additionalProperties": False,
}
