"""Which ground a walker's pictures have shown: sample points over a region, and from where to look next.

What stands between is not known, so a later pass looks again from other places and trusts shorter views.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing_agents.ground_plane import GroundPoint, lattice

SAMPLE_M = 8.0
PASSES_M = (36.0, 24.0, 18.0)
"""How far a view is trusted in each pass; the last one repeats."""

WORTH = 4
"""A picture is worth a tick if it would show so many new samples."""

OTHERS_M = 22.0
"""How far somebody else's look around is trusted."""

LOOK_COST_M = 45.0
"""What the looks around at a place cost, in metres of walking."""


def _always(_here: GroundPoint, _there: GroundPoint) -> bool:
    return True


@dataclass(slots=True)
class SeenGround:
    """The samples of the regions' polygons that nobody has looked at in this pass. `visible` says whether one place may
    be seen from another, as far as is known."""

    polygons: tuple[tuple[GroundPoint, ...], ...]
    passes_m: tuple[float, ...] = PASSES_M
    worth: int = WORTH
    visible: Callable[[GroundPoint, GroundPoint], bool] = _always
    number: int = 0
    unseen: set[GroundPoint] = field(default_factory=set)
    refused: set[GroundPoint] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.again()

    @property
    def far_m(self) -> float:
        """How far a view is trusted."""
        return self.passes_m[min(self.number, len(self.passes_m) - 1)]

    def again(self) -> None:
        """Begin with everything unseen, on a lattice shifted by half a step in every second pass."""
        shift = SAMPLE_M / 2 * (self.number % 2)
        self.refused.clear()
        self.unseen = {place for polygon in self.polygons for place in lattice(polygon, SAMPLE_M, shift)}

    def next_pass(self) -> None:
        """Look at everything once more, more closely."""
        self.number += 1
        self.again()

    def see(self, here: GroundPoint, heading_deg: float, half_deg: float) -> None:
        """A picture was taken from here, with half a field of view to both sides."""
        self.unseen -= set(self.shown(here, heading_deg, half_deg))

    def see_around(self, here: GroundPoint) -> None:
        """Somebody else has looked all around here; what hid the rest from them is not known, so little counts."""
        self.unseen = {place for place in self.unseen if math.dist(place, here) > min(self.far_m, OTHERS_M)}

    def refuse(self, place: GroundPoint) -> None:
        """That place cannot be reached."""
        self.refused.add(place)
        self.unseen = {other for other in self.unseen if math.dist(place, other) > SAMPLE_M * 0.8}

    def shown(self, here: GroundPoint, heading_deg: float, half_deg: float) -> list[GroundPoint]:
        """The unseen samples that a picture would show."""
        return [
            place
            for place in self.unseen
            if math.dist(here, place) <= self.far_m
            and (math.dist(here, place) < 1.0 or abs(turn_deg(heading_deg, bearing_deg(here, place))) <= half_deg)
            and self.visible(here, place)
        ]

    def best_turn(self, here: GroundPoint, heading_deg: float, half_deg: float) -> float | None:
        """By how much to turn (a multiple of the field of view) for the picture that shows most; None if none is
        worth taking. Staying costs nothing, so it wins a tie."""
        options = (0.0, -2 * half_deg, 2 * half_deg, 180.0)
        counts = [(len(self.shown(here, heading_deg + turn, half_deg)), -abs(turn), turn) for turn in options]
        if counts[0][0] >= self.worth:
            return 0.0
        most = max(counts)
        return most[2] if most[0] >= self.worth else None

    def next_place(
        self, here: GroundPoint, others: tuple[GroundPoint, ...], seen: Callable[[GroundPoint], bool] | None = None
    ) -> GroundPoint | None:
        """Where to look around next: much to see and near, nearer to here than to the others if possible, and
        `seen` from here if anything worth going to is."""
        options = sorted(place for place in self.unseen if place not in self.refused)
        own = [place for place in options if all(math.dist(place, here) <= math.dist(place, at) for at in others)]
        best, best_score = None, 0.0
        for place in [place for place in own if seen is not None and seen(place)] or own or options:
            gain = sum(1 for other in self.unseen if math.dist(place, other) <= self.far_m)
            score = gain / (LOOK_COST_M + math.dist(here, place))
            if score > best_score:
                best, best_score = place, score
        return best
