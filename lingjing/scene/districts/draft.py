"""`Draft`: the pieces of a district under construction, with ids in order; and random streams by name."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from random import Random

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Datum
from lingjing.scene.city import Bridge, Building, Land, PaintedArea, Pieces, Pipe, Prop, Slope, Solid, Water
from lingjing.scene.districts.rectangles import Rect, bounds

KERB_M = 0.10
"""Height of a block's slab over the streets, metres (chosen): a kerb that legged robots have to step on."""

PAINT_M = KERB_M + 0.01
"""Elevation of surfaces painted on a block, metres."""


def stream(seed: int, name: str) -> Random:
    """Return the random stream of that name: a function of seed and name alone."""
    return Random(int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest(), "big"))


class Draft:
    """Collects pieces, and remembers built areas as boxes, indexed by squares of 50 m."""

    def __init__(self) -> None:
        self.waters: list[Water] = []
        self.lands: list[Land] = []
        self.areas: list[PaintedArea] = []
        self.solids: list[Solid] = []
        self.slopes: list[Slope] = []
        self.buildings: list[Building] = []
        self.bridges: list[Bridge] = []
        self.pipes: list[Pipe] = []
        self.props: list[Prop] = []
        self._built: dict[tuple[int, int], list[Rect]] = {}
        self._numbers: dict[str, int] = {}

    def name(self, kind: str) -> str:
        """Return the next id of a kind: `tree-1`, then `tree-2`."""
        number = self._numbers[kind] = self._numbers.get(kind, 0) + 1
        return f"{kind}-{number}"

    def area(self, shape: Rect | Polygon, surface: str, top_m: float = PAINT_M) -> None:
        """Add a painted surface."""
        self.areas.append(PaintedArea(polygon=_outline(shape), surface=surface, top_m=top_m))

    def solid(self, kind: str, shape: Rect | Polygon, base_m: float, top_m: float, material: str = "concrete") -> None:
        """Add a prism. It counts as built if it is higher than a step."""
        outline = _outline(shape)
        self.solids.append(
            Solid(
                id=self.name(kind), polygon=outline, base_m=round(base_m, 3), top_m=round(top_m, 3), material=material
            )
        )
        if top_m > 0.5 and base_m < 2.0:
            self.take(bounds(outline))

    def building(self, building: Building) -> None:
        """Add a building."""
        self.buildings.append(building)
        self.take(bounds(building.polygon))

    def repaint(self, first: int, colours: Sequence[tuple[float, float, float]]) -> None:
        """Give the buildings from number `first` on the wall colours in turn."""
        for k, building in enumerate(self.buildings[first:]):
            self.buildings[first + k] = msgspec.structs.replace(building, colour=colours[k % len(colours)])

    def prop(
        self, cls: str, x: float, y: float, z: float = KERB_M, heading: float = 0.0, scale: float = 1.0,
        model: str = "", floating: bool = False, **options: Datum,
    ) -> None:  # fmt: skip
        """Add a prop."""
        self.props.append(
            Prop(
                id=self.name(cls), cls=cls, model=model or cls, position=(round(x, 2), round(y, 2), round(z, 3)),
                heading_deg=round(heading, 1) % 360.0, scale=round(scale, 3), floating=floating, options=options,
            )
        )  # fmt: skip

    def take(self, box: Rect) -> None:
        """Mark a box as built."""
        for key in _squares(box):
            self._built.setdefault(key, []).append(box)

    def free(self, box: Rect, margin: float = 0.0) -> bool:
        """True if nothing built is nearer to the box than `margin` metres."""
        grown = box.inset(-margin)
        return not any(other.meets(grown) for key in _squares(grown) for other in self._built.get(key, ()))

    def pieces(self) -> Pieces:
        """Return all pieces as values."""
        return Pieces(
            waters=tuple(self.waters),
            lands=tuple(self.lands),
            areas=tuple(self.areas),
            solids=tuple(self.solids),
            slopes=tuple(self.slopes),
            buildings=tuple(self.buildings),
            bridges=tuple(self.bridges),
            pipes=tuple(self.pipes),
            props=tuple(self.props),
        )


def _outline(shape: Rect | Polygon) -> Polygon:
    return shape.polygon if isinstance(shape, Rect) else shape


def _squares(box: Rect) -> list[tuple[int, int]]:
    columns = range(int(box.west // 50), int(box.east // 50) + 1)
    return [(column, row) for column in columns for row in range(int(box.south // 50), int(box.north // 50) + 1)]
