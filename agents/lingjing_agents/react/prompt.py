"""`ReactPrompt`: the prompt builder of `react`: its prompt and the facts of the brief, then the state as JSON."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.plugins.policy import Brief, Observation
from lingjing.plugins.scaffold import Situation
from lingjing_agents.react.facts import compact, interface, phrases_of
from lingjing_agents.react.prompt_files import PromptText
from lingjing_agents.react.road_costs import road_costs
from lingjing_agents.react.state import RequestLedger, observation_text
from lingjing_agents.react.step import CROPS_TOLD


class ReactPrompt:
    """The texts of one agent. `crops` is the number of crops of a boundary, `route` the content of the intervention."""

    def __init__(self, prompt: PromptText, brief: Brief, *, crops: int, route: Mapping[str, object]) -> None:
        self._prompt = prompt
        self._brief = brief
        self._crops = crops
        self._route = route

    def system(self, first: Observation, memory: str, answer: str) -> str:
        """Return the filled prompt, the facts of the interface, and one section for each further text.

        `answer` fills the prompt's hole of the schema; without that hole it is the last section.
        """
        say, costs = phrases_of(self._brief), road_costs(self._brief, first)
        sections = (
            self._prompt.filled(self._brief, answer),
            interface(self._brief),
            memory,
            f"{say('SEEING CLOSER')}\n{say(CROPS_TOLD, crops=self._crops)}" if self._crops else "",
            f"{say('GIVEN OF THE ROUTE')}\n{compact(self._route)}" if self._route else "",
            "" if costs is None else f"{say('ROADS (shortest ways when they are empty)')}\n{compact(costs)}",
            "" if self._prompt.has_schema else answer,
        )
        return "\n\n".join(section for section in sections if section)

    def state(self, situation: Situation) -> str:
        """Return the boundary as one line of JSON."""
        return observation_text(
            situation.observation,
            situation.inbox,
            self._brief,
            situation.pictures,
            situation.images,
            RequestLedger(situation.commands),
            situation.members,
        )
