"""All drawings of a figure as one, for a file: their titles above them, in two or three columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from lingjing.report.charts import wrapped
from lingjing.report.drawing import Drawing, DrawnMark, StrokeMark, WordsMark
from lingjing.report.figure import FigureKind, FigurePart

_GAP, _EDGE = 28.0, 16.0
_TITLE, _HEADING = 12.0, 14.0


def sheet_of(kind: FigureKind, parts: Sequence[FigurePart]) -> Drawing | None:
    """The sheet; None where the parts hold no drawing."""
    parts = [part for part in parts if part.drawings]
    if not parts:
        return None
    columns = _columns(max(sum(not drawing.wide for drawing in part.drawings) for part in parts))
    drawings = [drawing for part in parts for drawing in part.drawings]
    widest = max(drawing.width for drawing in drawings)
    cell = max((drawing.width for drawing in drawings if not drawing.wide), default=widest)
    inner = max(widest, columns * cell + (columns - 1) * _GAP)
    marks, y = list[DrawnMark](), _EDGE
    for part in parts:
        if part.heading:
            for line in wrapped(part.heading, inner, _HEADING, bold=True):
                y += 18.0
                marks.append(WordsMark(x=_EDGE, y=y, text=line, size=_HEADING, bold=True))
            y += 8.0
        for row in _rows(part.drawings, inner, cell):
            y = _placed(marks, row, y, cell) + _GAP / 2
    words = " ".join(drawing.description for part in parts for drawing in part.drawings)
    return Drawing(title=kind.title, description=words, width=inner + 2 * _EDGE, height=y + _EDGE, marks=(*marks,))


def shifted(mark: DrawnMark, dx: float, dy: float) -> DrawnMark:
    """The same mark elsewhere."""
    if isinstance(mark, StrokeMark):
        return msgspec.structs.replace(mark, points=tuple((x + dx, y + dy) for x, y in mark.points))
    return msgspec.structs.replace(mark, x=mark.x + dx, y=mark.y + dy)


def _placed(marks: list[DrawnMark], row: Sequence[Drawing], y: float, cell: float) -> float:
    """Put drawings side by side, on one line of titles; where they end."""
    titles = [wrapped(drawing.title, drawing.width - 4.0, _TITLE, bold=True) for drawing in row]
    room = 15.0 * max(len(lines) for lines in titles) + 6.0
    for at, (drawing, lines) in enumerate(zip(row, titles, strict=True)):
        x = _EDGE + at * (cell + _GAP)
        marks += (
            WordsMark(x=x + 2.0, y=y + 12.0 + 15.0 * number, text=line, size=_TITLE, bold=True)
            for number, line in enumerate(lines)
        )
        marks += (shifted(mark, x, y + room) for mark in drawing.marks)
    return y + room + max(drawing.height for drawing in row)


def _rows(drawings: Sequence[Drawing], inner: float, cell: float) -> Iterator[list[Drawing]]:
    """As many side by side as fit; a wide one has a row to itself."""
    fit = max(1, int((inner + _GAP) // (cell + _GAP)))
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


def _columns(most: int) -> int:
    return 1 if most < 2 else 2 if most in (2, 4) else 3


__all__ = ["sheet_of", "shifted"]
