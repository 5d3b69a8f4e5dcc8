"""Sites without public streets: a walled residential compound, a factory, a pipeline yard."""

from __future__ import annotations

from itertools import cycle
from random import Random

from lingjing.scene.city import Pipe
from lingjing.scene.districts.draft import Draft
from lingjing.scene.districts.dwellings import Heights, storeys
from lingjing.scene.districts.furnish import STOREY_M, bench, disc, erect, parking, trees, wall_ring
from lingjing.scene.districts.industry import RACK_M, clutter
from lingjing.scene.districts.palette import HOMES
from lingjing.scene.districts.rectangles import Rect, around

GATE_M = 9.0
"""Width of a gate, metres (chosen)."""
AXIS_M = 8.0
"""Half the width of the free way through a factory from gate to gate, metres (chosen)."""

Gates = dict[str, tuple[float, float]]
"""Side of the site → place of its gate."""


def gates(site: Rect, every: bool) -> Gates:
    """The gates of a site by side, each in the middle of its side: all four, or only the one nearest to the origin."""
    x, y = site.centre
    places = {"west": (site.west, y), "south": (x, site.south), "east": (site.east, y), "north": (x, site.north)}
    if every:
        return places
    nearest = min(places, key=lambda side: places[side][0] ** 2 + places[side][1] ** 2)
    return {nearest: places[nearest]}


def compound(draft: Draft, site: Rect, heights: Heights, chance: Random, openings: Gates) -> None:
    """Build a walled residential community: houses of different shape and colour on a grid of lots, paths, lawns, cars.

    Every house has its own wall colour as far as the palette suffices, and an entrance on the path in front of it.
    """
    draft.area(site, "residential", 0.005)
    wall_ring(draft, site, dict.fromkeys(openings, GATE_M))
    inner = site.inset(9.0)
    columns, rows = max(1, round(inner.width / 72.0)), max(1, round(inner.depth / 72.0))
    gap = 10.0
    lots = list(inner.cells(columns, rows, gap))
    for box in (*_between(inner, columns, gap, True), *_between(inner, rows, gap, False)):
        draft.area(box.inset(2.5 if min(box.width, box.depth) > 7.0 else 0.0), "plaza", 0.012)
    for side, (x, y) in openings.items():
        flat = side in ("west", "east")
        draft.area(around(x, y, 24.0 if flat else 7.0, 7.0 if flat else 24.0), "plaza", 0.014)
    colours = chance.sample(HOMES, len(HOMES))
    painted = cycle(colours)
    for lot in lots:
        draft.area(lot, "grass", 0.01)
        style = chance.random()
        if style < 0.5 and lot.depth > 58.0:
            for part in lot.cells(1, 2, 8.0):
                _home(draft, part.inset(2.0), heights, chance, next(painted))
        elif style < 0.75:
            _tower(draft, lot.inset(3.0), heights, chance, next(painted))
        else:
            _corner_house(draft, lot.inset(5.0), heights, chance, next(painted))
        trees(draft, lot.inset(1.5), int(lot.width * lot.depth / 320.0), chance, 0.0)
        bench(draft, lot.west + 3.0, lot.south - 1.0, chance)
    strip = Rect(inner.west, inner.north + 1.0, inner.east, inner.north + 6.2)
    parking(draft, strip, chance, 0.35)


def factory(draft: Draft, site: Rect, heights: Heights, chance: Random, openings: Gates) -> None:
    """Build a walled factory: halls in the four quarters, free ways from gate to gate, yards that robot dogs can
    walk."""
    draft.area(site, "industrial", 0.005)
    wall_ring(draft, site, dict.fromkeys(openings, GATE_M), 2.4, "concrete")
    for side, (x, y) in openings.items():
        flat = side in ("west", "east")
        reach = site.width if flat else site.depth
        cx, cy = site.centre
        draft.area(
            around((x + cx) / 2, (y + cy) / 2, reach / 2 if flat else 6.0, 6.0 if flat else reach / 2), "asphalt", 0.012
        )
    for quarter in site.inset(5.0).cells(2, 2, 2.0 * AXIS_M):
        _quarter(draft, quarter, heights, chance)
    x, y = site.centre
    draft.take(around(x, y, site.width, 2.0 * AXIS_M))
    draft.take(around(x, y, 2.0 * AXIS_M, site.depth))
    clutter(draft, site.inset(3.0), int(site.width * site.depth / 220.0), chance)


def pipeline(draft: Draft, site: Rect, path: tuple[tuple[float, float], ...], chance: Random) -> None:
    """Build an open yard with the pipeline on supports. Tanks and huts stand at the corners, off the ways."""
    draft.area(site.inset(-10.0), "concrete", 0.005)
    draft.area(site, "industrial", 0.008)
    raised = tuple((x, y, RACK_M) for x, y in path)
    draft.pipes.append(Pipe(id="pipeline", path=raised, radius_m=0.4))
    side = tuple((x + 1.4, y - 1.4, RACK_M + 0.25) for x, y in path)
    draft.pipes.append(Pipe(id="pipeline-return", path=side, radius_m=0.22))
    for x, y in path:
        draft.take(around(x, y, 4.0, 4.0))
    outer = site.inset(-3.0)
    for k, (x, y) in enumerate(((outer.west, outer.south), (outer.east, outer.north), (outer.west, outer.north))):
        radius = chance.uniform(4.5, 7.0)
        draft.solid("tank", disc(x, y, radius), 0.0, chance.uniform(6.0, 11.0), ("metal", "white", "metal")[k])
    hut = around(outer.east, outer.south, 9.0, 6.0)
    erect(draft, chance, hut, use="industrial", top_m=4.0, roof="gabled", roof_m=1.2, side="north")
    for x, y in ((site.west - 3.0, site.centre[1]), (site.east + 3.0, site.centre[1] + 9.0)):
        draft.prop("steam_vent", x, y, 0.0)
    for k in range(8):
        x = site.west + (k + 0.5) * site.width / 8.0
        y = site.north + chance.uniform(7.0, 11.0)
        draft.prop(chance.choice(("crates", "container", "parked_truck")), x, y, 0.0, 90.0, variant=k)
        draft.take(around(x, y, 12.0, 3.0))


# -- private


def _home(draft: Draft, part: Rect, heights: Heights, chance: Random, colour: tuple[float, float, float]) -> None:
    long = min(part.width - 4.0, chance.uniform(24.0, 46.0))
    deep = min(part.depth - 4.0, chance.uniform(11.0, 14.5))
    x = part.centre[0] + chance.uniform(-0.5, 0.5) * max(0.0, part.width - long - 2.0) * 0.5
    box = around(x, part.centre[1], long, deep)
    roof = chance.choice(("flat", "gabled", "hipped", "flat"))
    top = max(2 * STOREY_M, storeys(heights, chance))
    erect(draft, chance, box, use="residential", top_m=top, roof=roof, roof_m=0.0 if roof == "flat" else 3.0,
          colour=colour, facade=chance.choice(("punched", "punched", "ribbon")),
          side=chance.choice(("south", "north")))  # fmt: skip


def _tower(draft: Draft, lot: Rect, heights: Heights, chance: Random, colour: tuple[float, float, float]) -> None:
    side = min(chance.uniform(18.0, 24.0), lot.width, lot.depth)
    box = around(lot.centre[0] + chance.uniform(-6, 6), lot.centre[1] + chance.uniform(-6, 6), side, side)
    erect(draft, chance, box, use="residential", top_m=storeys(heights, chance, 0.7, 1.0), colour=colour,
          side=chance.choice(("south", "north", "west")))  # fmt: skip


def _corner_house(
    draft: Draft, lot: Rect, heights: Heights, chance: Random, colour: tuple[float, float, float]
) -> None:
    """Build a house with two wings that meet in a corner, with the door in the yard between them."""
    w, s, e, n = lot.west, lot.south + chance.uniform(0, 10), lot.east - chance.uniform(2, 12), lot.north
    outline = ((w, s), (w + 13.0, s), (w + 13.0, n - 13.0), (e, n - 13.0), (e, n), (w, n))
    erect(draft, chance, tuple((round(x, 3), round(y, 3)) for x, y in outline), use="residential", colour=colour,
          top_m=max(2 * STOREY_M, storeys(heights, chance, 0.2, 1.0)),
          door=(round((w + 13.0 + e) / 2.0, 3), round(n - 13.0, 3), 180.0))  # fmt: skip


def _quarter(draft: Draft, quarter: Rect, heights: Heights, chance: Random) -> None:
    width, depth = quarter.width * chance.uniform(0.5, 0.66), quarter.depth * chance.uniform(0.42, 0.55)
    x = quarter.centre[0] + chance.uniform(-0.3, 0.3) * (quarter.width - width) * 0.5
    y = quarter.centre[1] + chance.uniform(-0.3, 0.3) * (quarter.depth - depth) * 0.5
    body = around(x, y, width, depth)
    gabled = chance.random() < 0.5
    erect(draft, chance, body, use="industrial", top_m=chance.uniform(*heights), roof="gabled" if gabled else "flat",
          roof_m=2.0 if gabled else 0.0, side="south" if y > 0 else "north")  # fmt: skip
    if chance.random() < 0.7:
        draft.solid("tank", disc(body.west - 3.2, y, 2.0), 0.0, chance.uniform(4.0, 7.0), "metal")
    draft.prop("steam_vent", body.east + 1.0, y, 0.0)


def _between(box: Rect, many: int, gap: float, avenues: bool) -> list[Rect]:
    """The strips between the cells of a box."""
    cells = list(box.cells(many, 1, gap)) if avenues else list(box.cells(1, many, gap))
    if avenues:
        return [Rect(cell.east, box.south, cell.east + gap, box.north) for cell in cells[:-1]]
    return [Rect(box.west, cell.north, box.east, cell.north + gap) for cell in cells[:-1]]
