"""How a policy whose behaviour hangs on a prompt offers its prompts, and how a better one is asked for.

`lingjing prompts` lists and shows them, and improves one on development episodes: it plays, gives the failed episodes
to a reviser, and keeps the best candidate. The core knows neither models nor services: a plug-in brings the reviser.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from lingjing.plugins.calls import ModelCalls


@dataclass(frozen=True, slots=True)
class Revision:
    """A new prompt; `asked` and `answered` are the words that led to it, kept for whoever reads. Of an answer that
    nobody can use `fault` says what is wrong ("is empty"), and there is no text."""

    text: str
    asked: str = ""
    answered: str = ""
    fault: str = ""


@dataclass(frozen=True, slots=True)
class TriedPrompt:
    """An earlier candidate that did no better; `results` say how it did, or why it could not be used."""

    text: str
    results: str


class PromptReviser(Protocol):
    """What writes the next candidate of a prompt."""

    def revise(self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> Revision:
        """A revision of a prompt that was played with these results and failed in these episodes, other than those
        that were tried.

        Raises `LingjingError` if nobody answers.
        """
        ...


@dataclass(frozen=True, slots=True)
class PromptPlugin:
    """The prompts of one policy.

    `policy` is the policy's name and `option` the option of it that takes a prompt's name or file. `shipped` gives the
    texts by name. `check` raises `ValueError` for a text that is no prompt. `reviser` makes one of the given options
    that tells the calls of its model to what it is given, and raises `UsageError` for wrong ones.
    """

    name: str
    policy: str
    option: str
    shipped: Callable[[], Mapping[str, str]]
    check: Callable[[str], None]
    reviser: Callable[[Mapping[str, str], ModelCalls], PromptReviser]
    summary: str = ""


__all__ = ["PromptPlugin", "PromptReviser", "Revision", "TriedPrompt"]
