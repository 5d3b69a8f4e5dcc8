"""Numbers for names: the words that can occur in an agent's observations and actions, in a fixed order.

Number 0 always means "none of these". The order is that of the instance's declarations. It is the same for every seed
and mode in which the declared names are the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.kernel.mission_events import APPEARED, CHANGES, VANISHED, WEATHER
from lingjing.mission.instance import Instance
from lingjing.mission.vocabulary import ENGINE_EVENTS

STATUSES = ("accepted", "running", "completed", "rejected", "timed_out", "substituted")
"""Statuses of receipts; the status at index `i` has the number `i + 1`."""

EVENT_KINDS = (*ENGINE_EVENTS, WEATHER, APPEARED, VANISHED)
"""Kinds of events of the engines and of timed events. The mission's interactions and rules follow them, then the other
changes of events if the mission has such events."""


@dataclass(frozen=True, slots=True)
class Words:
    """An ordered set of words that are numbered from 1."""

    words: tuple[str, ...]
    """The words in order, without duplicates."""

    @classmethod
    def of(cls, words: Iterable[str]) -> Words:
        """Return the distinct words in their order."""
        return cls(tuple(dict.fromkeys(words)))

    def __len__(self) -> int:
        return len(self.words)

    def number(self, word: object) -> int:
        """Return the number of a word, or 0 for an unknown word."""
        return self.words.index(word) + 1 if word in self.words else 0

    def word(self, number: int) -> str | None:
        """Return the word of a number, or None for 0 and for a number out of range."""
        return self.words[number - 1] if 0 < number <= len(self.words) else None


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The words of one instance."""

    kinds: Words
    """Kinds of messages."""
    agents: Words
    """Ids of agents."""
    names: Words
    """Public names that a message may contain: types, agents, entities and cells."""
    events: Words
    """Kinds of events."""

    @classmethod
    def of(cls, instance: Instance) -> Vocabulary:
        """Return the vocabulary of an instance. Entities with a hidden position are left out."""
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
                (
                    *EVENT_KINDS,
                    *(unlock.interaction for unlock in instance.unlocks),
                    *(rule.name for rule in instance.rules),
                    *(() if all(event.is_fixed for event in instance.events) else CHANGES),
                )
            ),
        )
