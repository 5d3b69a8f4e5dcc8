"""The prompts of a policy and their revision.

`lingjing prompts` lists and shows prompts. It improves one on development episodes: it plays, gives the failed episodes
to a *reviser*, and keeps the best candidate. A plug-in brings the reviser, because the core knows no model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from lingjing.plugins.calls import ModelCalls


@dataclass(frozen=True, slots=True)
class Revision:
    """A new prompt, or the fault of an answer that holds none."""

    text: str
    """The prompt; "" for an answer that cannot be used."""
    asked: str = ""
    """The request that led to it, for readers."""
    answered: str = ""
    """The whole answer, for readers."""
    fault: str = ""
    """The fault of the answer, in words that follow "it" ("is empty")."""


@dataclass(frozen=True, slots=True)
class TriedPrompt:
    """An earlier candidate that was no better."""

    text: str
    results: str
    """Its results, or the reason for which it could not be used."""


class PromptReviser(Protocol):
    """The author of the next candidate of a prompt, such as a second model."""

    def revise(self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> Revision:
        """Return a revision of a prompt that is none of those in `tried`.

        `results` describes how the prompt was played, `failures` the failed episodes. Raises `LingjingError` if the
        service does not answer.
        """
        ...


@dataclass(frozen=True, slots=True)
class PromptPlugin:
    """The declaration of the prompts of one policy through the hook `lingjing_prompts`."""

    name: str
    policy: str
    """The policy's name."""
    option: str
    """The option of the policy that takes a prompt's name or file."""
    shipped: Callable[[], Mapping[str, str]]
    """Returns the shipped texts by name."""
    check: Callable[[str], None]
    """Raises `ValueError` for a text that is no prompt."""
    reviser: Callable[[Mapping[str, str], ModelCalls], PromptReviser]
    """Returns a reviser with the given options; it records its model calls in the second argument. Raises `UsageError`
    for wrong options."""
    summary: str = ""


__all__ = ["PromptPlugin", "PromptReviser", "Revision", "TriedPrompt"]
