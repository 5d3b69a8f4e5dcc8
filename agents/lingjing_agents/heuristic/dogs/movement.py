"""A dog's movement: from a goal to the next turn or forward step, around obstacles.

Receipts report when a step ended early (`blocked`, `unreachable`); a step without motion counts as blocked too.
"""

from __future__ import annotations

import math

from lingjing.plugins.geometry import bearing_deg, offset_xy, turn_deg
from lingjing.plugins.policy import Action, EntityView, Inbox, Resource
from lingjing_agents.capability import first_argument_bounds
from lingjing_agents.ground_plane import GroundPoint, between
from lingjing_agents.paths.kept_path import KeptPath
from lingjing_agents.paths.obstacle_grid import CELL_M, ObstacleGrid

OBSTRUCTED = frozenset({"blocked", "unreachable"})
"""Reason codes of an obstructed step."""
OFF_DEG = 6.0
"""Tolerated heading error of a walk in degrees: a turn costs a whole tick. Chosen."""

EYE_M = 0.37
"""Height of a dog's camera above the ground in metres."""

STALLED_M = 0.4
"""Motion in metres below which a step counts as blocked. Chosen."""
NARROW_M, WIDE = 2.4, 1.1
"""Half width of an assumed obstacle: metres, or shortest steps if those are longer, for a dog that cannot step short
must take a wide detour. Chosen.
"""

ONE_WALL_M, ONE_WALL_DEG, BEYOND_M = 12.0, 40.0, 5.0
"""Two walks in about one direction (degrees) that ended this near to each other (m) met one wall, which continues
`BEYOND_M` metres past the later one. Chosen.
"""

HAZARD_M = 3.0
"""Length in metres down to which a step that was rejected for water or a drop is halved and repeated. Chosen."""


class DogMovement:
    """The turns and steps of one dog."""

    def __init__(self, body: Resource, known: ObstacleGrid) -> None:
        self.body, self.map = body, known  # `map`: the known obstacles
        self.shortest_m, self.longest_m = first_argument_bounds(body.verbs, "forward", 0.5, 10.0)
        self.least_deg, self.most_deg = first_argument_bounds(body.verbs, "left", 1.0, 90.0)
        self.bumps = 0
        self._asked: tuple[GroundPoint, float, float] | None = None
        self._cap_m = math.inf
        self._way = KeptPath(known, self.shortest_m)
        self._hits: list[tuple[GroundPoint, float]] = []

    def feel(self, own: EntityView, inbox: Inbox) -> bool:
        """Evaluate the last step. Return whether it was obstructed."""
        if own.position is None or own.heading_deg is None:
            return False
        here = own.position[:2]
        self.map.tread(here)
        failed = [receipt for receipt in inbox.receipts if receipt.reason in OBSTRUCTED]
        requested, self._asked = self._asked, None if not own.busy else self._asked
        if requested is None or own.busy:
            return False
        start, heading, length = requested
        moved_m = math.dist(start, here)
        refused = any(receipt.reason == "unreachable" for receipt in failed)
        if refused and moved_m < STALLED_M and length > HAZARD_M:
            self._cap_m = length / 2.0
            return True
        if failed or (moved_m < STALLED_M and length > 2.0 * STALLED_M):
            self.map.bump(here, heading, half_width_m=max(NARROW_M, WIDE * self.shortest_m))
            self._hit(offset_xy(here, heading, CELL_M), heading)
            self.bumps += 1
            self._cap_m = math.inf
            return True
        self._cap_m = math.inf
        return False

    def sent(self, command: Action | None) -> None:
        """Process the command that was finally sent: a step that was planned but not sent has met nothing."""
        if command is None or command.verb != "forward":
            self._asked = None

    def _hit(self, place: GroundPoint, heading_deg: float) -> None:
        """Store the place where a walk was blocked. With the nearest such place from the same side it forms a wall."""
        same = [
            (math.dist(place, other), other)
            for other, heading in self._hits
            if CELL_M < math.dist(place, other) <= ONE_WALL_M and abs(turn_deg(heading, heading_deg)) <= ONE_WALL_DEG
        ]
        self._hits.append((place, heading_deg))
        if same:
            distance, other = min(same)
            self.map.wall(other, between(other, place, 1.0 + BEYOND_M / distance))

    def towards(
        self, own: EntityView, goal: GroundPoint, *, reach_m: float = 1.0, is_corner: bool = False
    ) -> Action | None:
        """Return the next command on the way to within `reach_m` of `goal`; None on arrival or without a path.

        A step ends short of the goal, unless the path has a corner there: a turn before the corner meets obstacles.
        """
        if own.position is None or own.heading_deg is None:
            return None
        here = own.position[:2]
        way = self._way.ahead(here, goal, reach_m)
        if not way:
            return None
        corner, last = way[0], len(way) == 1
        distance = math.dist(here, corner) - (reach_m * 0.5 if last and not is_corner else 0.0)
        return self.step(own, bearing_deg(here, corner), max(distance, self.shortest_m))

    def step(self, own: EntityView, bearing: float, distance_m: float) -> Action:
        """Return a turn to a bearing, or a step along it if the heading is near enough."""
        assert own.position is not None and own.heading_deg is not None
        here, off = own.position[:2], turn_deg(own.heading_deg, bearing)
        length = min(max(distance_m, self.shortest_m), self.longest_m, max(self._cap_m, self.shortest_m))
        ahead = offset_xy(here, own.heading_deg, length)
        if abs(off) > max(OFF_DEG, self.least_deg) or (abs(off) > OFF_DEG / 2 and not self.map.clear(here, ahead)):
            return self.turn(off)
        self._asked = here, own.heading_deg, length
        return Action(verb="forward", arguments={"distance": round(length, 2)}, resource=self.body.id)

    def turn(self, off_deg: float) -> Action:
        """Return a turn by `off_deg`, clockwise positive, as far as one command allows."""
        angle = min(max(abs(off_deg), self.least_deg), self.most_deg)
        verb = "right" if off_deg > 0 else "left"
        return Action(verb=verb, arguments={"angle": round(angle, 1)}, resource=self.body.id)
