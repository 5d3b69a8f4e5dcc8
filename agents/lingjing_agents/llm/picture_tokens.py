"""`PictureRule`: how many tokens a family of models makes of a picture, from its size.

The rules stand in `models.toml` (`[pictures.NAME]`), each with its source. `most_tokens` is the largest count of
several rules: requests are budgeted with it, so that every model of a suite is sent the same turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from io import BytesIO
from itertools import product
from typing import Literal

from pydantic import model_validator

from lingjing.plugins.options import Field, PluginOptions

Size = tuple[int, int]
"""Width and height, pixels."""


FULL_PICTURE: Size = (1920, 1080)
"""The size that a picture counts as where it is not known. Pixels, the largest of the shipped cameras."""


class PictureRule(PluginOptions, strict=True):
    """The tokens of a picture. `[pictures.NAME]` of `models.toml` explains the fields."""

    rule: Literal["fixed", "patches", "slices", "grid"]
    tokens: int = Field(1, ge=1, le=100_000)
    """Tokens of the picture (`fixed`), of a patch, of a slice or of a tile."""
    side: int | None = Field(None, ge=4, le=4096)
    """The side of a patch, slice or tile, pixels; required except for `fixed`."""
    most: int | None = Field(None, ge=1, le=1_000_000)
    """The largest number of patches, slices or tiles; a larger picture is shrunk first."""
    longest: int | None = Field(None, ge=16, le=16_384)
    """The longer side of a picture at most, pixels; a larger picture is shrunk first."""
    factor: float = Field(1.0, ge=0.01, le=100.0)
    """Tokens that the service counts for each token of a patch."""
    extra: int = Field(0, ge=0, le=100_000)
    """Tokens of a picture beside those of its parts: the whole at low resolution, and separators."""
    row_tokens: int = Field(0, ge=0, le=16)
    """Tokens that end each row of patches."""
    source: str = ""

    @model_validator(mode="after")
    def _has_a_side(self) -> PictureRule:
        if self.rule != "fixed" and self.side is None:
            raise ValueError(f"`side` is missing: the rule {self.rule} counts parts of that size")
        return self

    def count(self, size: Size) -> int:
        """Return the tokens of a picture of this size."""
        if self.rule == "fixed":
            return self.tokens + self.extra
        width, height = self._shrunk(size)
        assert self.side is not None
        if self.rule == "patches":
            columns, rows = math.ceil(width / self.side), math.ceil(height / self.side)
            patches = columns * rows if self.most is None else min(columns * rows, self.most)
            return math.ceil(patches * self.tokens * self.factor) + rows * self.row_tokens + self.extra
        if self.rule == "slices":
            slices = math.ceil(width * height / self.side**2)
            slices = slices if self.most is None else min(slices, self.most)
            return (slices if slices > 1 else 0) * self.tokens + self.extra
        tiles = _tiles(width, height, self.side, self.most or 1)
        return (tiles + (tiles > 1)) * self.tokens + self.extra

    def _shrunk(self, size: Size) -> Size:
        width, height = size
        scale = 1.0 if self.longest is None else min(1.0, self.longest / max(width, height))
        return max(1, round(width * scale)), max(1, round(height * scale))


def _tiles(width: int, height: int, side: int, most: int) -> int:
    """Return the number of tiles of the grid that is nearest in shape to the picture; of two as near ones the larger,
    if the picture fills half of it."""
    best, difference = 1, math.inf
    grids = sorted((i for i in product(range(1, most + 1), repeat=2) if i[0] * i[1] <= most), key=lambda i: i[0] * i[1])
    for columns, rows in grids:
        away = abs(width / height - columns / rows)
        fills = width * height > 0.5 * side**2 * columns * rows
        if away < difference or (away == difference and fills):
            best, difference = columns * rows, away
    return best


def most_tokens(rules: Iterable[PictureRule], sizes: Sequence[Size]) -> int:
    """Return the largest number of tokens that one of the rules counts for all of the pictures together."""
    return max((sum(rule.count(size) for size in sizes) for rule in rules), default=0)


def jpeg_size(data: bytes) -> Size:
    """Return the size of a JPEG file, from its head; `FULL_PICTURE` for a file without one that can be read."""
    import PIL.Image  # 20 ms of CPU, for policies with pictures alone

    try:
        with PIL.Image.open(BytesIO(data)) as picture:
            return picture.size
    except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError):
        return FULL_PICTURE
