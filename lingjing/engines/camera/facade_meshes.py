"""Meshes on the facades of buildings: doors with canopies, shop signs with awnings, and balconies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lingjing.engines.camera.mesh_rows import Floats, MeshPart, joined, oriented, prism
from lingjing.mission.appearance import LinearRgb
from lingjing.scene.camera_geometry import heading_vector
from lingjing.scene.city import Building

DWELLINGS = ("house", "residential")
"""Uses of buildings with narrow doors and with balconies."""
SHOPS = ("commercial", "office")
"""Uses of buildings with a sign over the door; `commercial` ones have an awning too."""
INDUSTRY = ("industrial", "warehouse")
"""Uses of buildings with roller shutters."""

# Linear colours (chosen).
GLASS: LinearRgb = (0.030, 0.045, 0.055)
FRAME: LinearRgb = (0.46, 0.46, 0.45)
STEEL: LinearRgb = (0.27, 0.28, 0.29)
LETTERS: LinearRgb = (0.78, 0.78, 0.75)
RAILING: LinearRgb = (0.20, 0.21, 0.22)
DOORS: tuple[LinearRgb, ...] = ((0.19, 0.06, 0.03), (0.03, 0.10, 0.07), (0.05, 0.07, 0.16), (0.13, 0.08, 0.05))
SIGNS: tuple[LinearRgb, ...] = (
    (0.45, 0.045, 0.035), (0.03, 0.12, 0.30), (0.03, 0.20, 0.10), (0.50, 0.30, 0.03), (0.12, 0.04, 0.20),
    (0.06, 0.06, 0.065),
)  # fmt: skip

BALCONY_M, BALCONY_DEEP_M, BALCONY_GAP_M = 2.6, 1.15, 7.2
"""Length and depth of a balcony, and distance between the middles of two, metres (chosen)."""
MOST_BALCONIES, BALCONY_STOREYS = 28, 9
"""Most balconies of a building, and most storeys of one with balconies (chosen)."""
LEAST_WALL_M = 9.0
"""Least length of a wall with balconies, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class _Wall:
    """A frame on a wall: a point at its foot, and unit vectors along it to the right and outwards."""

    foot: Floats
    right: Floats
    out: Floats
    number: int
    """Drawn id."""

    def block(
        self, along: tuple[float, float], away: tuple[float, float], up: tuple[float, float], colour: LinearRgb,
        gloss: float = 0.0,
    ) -> MeshPart:  # fmt: skip
        """Return a block from ranges to the right, outwards and of elevations, metres."""
        ends = ((along[0], away[0]), (along[1], away[0]), (along[1], away[1]), (along[0], away[1]))
        corners = [self.foot + self.right * x + self.out * y for x, y in ends]
        return prism(oriented(corners), up[0], up[1], colour, self.number, gloss=gloss)


def entrance(source: Building, number: int) -> MeshPart:
    """Return the door of a building with what belongs to it."""
    assert source.entrance is not None
    x, y, bearing = source.entrance
    wall = _Wall(np.array([x, y]), np.array(heading_vector(bearing - 90.0)), np.array(heading_vector(bearing)), number)
    base, seed = source.base_m, source.seed
    if source.use in INDUSTRY:
        return joined(_shutter(wall, base))
    if source.use in DWELLINGS:
        return joined(_house_door(wall, base, DOORS[seed % len(DOORS)], source.colour))
    parts = list(_glass_door(wall, base, source.colour))
    if source.use in SHOPS and source.top_m - base > 4.2:
        parts += _sign(wall, base, seed, awning=source.use == "commercial")
    return joined(parts)


def _house_door(wall: _Wall, base: float, leaf: LinearRgb, colour: LinearRgb) -> Iterator[MeshPart]:
    yield wall.block((-0.72, 0.72), (0.0, 0.10), (base, base + 2.42), FRAME)
    yield wall.block((-0.55, 0.55), (0.10, 0.13), (base, base + 2.08), leaf, 0.2)
    yield wall.block((-0.55, 0.55), (0.10, 0.12), (base + 2.14, base + 2.36), GLASS, 0.6)
    yield wall.block((-0.26, 0.26), (0.13, 0.14), (base + 1.25, base + 1.85), GLASS, 0.6)
    yield wall.block((0.38, 0.46), (0.13, 0.19), (base + 0.98, base + 1.10), STEEL, 0.6)
    yield wall.block((-1.15, 1.15), (0.0, 1.15), (base + 2.62, base + 2.76), _shaded(colour))


def _glass_door(wall: _Wall, base: float, colour: LinearRgb) -> Iterator[MeshPart]:
    yield wall.block((-2.1, 2.1), (0.0, 0.08), (base, base + 2.75), FRAME)
    for left, right in pairwise((-2.0, -1.0, 0.0, 1.0, 2.0)):
        yield wall.block((left + 0.05, right - 0.05), (0.08, 0.12), (base + 0.08, base + 2.2), GLASS, 0.7)
        yield wall.block((left + 0.05, right - 0.05), (0.08, 0.12), (base + 2.3, base + 2.67), GLASS, 0.7)
    for x in (-0.12, 0.12):
        yield wall.block((x - 0.02, x + 0.02), (0.12, 0.19), (base + 0.85, base + 1.45), STEEL, 0.6)
    yield wall.block((-2.5, 2.5), (0.0, 1.5), (base + 2.85, base + 3.05), _shaded(colour))


def _shutter(wall: _Wall, base: float) -> Iterator[MeshPart]:
    yield wall.block((-2.0, 2.0), (0.0, 0.10), (base, base + 3.5), (0.52, 0.36, 0.03))
    for k in range(8):
        low = base + 0.42 * k
        yield wall.block((-1.75, 1.75), (0.10, 0.13 + 0.03 * (k % 2)), (low, low + 0.40), STEEL, 0.3)


def _sign(wall: _Wall, base: float, seed: int, awning: bool) -> Iterator[MeshPart]:
    """Yield a board with a name of blocks over the door, and for a shop an awning of stripes."""
    paint = SIGNS[seed % len(SIGNS)]
    yield wall.block((-3.0, 3.0), (0.0, 0.16), (base + 3.15, base + 3.95), paint, 0.2)
    chance, x = np.random.default_rng(seed & 0xFFFFFFFF), -2.4
    while x < 2.2:
        wide = 0.16 + 0.22 * float(chance.random())
        tall = 0.30 + 0.14 * float(chance.random() > 0.6)
        yield wall.block((x, x + wide), (0.16, 0.19), (base + 3.36, base + 3.36 + tall), LETTERS)
        x += wide + (0.09 if chance.random() > 0.2 else 0.34)
    if awning:
        for k in range(10):
            cloth = paint if k % 2 else LETTERS
            yield wall.block((-3.0 + 0.6 * k, -2.4 + 0.6 * k), (0.0, 1.3), (base + 3.02, base + 3.10), cloth)
            yield wall.block((-3.0 + 0.6 * k, -2.4 + 0.6 * k), (1.26, 1.30), (base + 2.78, base + 3.02), cloth)


def balconies(source: Building, eaves: float, storey: float, number: int) -> list[MeshPart]:
    """Return the balconies of a block of flats, on its long walls, storey by storey."""
    floors = min(source.levels, int((eaves - source.base_m) / storey))
    if source.use != "residential" or not 2 <= floors <= BALCONY_STOREYS or source.seed % 3 == 0:
        return []
    ring = oriented(source.polygon)
    parts: list[MeshPart] = []
    paint = LETTERS if source.seed % 2 else _shaded(source.colour)
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        if length < LEAST_WALL_M:
            continue
        right = (end - start) / length
        wall = _Wall(start, right, np.array([right[1], -right[0]]), number)
        count = int((length - BALCONY_M) // BALCONY_GAP_M) + 1
        first = 0.5 * (length - BALCONY_GAP_M * (count - 1))
        for floor in range(1, floors):
            low = source.base_m + floor * storey
            for k in range(count):
                if len(parts) >= 2 * MOST_BALCONIES:
                    return parts
                x = first + BALCONY_GAP_M * k
                side = x - 0.5 * BALCONY_M, x + 0.5 * BALCONY_M
                parts.append(wall.block(side, (0.0, BALCONY_DEEP_M), (low - 0.10, low + 0.06), FRAME))
                parts.append(wall.block(side, (BALCONY_DEEP_M - 0.06, BALCONY_DEEP_M), (low + 0.06, low + 1.02), paint))
    return parts


def _shaded(colour: LinearRgb) -> LinearRgb:
    """Return a colour halfway to dark grey."""
    return 0.5 * colour[0] + 0.1, 0.5 * colour[1] + 0.1, 0.5 * colour[2] + 0.1


__all__ = ["DWELLINGS", "balconies", "entrance"]
