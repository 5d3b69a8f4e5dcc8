"""Paints that several models share: linear RGB 0..1."""

from __future__ import annotations

from lingjing.engines.camera.meshes import Colour

ORANGE: Colour = (0.85, 0.16, 0.02)
RED: Colour = (0.62, 0.03, 0.03)
YELLOW: Colour = (0.85, 0.56, 0.03)
WHITE: Colour = (0.80, 0.80, 0.78)
BLACK: Colour = (0.02, 0.02, 0.025)
GREY: Colour = (0.22, 0.22, 0.23)
WOOD: Colour = (0.24, 0.14, 0.07)
HULL_BLUE: Colour = (0.05, 0.14, 0.35)
HULL_GREEN: Colour = (0.04, 0.20, 0.14)

SKINS: tuple[Colour, ...] = ((0.72, 0.44, 0.30), (0.48, 0.26, 0.15), (0.80, 0.54, 0.40), (0.30, 0.16, 0.09))
HAIRS: tuple[Colour, ...] = (BLACK, (0.10, 0.05, 0.02), (0.35, 0.22, 0.08), (0.05, 0.04, 0.04))
