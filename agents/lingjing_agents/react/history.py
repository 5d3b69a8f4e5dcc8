"""`TurnMemory`: the memory of `react`: earlier turns, bounded in tokens, and the lines that the model keeps.

Services cache the beginning of a request. So a kept turn never changes. When the bound is passed, the oldest turns are
removed in one block, down to half of the bound. The beginning of a request then stays the same for many boundaries.
A turn is kept as a difference to the one before (`state_difference`), so that more of them fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.languages import Phrases
from lingjing.plugins.scaffold import MemoryLimits, Turn
from lingjing_agents.react.state_difference import EARLIER_TURNS, shortened
from lingjing_agents.react.step import MEMORY_TOLD
from lingjing_agents.react.token_bound import message_bound


class TurnMemory:
    """The earlier turns and the kept lines of one agent.

    With `keeps_lines` the model may keep lines. `pictures` counts the tokens of JPEG files, `say` writes the texts.
    """

    def __init__(
        self, *, keeps_lines: bool, pictures: Callable[[Sequence[bytes]], int], say: Phrases | None = None
    ) -> None:
        self._say = say or Phrases()
        self._keeps_lines = keeps_lines
        self._picture_tokens = pictures
        self._before: str | None = None
        self._limits = MemoryLimits(tokens=0, images=0)
        self._lines: dict[str, tuple[str, ...]] = {}
        self._turns: list[tuple[ChatMessage, ChatMessage, int]] = []

    @property
    def instructions(self) -> str:
        """The sections of the system text about the memory and earlier turns."""
        say = self._say
        earlier = f"{say('EARLIER TURNS')}\n{say(EARLIER_TURNS)}"
        return f"{say('YOUR MEMORY')}\n{say(MEMORY_TOLD)}\n\n{earlier}" if self._keeps_lines else earlier

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
        text = shortened(turn.state, self._before, frozenset(image.frame for image in kept))
        self._before = turn.state
        files = tuple(image.jpeg for image in kept)
        tokens = message_bound(text) + message_bound(turn.answer) + self._picture_tokens(files)
        self._turns.append((ChatMessage("user", text, files), ChatMessage("assistant", turn.answer), tokens))
        if self._used() > self._limits.tokens:
            while self._turns and self._used() > self._limits.tokens // 2:
                del self._turns[0]

    def _used(self) -> int:
        return sum(tokens for _, _, tokens in self._turns)
