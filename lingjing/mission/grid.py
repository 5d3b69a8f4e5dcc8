"""Search cells of a region.

The region's bounding box is divided into `rows` by `columns` equal rectangles. Row 1 is the southernmost, column 1 the
westernmost. Each rectangle is widened by overlap/2 of its own width and height on every side, so that neighbours share
a strip as wide as `overlap` of a cell, and then clipped to the region. `centre` is the middle of the rectangle before
it was widened. A rectangle outside the region gives no cell; the others keep their row and column.
"""

from __future__ import annotations

from lingjing.mission import geometry2d
from lingjing.mission.instance import Cell


def cells(
    grid: str,
    region: geometry2d.Polygon,
    rows: int,
    columns: int,
    overlap: float,
    *,
    hidden: bool = False,
    seen: bool = False,
) -> tuple[Cell, ...]:
    """The cells of a grid over an anticlockwise region, row by row from the south-west. `overlap` in 0..1.

    Cells over a `hidden` region are hidden too. `seen` is as in `Cell`.
    """
    west, south, east, north = geometry2d.bounds(region)
    width, height = (east - west) / columns, (north - south) / rows
    made: list[Cell] = []
    for row in range(1, rows + 1):
        for column in range(1, columns + 1):
            centre = west + (column - 0.5) * width, south + (row - 0.5) * height
            outline = geometry2d.clipped(region, _widened(centre, (width, height), overlap))
            if outline:
                name = f"{grid}-{row}-{column}"
                made.append(
                    Cell(
                        name=name,
                        grid=grid,
                        row=row,
                        column=column,
                        polygon=outline,
                        centre=centre,
                        hidden=hidden,
                        seen=seen,
                    )
                )
    return tuple(made)


def _widened(centre: geometry2d.Vector2, size: tuple[float, float], overlap: float) -> geometry2d.Extent:
    east, north = size[0] * (1 + overlap) / 2, size[1] * (1 + overlap) / 2
    return centre[0] - east, centre[1] - north, centre[0] + east, centre[1] + north
