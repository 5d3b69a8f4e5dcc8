"""`TurnMemory`: the memory of `react`: earlier turns, bounded in tokens, and the lines that the model keeps.

Services cache the beginning of a request. So a kept turn never changes. When the bound is passed, the oldest turns are
removed in one block, down to half of the bound. The beginning of a request then stays the same for many boundaries.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.scaffold import MemoryLimits, Turn
from lingjing_agents.react.step import MEMORY_TOLD

LETTERS_PER_TOKEN = 3.0
"""Letters of a token in JSON with many numbers; prose has about 4. Chosen low: a bound that is too strict does no
harm."""

PIXELS_PER_TOKEN = 28 * 28
"""Pixels of a token of an image: the patch of most models. Chosen."""


class TurnMemory:
    """The earlier turns and the kept lines of one agent. With `keeps_lines` the model may keep lines."""

    def __init__(self, *, keeps_lines: bool) -> None:
        self._keeps_lines = keeps_lines
        self._limits = MemoryLimits(tokens=0, images=0)
        self._lines: dict[str, tuple[str, ...]] = {}
        self._turns: list[tuple[ChatMessage, ChatMessage, int]] = []

    @property
    def instructions(self) -> str:
        """The section of the system text about the memory; "" without one."""
        return f"YOUR MEMORY\n{MEMORY_TOLD}" if self._keeps_lines else ""

    def begin(self, limits: MemoryLimits) -> None:
        """Set the bounds of the turns."""
        self._limits = limits

    def members(self) -> Mapping[str, object]:
        """Return the lines that the model wrote last, by field."""
        return self._lines

    def turns(self) -> tuple[ChatMessage, ...]:
        """Return the turns in order: the text of the state, then the answer."""
        return tuple(message for state, answer, _ in self._turns for message in (state, answer))

    def record(self, turn: Turn) -> None:
        """Keep a turn and its lines. Images of its reported pictures are kept too, within the bound of images."""
        if turn.step.memory:
            self._lines = {**self._lines, **turn.step.memory}
        if self._limits.tokens == 0:
            return
        reported = {str(message.body.get("frame")) for message in turn.decision.messages}
        room = self._limits.images - sum(len(state.images) for state, _, _ in self._turns)
        kept = [image for image in turn.images if image.frame in reported][: max(0, room)]
        tokens = text_tokens(turn.state) + text_tokens(turn.answer)
        tokens += sum(image.pixels // PIXELS_PER_TOKEN for image in kept)
        state = ChatMessage("user", turn.state, tuple(image.jpeg for image in kept))
        self._turns.append((state, ChatMessage("assistant", turn.answer), tokens))
        if self._used() > self._limits.tokens:
            while self._turns and self._used() > self._limits.tokens // 2:
                del self._turns[0]

    def _used(self) -> int:
        return sum(tokens for _, _, tokens in self._turns)


def text_tokens(text: str) -> int:
    """Return about how many tokens a text has."""
    return int(len(text) / LETTERS_PER_TOKEN) + 1
