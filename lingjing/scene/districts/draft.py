"""`Draft`: the pieces of a district while it is laid out, with ids given in order and random streams by name."""

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
"""A block stands this high over its streets: a `Solid` slab, so that legs meet a kerb they have to step on."""

PAINT_M = KERB_M + 0.01
"""Where surfaces on a block are painted."""


def stream(seed: int, name: str) -> Random:
    """The random stream of that name, a function of seed and name alone."""
    return Random(int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest(), "big"))


class Draft:
    """Collects pieces. `free` tells whether a place is still unbuilt; what is built is kept as boxes by 50 m square."""

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
        self._taken: dict[tuple[int, int], list[Rect]] = {}
        self._numbers: dict[str, int] = {}

    def name(self, kind: str) -> str:
        """The next id of a kind: `tree-1`, then `tree-2`."""
        number = self._numbers[kind] = self._numbers.get(kind, 0) + 1
        return f"{kind}-{number}"

    def area(self, shape: Rect | Polygon, surface: str, top_m: float = PAINT_M) -> None:
        """Paint a surface."""
        self.areas.append(PaintedArea(polygon=_outline(shape), surface=surface, top_m=top_m))

    def solid(self, kind: str, shape: Rect | Polygon, base_m: float, top_m: float, material: str = "concrete") -> None:
        """Put up a prism; what is higher than a step takes its place."""
        outline = _outline(shape)
        self.solids.append(
            Solid(
                id=self.name(kind), polygon=outline, base_m=round(base_m, 3), top_m=round(top_m, 3), material=material
            )
        )
        if top_m > 0.5 and base_m < 2.0:
            self.take(bounds(outline))

    def building(self, building: Building) -> None:
        """Put up a building."""
        self.buildings.append(building)
        self.take(bounds(building.polygon))

    def repaint(self, first: int, colours: Sequence[tuple[float, float, float]]) -> None:
        """Give the buildings from number `first` on wall colours in turn."""
        for k, building in enumerate(self.buildings[first:]):
            self.buildings[first + k] = msgspec.structs.replace(building, colour=colours[k % len(colours)])

    def prop(
        self, cls: str, x: float, y: float, z: float = KERB_M, heading: float = 0.0, scale: float = 1.0,
        model: str = "", floating: bool = False, **options: Datum,
    ) -> None:  # fmt: skip
        """Put a thing at a place."""
        self.props.append(
            Prop(
                id=self.name(cls), cls=cls, model=model or cls, position=(round(x, 2), round(y, 2), round(z, 3)),
                heading_deg=round(heading, 1) % 360.0, scale=round(scale, 3), floating=floating, options=options,
            )
        )  # fmt: skip

    def take(self, box: Rect) -> None:
        """Mark a box as built."""
        for key in _squares(box):
            self._taken.setdefault(key, []).append(box)

    def free(self, box: Rect, margin: float = 0.0) -> bool:
        """Whether nothing built comes nearer to the box than `margin` metres."""
        grown = box.inset(-margin)
        return not any(other.meets(grown) for key in _squares(grown) for other in self._taken.get(key, ()))

    def pieces(self) -> Pieces:
        """All of it as values."""
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
