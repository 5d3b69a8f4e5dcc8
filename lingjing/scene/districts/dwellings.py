"""Fillings of residential blocks: rows of slab houses, small houses with gardens, point towers, closed rings."""

from __future__ import annotations

from random import Random

from lingjing.scene.districts.draft import KERB_M, Draft
from lingjing.scene.districts.furnish import SIDES, STOREY_M, bench, canopies, doorstep, erect, parking, trees
from lingjing.scene.districts.rectangles import Rect, around

Heights = tuple[float, float]
"""Lowest and greatest building height, metres."""


def storeys(heights: Heights, chance: Random, low: float = 0.0, high: float = 1.0) -> float:
    """A random height in whole storeys from the part `low`..`high` of the range."""
    span = heights[1] - heights[0]
    metres = heights[0] + span * chance.uniform(low, high)
    return max(STOREY_M, min(heights[1], round(metres / STOREY_M) * STOREY_M))


def slabs(draft: Draft, lot: Rect, heights: Heights, chance: Random, use: str = "residential") -> None:
    """Build long houses that face south, in rows with gardens and parked cars between them."""
    depth, gap = 13.0, max(17.0, 0.8 * heights[1])
    rows = max(1, int((lot.depth + gap) // (depth + gap)))
    pitch = (lot.depth - depth) / max(1, rows - 1) if rows > 1 else 0.0
    for row in range(rows):
        south = lot.south + row * pitch if rows > 1 else lot.centre[1] - depth / 2.0
        _row(draft, Rect(lot.west, south, lot.east, south + depth), heights, chance, use)
        if row and pitch > depth + 14.0:
            yard = Rect(lot.west + 2.0, south - pitch + depth + 2.0, lot.east - 2.0, south - 2.0)
            _garden(draft, yard, chance, cars=row % 2 == 1)


def houses(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build detached houses with tiled roofs, each in its garden, with the door on the side of the nearer street."""
    _houses(draft, lot, heights, chance)


def homes(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build such houses without steps, with the door on any side and a canopy on each side: in a depth image from above
    a door is one canopy of four.
    """
    begun = len(draft.buildings)
    _houses(draft, lot, heights, chance, any_side=True)
    for building in draft.buildings[begun:]:
        canopies(draft, building)


def _houses(draft: Draft, lot: Rect, heights: Heights, chance: Random, *, any_side: bool = False) -> None:
    columns, rows = max(1, int(lot.width // 19.0)), max(1, int(lot.depth // 24.0))
    for k, cell in enumerate(lot.cells(columns, rows, 0.0)):
        if chance.random() < 0.08:
            trees(draft, cell.inset(2.0), 4, chance)
            continue
        width = min(chance.uniform(8.5, 12.0), cell.width - 5.0)
        deep = min(chance.uniform(8.0, 11.0), cell.depth - 7.0)
        south = k < columns * rows / 2
        x = cell.centre[0] + chance.uniform(-0.8, 0.8)
        y = cell.centre[1] + (-1.0 if south else 1.0) * chance.uniform(0.5, 2.5)
        roof = chance.choice(("gabled", "gabled", "hipped", "pyramidal"))
        top = min(max(heights[0] - 2.5, 3.0) + STOREY_M * chance.randrange(2), 7.0)
        side = chance.choice(tuple(SIDES)) if any_side else "south" if south else "north"
        made = erect(draft, chance, around(x, y, width, deep), use="house", top_m=top, roof=roof,
                     roof_m=chance.uniform(2.0, 3.2), side=side)  # fmt: skip
        if made.entrance and not any_side and chance.random() < 0.3:
            doorstep(draft, made.entrance, chance)
        if chance.random() < 0.25:
            edge = cell.east - 0.4
            draft.solid("wall", Rect(edge - 0.1, cell.south + 5.0, edge + 0.1, cell.north - 5.0), 0.0, 1.0, "brick")
        trees(draft, cell.inset(1.5), 2, chance)


def towers(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build point towers on lawns."""
    columns, rows = max(1, int(lot.width // 50.0)), max(1, int(lot.depth // 50.0))
    for cell in lot.cells(columns, rows, 0.0):
        side = min(chance.uniform(18.0, 25.0), cell.width - 12.0, cell.depth - 12.0)
        x, y = cell.centre[0] + chance.uniform(-3, 3), cell.centre[1] + chance.uniform(-3, 3)
        made = erect(draft, chance, around(x, y, side, side * chance.uniform(0.8, 1.0)), use="residential",
                     top_m=storeys(heights, chance, 0.7, 1.0), side="south")  # fmt: skip
        if made.entrance and chance.random() < 0.4:
            doorstep(draft, made.entrance, chance)
    _garden(draft, lot, chance, cars=False)


def ring(draft: Draft, lot: Rect, heights: Heights, chance: Random, use: str = "residential") -> None:
    """Build houses along all four sides of a courtyard, with passages at the corners and at random places."""
    depth = min(15.0, lot.width / 4.0, lot.depth / 4.0)
    spans = (
        (Rect(lot.west, lot.south, lot.east, lot.south + depth), True, "south"),
        (Rect(lot.west, lot.north - depth, lot.east, lot.north), True, "north"),
        (Rect(lot.west, lot.south + depth + 8.0, lot.west + depth, lot.north - depth - 8.0), False, "west"),
        (Rect(lot.east - depth, lot.south + depth + 8.0, lot.east, lot.north - depth - 8.0), False, "east"),
    )
    for span, flat, side in spans:
        length = span.width if flat else span.depth
        many = max(1, round(length / chance.uniform(26.0, 40.0)))
        for cell in span.cells(many if flat else 1, 1 if flat else many, 4.0):
            if min(cell.width, cell.depth) < 6.0 or chance.random() < 0.06:
                continue
            kind = "commercial" if use == "residential" and chance.random() < 0.25 else use
            made = erect(draft, chance, cell, use=kind, top_m=storeys(heights, chance, 0.0, 0.7), side=side)
            if made.entrance and chance.random() < 0.1:
                doorstep(draft, made.entrance, chance)
    yard = lot.inset(depth + 5.0)
    if min(yard.width, yard.depth) > 75.0 and chance.random() < 0.6:
        slabs(draft, yard.inset(6.0), heights, chance, use="residential")
    elif min(yard.width, yard.depth) > 75.0:
        field = around(*yard.centre, 0.7 * yard.width, 0.5 * yard.depth)
        draft.area(field.inset(-4.0), "grass", KERB_M + 0.013)
        draft.area(field, "pitch", KERB_M + 0.015)
        draft.take(field)
        trees(draft, yard, int(yard.width * yard.depth / 300.0), chance)
    elif min(yard.width, yard.depth) > 12.0:
        _garden(draft, yard, chance, cars=chance.random() < 0.6)


# -- private


def _row(draft: Draft, strip: Rect, heights: Heights, chance: Random, use: str) -> None:
    x = strip.west + chance.uniform(0.0, 4.0)
    while x < strip.east - 18.0:
        length = min(chance.uniform(30.0, 54.0), strip.east - x)
        if strip.east - x - length < 26.0:
            length = min(strip.east - x, 56.0)
        shift = chance.uniform(-1.0, 1.0)
        box = Rect(x, strip.south + max(0.0, shift), x + length, strip.north + min(0.0, shift))
        roof = chance.choice(("flat", "flat", "hipped"))
        made = erect(draft, chance, box, use=use, top_m=storeys(heights, chance), roof=roof, side="south",
                     roof_m=0.0 if roof == "flat" else 3.0)  # fmt: skip
        if made.entrance and chance.random() < 0.3:
            doorstep(draft, made.entrance, chance)
        x += length + chance.uniform(9.0, 14.0)


def _garden(draft: Draft, yard: Rect, chance: Random, cars: bool) -> None:
    """Build a path through the middle with trees beside it, and benches or a row of parked cars."""
    if yard.depth < 6.0 or yard.width < 6.0:
        return
    middle = yard.centre[1]
    draft.area(Rect(yard.west, middle - 1.2, yard.east, middle + 1.2), "plaza", KERB_M + 0.012)
    if cars and yard.depth > 12.0:
        parking(draft, Rect(yard.west + 4.0, middle + 1.4, yard.east - 4.0, middle + 6.6), chance, 0.45)
    trees(draft, yard, int(yard.width * yard.depth / 260.0), chance)
    for _ in range(int(yard.width // 60.0)):
        bench(draft, chance.uniform(yard.west + 3.0, yard.east - 3.0), middle - 1.8, chance)
