"""The step in a model's answer: one JSON object among reasoning, fences and prose.

Reasoning that a service leaves in the answer (`<think>…</think>` and similar) is separated from the text behind it. In
that text the objects with fields of a step count. Two different ones are a fault, because the answer is ambiguous.
"""

from __future__ import annotations

import json
import re

from lingjing.plugins.decisions import JsonSchema, prompt_schema
from lingjing.plugins.languages import Phrases
from lingjing.plugins.policy import UnreadBox
from lingjing.plugins.scaffold import ModelStep, StepError
from lingjing_agents.react.facts import compact
from lingjing_agents.react.step import StepFormat

_END_OF_REASONING = re.compile(
    r"</(?:\w+:)?(?:think|thinking|thought|reasoning|analysis|scratchpad)>|\[/THINK\]|<\|channel\|>final<\|message\|>",
    re.IGNORECASE,
)
_REASONING = re.compile(
    r"\s*(?:<(?:\w+:)?(?:think|thinking|thought|reasoning|analysis|scratchpad)>|\[THINK\]|<\|channel\|>analysis)",
    re.IGNORECASE,
)
_KEYS = frozenset({"thought", "command", "messages", "crop"})
_TOO_DEEP = "not a step: the JSON object is nested too deeply"
_DECODER = json.JSONDecoder()

_BEGINNING = re.compile(r"\{\s*[\"}]")

MOST_TRIES = 400
SCANNED_LETTERS = 2_000_000
"""Bounds of the search for objects: attempts, and letters in all. Chosen: unclosed braces cost time."""


class StepParser:
    """The parser of `react`. Without `in_text` the prompt leaves the form of an answer to the model.

    The text does not depend on whether the service keeps answers to the schema: all models share the prompt.
    """

    def __init__(self, form: StepFormat, *, in_text: bool = True, say: Phrases | None = None) -> None:
        self._form = form
        self._in_text = in_text
        self._say = say or Phrases()

    @property
    def instructions(self) -> str:
        """The JSON Schema of an answer as text; "" where the prompt leaves it out."""
        return compact(prompt_schema(self.schema)) if self._in_text else ""

    @property
    def schema(self) -> JsonSchema:
        """The JSON Schema of an answer."""
        return self._form.schema

    def parse(self, text: str) -> ModelStep:
        """Return the step of an answer. Raises `StepError` that lists every fault found."""
        return read_step(text, self._form)

    def unread_boxes(self, text: str) -> tuple[UnreadBox, ...]:
        """Return the boxes of the reports in an answer that `parse` refused, as they are written."""
        try:
            answer = json.loads(step_text(text))
        except (StepError, ValueError, RecursionError):
            return ()
        return self._form.unread_boxes(answer)

    def repair(self, fault: str) -> str:
        """Return the text that requests another answer."""
        return self._say(
            "Your answer cannot be used: {fault}. Answer again with one valid JSON object and nothing else.",
            fault=fault,
        )


def step_text(text: str) -> str:
    """Return the JSON text of the one step in an answer. Raises `StepError`."""
    try:
        if text.lstrip().startswith("{"):  # a step's own texts may speak of reasoning
            steps, _ = _objects(text)
            if len(steps) == 1:
                return steps[0]
        steps, fault = _objects(after_reasoning(text))
    except RecursionError:
        raise StepError(_TOO_DEEP) from None
    if len(steps) > 1:
        raise StepError(f"the answer holds {len(steps)} different steps; give one")
    if not steps:
        raise StepError(fault)
    return steps[0]


def read_step(text: str, form: StepFormat) -> ModelStep:
    """Return the step in a model's answer. Raises `StepError`, which lists every fault: services that promise a schema
    do not always keep it."""
    try:
        answer = form.completed(json.loads(step_text(text), parse_constant=_refused))
        faults = form.faults(answer)
    except RecursionError:
        raise StepError(_TOO_DEEP) from None
    if faults:
        raise StepError("not a step: " + "; ".join(faults))
    return form.step(answer)


def _refused(constant: str) -> None:
    raise StepError(f"not a step: {constant} is no JSON")


def after_reasoning(text: str) -> str:
    """Return the text behind the reasoning; the whole text without one. Raises `StepError` if the reasoning does not
    end."""
    ends = [match.end() for match in _END_OF_REASONING.finditer(text)]
    if ends:
        return text[ends[-1] :]
    if _REASONING.match(text):
        raise StepError("the reasoning does not end, and no answer follows it")
    return text


def _objects(text: str) -> tuple[list[str], str]:
    """Return the different objects with fields of a step, in order, and the fault if there is none."""
    steps: dict[str, str] = {}
    fault = "no JSON object in the answer"
    beginning, scanned, tries = _BEGINNING.search(text), 0, 0
    while beginning is not None and scanned < SCANNED_LETTERS and tries < MOST_TRIES:
        at = beginning.start()
        value, end, wrong = _object(text, at)
        if isinstance(value, dict) and _KEYS & value.keys():
            steps.setdefault(json.dumps(value, sort_keys=True), text[at:end])
        elif not steps:
            fault = wrong or f"not a step: the object has none of the fields {', '.join(sorted(_KEYS))}"
        scanned, tries = scanned + end - at, tries + 1
        beginning = _BEGINNING.search(text, at + 1 if wrong else end)
    return list(steps.values()), fault


def _object(text: str, at: int) -> tuple[object, int, str]:
    """Return the object that begins at `at`, the end of the text read, and the fault (the object is then None)."""
    try:
        value, end = _DECODER.raw_decode(text, at)
    except json.JSONDecodeError as error:
        ended = error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated")
        wrong = "the JSON object does not end" if ended else f"not a step: JSON is malformed: {error.msg}"
        return None, max(error.pos, at + 1), wrong
    except RecursionError:
        return None, len(text), _TOO_DEEP
    except ValueError as error:  # a number with thousands of digits
        return None, at + 1, f"not a step: {error}"
    return value, end, ""
