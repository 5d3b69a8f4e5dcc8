"""Places: more members than fit into a region at the distance they must keep."""

from __future__ import annotations

import math

from lingjing.mission.feasibility.outline import Outline
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.feasibility.spread import PossiblePlaces
from lingjing.mission.geometry2d import convex_hull, signed_area

MILLIMETRE = 0.001
"""Places are drawn in steps of this; a smaller distance between them asks for nothing."""


def refute_places(outline: Outline) -> list[Proof]:
    """Groups whose drawn places cannot all lie in their region."""
    found = []
    for group, count, where in outline.drawn_sites:
        most = most_places(where)
        if count > most:
            hectares = sum(abs(signed_area(outline_)) for outline_ in where.outlines) / 10_000.0
            found.append(
                Proof(
                    "LJ0611",
                    f"target/{group}",
                    f"{count} places at least {spelled(where.apart)} m apart cannot fit into {hectares:.4g} ha: "
                    f"at most {most} can",
                    "lower `apart`, ask for fewer members, or widen the region",
                )
            )
    return found


def most_places(where: PossiblePlaces) -> float:
    """How many points at least `apart` from each other the region can hold, at most.

    Groemer (1960): a convex area A of perimeter P holds at most 2/√3 · A/d² + P/(2d) + 1 points with distances of d
    or more; the convex hull holds at least as many as what it is the hull of.
    """
    if where.apart < MILLIMETRE or not where.drawn:
        return math.inf
    hull = convex_hull(tuple(corner for outline in where.outlines for corner in outline))
    if len(hull) < 3:
        return math.inf
    around = sum(math.dist(a, b) for a, b in zip(hull, (*hull[1:], hull[0]), strict=True))
    apart = where.apart
    return math.floor(2.0 / math.sqrt(3.0) * abs(signed_area(hull)) / apart**2 + around / (2.0 * apart) + 1.0 + 1e-9)
