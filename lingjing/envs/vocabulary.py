"""Names as numbers: every word that an agent may meet or say in one instance, in a fixed order.

0 always stands for "none of these". The order is that of the instance's declarations, so it is the same for every
seed and mode as long as the names are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.kernel.scheduled import APPEARED, VANISHED, WEATHER
from lingjing.mission.instance import Instance
from lingjing.mission.vocabulary import ENGINE_EVENTS

STATUSES = ("accepted", "running", "completed", "rejected", "timed_out", "substituted")
"""Words of receipts, from 1."""

EVENT_KINDS = (*ENGINE_EVENTS, WEATHER, APPEARED, VANISHED)
"""Events of engines, and those that happen by themselves; those of the mission's interactions and rules follow."""


@dataclass(frozen=True, slots=True)
class Words:
    """An ordered set of words that are numbered from 1."""

    words: tuple[str, ...]

    @classmethod
    def of(cls, words: Iterable[str]) -> Words:
        """The words in their order, each once."""
        return cls(tuple(dict.fromkeys(words)))

    def __len__(self) -> int:
        return len(self.words)

    def number(self, word: object) -> int:
        """The number of a word, 0 for one that is not known."""
        return self.words.index(word) + 1 if word in self.words else 0

    def word(self, number: int) -> str | None:
        """The word of a number; None for 0 and what lies beyond."""
        return self.words[number - 1] if 0 < number <= len(self.words) else None


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The words of an instance: message kinds, agents, public names that a message may carry, kinds of events."""

    kinds: Words
    agents: Words
    names: Words
    events: Words

    @classmethod
    def of(cls, instance: Instance) -> Vocabulary:
        """All of them. Entities with a hidden place have no public name."""
        entities = [entity for entity in instance.entities if "position" not in entity.hidden]
        return cls(
            kinds=Words.of(message.kind for message in instance.messages),
            agents=Words.of(agent.id for agent in instance.agents),
            names=Words.of(
                (
                    *(entity.type for entity in instance.entities),
                    *(agent.id for agent in instance.agents),
                    *(entity.id for entity in entities),
                    *(cell.name for cell in instance.cells if not cell.hidden),
                )
            ),
            events=Words.of(
                (*EVENT_KINDS, *(unlock.interaction for unlock in instance.unlocks), *(r.name for r in instance.rules))
            ),
        )
