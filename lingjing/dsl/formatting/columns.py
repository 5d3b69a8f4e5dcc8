"""Columns: what is lined up in a run of lines of one sort, as a table.

A run is a sequence of neighbouring lines, each with one statement, whose first tokens are of one family. In every
column of the family the lines that have it are padded to the same place. A run that would grow wider than the page
is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from lingjing.dsl.formatting.spacing import Spelling
from lingjing.dsl.syntax.tokens import Token

SECOND, THIRD, RELATION = "second", "third", "relation"
_RELATIONS = frozenset(("EQUAL", "TILDE", "LE"))

FAMILIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "SCENE": ("settings", (SECOND,)),
    "CLOCK": ("settings", (SECOND,)),
    "BUDGET": ("settings", (SECOND,)),
    "WEATHER": ("settings", (SECOND,)),
    "COMMS": ("settings", (SECOND,)),
    "PARAM": ("parameters", (SECOND, "EQUAL", "IN")),
    "MODE": ("parameters", (SECOND,)),
    "REGION": ("places", (SECOND, "EQUAL")),
    "GRID": ("places", (SECOND,)),
    "MESSAGE": ("messages", ("COLON", "FROM")),
    "STAGE": ("stages", ("PER",)),
    "RELATION": ("relations", (THIRD,)),
    "CAMERA": ("cameras", ("LBRACE",)),
    "NAME": ("properties", (RELATION,)),
    "HIDDEN": ("hidden properties", (RELATION,)),
}
"""First token's type → family and columns: a token type (its first outside of brackets), or a place in the line."""


@dataclass(slots=True)
class Row:
    """One line to be: text without indentation, the comment behind it, and the columns of its family by name.

    `joinable`: a further statement may follow on it after a comma. An empty text without a comment is a blank line.
    """

    level: int
    text: str
    comment: str = ""
    family: str = ""
    anchors: dict[str, int] = field(default_factory=dict)
    joinable: bool = False
    extra: int = 0

    def line(self) -> str:
        """The finished line."""
        code = " " * (2 * self.level + self.extra) + self.text if self.text else ""
        if not self.comment:
            return code
        return f"{code}  {self.comment}" if code else "  " * self.level + " " * self.extra + self.comment

    def width(self) -> int:
        """Columns taken by the code; a comment is never a reason to break a line."""
        return 2 * self.level + self.extra + len(self.text)


def with_columns(row: Row, tokens: list[Token], spelling: Spelling) -> Row:
    """Note the row's family and where its columns are. `tokens` are those of its head, `{` included."""
    family, columns = FAMILIES.get(tokens[0].type, ("", ()))
    if not family:
        return row
    for column in columns:
        place = _place(column, tokens, spelling)
        if place is not None:
            row.anchors[column] = spelling.begins[place]
    if family not in ("properties", "hidden properties") or row.anchors:
        row.family = family
    return row


def _place(column: str, tokens: list[Token], spelling: Spelling) -> int | None:
    if column in (SECOND, THIRD):
        place = 1 if column == SECOND else 2
        return place if place < len(tokens) else None
    if column == RELATION:
        place = 2 if tokens[0].type == "HIDDEN" else 1
        return place if place < len(tokens) and tokens[place].type in _RELATIONS else None
    for place, token in enumerate(tokens):
        if token.type == column and spelling.depths[place] == 0:
            return place
    return None


def align(rows: list[Row], width: int) -> None:
    """Pad the rows of every run in place."""
    start = 0
    while start < len(rows):
        stop = start + 1
        first = rows[start]
        while (
            first.family and stop < len(rows) and (rows[stop].family, rows[stop].level) == (first.family, first.level)
        ):
            stop += 1
        if stop - start > 1:
            _align_run(rows[start:stop], width)
        start = stop


def _align_run(run: list[Row], width: int) -> None:
    before = [(row.text, dict(row.anchors)) for row in run]
    columns = dict.fromkeys(column for row in run for column in row.anchors)
    for column in columns:
        having = [row for row in run if column in row.anchors]
        target = max(row.anchors[column] for row in having)
        for row in having:
            _pad(row, column, target)
    if any(row.width() > width for row in run):
        for row, (text, anchors) in zip(run, before, strict=True):
            row.text, row.anchors = text, anchors


def _pad(row: Row, column: str, target: int) -> None:
    at = row.anchors[column]
    missing = target - at
    row.text = row.text[:at] + " " * missing + row.text[at:]
    row.anchors = {name: place + missing if place >= at else place for name, place in row.anchors.items()}
