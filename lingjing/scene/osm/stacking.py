"""Overlap of building pieces: changes pieces so that no two show their walls in the same plane.

Mappers let a tower's part begin at the ground inside its podium's outline, or draw a wing twice. Two walls in one plane
would flicker in a picture (z-fighting). Pieces that intersect with walls in different planes (spheres on a shaft, drawn
as discs) remain as they are. The union of all pieces does not change.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from lingjing.scene.city import Building
from lingjing.scene.cutting import polygons, rings

PLANE_M = 0.06
"""Distance below which walls lie in one plane, metres: outlines are simplified to 5 cm."""

SHARED_M = 1.0
"""Length of common wall below which two pieces remain as they are, metres (chosen)."""

INSIDE = 0.98
"""Share of its ground from which a piece counts as inside another (chosen)."""

SLIVER_M = 0.1
"""Half the width below which a remainder of a piece is dropped, metres (chosen)."""

LEFT = "-left"
"""Suffix of the ids of further parts of a divided piece; a number follows."""

PARAPET_M = 1.0
"""Height over a flat roof's top that its parapet may reach, with a reserve, metres (chosen)."""


def resolve_overlaps(pieces: Sequence[Building]) -> tuple[Building, ...]:
    """Return the pieces in their order: some lower or smaller, some removed or divided; roofs that carry a piece are
    `bare`.
    """
    if not pieces:
        return ()
    stack = _StackedPieces(pieces)
    for a, b in stack.touching():
        stack.separate(a, b)
    for a, b in stack.touching():
        stack.remove_parapet(a, b)
    return tuple(stack.result())


class _StackedPieces:
    """Pieces and their shapes, changed pair by pair. A piece may be removed by an empty shape."""

    def __init__(self, pieces: Sequence[Building]) -> None:
        import shapely

        self._originals = pieces
        self._pieces: list[Building] = list(pieces)
        self._shapes = [shapely.make_valid(shapely.Polygon(piece.polygon, piece.holes)) for piece in pieces]
        pairs = shapely.STRtree(self._shapes).query(self._shapes, predicate="intersects").T.tolist()
        self._pairs = sorted((a, b) for a, b in pairs if a < b)
        self._cut: set[int] = set()

    def touching(self) -> list[tuple[int, int]]:
        """The pairs with common ground; the lower piece comes first, of equally high ones the smaller."""
        return [min((a, b), (b, a), key=lambda pair: self._rank(pair[0])) for a, b in self._pairs]

    def separate(self, low: int, high: int) -> None:
        """Separate two pieces if they show walls in one plane at one height."""
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

    def remove_parapet(self, low: int, high: int) -> None:
        """Remove the parapet of a roof if the wall of a piece on it continues its own wall."""
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
        return self._originals[k].top_m, self._shapes[k].area, k

    def _is_podium(self, low: int, high: int) -> bool:
        """True if the higher piece rises out of the flat roof of the lower one, and only there."""
        lower, upper = self._pieces[low], self._pieces[high]
        rises = upper.base_m >= lower.base_m - 0.05 and upper.top_m - upper.roof_m > lower.top_m + 0.3
        return lower.roof == "flat" and rises and self._is_within(high, low)

    def _is_within(self, inner: int, outer: int) -> bool:
        shape = self._shapes[inner]
        return bool(shape.intersection(self._shapes[outer]).area >= INSIDE * shape.area)

    def _shares_walls(self, a: int, b: int) -> bool:
        """True if outlines run along each other with both pieces on the same side, not back to back."""
        import shapely

        # pieces may also touch in lines and points, which have no boundary
        shared = shapely.union_all(list(polygons(self._shapes[a].intersection(self._shapes[b]))))
        if shared.area < SHARED_M * PLANE_M:
            return False
        along = shared.boundary.intersection(self._shapes[a].boundary.buffer(PLANE_M))
        return bool(along.intersection(self._shapes[b].boundary.buffer(PLANE_M)).length > SHARED_M)

    def _subtract(self, low: int, high: int) -> None:
        self._shapes[low] = self._shapes[low].difference(self._shapes[high])
        self._cut.add(low)


def _between(piece: Building, base_m: float, top_m: float) -> Building:
    """A piece cut to the range between two elevations, with its share of the storeys."""
    share = (top_m - base_m) / (piece.top_m - piece.base_m)
    return msgspec.structs.replace(piece, base_m=base_m, top_m=top_m, levels=max(1, round(share * piece.levels)))


def _reshaped(piece: Building, shape: Any) -> Iterator[Building]:
    """Yield a piece on the remainder of its ground."""
    import shapely

    # Opening (erosion, then dilation) removes slivers. Rounding to the millimetre here keeps the shape valid.
    wide = shape.buffer(-SLIVER_M, join_style="mitre").buffer(SLIVER_M, join_style="mitre")
    remainder = list(polygons(shapely.set_precision(wide, 0.001)))
    for number, part in enumerate(remainder):
        for outline, *holes in filter(None, (rings(part),)):
            name = f"{piece.id}{LEFT}{number}" if number else piece.id
            yield msgspec.structs.replace(piece, id=name, polygon=outline, holes=(*holes,))
