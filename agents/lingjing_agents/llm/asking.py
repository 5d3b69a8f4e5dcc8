"""`AskedModel`: one agent's questions to its model, recorded, limited, retried and billed.

A question is looked up in the record first (a replay asks nobody), then asked with retries until the deadline, and what
came out of it, an answer or a failure, is recorded before the policy sees it. So a replay needs no clock: whatever
time decided is in the record.
"""

from __future__ import annotations

import os
import time

import msgspec

from lingjing.plugins.calls import AbandonedCallError, CallRequest, CallResult, ModelCalls
from lingjing.plugins.policy import Usage, UsageError
from lingjing_agents.llm.chat import (
    ChatMessage,
    ChatRequest,
    FailureCause,
    ModelClient,
    ModelCompletion,
    ModelError,
    parameters,
    recorded_message,
)
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.guard import GuardedClient
from lingjing_agents.llm.limits import limited
from lingjing_agents.llm.options import ModelOptions, ModelProfile
from lingjing_agents.llm.redaction import Redactor
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries
from lingjing_agents.llm.through_litellm import LitellmClient, load_litellm

_KEY_VARIABLES = ("_API_KEY", "_ACCESS_KEY", "_API_TOKEN", "_ACCESS_TOKEN", "_AUTH_TOKEN")
_LEAST_KEY_LETTERS = 16

_OVERHEAD_TOKENS = 64
"""Tokens that a service's template may add to one message."""


class AskedModel:
    """A model, one agent's record of it, and what it has cost since the last bill.

    `profile` says what the model can do. `client` is None in a replay.
    """

    def __init__(self, profile: ModelProfile, client: ModelClient | None, calls: ModelCalls) -> None:
        self.profile = profile
        self._client = client
        self._calls = calls
        self._unbilled = Usage()
        self._asked_at = (-1, 0)

    async def ask(
        self, tick: int, messages: tuple[ChatMessage, ...], deadline: CallDeadline, *, schema: bytes | None = None
    ) -> CallResult:
        """The model's answer to the question that is asked at boundary `tick`. `schema` is a JSON Schema as text.

        Raises `ModelError` if there is none within the deadline, and what `ModelCalls.begin` raises.
        """
        request = self._request(messages, schema)
        kept = self._kept(tick, request)
        try:
            result = self._calls.begin(kept)
        except AbandonedCallError as error:
            self._bill(error.result)
            raise
        if result is None:
            result = await self._asked(request, kept, deadline)
        else:
            self._bill(result)
        if result.failure:
            raise ModelError(result.failure, status=result.status, fault=_cause(result))
        return result

    def bill(self) -> Usage:
        """What the questions since the last bill have cost."""
        usage, self._unbilled = self._unbilled, Usage()
        return usage

    async def _asked(self, request: ChatRequest, kept: CallRequest, deadline: CallDeadline) -> CallResult:
        assert self._client is not None, "a replay asks nobody"
        attempts, started = Attempts(), time.monotonic()
        result = CallResult(failure="the policy was given up while it waited", fault="abandoned")
        try:
            answer = await complete_with_retries(self._client, request, deadline, attempts, tries=self.profile.tries)
            result = self._answered(answer)
        except ModelError as error:
            result = CallResult(failure=str(error), fault=error.fault, status=error.status)
        finally:
            uncounted = not result.failure and not result.prompt_tokens
            unsure = attempts.billed + (result.fault == "abandoned") + uncounted
            result = msgspec.structs.replace(
                result,
                failure=attempts.told(result.failure) if result.fault == "abandoned" else result.failure,
                attempts=attempts.calls,
                unknown_usd=result.unknown_usd + unsure * (kept.most_usd or 0.0),
                wall_s=round(time.monotonic() - started, 3),
            )
            self._calls.end(kept, result)
            self._bill(result)
        return result

    def _answered(self, answer: ModelCompletion) -> CallResult:
        cost = self.profile.traits.cost_usd(answer.prompt_tokens, answer.completion_tokens, answer.cached_tokens)
        return CallResult(
            text=answer.text,
            reasoning=answer.reasoning,
            finish_reason=answer.finish_reason,
            prompt_tokens=answer.prompt_tokens,
            completion_tokens=answer.completion_tokens,
            cached_tokens=answer.cached_tokens,
            cost_usd=answer.cost_usd if cost is None else cost,
        )

    def _request(self, messages: tuple[ChatMessage, ...], schema: bytes | None) -> ChatRequest:
        profile = self.profile
        return ChatRequest(
            model=profile.served,
            messages=messages,
            temperature=profile.temperature,
            max_tokens=profile.max_tokens,
            schema=schema,
            insist=profile.insist,
            limit_name=profile.traits.limit,
            structured=profile.traits.structured,
            reasoning_effort=profile.traits.reasoning_effort,
            extra=msgspec.json.encode(profile.traits.extra_body),
        )

    def _kept(self, tick: int, request: ChatRequest) -> CallRequest:
        messages = tuple(map(recorded_message, request.messages))
        pictures = tuple(image for message in request.messages for image in message.images)
        head = msgspec.json.encode(parameters(request), order="sorted")
        # No tokenizer makes more than one token of a byte.
        prompt = len(head) + sum(len(one) + _OVERHEAD_TOKENS for one in messages)
        prompt += len(pictures) * self.profile.traits.image_tokens
        return CallRequest(
            tick=tick,
            number=self._number(tick),
            head=head,
            messages=messages,
            pictures=pictures,
            most_usd=self.profile.traits.cost_usd(prompt, request.max_tokens),
            most_tokens=prompt + request.max_tokens,
        )

    def _number(self, tick: int) -> int:
        """How many questions this boundary has had before."""
        before, number = self._asked_at
        self._asked_at = (tick, number + 1 if tick == before else 0)
        return self._asked_at[1]

    def _bill(self, result: CallResult) -> None:
        spent = self._unbilled
        self._unbilled = Usage(
            calls=spent.calls + result.attempts,
            prompt_tokens=spent.prompt_tokens + result.prompt_tokens,
            completion_tokens=spent.completion_tokens + result.completion_tokens,
            cost_usd=spent.cost_usd + (result.cost_usd or 0.0),
        )


def open_model(options: ModelOptions, calls: ModelCalls) -> AskedModel:
    """The model that the options name, with the record of its calls.

    Raises `UsageError` if its key or address is missing, or its price where money is capped.
    """
    profile = options.profile
    if calls.capped and not profile.traits.priced and not calls.replaying:
        raise UsageError(
            f"money is capped, and nobody has said what `{options.model}` costs",
            hint="give price_in= and price_out= (US dollars per million tokens), or both in models.toml; 0 is a price",
        )
    return AskedModel(profile, None if calls.replaying else open_client(options, profile), calls)


def open_client(options: ModelOptions, profile: ModelProfile) -> ModelClient:
    """The client that the profile asks for, behind a guard that knows its secrets. Raises `UsageError` if its key or
    its address is missing."""
    given = options.credentials(profile)
    secrets = (given.key, *given.secrets)
    client: ModelClient = DirectClient(given.url, given.key, given.login)
    if profile.client == "litellm":
        load_litellm()  # seconds of import: before the first barrier, and a missing package is told at once
        secrets = (*secrets, *_keys_of_environment())
        client = LitellmClient(given.url, given.key, given.login)
    return GuardedClient(limited(client, profile.service, given.url or profile.served), Redactor(secrets))


def _keys_of_environment() -> tuple[str, ...]:
    """The keys that litellm may find for itself."""
    return tuple(
        value
        for name, value in sorted(os.environ.items())
        if name.endswith(_KEY_VARIABLES) and len(value) >= _LEAST_KEY_LETTERS
    )


def _cause(result: CallResult) -> FailureCause:
    assert result.fault in ("service", "model", "time")
    return result.fault
