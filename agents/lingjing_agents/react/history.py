"""`TurnHistory`: the earlier turns that a model is shown, bounded in tokens, with the pictures that matter.

Services keep what a request begins with. So a turn never changes once it is kept, and turns are let go in one block
when the bound is passed (the oldest, until half of it is left): the beginning of a request stays the same for long.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.plugins.policy import Decision
from lingjing_agents.llm.chat import ChatMessage
from lingjing_agents.react.pictures import SentImage

LETTERS_PER_TOKEN = 3.0
"""Of JSON with many numbers; prose has some 4. A bound that is too strict does no harm."""

PIXELS_PER_TOKEN = 28 * 28
"""What most models make of an image where nothing better is known."""


class TurnHistory:
    """Earlier turns of one agent: at most `tokens`, and among them at most `pictures` images of what was reported."""

    def __init__(self, tokens: int, pictures: int) -> None:
        self._most = tokens
        self._pictures = pictures
        self._turns: list[tuple[ChatMessage, ChatMessage, int]] = []

    def messages(self) -> tuple[ChatMessage, ...]:
        """The turns in order, what the agent was told and what it answered."""
        return tuple(self._flat())

    def _flat(self) -> Iterator[ChatMessage]:
        for told, answered, _ in self._turns:
            yield from (told, answered)

    def add(self, told: str, answered: str, decision: Decision, sent: Sequence[SentImage]) -> None:
        """Keep a turn. Of its images stay those whose pictures the decision reports on (they show what was found), as
        far as there is room: those of earlier turns stay while the turns do."""
        if self._most == 0:
            return
        named = {str(message.body.get("frame")) for message in decision.messages}
        room = self._pictures - sum(len(turn.images) for turn, _, _ in self._turns)
        kept = [image for image in sent if image.frame in named][: max(0, room)]
        tokens = text_tokens(told) + text_tokens(answered) + sum(image.pixels // PIXELS_PER_TOKEN for image in kept)
        images = tuple(image.jpeg for image in kept)
        self._turns.append((ChatMessage("user", told, images), ChatMessage("assistant", answered), tokens))
        if self._used() > self._most:
            while self._turns and self._used() > self._most // 2:
                del self._turns[0]

    def _used(self) -> int:
        return sum(tokens for _, _, tokens in self._turns)


def text_tokens(text: str) -> int:
    """About how many tokens a text has."""
    return int(len(text) / LETTERS_PER_TOKEN) + 1
