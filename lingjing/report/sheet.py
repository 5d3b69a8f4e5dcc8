"""All drawings of a figure on one sheet, for a file: in up to three columns, with their titles above them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from lingjing.report.drawing import Drawing
from lingjing.report.figure import FigureKind, FigurePart
from lingjing.report.text_layout import wrapped

if TYPE_CHECKING:
    from lingjing.report.painting import Canvas

_GAP, _EDGE = 28.0, 16.0
_TITLE, _HEADING = 12.0, 14.0
"""Sizes of the letters of titles and headings."""
_TITLE_LINE, _HEADING_LINE = 15.0, 18.0


class _SheetLine(NamedTuple):
    """A bold line of text on a sheet, with its base line at y."""

    x: float
    y: float
    text: str
    size: float


def sheet_of(kind: FigureKind, parts: Sequence[FigurePart]) -> Drawing | None:
    """Return the sheet of a figure's parts; None if they hold no drawing."""
    parts = [part for part in parts if part.drawings]
    if not parts:
        return None
    columns = _columns(max(sum(not drawing.wide for drawing in part.drawings) for part in parts))
    drawings = [drawing for part in parts for drawing in part.drawings]
    widest = max(drawing.width for drawing in drawings)
    column = max((drawing.width for drawing in drawings if not drawing.wide), default=widest)
    inner = max(widest, columns * column + (columns - 1) * _GAP)
    lines, placed, y = list[_SheetLine](), list[tuple[float, float, Drawing]](), _EDGE
    for part in parts:
        for line in wrapped(part.heading, inner, _HEADING, bold=True):
            y += _HEADING_LINE
            lines.append(_SheetLine(_EDGE, y, line, _HEADING))
        y += 8.0 if part.heading else 0.0
        for row in _rows(part.drawings, inner, column):
            titles = [wrapped(drawing.title, drawing.width - 4.0, _TITLE, bold=True) for drawing in row]
            room = _TITLE_LINE * max(map(len, titles)) + 6.0
            for place, (drawing, title) in enumerate(zip(row, titles, strict=True)):
                x = _EDGE + place * (column + _GAP)
                lines += (_SheetLine(x + 2.0, y + 12.0 + _TITLE_LINE * at, text, _TITLE)
                          for at, text in enumerate(title))  # fmt: skip
                placed.append((x, y + room, drawing))
            y += room + max(drawing.height for drawing in row) + _GAP / 2

    def paint(canvas: Canvas) -> None:
        for line in lines:
            canvas.text(line.x, line.y, line.text, size=line.size, bold=True)
        for left, top, drawing in placed:
            drawing.paint(canvas.part(left, top))

    words = " ".join(drawing.description for drawing in drawings)
    return Drawing(title=kind.title, description=words, width=inner + 2 * _EDGE, height=y + _EDGE, paint=paint)


def _rows(drawings: Sequence[Drawing], inner: float, column: float) -> Iterator[list[Drawing]]:
    """Yield as many drawings as fit side by side; a wide one has a row to itself."""
    fit = max(1, int((inner + _GAP) // (column + _GAP)))
    row: list[Drawing] = []
    for drawing in drawings:
        if row and (drawing.wide or len(row) == fit):
            yield row
            row = []
        row.append(drawing)
        if drawing.wide:
            yield row
            row = []
    if row:
        yield row


def _columns(drawings: int) -> int:
    """Return the number of columns for that many drawings: two where that fills the rows, else three."""
    return 1 if drawings < 2 else 2 if drawings in (2, 4) else 3


__all__ = ["sheet_of"]
