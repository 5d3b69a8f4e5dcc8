"""`RequestBudget`: the tokens of one request, the same for every model that plays.

The texts, the pictures and the longest answer share the budget. What is left is the room for earlier turns. It depends
on the mission and on the options alone: texts are counted by `token_bound`, pictures by the most costly rule of
`models.toml`. So two models of a suite are shown the same turns (ADR 0056).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.policy import Brief
from lingjing_agents.llm.picture_tokens import PictureRule, Size, jpeg_size, most_tokens
from lingjing_agents.react.token_bound import message_bound

GROWTH_TOKENS = 1500
"""Tokens by which the state of a later boundary may be longer than the first. Measured in all columns with the rules
of `heuristic`: 1,506 for the planner of `cd`, at most 1,190 elsewhere. Longer states push out earlier turns."""


@dataclass(frozen=True, slots=True)
class RequestBudget:
    """The budget of the requests of one agent."""

    tokens: int
    """Tokens of a request and its answer."""
    answer: int
    """Tokens of the longest answer."""
    rules: tuple[PictureRule, ...]
    """The rules that count pictures."""

    def pictures(self, files: Sequence[bytes]) -> int:
        """Return the bound on the tokens of JPEG files."""
        return most_tokens(self.rules, [jpeg_size(file) for file in files])

    def message(self, message: ChatMessage) -> int:
        """Return the bound on the tokens of a message with its pictures."""
        return message_bound(message.text) + self.pictures(message.images)

    def room(self, system: ChatMessage, state: str, sizes: Sequence[Size]) -> int:
        """Return the tokens for earlier turns, beside the system text, states that grow from the first one, and
        pictures of the given sizes."""
        states = message_bound(state) + GROWTH_TOKENS
        used = self.message(system) + states + most_tokens(self.rules, sizes) + self.answer
        return max(0, self.tokens - used)

    def fitted(
        self, system: ChatMessage, turns: tuple[ChatMessage, ...], question: ChatMessage
    ) -> tuple[ChatMessage, ...]:
        """Return the request: the system text, the latest turns that fit beside a long state, the question."""
        left = self.tokens - self.answer - self.message(system) - self.message(question)
        sizes = [self.message(message) for message in turns]
        first = 0
        while first < len(turns) and sum(sizes[first:]) > left:
            first += 2  # a state and its answer
        return (system, *turns[first:], question)


def picture_sizes(brief: Brief, most: int, longest_side: int) -> tuple[Size, ...]:
    """Return the sizes of the largest pictures that one boundary can bring to an agent, `most` at most."""
    sizes = [_shrunk((view.camera.width, view.camera.height), longest_side) for view in brief.views]
    return tuple(sorted(sizes, key=lambda size: (size[0] * size[1], size), reverse=True)[:most])


def _shrunk(size: Size, longest_side: int) -> Size:
    scale = min(1.0, longest_side / max(size))
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))
