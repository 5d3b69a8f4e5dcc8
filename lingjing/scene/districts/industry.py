"""Fillings of industrial and logistics blocks: halls, tanks, yards, warehouses with docks, container stacks."""

from __future__ import annotations

from random import Random

from lingjing.scene.city import Pipe
from lingjing.scene.districts.draft import KERB_M, Draft
from lingjing.scene.districts.dwellings import Heights
from lingjing.scene.districts.furnish import disc, erect, parking, wall_ring
from lingjing.scene.districts.rectangles import Rect, around

DOCK_M = 1.1
"""Height of a loading dock, metres (chosen)."""
CONTAINER_M = (12.2, 2.44)
"""Length and width of a container, metres (40-foot container)."""
RACK_M = 1.4
"""Height of a pipe's centre line over the ground, metres (chosen): a robot dog walks underneath."""


def halls(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build production halls with yards between them, behind a wall with gates."""
    draft.area(lot, "industrial", KERB_M + 0.012)
    wall_ring(draft, lot.inset(0.5), {"south": 9.0, "north": 9.0, "west": 9.0, "east": 9.0}, 2.0, "concrete")
    yard = lot.inset(7.0)
    columns, rows = max(1, round(yard.width / 75.0)), max(1, round(yard.depth / 52.0))
    for k, cell in enumerate(yard.cells(columns, rows, 12.0)):
        if k and chance.random() < 0.22:
            tank_farm(draft, cell, chance)
        else:
            hall(draft, cell, heights, chance)
    clutter(draft, lot.inset(2.0), int(lot.width * lot.depth / 900.0), chance)


def hall(draft: Draft, cell: Rect, heights: Heights, chance: Random) -> None:
    """Build one hall with its office annexe and equipment along its walls."""
    top = chance.uniform(*heights)
    body = Rect(cell.west + chance.uniform(1, 6), cell.south + chance.uniform(1, 5),
               cell.east - chance.uniform(1, 6), cell.north - chance.uniform(1, 5))  # fmt: skip
    gabled = chance.random() < 0.6
    erect(draft, chance, body, use="industrial", top_m=top, roof="gabled" if gabled else "flat",
          roof_m=min(2.5, body.depth / 12.0) if gabled else 0.0, side=chance.choice(("south", "north")))  # fmt: skip
    if chance.random() < 0.5 and body.width > 30.0:
        annexe = Rect(body.west + 3.0, body.south - 5.0, body.west + 15.0, body.south - 0.05)
        if draft.free(annexe.inset(0.2)):
            erect(draft, chance, annexe, use="commercial", top_m=min(6.0, top * 0.6), facade="ribbon", side="south")
    draft.prop("steam_vent", body.east + 1.2, body.centre[1])
    if chance.random() < 0.25:
        draft.solid(
            "chimney", disc(body.west + 4.0, body.north + 2.2, 1.1, 12), 0.0, top + chance.uniform(8, 16), "brick"
        )


def tank_farm(draft: Draft, cell: Rect, chance: Random) -> None:
    """Build cylindrical tanks in a bund, joined by a pipe."""
    draft.area(cell, "concrete", KERB_M + 0.014)
    radius = min(cell.width, cell.depth) * 0.17
    centres = [part.centre for part in cell.cells(max(1, int(cell.width // (2.8 * radius))), 2, 0.0)]
    for x, y in centres:
        r = radius * chance.uniform(0.75, 1.0)
        draft.solid("tank", disc(x, y, r), 0.0, chance.uniform(1.0, 1.8) * r + 2.0, chance.choice(("metal", "white")))
    x0, x1 = centres[0][0], centres[-1][0]
    path = ((x0, cell.centre[1], RACK_M), (x1, cell.centre[1], RACK_M))
    if x1 - x0 > 5.0:
        draft.pipes.append(Pipe(id=draft.name("pipe"), path=path, radius_m=0.3))


def warehouse(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build a long warehouse with loading docks to the south and a yard with parked lorries."""
    draft.area(lot, "asphalt", KERB_M + 0.012)
    width = lot.width - chance.uniform(8.0, 20.0)
    deep = min(lot.depth * 0.45, 60.0)
    x = lot.centre[0]
    body = Rect(x - width / 2.0, lot.north - 8.0 - deep, x + width / 2.0, lot.north - 8.0)
    top = max(heights[0], min(heights[1], chance.uniform(9.0, 13.0)))
    erect(draft, chance, body, use="warehouse", top_m=top, side="west")
    dock = Rect(body.west + 6.0, body.south - 4.0, body.east - 6.0, body.south)
    draft.solid("dock", dock, 0.0, DOCK_M)
    for k in range(int(dock.width // 7.0)):
        if chance.random() < 0.4:
            draft.prop("parked_truck", dock.west + 3.5 + 7.0 * k, dock.south - 6.0, heading=180.0,
                       variant=chance.randrange(6))  # fmt: skip
            draft.take(around(dock.west + 3.5 + 7.0 * k, dock.south - 6.0, 3.0, 11.0))
    if dock.south - 30.0 > lot.south + 12.0:
        containers(draft, Rect(lot.west + 6.0, lot.south + 2.0, lot.centre[0] - 12.0, dock.south - 26.0), chance, 0.6)
        bays = Rect(lot.centre[0] + 12.0, lot.south + 3.0, lot.east - 6.0, lot.south + 14.0)
        parking(draft, bays, chance, 0.4, "parked_truck")
    clutter(draft, lot.inset(4.0), int(lot.width / 16.0), chance)


def yard(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build stacks of containers with lanes between them, and a small office."""
    draft.area(lot, "asphalt", KERB_M + 0.012)
    erect(draft, chance, Rect(lot.west + 3.0, lot.north - 14.0, lot.west + 21.0, lot.north - 3.0), use="commercial",
          top_m=max(heights[0], 6.0), side="south")  # fmt: skip
    containers(draft, Rect(lot.west + 4.0, lot.south + 4.0, lot.east - 4.0, lot.north - 24.0), chance, 0.75)
    parking(
        draft, Rect(lot.west + 30.0, lot.north - 15.0, lot.east - 3.0, lot.north - 4.0), chance, 0.4, "parked_truck"
    )


def containers(draft: Draft, box: Rect, chance: Random, full: float) -> None:
    """Place rows of containers, one to three high, with lanes of 9 m between pairs of rows."""
    columns, rows = int(box.width // (CONTAINER_M[0] + 1.5)), int((box.depth + 9.0) // 14.5)
    for row in range(rows):
        for line in (0, 1):
            y = box.south + row * 14.5 + 1.3 + line * 2.7
            for column in range(columns):
                if chance.random() >= full:
                    continue
                x = box.west + (column + 0.5) * (CONTAINER_M[0] + 1.5)
                for level in range(chance.choice((1, 1, 2, 3))):
                    draft.prop("container", x, y, KERB_M + 2.6 * level, 90.0, variant=chance.randrange(8))
                draft.take(around(x, y, *CONTAINER_M))


def clutter(draft: Draft, box: Rect, many: int, chance: Random) -> None:
    """Place crates, lorries, containers and vents near walls, wherever there is room."""
    for _ in range(many):
        x, y = chance.uniform(box.west, box.east), chance.uniform(box.south, box.north)
        kind = chance.choice(("crates", "crates", "container", "parked_truck", "parked_car", "steam_vent"))
        length = {"crates": 2.6, "steam_vent": 2.0, "parked_car": 5.0}.get(kind, CONTAINER_M[0])
        spot = around(x, y, 3.2, length)
        gap = 0.4 if kind in ("crates", "steam_vent") else 2.5
        if draft.free(spot, gap) and not draft.free(spot, gap + 4.0):
            draft.prop(kind, x, y, heading=chance.choice((0.0, 180.0)), variant=chance.randrange(8))
            if kind != "steam_vent":
                draft.take(spot)
