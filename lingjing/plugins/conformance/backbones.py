"""The checks of a chat-model backbone: it answers, or raises `ModelError`, and its texts hold no secret.

They make a few short requests to the service that the case names.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lingjing.plugins.backbone import (
    BackbonePlugin,
    ChatMessage,
    ChatRequest,
    ModelCompletion,
    ModelError,
    ServiceAccess,
)
from lingjing.plugins.conformance.case import ConformanceError, require, run_all
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.hook_faults import check_declaration
from lingjing.trace.images import encode_jpeg

GREY = 128
"""The value of each channel of the image of a request."""

UNKNOWN = "conformance-no-such-model"
TIMEOUT_S = 60.0
"""Wall clock for one request. Chosen: a model on a CPU answers a few words within it."""


@dataclass(frozen=True, slots=True)
class BackboneCase:
    """The inputs of the checks of a backbone."""

    plugin: BackbonePlugin
    model: str
    access: ServiceAccess
    images: bool = False
    """True if the model takes images."""
    max_tokens: int = 64

    def request(self, text: str = "Answer with the word yes.", images: tuple[bytes, ...] = ()) -> ChatRequest:
        """Return a request without a schema."""
        turns = (ChatMessage("system", "You answer with one word."), ChatMessage("user", text, images))
        return ChatRequest(self.model, turns, max_tokens=self.max_tokens, structured="none")

    def ask(self, request: ChatRequest, timeout_s: float = TIMEOUT_S) -> object:
        """Make a request to a new backbone, in an event loop of its own. Returns its answer or its `ModelError`."""
        try:
            return asyncio.run(self.plugin.factory(self.access).complete(request, timeout_s))
        except ModelError as error:
            return error
        except Exception as error:
            raise ConformanceError(f"complete: {one_line(error)}; it must raise a ModelError") from error


def check_backbone(
    plugin: BackbonePlugin, model: str, access: ServiceAccess | None = None, *, images: bool = False
) -> None:
    """Run every check of a backbone with a model of its service; one `ConformanceError` lists all that failed."""
    check_declaration(plugin, "lingjing_backbones", plugin.name)
    case = BackboneCase(plugin, model, access or ServiceAccess(""), images)
    run_all(f"backbone `{plugin.name}`", BACKBONE_CHECKS, case)


def check_completion(case: BackboneCase) -> None:
    """Check that a request returns a whole `ModelCompletion`, in each of two event loops."""
    for _ in range(2):
        _require_completion("a request", case.ask(case.request()))


def check_one_object(case: BackboneCase) -> None:
    """Check that one backbone works in one event loop after another."""
    backbone = case.plugin.factory(case.access)
    for _ in range(2):
        try:
            answer: object = asyncio.run(backbone.complete(case.request(), TIMEOUT_S))
        except Exception as error:  # noqa: BLE001 - this is what the check is for
            answer = error
        _require_completion("a second event loop", answer)


def check_images(case: BackboneCase) -> None:
    """Check that a request with an image returns a completion, if the model takes images."""
    if case.images:
        grey = encode_jpeg(np.full((32, 32, 3), GREY, np.uint8))
        _require_completion("a request with an image", case.ask(case.request("Is it grey?", (grey,))))


def check_failures(case: BackboneCase) -> None:
    """Check that an unknown model and a timeout of 0 s give a completion or a `ModelError`, without secrets."""
    unknown = replace(case.request(), model=UNKNOWN)
    for answer in (case.ask(unknown), case.ask(case.request(), 0.0)):
        text = str(answer)
        for secret in (case.access.key, case.access.login):
            require(not secret or secret not in text, "complete: an error contains the key or the login")
        require(not isinstance(answer, ModelError) or bool(text), "complete: a ModelError has no text")


BACKBONE_CHECKS: tuple[Callable[[BackboneCase], None], ...] = (
    check_completion,
    check_one_object,
    check_images,
    check_failures,
)
"""Every check of a backbone."""


def _require_completion(what: str, answer: object) -> None:
    if isinstance(answer, BaseException):
        require(False, f"complete: {what} fails: {one_line(answer)}")
    require(
        isinstance(answer, ModelCompletion), f"complete: {what} returns {kind_of_value(answer)}, no ModelCompletion"
    )
    assert isinstance(answer, ModelCompletion)
    texts = (answer.text, answer.finish_reason, answer.reasoning)
    require(all(isinstance(text, str) for text in texts), f"complete: {what}: a text of the completion is not a string")
    require(bool(answer.finish_reason), f"complete: {what}: `finish_reason` is empty")
    counts: tuple[object, ...] = (answer.prompt_tokens, answer.completion_tokens, answer.cached_tokens)
    right = all(isinstance(count, int) and count >= 0 for count in counts)
    require(right, f"complete: {what}: the numbers of tokens are {counts}, not counts")
    require(answer.cached_tokens <= answer.prompt_tokens, f"complete: {what}: more tokens are cached than sent")


__all__ = [
    "BACKBONE_CHECKS", "BackboneCase", "check_backbone", "check_completion", "check_failures", "check_images",
    "check_one_object",
]  # fmt: skip
