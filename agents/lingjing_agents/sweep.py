"""`sweep`: the paper's search without a model, a plain lawn-mower over the cells.

It stands for the decision layer alone and adds nothing that a model would have to decide. Each searcher flies the
cells of its share row by row, each row in the other direction, and takes one picture straight down from the middle of
each cell. It reports what the colour rules find there at the UAV's own position, which "transfers the UAV coordinate"
as the paper says. It takes no second look, merges nothing, and stops after one pass. A vessel or vehicle goes to the
reported places in the order of their arrival. A coordinator passes reports on as orders.

`heuristic` is the other policy without a model: it plans pictures by their footprint, confirms doubtful detections,
computes places from boxes, merges reports and searches again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import ClassVar

from lingjing.plugins.policy import (
    DEAD,
    NOTE,
    Action,
    Brief,
    Cell,
    Decision,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
)
from lingjing_agents.capability import (
    centimetres,
    compose,
    drive,
    fly,
    flying_camera,
    may_send,
    nadir_camera,
    photo,
    rated,
    sends,
    sighting,
    team,
    vehicle,
    vessel,
)
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.role_rules import RoleRules
from lingjing_agents.heuristic.target_types import ColourRule, target_type_of

REACHED_M = 12.0
"""Distance in metres at which a cell's middle counts as reached. Chosen."""

ATTEMPTS = 3
"""Number of flights to one cell before it is left out. Chosen."""

SURE = 0.3
"""Least confidence of a report. Chosen: that of the second look of `heuristic`, because no second look follows."""

SAME_ROW = 0.5
"""Share of a cell's extent from north to south within which two cells are in one row. Chosen."""

_NO_CELLS = "the plain sweep searches cells, and this agent has none to search"


class SweepPolicy:
    """The plain sweep. It needs no arguments and draws no random numbers."""

    def __init__(self) -> None:
        self._rules: RoleRules | None = None

    async def reset(self, brief: Brief) -> None:
        """Select the rules by the agent's body."""
        self._rules = _rules_for(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of the rules; an agent without rules does nothing, and its first decision says so."""
        if self._rules is not None:
            return self._rules.act(observation, inbox)
        return Decision(thought=f"{NOTE}{_NO_CELLS}") if observation.tick == 0 else Decision()


def _rules_for(brief: Brief) -> RoleRules | None:
    camera = flying_camera(brief)
    if camera is not None:
        return _Mower(brief, camera) if brief.cells else None
    body = vessel(brief) or vehicle(brief)
    if body is not None:
        return _Responder(body)
    return None if any(resource.embodied for resource in brief.resources) else _Relay(brief)


def lawn_mower(cells: Sequence[Cell]) -> tuple[Cell, ...]:
    """Return cells row by row from the south, each row in the other direction than the one before."""
    rows: list[list[Cell]] = []
    for cell in sorted(cells, key=lambda each: (each.centre[1], each.centre[0])):
        heights = [corner[1] for corner in cell.polygon]
        if rows and cell.centre[1] - rows[-1][0].centre[1] <= SAME_ROW * (max(heights) - min(heights)):
            rows[-1].append(cell)
        else:
            rows.append([cell])
    ordered = [sorted(row, key=lambda each: each.centre[0], reverse=bool(n % 2)) for n, row in enumerate(rows)]
    return tuple(itertools.chain.from_iterable(ordered))


class _Mower:
    """One airborne camera with its share of the cells."""

    roles: ClassVar[tuple[str, ...]] = ("searcher",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ("report",)

    def __init__(self, brief: Brief, body: Resource) -> None:
        camera, mates = nadir_camera(body), team(brief)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._report, kind = may_send(brief, "report"), target_type_of(brief)
        self._find: ColourRule | None = None if kind is None else kind[0].find
        self._class = "" if kind is None else kind[1]
        path, index = lawn_mower(brief.cells), mates.index(brief.agent)
        first, last = (len(path) * place // len(mates) for place in (index, index + 1))
        self._left = list(path[first:last])
        floor, ceiling = rated(body, "band_low_m", 0.0), rated(body, "band_high_m", math.inf)
        z = brief.water_level_m + min(max(brief.settings.get("altitude", 100.0), floor), ceiling)
        self._z = FlightLevels(index, len(mates), floor, ceiling, anchor_m=z).level(z)
        self._flights = 0

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Report what the picture of a cell shows, then go on to the next cell."""
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and picture.camera == self._camera.name:
                messages += tuple(self._reports(picture))
                self._next_cell()
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or own.status == DEAD:
            return Decision(messages=messages)
        return Decision(command=self._move(own.position, grounded=own.status == "grounded"), messages=messages)

    def _reports(self, picture: Picture) -> Iterator[Outgoing]:
        if self._report is None or self._find is None:
            return
        here = (*picture.pose.position[:2], self._brief.water_level_m)
        for find in self._find(picture.rgb, picture.pose, self._brief.water_level_m):
            if find.confidence >= SURE:
                place = centimetres(here)
                yield sighting(self._report, picture.frame, self._class, find.box, place, find.confidence)

    def _next_cell(self) -> None:
        self._left, self._flights = self._left[1:], 0

    def _move(self, here: tuple[float, float, float], *, grounded: bool) -> Action | None:
        if grounded:
            return fly(self._body, here[0], here[1], self._z)
        if self._flights >= ATTEMPTS:
            self._next_cell()
        if not self._left:
            return None
        there = (*self._left[0].centre[:2], self._z)
        if math.dist(here, there) <= REACHED_M:
            return photo(self._body, self._camera)
        self._flights += 1
        return fly(self._body, *there)


class _Responder:
    """A vessel or vehicle that goes to the reported places one after the other."""

    roles: ClassVar[tuple[str, ...]] = ("rescuer", "responder")
    reads: ClassVar[tuple[str, ...]] = ("report", "assignment")
    sends: ClassVar[tuple[str, ...]] = ()

    def __init__(self, body: Resource) -> None:
        self._body = body
        self._known: list[GroundPoint] = []
        self._gone = 0

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Store new places; go to the next one when the last command has ended."""
        for envelope in inbox.messages:
            place = position_in(envelope.body) if envelope.category in ("report", "assignment") else None
            if place is not None and place not in self._known:
                self._known.append(place)
        own = view_of(observation, self._body.id)
        if own is None or own.busy or self._gone >= len(self._known):
            return Decision()
        self._gone += 1
        return Decision(command=drive(self._body, self._known[self._gone - 1]))


class _Relay:
    """A coordinator that turns each report into an order to the bodies that do not search."""

    roles: ClassVar[tuple[str, ...]] = ("coordinator",)
    reads: ClassVar[tuple[str, ...]] = ("report",)
    sends: ClassVar[tuple[str, ...]] = ("assignment",)

    def __init__(self, brief: Brief) -> None:
        self._order, self._level = sends(brief, "assignment"), brief.water_level_m
        searchers = {role for message in brief.messages if message.category == "report" for role in message.senders}
        self._bodies = tuple(peer.id for peer in brief.peers if peer.resources and peer.role not in searchers)

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Pass the places of the new reports on."""
        places = [position_in(envelope.body) for envelope in inbox.messages if envelope.category == "report"]
        if self._order is None:
            return Decision()
        return Decision(
            messages=tuple(
                compose(self._order, {"assignee": body, "task": "serve", "position": (*place, self._level)}, to=(body,))
                for place in places
                if place is not None
                for body in self._bodies
            )
        )


__all__ = ["SweepPolicy", "lawn_mower"]
