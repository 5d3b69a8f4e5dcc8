"""`ModelWriter`: a chat model that writes missions, for `lingjing new mission --from`."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.options import Field, read_options
from lingjing.plugins.policy import InfrastructureError
from lingjing.plugins.scaffold import StepError
from lingjing.plugins.writers import WrittenAnswer
from lingjing_agents.llm.asking import AskedModel, open_model
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.answer import after_reasoning


class WriterOptions(ModelOptions):
    """The options of the model."""

    max_tokens: int = Field(8192, ge=256, le=1_000_000, description="the longest answer")
    deadline_s: float = Field(300.0, alias="deadline", ge=1.0, le=86_400.0, description="seconds for one answer")
    grammar: Literal["none", "grammar", "guided_grammar", "structured_outputs"] = Field(
        "none",
        description="member of a request in which a service with constrained decoding takes a grammar: grammar "
        "(llama.cpp), structured_outputs (vLLM), guided_grammar (older vLLM)",
    )


class ModelWriter:
    """A writer with one model."""

    def __init__(self, options: WriterOptions, calls: ModelCalls) -> None:
        self._options = options
        self._model: AskedModel = open_model(options, calls)

    def write(self, conversation: Sequence[ChatMessage], grammar: str) -> WrittenAnswer:
        """Return the model's answer. Raises `InfrastructureError` without one."""
        self._send_grammar(grammar)
        deadline = CallDeadline(self._options.deadline_s)
        try:
            answer = asyncio.run(self._model.ask(0, tuple(conversation), deadline))
        except ModelError as error:
            raise InfrastructureError(f"the model `{self._options.model}` gave no answer: {error}") from error
        try:
            text = after_reasoning(answer.text)
        except StepError:
            text = ""
        return WrittenAnswer(text, is_cut=answer.finish_reason == "length")

    def _send_grammar(self, grammar: str) -> None:
        """Add the grammar to the members of every request."""
        member = self._options.grammar
        if member == "none":
            return
        profile = self._model.profile
        value: object = {"grammar": grammar} if member == "structured_outputs" else grammar
        body = {**profile.traits.extra_body, member: value}
        self._model.profile = replace(profile, traits=profile.traits.model_copy(update={"extra_body": body}))


def make_writer(options: Mapping[str, str], calls: ModelCalls) -> ModelWriter:
    """Return the writer with these options. Raises `UsageError` that lists every fault of them."""
    return ModelWriter(read_options(WriterOptions, options, "writer"), calls)
