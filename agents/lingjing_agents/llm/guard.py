"""`GuardedClient`: the border between a service and everything else. What it lets through holds no key or password.

Answers, errors and what the HTTP libraries log during a call are redacted; an error leaves without the exceptions that
caused it, because these carry the request and its headers.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from lingjing_agents.llm.chat import ChatRequest, ModelClient, ModelCompletion, ModelError
from lingjing_agents.llm.redaction import Redactor

MESSAGE_LETTERS = 300

LOGGERS = (
    "httpx",
    "httpcore.connection",
    "httpcore.http11",
    "httpcore.http2",
    "httpcore.proxy",
    "httpcore.socks",
    "openai._base_client",
    "openai._response",
    "LiteLLM",
)
"""Who logs requests and answers, some of it only at the level DEBUG. A filter holds for its own logger alone."""


class GuardedClient:
    """A chat model behind a redactor."""

    def __init__(self, client: ModelClient, redact: Redactor) -> None:
        self._client = client
        self._redact = redact

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Ask once. Raises `ModelError`, without a cause; an exception that is none becomes one."""
        try:
            with _redacted_logs(self._redact):
                answer = await self._client.complete(request, timeout_s)
        except ModelError as error:
            failure = self._without_secrets(error)
        except Exception as error:  # noqa: BLE001 - whatever a library raises may quote the request
            failure = self._without_secrets(ModelError(f"{type(error).__name__}: {error}", billed=True))
        else:
            redact = self._redact
            return replace(
                answer,
                text=redact(answer.text),
                reasoning=redact(answer.reasoning),
                finish_reason=redact(answer.finish_reason),
            )
        raise failure  # outside of the `except`, so that no exception hangs on to it

    def _without_secrets(self, error: ModelError) -> ModelError:
        text = self._redact(str(error))
        return ModelError(
            text if len(text) <= MESSAGE_LETTERS else text[:MESSAGE_LETTERS] + "…",
            transient=error.transient,
            retry_after_s=error.retry_after_s,
            status=error.status,
            fault=error.fault,
            adapted=error.adapted,
            billed=error.billed,
        )


@contextmanager
def _redacted_logs(redact: Redactor) -> Iterator[None]:
    def redacted(record: logging.LogRecord) -> bool:
        text = record.getMessage()
        if record.exc_info:
            text += "\n" + logging.Formatter().formatException(record.exc_info)
        record.msg, record.args, record.exc_info, record.exc_text = redact(text), (), None, None
        return True

    loggers = [logging.getLogger(name) for name in LOGGERS]
    for logger in loggers:
        logger.addFilter(redacted)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(redacted)
