"""Adversaries that do without messages: `Deaf`, `Loner` and `Whiteboard`. They see what the heuristic sees.

They answer whether a mission of tier 1 needs its bus (ADR 0055).

- `Deaf`: receives no message of another agent; its own are sent, and adjudicated like any other.
- `Loner`: is written to need none. Agents that search with a camera search alone. All others explore by themselves:
  they sweep the region around them, lane after lane, and take pictures where they can.
- `Whiteboard`: its agents exchange messages and observations beside the bus, over a global variable of their process
  and over files. Reports alone go over the bus.
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing.plugins.policy import (
    Action,
    Brief,
    Datum,
    Decision,
    EntityView,
    Envelope,
    Inbox,
    Observation,
    Outgoing,
    Policy,
    Resource,
)
from lingjing_agents.capability import (
    drive,
    first_argument_bounds,
    fly,
    has_verb,
    nadir_camera,
    photo,
    rated,
    route_to,
    sends,
    straight_to,
    walks,
)
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, inside
from lingjing_agents.heuristic.policy import HeuristicPolicy

LANE_M = 90.0
"""Distance between the lanes of a sweep, metres (chosen: a lifeboat reaches 50 m to both sides)."""
NEAR_M = 12.0
"""Distance at which a place of a sweep counts as reached, metres (chosen)."""
STUCK_TICKS = 4
"""Ticks without an approach to the next place after which it is given up (chosen)."""


class Deaf:
    """The heuristic, of which every agent receives no message. It sends and acts as before."""

    def __init__(self) -> None:
        self._wrapped: Policy = HeuristicPolicy()

    async def reset(self, brief: Brief) -> None:
        """Reset the heuristic."""
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision without messages of others."""
        return await self._wrapped.act(observation, msgspec.structs.replace(inbox, messages=()))


class Loner:
    """A player that needs no messages: it searches, drives, sails and walks by itself."""

    def __init__(self) -> None:
        self._wrapped: Policy = HeuristicPolicy()
        self._sweep: _Sweep | None = None

    async def reset(self, brief: Brief) -> None:
        """Select the behaviour of the agent."""
        body = next((resource for resource in brief.resources if resource.embodied), None)
        reports = sends(brief, "report") is not None or any(spec.category == "report" for spec in brief.messages)
        searches = body is not None and bool(brief.cells) and bool(body.cameras) and reports
        sees = body is not None and walks(body.verbs) and bool(body.cameras)
        self._sweep = _Sweep(brief, body) if body is not None and not searches and not sees else None
        await self._wrapped.reset(msgspec.structs.replace(brief, hub=None))

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of the heuristic; an agent without a picture of its own sweeps instead."""
        decision = await self._wrapped.act(observation, msgspec.structs.replace(inbox, messages=()))
        if self._sweep is None or decision.command is not None:
            return decision
        return msgspec.structs.replace(decision, command=self._sweep.command(observation))


BOARD: dict[int, dict[str, _Page]] = {}
"""The whiteboard of all agents in one process: the pages by tick and agent. An episode's first turn clears it."""
KEPT_TICKS = 4
"""Ticks for which a page is kept (chosen)."""


class _Page(msgspec.Struct, frozen=True):
    """The notes of one agent at one tick."""

    messages: tuple[Outgoing, ...]
    entities: tuple[EntityView, ...]


class Whiteboard:
    """The heuristic with a whiteboard in the place of the bus."""

    def __init__(self) -> None:
        self._wrapped: Policy = HeuristicPolicy()

    async def reset(self, brief: Brief) -> None:
        """Reset the heuristic."""
        self._brief = brief
        self._folder = Path(tempfile.gettempdir()) / f"whiteboard-{os.getppid()}"
        self._kinds = {message.kind: message for message in brief.messages}
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision after a look at the board, and write what others may need."""
        pages = self._pages(observation.tick - 1)
        seen = {view.id: view for page in pages.values() for view in page.entities if view.position is not None}
        own = {view.id: view for view in observation.entities}
        complete = {name: _merged(own.get(name), view) for name, view in seen.items()}
        whole = replace(observation, entities=tuple({**own, **complete}.values()))
        received = tuple(self._envelopes(pages, observation.tick))
        decision = await self._wrapped.act(whole, msgspec.structs.replace(inbox, messages=received))
        reports = tuple(message for message in decision.messages if "box" in message.body)
        notes = tuple(message for message in decision.messages if "box" not in message.body)
        self._write(observation.tick, _Page((*notes, *reports), observation.entities))
        return msgspec.structs.replace(decision, messages=reports)

    def _envelopes(self, pages: dict[str, _Page], tick: int) -> Iterator[Envelope]:
        """Yield the messages of other agents as if the bus had delivered them."""
        for agent, page in sorted(pages.items()):
            for number, message in enumerate(page.messages):
                if agent != self._brief.agent and (not message.to or self._brief.agent in message.to):
                    kind = self._kinds.get(message.kind)
                    yield Envelope(
                        id=f"w{tick}-{agent}-{number}", tick=tick, sender=agent, recipient=self._brief.agent,
                        kind=message.kind, category=kind.category if kind is not None else "other",
                        body=dict(message.body), bytes=0, deliver_at=tick,
                    )  # fmt: skip

    def _pages(self, tick: int) -> dict[str, _Page]:
        """Return the pages of a tick: those of this process, and those of the files that can be read."""
        pages = dict(BOARD.get(tick, {}))
        for file in self._folder.glob(f"{tick}-*.json"):
            with contextlib.suppress(OSError, msgspec.MsgspecError):
                pages[file.stem.partition("-")[2]] = from_json(file.read_bytes(), _Page)
        return pages

    def _write(self, tick: int, page: _Page) -> None:
        if tick == 0:
            BOARD.clear()
        BOARD.setdefault(tick, {})[self._brief.agent] = page
        BOARD.pop(tick - KEPT_TICKS, None)
        with contextlib.suppress(OSError):
            self._folder.mkdir(exist_ok=True)
            file = self._folder / f"{tick}-{self._brief.agent}.json"
            file.with_suffix(".new").write_bytes(msgspec.json.encode(page))
            file.with_suffix(".new").replace(file)


def _merged(own: EntityView | None, other: EntityView) -> EntityView:
    """Return the agent's own view of an entity with the fields that only another agent observes."""
    if own is None:
        return other
    known = {name: value for name in own.__struct_fields__ if (value := getattr(own, name)) not in (None, (), {})}
    return msgspec.structs.replace(other, **known)


class _Sweep:
    """A sweep of one body over the smallest region around it, or else the largest one, lane after lane."""

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body
        self._places: list[GroundPoint] | None = None
        self._nearest, self._since = math.inf, 0
        self._is_due_for_photo = False
        self._turned = 0

    def command(self, observation: Observation) -> Action | None:
        """Return the command towards the next place; a walker without a place wanders."""
        own = next((view for view in observation.entities if view.id == self._body.id), None)
        if own is None or own.position is None:
            return self._wander(observation.tick)
        if own.busy:
            return None
        camera = nadir_camera(self._body)
        if self._is_due_for_photo and camera is not None:
            self._is_due_for_photo = False
            return photo(self._body, camera)
        here = own.position[:2]
        if self._places is None:
            self._places = self._planned(here)
        place = self._next(here, observation.tick)
        if place is None:
            return None
        self._is_due_for_photo = camera is not None
        if walks(self._body.verbs):
            return self._walked(here, own.heading_deg or 0.0, place)
        if straight_to(self._body, "x", "y", "z"):
            low, high = rated(self._body, "band_low_m", 40.0), rated(self._body, "band_high_m", 80.0)
            return fly(self._body, *place, min(max(60.0, low), high))
        return drive(self._body, place) if route_to(self._body) or straight_to(self._body, "x", "y") else None

    def _planned(self, here: GroundPoint) -> list[GroundPoint]:
        regions = [region.polygon for region in self._brief.regions if len(region.polygon) >= 3]
        if not regions:
            return []
        around = [polygon for polygon in regions if inside(polygon, here)]
        size = {id(polygon): GroundRectangle.around(polygon).area_m2 for polygon in regions}
        chosen = max(around or regions, key=lambda polygon: size[id(polygon)])
        xs, ys = [x for x, _ in chosen], [y for _, y in chosen]
        lanes = max(1, round((max(ys) - min(ys)) / LANE_M))
        places: list[GroundPoint] = []
        for lane in range(lanes):
            y = min(ys) + (lane + 0.5) * (max(ys) - min(ys)) / lanes
            many = max(2, round((max(xs) - min(xs)) / LANE_M))
            row = [(min(xs) + (k + 0.5) * (max(xs) - min(xs)) / many, y) for k in range(many)]
            places += row if lane % 2 == 0 else row[::-1]
        return places if math.dist(here, places[0]) <= math.dist(here, places[-1]) else places[::-1]

    def _next(self, here: GroundPoint, tick: int) -> GroundPoint | None:
        assert self._places is not None
        while self._places:
            far = math.dist(here, self._places[0])
            if far < self._nearest - 1.0:
                self._nearest, self._since = far, tick
            if far > NEAR_M and tick - self._since <= STUCK_TICKS:
                return self._places[0]
            self._places.pop(0)
            self._nearest, self._since = math.inf, tick
        return None

    def _walked(self, here: GroundPoint, heading_deg: float, place: GroundPoint) -> Action:
        turn = turn_deg(heading_deg, bearing_deg(here, place))
        if abs(turn) > 8.0:
            return self._step("right" if turn > 0.0 else "left", abs(turn))
        return self._step("forward", math.dist(here, place))

    def _wander(self, tick: int) -> Action | None:
        """Return a step of a walker that does not know its place: straight on, with a turn now and then."""
        if not has_verb(self._body, "forward"):
            return None
        self._turned += 1
        return self._step("left", 60.0) if self._turned % 6 == 0 else self._step("forward", 100.0)

    def _step(self, verb: str, amount: float) -> Action:
        least, most = first_argument_bounds(self._body.verbs, verb)
        spec = next(each for each in self._body.verbs if each.name == verb)
        arguments: dict[str, Datum] = {spec.arguments[0].name: round(max(least, min(amount, most)), 2)}
        return Action(verb=verb, arguments=arguments, resource=self._body.id)
