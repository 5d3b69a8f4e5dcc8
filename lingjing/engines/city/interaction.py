"""Who is near enough to a target to act on it, and the verb with which the kernel allows it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.instance import InteractionSpec, Vector

Actor = tuple[str, Vector]
"""Somebody who may act: its id and where it is."""


def actors_in_reach(interaction: InteractionSpec, target: Vector, actors: Sequence[Actor]) -> list[tuple[str, float]]:
    """The actors within reach (inclusive, in the plane) with their distances in metres: nearest first, of equally near
    ones in the order given."""
    distances = [(math.dist(place[:2], target[:2]), order) for order, (_, place) in enumerate(actors)]
    return [(actors[order][0], far) for far, order in sorted(distances) if far <= interaction.within_m]
