"""Fillings of commercial and campus blocks: towers on podiums, plazas and parks, lecture halls, sports grounds."""

from __future__ import annotations

from random import Random

from lingjing.mission.geometry2d import Polygon
from lingjing.scene.districts.draft import KERB_M, Draft
from lingjing.scene.districts.dwellings import Heights, slabs, storeys
from lingjing.scene.districts.furnish import bench, disc, doorstep, erect, parking, trees
from lingjing.scene.districts.rectangles import Rect, around

PODIUM_M = 10.0
"""Height of a podium, metres (chosen)."""


def towers(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build lots with podiums and towers along the streets; the lots behind them become small plazas or car parks."""
    columns, rows = max(1, round(lot.width / 58.0)), max(1, round(lot.depth / 58.0))
    for k, cell in enumerate(lot.cells(columns, rows, 9.0)):
        column, row = k % columns, k // columns
        if 0 < column < columns - 1 and 0 < row < rows - 1:
            plaza(draft, cell, chance) if chance.random() < 0.6 else _car_park(draft, cell, chance)
            continue
        side = "south" if row == 0 else "north" if row == rows - 1 else "west" if column == 0 else "east"
        _lot(draft, cell.inset(chance.uniform(0.5, 2.5)), heights, chance, side)


def plaza(draft: Draft, lot: Rect, chance: Random) -> None:
    """Build paving with trees in rows, benches and a pavilion."""
    draft.area(lot, "plaza", KERB_M + 0.012)
    if min(lot.width, lot.depth) > 30.0 and chance.random() < 0.7:
        x, y = lot.centre
        erect(draft, chance, around(x, y, 12.0, 9.0), use="public", top_m=4.5, roof="pyramidal", roof_m=1.8,
              facade="curtain", side="south")  # fmt: skip
    for x, y in _points(lot.inset(4.0), 11.0):
        if draft.free(around(x, y, 3.0, 3.0)) and chance.random() < 0.6:
            trees(draft, around(x, y, 2.2, 2.2), 1, chance)
        elif chance.random() < 0.2:
            bench(draft, x, y, chance)
    if chance.random() < 0.4:
        draft.prop("steam_vent", lot.west + 5.0, lot.south + 2.0)


def park(draft: Draft, lot: Rect, chance: Random) -> None:
    """Build a lawn with a wood, crossing paths and benches."""
    draft.area(lot, "park")
    x, y = lot.centre
    wood = around(lot.west + lot.width * 0.28, lot.south + lot.depth * 0.7, lot.width * 0.4, lot.depth * 0.42)
    draft.area(wood, "forest", KERB_M + 0.012)
    trees(draft, wood.inset(1.0), int(wood.width * wood.depth / 70.0), chance)
    trees(draft, lot.inset(2.0), int(lot.width * lot.depth / 500.0), chance)
    draft.area(_strip((lot.west, lot.south), (lot.east, lot.north), 3.0), "plaza", KERB_M + 0.014)
    draft.area(_strip((lot.west, lot.north), (lot.east, lot.south), 3.0), "plaza", KERB_M + 0.014)
    draft.area(disc(x, y, min(lot.width, lot.depth) * 0.09), "plaza", KERB_M + 0.016)
    for sign in (-1, 1):
        bench(draft, x + sign * 0.2 * lot.width, y + sign * 0.2 * lot.depth + 3.0, chance)


def campus(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build lecture halls around a lawn: U-shaped wings and a library in the north."""
    draft.area(lot.inset(2.0), "grass", KERB_M + 0.012)
    x, y = lot.centre
    wing = min(15.0, lot.width / 6.0, lot.depth / 6.0)
    west = Rect(lot.west, lot.south + 6.0, lot.west + min(46.0, lot.width * 0.33), lot.north - 24.0)
    east = Rect(lot.east - min(46.0, lot.width * 0.33), lot.south + 6.0, lot.east, lot.north - 24.0)
    for box, opening in ((west, "east"), (east, "west")):
        if min(box.width, box.depth) > 2.2 * wing:
            erect(draft, chance, _horseshoe(box, wing, opening), use="school", top_m=storeys(heights, chance, 0.1, 0.7))
    hall = around(x, lot.north - 11.0, min(44.0, lot.width * 0.4), 20.0)
    dome = chance.random() < 0.4
    made = erect(draft, chance, hall, use="public", top_m=storeys(heights, chance, 0.3, 0.8), side="south",
                 roof="pyramidal" if dome else "flat", roof_m=5.0 if dome else 0.0, name="Library")  # fmt: skip
    if made.entrance:
        doorstep(draft, made.entrance, chance)
    for a, b in (((lot.west, lot.south), (x, lot.north - 22)), ((lot.east, lot.south), (x, lot.north - 22))):
        draft.area(_strip(a, b, 2.6), "plaza", KERB_M + 0.014)
    draft.area(Rect(x - 2.0, lot.south, x + 2.0, lot.north - 21.0), "plaza", KERB_M + 0.015)
    trees(draft, lot.inset(3.0), int(lot.width * lot.depth / 420.0), chance)
    for sign in (-1, 1):
        bench(draft, x + 4.0 * sign, y - 6.0, chance)


def dormitories(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build rows of student houses."""
    slabs(draft, lot, heights, chance, use="school")


def sports(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    """Build a pitch with its track, a stand and a gymnasium."""
    draft.area(lot, "grass", KERB_M + 0.012)
    x, y = lot.centre
    field = around(x, y - lot.depth * 0.08, min(lot.width - 16.0, 116.0), min(lot.depth * 0.6, 72.0))
    draft.area(field.inset(-5.0).chamfered(9.0), "sand", KERB_M + 0.014)
    draft.area(field, "pitch", KERB_M + 0.016)
    stand = Rect(field.west, field.north + 7.0, field.east, field.north + 13.0)
    for step in range(3):
        draft.solid("stand", Rect(stand.west, stand.south + 2.0 * step, stand.east, stand.north), 0.0, 0.9 + 0.9 * step)
    gym = Rect(lot.west + 4.0, stand.north + 6.0, min(lot.west + 50.0, lot.east - 4.0), lot.north - 2.0)
    if gym.depth > 10.0:
        erect(draft, chance, gym, use="public", top_m=max(9.0, heights[0]), roof="gabled", roof_m=2.5, side="east")
    trees(draft, lot.inset(1.0), int(lot.width / 12.0), chance)


# -- private


def _lot(draft: Draft, lot: Rect, heights: Heights, chance: Random, side: str) -> None:
    style = chance.random()
    top = storeys(heights, chance)
    if style < 0.5 and top > PODIUM_M + 9.0:
        erect(draft, chance, lot, use="commercial", top_m=PODIUM_M, side=side)
        margin = chance.uniform(0.14, 0.24)
        tower = Rect(lot.west + margin * lot.width, lot.south + margin * lot.depth,
                    lot.east - margin * lot.width, lot.north - margin * lot.depth)  # fmt: skip
        erect(draft, chance, tower, use="office", base_m=PODIUM_M, top_m=top)
    elif style < 0.75:
        depth = lot.depth * chance.uniform(0.5, 0.7)
        front = lot.south if side != "north" else lot.north - depth
        erect(draft, chance, Rect(lot.west, front, lot.east, front + depth), use="office", top_m=top, side=side)
        back = (
            Rect(lot.west, lot.south, lot.east, front - 3.0)
            if side == "north"
            else Rect(lot.west, front + depth + 3.0, lot.east, lot.north)
        )
        if back.depth > 7.0:
            parking(draft, Rect(back.west, back.centre[1] - 2.6, back.east, back.centre[1] + 2.6), chance)
    else:
        corner = chance.choice(("sw", "se", "nw", "ne"))
        erect(draft, chance, _angle(lot, 0.45, corner), use=chance.choice(("office", "commercial")),
              top_m=storeys(heights, chance, 0.0, 0.6))  # fmt: skip
    if chance.random() < 0.25:
        draft.prop("steam_vent", lot.centre[0], lot.south - 1.5)


def _car_park(draft: Draft, lot: Rect, chance: Random) -> None:
    draft.area(lot, "asphalt", KERB_M + 0.012)
    rows = int(lot.depth // 16.0)
    for row in range(rows):
        south = lot.south + 2.0 + row * 16.0
        parking(draft, Rect(lot.west + 3.0, south, lot.east - 3.0, south + 5.2), chance, 0.5)
    trees(draft, Rect(lot.west, lot.north - 3.0, lot.east, lot.north), 4, chance)


def _horseshoe(box: Rect, wing: float, opening: str) -> Polygon:
    """A U-shaped outline around a yard that is open to the east or west."""
    w, s, e, n = box
    if opening == "east":
        return (
            (w, s),
            (e, s),
            (e, s + wing),
            (w + wing, s + wing),
            (w + wing, n - wing),
            (e, n - wing),
            (e, n),
            (w, n),
        )
    return ((w, s), (e, s), (e, n), (w, n), (w, n - wing), (e - wing, n - wing), (e - wing, s + wing), (w, s + wing))


def _angle(box: Rect, share: float, corner: str) -> Polygon:
    """An L-shaped outline. Its arms meet in the named corner and are `share` of the box wide."""
    w, s, e, n = box
    x, y = share * box.width, share * box.depth
    return {
        "sw": ((w, s), (e, s), (e, s + y), (w + x, s + y), (w + x, n), (w, n)),
        "se": ((w, s), (e, s), (e, n), (e - x, n), (e - x, s + y), (w, s + y)),
        "nw": ((w, s), (w + x, s), (w + x, n - y), (e, n - y), (e, n), (w, n)),
        "ne": ((e - x, s), (e, s), (e, n), (w, n), (w, n - y), (e - x, n - y)),
    }[corner]


def _strip(a: tuple[float, float], b: tuple[float, float], width: float) -> Polygon:
    """The band of that width along a line."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = (dx * dx + dy * dy) ** 0.5
    x, y = -dy / length * width / 2.0, dx / length * width / 2.0
    corners = ((a[0] - x, a[1] - y), (b[0] - x, b[1] - y), (b[0] + x, b[1] + y), (a[0] + x, a[1] + y))
    return tuple((round(px, 3), round(py, 3)) for px, py in corners)


def _points(box: Rect, pitch: float) -> list[tuple[float, float]]:
    columns, rows = max(1, int(box.width // pitch)), max(1, int(box.depth // pitch))
    return [cell.centre for cell in box.cells(columns, rows, 0.0)]
