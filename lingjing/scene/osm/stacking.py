"""Pieces of buildings that stand in or on each other, set so that no two show their walls in the same plane.

Mappers let a tower's part begin at the ground inside its podium's outline, or draw a wing twice. Where the walls of two
such pieces lie in one plane a picture would show now one, now the other. Pieces that pass through each other with their
walls apart (spheres on a shaft, drawn as discs) are left as they are. The room all take up together does not change.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from lingjing.scene.city import Building
from lingjing.scene.cutting import polygons, rings

PLANE_M = 0.06
"""Walls closer than this lie in one plane: outlines are simplified to 5 cm."""

SHARED_M = 1.0
"""Two pieces with less wall than this in common are left as they are."""

INSIDE = 0.98
"""A piece stands within another with this share of its ground."""

SLIVER_M = 0.1
"""What is left of a piece and nowhere wider than twice this is dropped."""

LEFT = "-left"
"""The id of a further part of what is left of a piece is that of the piece, this, and a number."""

PARAPET_M = 1.0
"""How far over its top a flat roof's parapet may reach, and then some."""


def settled(pieces: Sequence[Building]) -> tuple[Building, ...]:
    """The pieces in their order, some shorter or smaller, some gone or in several; roofs built upon are `bare`."""
    if not pieces:
        return ()
    pile = _StackedPieces(pieces)
    for a, b in pile.touching():
        pile.part(a, b)
    for a, b in pile.touching():
        pile.bare(a, b)
    return tuple(pile.result())


class _StackedPieces:
    """Pieces and their shapes, changed pair by pair; None for a piece that is gone."""

    def __init__(self, pieces: Sequence[Building]) -> None:
        import shapely

        self._given = pieces
        self._pieces: list[Building] = list(pieces)
        self._shapes = [shapely.make_valid(shapely.Polygon(piece.polygon, piece.holes)) for piece in pieces]
        found = shapely.STRtree(self._shapes).query(self._shapes, predicate="intersects").T.tolist()
        self._pairs = sorted((a, b) for a, b in found if a < b)
        self._cut: set[int] = set()

    def touching(self) -> list[tuple[int, int]]:
        """The pairs that have ground in common, the lower piece first, the smaller one of equals."""
        return [min((a, b), (b, a), key=lambda pair: self._rank(pair[0])) for a, b in self._pairs]

    def part(self, low: int, high: int) -> None:
        """Set two pieces apart if they show walls in one plane at one height."""
        lower, upper = self._pieces[low], self._pieces[high]
        if min(lower.top_m, upper.top_m) - max(lower.base_m, upper.base_m) < 0.05 or not self._shares_walls(low, high):
            return
        walls_m = lower.top_m - lower.roof_m, upper.top_m - upper.roof_m
        if self._is_podium(low, high):
            self._pieces[high] = _between(upper, lower.top_m, upper.top_m)
        elif upper.base_m <= lower.base_m + 0.05 and walls_m[0] <= walls_m[1] + 0.05:
            self._subtract(low, high)
        elif lower.base_m < upper.base_m and self._is_within(low, high):
            self._pieces[low] = _between(lower, lower.base_m, upper.base_m)

    def bare(self, low: int, high: int) -> None:
        """Leave a roof without parapet where the wall of what stands on it goes on from its own."""
        lower, upper = self._pieces[low], self._pieces[high]
        meets = lower.top_m - 0.05 <= upper.base_m < lower.top_m + PARAPET_M and upper.top_m > lower.top_m
        if lower.roof == "flat" and meets and self._shares_walls(low, high):
            self._pieces[low] = msgspec.structs.replace(lower, roof="bare")

    def result(self) -> Iterator[Building]:
        for k, piece in enumerate(self._pieces):
            if k in self._cut:
                yield from _reshaped(piece, self._shapes[k])
            else:
                yield piece

    def _rank(self, k: int) -> tuple[float, float, int]:
        return self._given[k].top_m, self._shapes[k].area, k

    def _is_podium(self, low: int, high: int) -> bool:
        """Whether the higher piece rises out of the flat roof of the lower one, and only there."""
        lower, upper = self._pieces[low], self._pieces[high]
        rises = upper.base_m >= lower.base_m - 0.05 and upper.top_m - upper.roof_m > lower.top_m + 0.3
        return lower.roof == "flat" and rises and self._is_within(high, low)

    def _is_within(self, inner: int, outer: int) -> bool:
        shape = self._shapes[inner]
        return bool(shape.intersection(self._shapes[outer]).area >= INSIDE * shape.area)

    def _shares_walls(self, a: int, b: int) -> bool:
        """Whether outlines run along each other with both pieces on the same side; not back to back."""
        import shapely

        # they may also touch in lines and points, which have no outline
        shared = shapely.union_all(list(polygons(self._shapes[a].intersection(self._shapes[b]))))
        if shared.area < SHARED_M * PLANE_M:
            return False
        along = shared.boundary.intersection(self._shapes[a].boundary.buffer(PLANE_M))
        return bool(along.intersection(self._shapes[b].boundary.buffer(PLANE_M)).length > SHARED_M)

    def _subtract(self, low: int, high: int) -> None:
        self._shapes[low] = self._shapes[low].difference(self._shapes[high])
        self._cut.add(low)


def _between(piece: Building, base_m: float, top_m: float) -> Building:
    """A piece from one height to another, with as many of its storeys."""
    share = (top_m - base_m) / (piece.top_m - piece.base_m)
    return msgspec.structs.replace(piece, base_m=base_m, top_m=top_m, levels=max(1, round(share * piece.levels)))


def _reshaped(piece: Building, shape: Any) -> Iterator[Building]:
    """A piece on what is left of its ground."""
    import shapely

    # opened, so that no sliver hangs on it; to the millimetre here, where that keeps it sound
    wide = shape.buffer(-SLIVER_M, join_style="mitre").buffer(SLIVER_M, join_style="mitre")
    left = list(polygons(shapely.set_precision(wide, 0.001)))
    for number, part in enumerate(left):
        for outline, *holes in filter(None, (rings(part),)):
            name = f"{piece.id}{LEFT}{number}" if number else piece.id
            yield msgspec.structs.replace(piece, id=name, polygon=outline, holes=(*holes,))
