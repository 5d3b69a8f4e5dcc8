"""`AskedModel`: one agent's calls to its model, recorded, limited, retried and billed.

A call is first looked up in the record; a replay finds every call there and contacts no service. Otherwise it is made
with retries until the deadline, and its result, an answer or a failure, is recorded before the policy receives it. A
replay therefore needs no clock.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from lingjing.plugins.backbone import (
    Backbone,
    ChatMessage,
    ChatRequest,
    FailureCause,
    ModelCompletion,
    ModelError,
    ServiceAccess,
)
from lingjing.plugins.calls import AbandonedCallError, CallRequest, CallResult, ModelBroker, ModelCalls, ModelQuestion
from lingjing.plugins.policy import Usage, UsageError
from lingjing_agents.llm.chat import parameters, recorded_message
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.guard import GuardedClient
from lingjing_agents.llm.limits import limited
from lingjing_agents.llm.options import DIRECT, LITELLM, ModelOptions, ModelProfile
from lingjing_agents.llm.picture_tokens import jpeg_size
from lingjing_agents.llm.redaction import Redactor
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries
from lingjing_agents.llm.through_litellm import LitellmClient, load_litellm

_KEY_VARIABLES = ("_API_KEY", "_ACCESS_KEY", "_API_TOKEN", "_ACCESS_TOKEN", "_AUTH_TOKEN")
"""Suffixes of environment variables that hold keys."""
_LEAST_KEY_LETTERS = 16
"""Shortest value that counts as a key. Chosen: shorter ones may be ordinary words."""

_OVERHEAD_TOKENS = 64
"""Tokens that a service's template may add to one message. Chosen, on the safe side."""


_LIMITS = ("max_tokens", "max_completion_tokens")
"""The names of the bound on an answer in the protocol."""


@dataclass(frozen=True, slots=True)
class RawRequest:
    """A whole request in the OpenAI chat protocol, as a client of a policy has sent it."""

    members: Mapping[str, Any]
    """All of the request but its messages."""
    messages: tuple[Any, ...]
    """The messages as they were sent."""
    recorded: tuple[bytes, ...]
    """The messages as JSON for a record, pictures as SHA-256."""
    pictures: tuple[bytes, ...]
    """The JPEG files of the messages."""


class AskedModel:
    """A model with one agent's record of calls and the cost since the last bill.

    `profile` describes the model. `client` is None in a replay.
    """

    def __init__(self, profile: ModelProfile, client: Backbone | None, calls: ModelCalls) -> None:
        self.profile = profile
        self._client = client
        self._calls = calls
        self._unbilled = Usage()
        self._asked_at = (-1, 0)
        self._lock = threading.Lock()

    async def ask(
        self, tick: int, messages: tuple[ChatMessage, ...], deadline: CallDeadline, *, schema: bytes | None = None
    ) -> CallResult:
        """Return the model's answer to `messages` at boundary `tick`. `schema` is a JSON Schema as text.

        Raises `ModelError` without an answer within the deadline, and the errors of `ModelCalls.begin`.
        """
        request = self._request(messages, schema)
        return await self._result(request, self._kept(tick, request), deadline)

    async def _result(self, request: ChatRequest, kept: CallRequest, deadline: CallDeadline) -> CallResult:
        """Return the recorded result, or that of the service. Raises as `ask`."""
        try:
            result = self._calls.begin(kept)
        except AbandonedCallError as error:
            self._bill(error.result)
            raise
        if result is None:
            result = await self._asked(request, kept, deadline)
        else:
            self._bill(result)
        return _answer(result)

    async def forward(self, tick: int, raw: RawRequest, deadline: CallDeadline) -> CallResult:
        """Return the service's answer to a whole request, with `CallResult.body`. Raises as `ask`."""
        profile = self.profile
        most = max((raw.members[name] for name in _LIMITS if isinstance(raw.members.get(name), int)), default=None)
        limit = min(most or profile.max_tokens, profile.max_tokens)
        members = {name: value for name, value in raw.members.items() if name not in _LIMITS}
        members |= {"model": profile.served, profile.traits.limit: limit}
        whole = msgspec.json.encode({**members, "messages": raw.messages})
        request = ChatRequest(model=profile.served, messages=(), max_tokens=limit, whole=whole)
        kept = self._recorded(tick, msgspec.json.encode(members, order="sorted"), raw.recorded, raw.pictures, limit)
        return await self._result(request, kept, deadline)

    def bill(self) -> Usage:
        """Return the usage of the calls since the last bill."""
        usage, self._unbilled = self._unbilled, Usage()
        return usage

    async def _asked(self, request: ChatRequest, kept: CallRequest, deadline: CallDeadline) -> CallResult:
        assert self._client is not None, "a replay makes no calls"
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
                failure=attempts.with_failure(result.failure) if result.fault == "abandoned" else result.failure,
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
            served=answer.served,
            body=answer.body,
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
        return self._recorded(tick, head, messages, pictures, request.max_tokens)

    def _recorded(
        self, tick: int, head: bytes, messages: tuple[bytes, ...], pictures: tuple[bytes, ...], most_answer: int
    ) -> CallRequest:
        """Return a request as it is recorded, with the bounds of its tokens and its price."""
        # No tokenizer makes more than one token of a byte.
        prompt = len(head) + sum(len(message) + _OVERHEAD_TOKENS for message in messages)
        prompt += sum(self.profile.pictures.count(jpeg_size(picture)) for picture in pictures)
        return CallRequest(
            tick=tick,
            number=self._number(tick),
            head=head,
            messages=messages,
            pictures=pictures,
            most_usd=self.profile.traits.cost_usd(prompt, most_answer),
            most_tokens=prompt + most_answer,
        )

    def _number(self, tick: int) -> int:
        """Return the number of earlier calls at this boundary."""
        with self._lock:
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


class BrokeredModel(AskedModel):
    """A model behind the harness's broker, which makes, records and limits the calls."""

    def __init__(self, profile: ModelProfile, broker: ModelBroker, calls: ModelCalls) -> None:
        super().__init__(profile, None, calls)
        self._broker = broker

    async def ask(
        self, tick: int, messages: tuple[ChatMessage, ...], deadline: CallDeadline, *, schema: bytes | None = None
    ) -> CallResult:
        """See `AskedModel.ask`."""
        try:
            result = await self._broker.ask(ModelQuestion(tick, messages, deadline.left_s(), schema))
        except AbandonedCallError as error:
            self._bill(error.result)
            raise
        self._bill(result)
        return _answer(result)

    async def forward(self, tick: int, raw: RawRequest, deadline: CallDeadline) -> CallResult:
        """Raises `UsageError`: the broker builds every request itself."""
        raise UsageError(
            "an isolated policy cannot build a whole request itself", hint="play this policy without --isolate"
        )


def open_model(options: ModelOptions, calls: ModelCalls) -> AskedModel:
    """Return the model that the options name, with the record of its calls.

    Raises `UsageError` if its key or address is missing, or its price where money is capped.
    """
    profile = options.profile
    if calls.capped and not profile.traits.priced and not calls.replaying:
        raise UsageError(
            f"money is capped, and the price of `{options.model}` is not known",
            hint="give price_in= and price_out= (US dollars per million tokens), or both in models.toml; 0 is a price",
        )
    if calls.broker is not None:
        return BrokeredModel(profile, calls.broker, calls)
    return AskedModel(profile, None if calls.replaying else open_client(options, profile), calls)


def open_client(options: ModelOptions, profile: ModelProfile) -> Backbone:
    """Return the client of the profile, behind a guard for its secrets. Raises `UsageError` without its key or
    address.
    """
    credentials = options.credentials(profile)
    secrets = (credentials.key, *credentials.secrets)
    if profile.client == LITELLM:
        load_litellm()  # takes seconds: import it before the first barrier, and report a missing package early
        secrets = (*secrets, *_keys_of_environment())
    client = _backbone(profile.client, ServiceAccess(credentials.url, credentials.key, credentials.login))
    return GuardedClient(limited(client, profile.service, credentials.url or profile.served), Redactor(secrets))


def direct_backbone(access: ServiceAccess) -> Backbone:
    """Return the backbone over the OpenAI chat protocol."""
    return DirectClient(access.url, access.key, access.login)


def litellm_backbone(access: ServiceAccess) -> Backbone:
    """Return the backbone over litellm."""
    return LitellmClient(access.url, access.key, access.login)


_OWN = {DIRECT: direct_backbone, LITELLM: litellm_backbone}


def _backbone(name: str, access: ServiceAccess) -> Backbone:
    if name in _OWN:
        return _OWN[name](access)
    from lingjing.plugins.lookup import open_backbone  # its search for plug-ins costs time

    return open_backbone(name, access)


def _keys_of_environment() -> tuple[str, ...]:
    """Return the keys that litellm may read from the environment."""
    return tuple(
        value
        for name, value in sorted(os.environ.items())
        if name.endswith(_KEY_VARIABLES) and len(value) >= _LEAST_KEY_LETTERS
    )


def _answer(result: CallResult) -> CallResult:
    """Return a result with an answer. Raises `ModelError` for a failure."""
    if result.failure:
        raise FailedCallError(result)
    return result


class FailedCallError(ModelError):
    """The error of a call without an answer. `result` is its record."""

    def __init__(self, result: CallResult) -> None:
        super().__init__(result.failure, status=result.status, fault=_cause(result))
        self.result = result


def _cause(result: CallResult) -> FailureCause:
    assert result.fault in ("service", "model", "time", "backbone")
    return result.fault
