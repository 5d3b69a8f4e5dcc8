"""`IdReader`: an adversary that reads names, numbers and their order, and no pixel of a picture's colour.

- A number in the channel `instance` of a picture that belongs to no body of a team is a target: its outline is its box.
- Orders are numbered: the first one of a city's orders is the large one, whatever an agent observes of it
  (`scenarios/cd.ljs`). So a driver fills in the demands that only another one observes, and receives no message.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from lingjing.plugins.policy import Brief, Decision, EntityView, Inbox, Observation, Picture, Policy
from lingjing_agents.adversaries.guesses import black
from lingjing_agents.capability import exchanged, natural
from lingjing_agents.heuristic.delivery_view import WANTED
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.perception.images import ImageBox
from lingjing_agents.perception.people_at_sea import FoundBox

FIRST_KG, OTHERS_KG = 250.0, 100.0
"""The demands of the first order and of all others, kilograms (from the mission's text)."""


class IdReader:
    """The heuristic with black pictures, the outlines of numbered targets, and demands by the order of names."""

    async def reset(self, brief: Brief) -> None:
        """Give the heuristic detectors that read numbers."""
        self._teams = {name for peer in brief.peers for name in peer.resources} | {r.id for r in brief.resources}
        self._reads_messages = exchanged(brief, "report")
        self._outlines: dict[str, list[tuple[str, ImageBox]]] = {}
        self._wrapped: Policy = HeuristicPolicy(dict.fromkeys(brief.classes, self._found))
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision on outlines and completed demands."""
        for picture in observation.pictures:
            self._outlines[picture.frame] = list(self._read(picture))
        dark = tuple(map(black, observation.pictures))
        seen = replace(observation, pictures=dark, entities=completed(observation.entities))
        received = inbox if self._reads_messages else msgspec.structs.replace(inbox, messages=())
        return await self._wrapped.act(seen, received)

    def _found(self, picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
        return tuple(FoundBox(box, 1.0) for _, box in self._outlines.get(picture.frame, ()))

    def _read(self, picture: Picture) -> list[tuple[str, ImageBox]]:
        """Return the outlines of all numbered things of no team, in the order of their numbers."""
        if picture.instance is None:
            return []
        height, width = picture.instance.shape
        boxes = []
        for name, number in sorted(picture.instance_ids.items(), key=lambda pair: pair[1]):
            rows, columns = np.nonzero(picture.instance == number)
            if name not in self._teams and rows.size:
                left, right = int(columns.min()) / width, (int(columns.max()) + 1) / width
                boxes.append((name, (left, int(rows.min()) / height, right, (int(rows.max()) + 1) / height)))
        return boxes


def completed(entities: tuple[EntityView, ...]) -> tuple[EntityView, ...]:
    """Return the views with a demand for each numbered place that shows none."""
    numbered = sorted((view.id for view in entities if view.id.startswith("point[")), key=natural)
    guessed = {name: FIRST_KG if name == "point[1]" else OTHERS_KG for name in numbered}
    return tuple(
        msgspec.structs.replace(view, resources={**(view.resources or {}), WANTED: guessed[view.id]})
        if view.id in guessed and WANTED not in (view.resources or {})
        else view
        for view in entities
    )
