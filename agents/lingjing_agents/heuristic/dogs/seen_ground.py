"""The ground that a walker's pictures have shown: sample points over a region, and the next place for a picture.

Obstacles in the view are not known, so later passes look again from other places and assume shorter views.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing_agents.ground_plane import GroundPoint, lattice

SAMPLE_M = 8.0
"""Distance between sample points in metres. Chosen."""
PASSES_M = (36.0, 24.0, 18.0)
"""Assumed length of a view in metres, in each pass; the last one repeats. Chosen."""

WORTH = 4
"""Number of new samples that make a picture worth a tick. Chosen."""

OTHERS_M = 22.0
"""Assumed length in metres of another dog's views. Chosen."""

LOOK_COST_M = 45.0
"""Cost of the pictures at a place, in metres of walking. Chosen."""


def _always(_here: GroundPoint, _there: GroundPoint) -> bool:
    return True


@dataclass(slots=True)
class SeenGround:
    """The sample points that no dog has photographed in this pass."""

    polygons: tuple[tuple[GroundPoint, ...], ...]
    """The regions."""
    passes_m: tuple[float, ...] = PASSES_M
    """Assumed length of a view in metres, in each pass."""
    worth: int = WORTH
    """Number of new samples that make a picture worth a tick."""
    visible: Callable[[GroundPoint, GroundPoint], bool] = _always
    """A function that tests whether one place can be seen from another, as far as is known."""
    number: int = 0
    """Number of the pass, from 0."""
    unseen: set[GroundPoint] = field(default_factory=set)
    """Samples that are not photographed yet."""
    refused: set[GroundPoint] = field(default_factory=set)
    """Places that cannot be reached."""

    def __post_init__(self) -> None:
        self.again()

    @property
    def far_m(self) -> float:
        """The assumed length of a view in metres."""
        return self.passes_m[min(self.number, len(self.passes_m) - 1)]

    def again(self) -> None:
        """Reset all samples to unseen. The lattice is shifted by half a step in every second pass."""
        shift = SAMPLE_M / 2 * (self.number % 2)
        self.refused.clear()
        self.unseen = {place for polygon in self.polygons for place in lattice(polygon, SAMPLE_M, shift)}

    def next_pass(self) -> None:
        """Start another pass with shorter views."""
        self.number += 1
        self.again()

    def see(self, here: GroundPoint, heading_deg: float, half_deg: float) -> None:
        """Mark the samples of a picture from here, with half a field of view to both sides."""
        self.unseen -= set(self.shown(here, heading_deg, half_deg))

    def see_around(self, here: GroundPoint) -> None:
        """Mark the samples around a place that another dog has searched. Its obstacles are not known, so the radius is
        small.
        """
        self.unseen = {place for place in self.unseen if math.dist(place, here) > min(self.far_m, OTHERS_M)}

    def come_to(self, here: GroundPoint) -> None:
        """Mark the samples within the length of a view, where nearness counts and no picture."""
        self.unseen = {place for place in self.unseen if math.dist(place, here) > self.far_m}

    def refuse(self, place: GroundPoint) -> None:
        """Mark a place as unreachable."""
        self.refused.add(place)
        self.unseen = {other for other in self.unseen if math.dist(place, other) > SAMPLE_M * 0.8}

    def shown(self, here: GroundPoint, heading_deg: float, half_deg: float) -> list[GroundPoint]:
        """Return the unseen samples that a picture would show."""
        return [
            place
            for place in self.unseen
            if math.dist(here, place) <= self.far_m
            and (math.dist(here, place) < 1.0 or abs(turn_deg(heading_deg, bearing_deg(here, place))) <= half_deg)
            and self.visible(here, place)
        ]

    def best_turn(self, here: GroundPoint, heading_deg: float, half_deg: float) -> float | None:
        """Return the turn (a multiple of the field of view) for the picture with the most new samples; None if none is
        worth it.

        No turn wins a tie, because it costs nothing.
        """
        options = (0.0, -2 * half_deg, 2 * half_deg, 180.0)
        counts = [(len(self.shown(here, heading_deg + turn, half_deg)), -abs(turn), turn) for turn in options]
        if counts[0][0] >= self.worth:
            return 0.0
        most = max(counts)
        return most[2] if most[0] >= self.worth else None

    def next_place(
        self, here: GroundPoint, others: tuple[GroundPoint, ...], seen: Callable[[GroundPoint], bool] | None = None
    ) -> GroundPoint | None:
        """Return the next place for pictures: much unseen ground near `here`; None without a place.

        Places that are nearer to `here` than to `others` are preferred, and among them those that `seen` accepts.
        """
        options = sorted(place for place in self.unseen if place not in self.refused)
        own = [place for place in options if all(math.dist(place, here) <= math.dist(place, at) for at in others)]
        best, best_score = None, 0.0
        for place in [place for place in own if seen is not None and seen(place)] or own or options:
            gain = sum(1 for other in self.unseen if math.dist(place, other) <= self.far_m)
            score = gain / (LOOK_COST_M + math.dist(here, place))
            if score > best_score:
                best, best_score = place, score
        return best
