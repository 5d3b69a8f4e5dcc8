"""The broker of `react` behind walls: the harness's side of its model calls, from the same options.

It serves other policies too: of their options it reads those that name a model and its service.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lingjing.plugins.calls import CallResult, ModelCalls, ModelQuestion
from lingjing.plugins.options import read_options
from lingjing_agents.llm.asking import AskedModel, FailedCallError, open_model
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.options import ReactOptions


def open_broker(arguments: Mapping[str, Any], calls: ModelCalls) -> ModelBroker:
    """Return the broker for a policy's options. Raises `UsageError` that lists every fault of theirs."""
    model = ReactOptions if arguments.keys() <= _spellings(ReactOptions) else ModelOptions
    known = {name: value for name, value in arguments.items() if name in _spellings(model)}
    return ModelBroker(open_model(read_options(model, known, "the broker of model calls"), calls))


class ModelBroker:
    """Asks the model of one policy."""

    def __init__(self, model: AskedModel) -> None:
        self._model = model

    async def ask(self, question: ModelQuestion) -> CallResult:
        """See `lingjing.plugins.calls.ModelBroker.ask`."""
        deadline = CallDeadline(question.timeout_s)
        try:
            return await self._model.ask(question.tick, question.messages, deadline, schema=question.schema)
        except FailedCallError as error:
            return error.result


def _spellings(model: type[ModelOptions]) -> set[str]:
    fields = model.model_fields
    return {*fields, *(field.alias for field in fields.values() if field.alias)}
