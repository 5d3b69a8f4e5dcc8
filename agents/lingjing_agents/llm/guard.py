"""`GuardedClient`: the border between a service and the rest of the program, which no key or password passes.

It redacts answers, errors and the logs of HTTP libraries during a call. Errors lose their causes, because these hold
the request with its headers.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from lingjing.plugins.backbone import Backbone, ChatRequest, ModelCompletion, ModelError
from lingjing_agents.llm.redaction import Redactor

MESSAGE_LETTERS = 300
"""Characters after which an error message is truncated. Chosen."""

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
"""The loggers of requests and answers, some only at level DEBUG. A filter applies to its own logger alone, so each gets
one.
"""


class GuardedClient:
    """A chat model behind a redactor."""

    def __init__(self, client: Backbone, redact: Redactor) -> None:
        self._client = client
        self._redact = redact

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Make one call. Raises `ModelError` without a cause; any other exception becomes one."""
        try:
            with _redacted_logs(self._redact):
                answer: object = await self._client.complete(request, timeout_s)
        except ModelError as error:
            failure = self._without_secrets(error)
        except Exception as error:  # noqa: BLE001 - any exception of a library may quote the request
            failure = self._without_secrets(ModelError(f"{type(error).__name__}: {error}", billed=True))
        else:
            if not isinstance(answer, ModelCompletion):
                kind = type(answer).__name__
                raise ModelError(f"the backbone returned a value of type `{kind}`, no ModelCompletion", billed=True)
            redact = self._redact
            return replace(
                answer,
                text=redact(answer.text),
                reasoning=redact(answer.reasoning),
                finish_reason=redact(answer.finish_reason),
                served=redact(answer.served),
                body=redact(answer.body),
            )
        raise failure  # outside of the `except`, so that it has no context with the request

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
