"""The contract of a writer of missions: a chat model that continues a conversation about the text of a mission.

`lingjing new mission --from` holds the conversation: it sends the language's card, the user's sentence, and what the
compiler and the mission's own tests say about each answer. A plug-in brings the writer: the core knows no model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.calls import ModelCalls


@dataclass(frozen=True, slots=True)
class WrittenAnswer:
    """One answer of a writer."""

    text: str
    """The whole answer, without the model's reasoning."""
    is_cut: bool = False
    """True if the limit of tokens ended it."""


class MissionWriter(Protocol):
    """A chat model with its options."""

    def write(self, conversation: Sequence[ChatMessage], grammar: str) -> WrittenAnswer:
        """Return the next answer. `grammar` describes the language in GBNF, for services that keep answers to one.

        Raises `InfrastructureError` if the service does not answer.
        """
        ...


@dataclass(frozen=True, slots=True)
class WriterPlugin:
    """The declaration of a writer through the hook `lingjing_writers`."""

    name: str
    factory: Callable[[Mapping[str, str], ModelCalls], MissionWriter]
    """Returns the writer with the given options; it records its calls in the second argument. Raises `UsageError` for
    wrong options."""
    summary: str = ""


__all__ = ["MissionWriter", "WriterPlugin", "WrittenAnswer"]
