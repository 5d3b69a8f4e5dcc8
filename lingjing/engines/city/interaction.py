"""Actors within reach of a target."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.instance import InteractionSpec, Vector

Actor = tuple[str, Vector]
"""An actor: its id and position."""


def actors_in_reach(interaction: InteractionSpec, target: Vector, actors: Sequence[Actor]) -> list[tuple[str, float]]:
    """Return the actors within reach (inclusive, in the plane) with their distances in metres.

    The nearest comes first; equally near actors keep the order of `actors`.
    """
    distances = [(math.dist(place[:2], target[:2]), order) for order, (_, place) in enumerate(actors)]
    return [(actors[order][0], far) for far, order in sorted(distances) if far <= interaction.within_m]
