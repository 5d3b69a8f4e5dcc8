"""Colours of walls and roofs (linear RGB), and the facades of buildings by use."""

from __future__ import annotations

from random import Random

from lingjing.mission.appearance import LinearRgb

WHITE: LinearRgb = (0.82, 0.82, 0.80)
"""Walls of the one building that a mission calls white. No colour of `WALLS` or `HOMES` is near it."""

HOMES: tuple[LinearRgb, ...] = (
    (0.47, 0.13, 0.08), (0.62, 0.42, 0.13), (0.20, 0.30, 0.42), (0.55, 0.30, 0.22), (0.30, 0.36, 0.20),
    (0.60, 0.24, 0.12), (0.33, 0.28, 0.25), (0.14, 0.34, 0.36), (0.56, 0.46, 0.30), (0.42, 0.20, 0.26),
    (0.24, 0.24, 0.27), (0.64, 0.52, 0.20), (0.26, 0.18, 0.13), (0.45, 0.36, 0.40), (0.52, 0.38, 0.30),
    (0.16, 0.22, 0.18),
)  # fmt: skip
"""Sixteen wall colours that are distinguishable from the height of a robot dog's camera."""

WALLS: dict[str, tuple[LinearRgb, ...]] = {
    "residential": ((0.55, 0.47, 0.36), (0.50, 0.33, 0.24), (0.58, 0.52, 0.42), (0.42, 0.38, 0.34), (0.60, 0.44, 0.30)),
    "house": ((0.60, 0.50, 0.36), (0.50, 0.24, 0.16), (0.46, 0.46, 0.40), (0.36, 0.42, 0.44), (0.60, 0.40, 0.26)),
    "commercial": ((0.42, 0.40, 0.38), (0.55, 0.50, 0.44), (0.30, 0.32, 0.36), (0.50, 0.42, 0.34)),
    "office": ((0.20, 0.30, 0.36), (0.26, 0.34, 0.42), (0.18, 0.24, 0.26), (0.34, 0.38, 0.40), (0.30, 0.27, 0.24)),
    "industrial": ((0.40, 0.42, 0.44), (0.30, 0.38, 0.46), (0.46, 0.42, 0.36), (0.36, 0.28, 0.24)),
    "warehouse": ((0.52, 0.53, 0.54), (0.34, 0.42, 0.52), (0.56, 0.50, 0.40), (0.44, 0.30, 0.24)),
    "school": ((0.46, 0.17, 0.11), (0.52, 0.24, 0.15), (0.56, 0.48, 0.38)),
    "public": ((0.56, 0.52, 0.46), (0.48, 0.44, 0.40)),
}
"""Wall colours by use."""
FACADES: dict[str, tuple[str, ...]] = {
    "residential": ("punched", "punched", "ribbon"),
    "house": ("punched",),
    "commercial": ("ribbon", "punched", "curtain"),
    "office": ("curtain", "curtain", "ribbon"),
    "industrial": ("industrial",),
    "warehouse": ("industrial", "blank"),
    "school": ("punched", "ribbon"),
    "public": ("ribbon", "curtain"),
}
"""Patterns of windows by use; a repeated one is more frequent."""
ROOFS: tuple[LinearRgb, ...] = ((0.30, 0.29, 0.28), (0.38, 0.36, 0.33), (0.24, 0.24, 0.25), (0.44, 0.43, 0.41))
"""Colours of flat roofs."""
TILES: tuple[LinearRgb, ...] = ((0.36, 0.12, 0.08), (0.28, 0.15, 0.11), (0.20, 0.20, 0.22), (0.16, 0.22, 0.28))
"""Colours of tiled roofs."""
METAL: tuple[LinearRgb, ...] = ((0.40, 0.42, 0.44), (0.18, 0.28, 0.42), (0.30, 0.34, 0.30), (0.48, 0.46, 0.42))
"""Colours of the roofs of industrial buildings."""
ORANGE: LinearRgb = (0.80, 0.24, 0.03)
"""A roof colour that resembles fire, as a distractor."""

ORANGE_SHARE = 0.03
"""Share of roofs with `ORANGE` (chosen)."""


def vary(colour: LinearRgb, chance: Random) -> LinearRgb:
    """The colour, lighter or darker by at most 12 %, to three digits."""
    factor = chance.uniform(0.88, 1.12)
    red, green, blue = (round(min(0.78, channel * factor), 3) for channel in colour)
    return red, green, blue


def roof_colour(use: str, roof: str, chance: Random) -> LinearRgb:
    """A random roof colour: felt or gravel, tiles, metal, or rarely orange."""
    if chance.random() < ORANGE_SHARE:
        return ORANGE
    if use in ("industrial", "warehouse"):
        return vary(chance.choice(METAL), chance)
    return vary(chance.choice(ROOFS if roof == "flat" else TILES), chance)
