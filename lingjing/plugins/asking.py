"""Model calls of a policy of your own: `ask` calls a model, `serve_models` serves one to a framework.

A policy with `calls = True` and `options = AskOptions` receives its options and the record of its calls. `ask` returns
a function that sends messages. `serve_models` starts a server on loopback that speaks the OpenAI chat protocol, for
clients and frameworks that have a model's address: it passes each request on to the service. In both ways calls are
recorded, replayed, limited, retried and billed as those of `react` are, and the key stays out of requests and records.

    class Scout:
        calls, options = True, AskOptions

        def __init__(self, options: AskOptions, calls: ModelCalls) -> None:
            self.model = ask(options, calls)

        async def act(self, observation: Observation, inbox: Inbox) -> Decision:
            answer = await self.model("Where do you fly?", images=[one.jpeg for one in observation.pictures])
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import msgspec

from lingjing.errors import LingjingError, PluginError, UsageError
from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.model_access import AskerPlugin, ModelAsker, ModelServer
from lingjing.plugins.options import Field, PluginOptions
from lingjing.plugins.policy_calls import tick_of


class AskOptions(PluginOptions):
    """The options of a policy that calls a model: which one, where, and within which limits."""

    model: str = Field(min_length=1, description="a model of the list, or any other model's name at its service")
    client: str = Field("direct", description="the backbone: direct, litellm, or an installed one")
    base_url: str = Field("", description="the service's address, for instance http://localhost:8000/v1")
    base_url_env: str = Field("", description="environment variable that holds the service's address")
    api_key_env: str = Field("", description="environment variable that holds the service's key")
    temperature: float | None = Field(None, ge=0.0, le=2.0, description="not given: as the list says")
    max_tokens: int = Field(2048, ge=16, le=1_000_000, description="the longest answer")
    deadline_s: float = Field(60.0, alias="deadline", ge=0.1, le=86_400.0, description="seconds for one answer")
    price_in: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of a prompt")
    price_out: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of an answer")

    def for_model(self) -> dict[str, object]:
        """Return the given options as those of a model."""
        values = self.model_dump(include=self.model_fields_set - {"deadline_s"})
        return {name: value for name, value in values.items() if value is not None}


class AskModel:
    """A function that asks a model; `ask` makes it."""

    def __init__(self, asker: ModelAsker, tick: Callable[[], int], within_s: float) -> None:
        self._asker = asker
        self._tick = tick
        self._within_s = within_s

    async def __call__(
        self,
        text: str | Sequence[ChatMessage],
        *,
        images: Sequence[bytes] = (),
        system: str = "",
        schema: Mapping[str, object] | None = None,
    ) -> str:
        """Return the model's answer to a text with JPEG images, or to a conversation.

        Raises `NoDecisionError` without an answer in time: the kernel then substitutes a no-op and records the reason.
        """
        turns = (ChatMessage("user", text, tuple(images)),) if isinstance(text, str) else tuple(text)
        messages = (*([ChatMessage("system", system)] if system else []), *turns)
        form = msgspec.json.encode(schema) if schema is not None else None
        return (await self._asker.ask(self._tick(), messages, self._within_s, form)).text


def ask(options: AskOptions, calls: ModelCalls) -> AskModel:
    """Return a function that asks the model of the options. Raises `UsageError` for wrong options."""
    _, asker = _opened(options, calls)
    return AskModel(asker, lambda: tick_of(calls), options.deadline_s)


def serve_models(options: AskOptions, calls: ModelCalls) -> ModelServer:
    """Return a server for the model of the options, for one agent. Raises `UsageError` for wrong options."""
    plugin, asker = _opened(options, calls)
    return plugin.serve(asker, lambda: tick_of(calls), options.deadline_s)


def _opened(options: AskOptions, calls: ModelCalls) -> tuple[AskerPlugin, ModelAsker]:
    from lingjing.plugins.host import PluginHost  # its search for plug-ins costs time

    askers = PluginHost().askers
    if not askers:
        raise UsageError("no installed plug-in calls models", hint="pip install lingjing-sim-agents")
    plugin = next(iter(askers.values()))
    try:
        return plugin, plugin.factory(options.for_model(), calls)
    except LingjingError:
        raise
    except Exception as error:
        raise PluginError(f"the access to models `{plugin.name}` cannot be opened: {one_line(error)}") from error


__all__ = ["AskModel", "AskOptions", "ask", "serve_models"]
