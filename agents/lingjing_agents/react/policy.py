"""`react`: one model call a tick, more only to repair an answer that cannot be used.

It gives up with `ReactError` before the kernel's barrier would (`deadline`, in seconds); the kernel then substitutes
a no-op and records the reason and what was spent. A service that refuses `PATIENCE` ticks in a row ends the episode
with `InfrastructureError`: it says nothing about the model.
"""

from __future__ import annotations

from collections import deque

import msgspec

from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.decisions import DecisionFormat
from lingjing.plugins.policy import (
    Brief,
    Decision,
    Inbox,
    InfrastructureError,
    NoDecisionError,
    Observation,
    Picture,
)
from lingjing_agents.llm.asking import open_model
from lingjing_agents.llm.chat import ChatMessage, ModelCompletion, ModelError
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.answer import StepError, after_reasoning, read_step
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.picture import jpeg
from lingjing_agents.react.prompt import observation_text, system_prompt
from lingjing_agents.react.remedy import explained, remedy

PATIENCE = 3
"""Ticks in a row without any answer of an agent's service, each with its own tries, before the episode is given up."""


class ReactError(NoDecisionError):
    """No decision this tick; the text says why."""


class ReactPolicy:
    """An agent's mind that is a chat model."""

    def __init__(self, options: ReactOptions, calls: ModelCalls) -> None:
        self._options = options
        self._model = open_model(options, calls)
        self._refused = 0

    async def reset(self, brief: Brief) -> None:
        """Write the system prompt and the schema; forget everything else."""
        self._brief = brief
        self._refused = 0
        self._form = DecisionFormat(brief)
        schema = msgspec.json.encode(self._form.schema)
        self._schema = schema if self._model.profile.structured in ("json_schema", "tool") else None
        in_words = self._form.schema if self._schema is None else None
        self._system = ChatMessage("system", system_prompt(brief, in_words))
        self._history: deque[tuple[ChatMessage, ChatMessage]] = deque(maxlen=self._options.history)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Ask for a step, repair it if need be. Raises `ReactError` if no valid step came in time, and
        `InfrastructureError` if the service refuses to answer at all."""
        pictures = self._shown(observation)
        text = observation_text(observation, inbox, self._brief, pictures)
        images = tuple(jpeg(picture.rgb, self._options.image_side) for picture in pictures)
        past = tuple(turn for pair in self._history for turn in pair)
        question = ChatMessage("user", text, images)
        try:
            decision, answer = await self._settle(observation.tick, (self._system, *past, question))
        except ModelError as error:
            raise self._failure(error, images) from error
        self._history.append((ChatMessage("user", text), ChatMessage("assistant", answer)))
        return msgspec.structs.replace(decision, usage=self._model.bill())

    def _failure(self, error: ModelError, images: tuple[bytes, ...]) -> ReactError | InfrastructureError:
        """Slow answers and refused topics are the model's doing; a service that answers nothing is not."""
        if error.fault != "time":
            self._refused = self._refused + 1 if error.fault == "service" else 0
        if self._refused < PATIENCE:
            return ReactError(explained(error, images, self._schema), self._model.bill())
        return InfrastructureError(
            f"the model service refused `{self._brief.agent}` {self._refused} ticks in a row, at last with: {error}",
            hint=remedy(error, images, self._schema) or "see that the service runs and answers, then run it again",
        )

    def _shown(self, observation: Observation) -> tuple[Picture, ...]:
        return observation.pictures[: self._options.images] if self._model.profile.vision else ()

    async def _settle(self, tick: int, messages: tuple[ChatMessage, ...]) -> tuple[Decision, str]:
        deadline = CallDeadline(self._options.deadline_s)
        fault = ""
        for _ in range(self._options.repairs + 1):
            completion = await self._model.ask(tick, messages, deadline, schema=self._schema)
            self._refused = 0
            try:
                return _read(completion, self._form, self._options.max_tokens), answered(completion.text)
            except StepError as error:
                fault = str(error)
            complaint = (
                f"Your answer cannot be used: {fault}. Answer again with one valid JSON object and nothing else."
            )
            said = answered(completion.text)[:2000]
            messages = (*messages, ChatMessage("assistant", said), ChatMessage("user", complaint))
        raise ReactError(
            f"no valid step after {self._options.repairs} repairs; last fault: {fault}", self._model.bill()
        )


def _read(completion: ModelCompletion, form: DecisionFormat, max_tokens: int) -> Decision:
    if completion.finish_reason == "length":
        raise StepError(f"it was cut off at {max_tokens} tokens; be much shorter")
    if completion.finish_reason == "content_filter":
        raise StepError("the service's content filter removed it")
    return read_step(completion.text, form)


def answered(text: str) -> str:
    """An answer without its reasoning: what a model is shown of what it said."""
    try:
        return after_reasoning(text)
    except StepError:
        return ""
