"""`react`: one model call a tick, more only to repair an answer that cannot be used.

It gives up with `ReactError` before the kernel's barrier would (`deadline`, in seconds); the kernel then substitutes
a no-op and records the reason. Tokens of calls that led to nothing are billed to the next decision.
"""

from __future__ import annotations

import os
from collections import deque
from dataclasses import dataclass

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Picture, Usage, UsageError
from lingjing_agents.llm.capabilities import Capability, capability_of
from lingjing_agents.llm.chat import ChatMessage, ChatRequest, Completion, ModelClient, ModelError
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.retry import Attempts, Deadline, complete_with_retries
from lingjing_agents.llm.through_litellm import LitellmClient, load_litellm
from lingjing_agents.options import choice, number, whole
from lingjing_agents.react.picture import jpeg
from lingjing_agents.react.prompt import observation_text, system_prompt
from lingjing_agents.react.schema import step_schema
from lingjing_agents.react.step import StepError, read_step


class ReactError(Exception):
    """No decision this tick; the text says why."""


@dataclass(frozen=True, slots=True)
class Options:
    """The policy's checked arguments; `price_*` in US dollars per million tokens, None where not given."""

    model: str
    capability: Capability
    temperature: float
    max_tokens: int
    deadline_s: float
    repairs: int
    tries: int
    history: int
    image_side: int
    images: int
    price_in: float | None
    price_out: float | None


class ReactPolicy:
    """An agent's mind that is a chat model. `read_options` and `make_client` say what its arguments are."""

    def __init__(self, **arguments: str) -> None:
        self._options = read_options(arguments)
        self._client = make_client(arguments)
        self._unbilled = Usage()

    async def reset(self, brief: Brief) -> None:
        """Write the system prompt and the schema; forget everything else."""
        self._brief = brief
        self._unbilled = Usage()
        schema = step_schema(brief)
        self._schema = schema if self._options.capability.json_schema else None
        self._system = ChatMessage("system", system_prompt(brief, with_schema=self._schema is None))
        self._history: deque[tuple[ChatMessage, ChatMessage]] = deque(maxlen=self._options.history)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Ask for a step, repair it if need be. Raises `ReactError` if no valid step came in time."""
        pictures = self._shown(observation)
        text = observation_text(observation, inbox, self._brief, pictures)
        images = tuple(jpeg(picture.rgb, self._options.image_side) for picture in pictures)
        past = tuple(turn for pair in self._history for turn in pair)
        question = ChatMessage("user", text, images)
        try:
            decision, answer = await self._settle((self._system, *past, question))
        except ModelError as error:
            raise ReactError(_explain(error, images, self._schema)) from error
        self._history.append((ChatMessage("user", text), ChatMessage("assistant", answer)))
        return self._billed(decision)

    def _shown(self, observation: Observation) -> tuple[Picture, ...]:
        return observation.pictures[: self._options.images] if self._options.capability.vision else ()

    async def _settle(self, messages: tuple[ChatMessage, ...]) -> tuple[Decision, str]:
        deadline = Deadline(self._options.deadline_s)
        fault = ""
        for _ in range(self._options.repairs + 1):
            completion = await self._ask(messages, deadline)
            try:
                return _read(completion, self._brief, self._options.max_tokens), completion.text
            except StepError as error:
                fault = str(error)
            complaint = (
                f"Your answer cannot be used: {fault}. Answer again with one valid JSON object and nothing else."
            )
            messages = (*messages, ChatMessage("assistant", completion.text[:2000]), ChatMessage("user", complaint))
        raise ReactError(f"no valid step after {self._options.repairs} repairs; last fault: {fault}")

    async def _ask(self, messages: tuple[ChatMessage, ...], deadline: Deadline) -> Completion:
        options = self._options
        request = ChatRequest(options.model, messages, options.temperature, options.max_tokens, self._schema)
        attempts = Attempts()
        completion = Completion("", "")
        try:
            completion = await complete_with_retries(self._client, request, deadline, attempts, tries=options.tries)
        finally:
            self._bill(attempts.calls, completion)
        return completion

    def _bill(self, calls: int, completion: Completion) -> None:
        prompt, answer = completion.prompt_tokens, completion.completion_tokens
        price_in, price_out = self._options.price_in, self._options.price_out
        if price_in is None and price_out is None:
            cost = completion.cost_usd or 0.0
        else:
            cost = (prompt * (price_in or 0.0) + answer * (price_out or 0.0)) / 1e6
        spent = self._unbilled
        self._unbilled = Usage(
            calls=spent.calls + calls,
            prompt_tokens=spent.prompt_tokens + prompt,
            completion_tokens=spent.completion_tokens + answer,
            cost_usd=spent.cost_usd + cost,
        )

    def _billed(self, decision: Decision) -> Decision:
        usage, self._unbilled = self._unbilled, Usage()
        return Decision(command=decision.command, messages=decision.messages, thought=decision.thought, usage=usage)


def read_options(given: dict[str, str]) -> Options:
    """The policy's arguments, checked. Raises `UsageError` for each that is wrong."""
    model = given.get("model", "")
    if not model:
        raise UsageError("policy `react` needs a model", hint="give --policy-arg model=NAME")
    known = capability_of(model)
    capability = Capability(
        vision=_switch("vision", given, default=known.vision),
        json_schema=_switch("schema", given, default=known.json_schema),
    )
    return Options(
        model=model,
        capability=capability,
        temperature=number("temperature", given.get("temperature", "0"), 0.0, 2.0),
        max_tokens=whole("max_tokens", given.get("max_tokens", "2048"), 16, 1_000_000),
        deadline_s=number("deadline", given.get("deadline", "80"), 0.1, 86_400.0),
        repairs=whole("repairs", given.get("repairs", "2"), 0, 10),
        tries=whole("tries", given.get("tries", "5"), 1, 20),
        history=whole("history", given.get("history", "6"), 0, 1000),
        image_side=whole("image_side", given.get("image_side", "1280"), 64, 8192),
        images=whole("images", given.get("images", "2"), 0, 16),
        price_in=_price("price_in", given),
        price_out=_price("price_out", given),
    )


def make_client(given: dict[str, str]) -> ModelClient:
    """The client the arguments ask for. A key is named by its environment variable: arguments go into the trace."""
    variable = given.get("api_key_env", "")
    key = os.environ.get(variable, "") if variable else ""
    if variable and not key:
        raise UsageError(f"api_key_env={variable}: that environment variable is not set", hint=f"export {variable}=…")
    url = given.get("base_url", "")
    if choice("client", given.get("client", "direct"), ("direct", "litellm")) == "litellm":
        load_litellm()  # seconds of import: before the first barrier, and a missing package is told at once
        return LitellmClient(url, key)
    if not url.startswith(("http://", "https://")):
        raise UsageError(
            f"client=direct needs the service's address, not base_url={url!r}",
            hint="for instance --policy-arg base_url=http://localhost:8000/v1",
        )
    return DirectClient(url, key)


def _read(completion: Completion, brief: Brief, max_tokens: int) -> Decision:
    if completion.finish_reason == "length":
        raise StepError(f"it was cut off at {max_tokens} tokens; be much shorter")
    if completion.finish_reason == "content_filter":
        raise StepError("the service's content filter removed it")
    return read_step(completion.text, brief)


def _explain(error: ModelError, images: tuple[bytes, ...], schema: bytes | None) -> str:
    if error.status != 400:
        return str(error)
    ways = ["vision=no if the model takes no pictures"] * bool(images)
    ways += ["schema=no if the service takes no JSON Schema"] * (schema is not None)
    return f"{error} (try {' or '.join(ways)})" if ways else str(error)


def _switch(name: str, given: dict[str, str], *, default: bool) -> bool:
    value = choice(name, given.get(name, "auto"), ("auto", "yes", "no"))
    return default if value == "auto" else value == "yes"


def _price(name: str, given: dict[str, str]) -> float | None:
    return number(name, given[name], 0.0, 1e6) if name in given else None
