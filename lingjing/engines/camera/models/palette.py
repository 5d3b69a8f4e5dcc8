"""Colours that several models share: linear RGB 0..1 (chosen)."""

from __future__ import annotations

from lingjing.mission.appearance import LinearRgb

ORANGE: LinearRgb = (0.85, 0.16, 0.02)
RED: LinearRgb = (0.62, 0.03, 0.03)
YELLOW: LinearRgb = (0.85, 0.56, 0.03)
WHITE: LinearRgb = (0.80, 0.80, 0.78)
BLACK: LinearRgb = (0.02, 0.02, 0.025)
GREY: LinearRgb = (0.22, 0.22, 0.23)
WOOD: LinearRgb = (0.24, 0.14, 0.07)
HULL_BLUE: LinearRgb = (0.05, 0.14, 0.35)
HULL_GREEN: LinearRgb = (0.04, 0.20, 0.14)

SKINS: tuple[LinearRgb, ...] = ((0.72, 0.44, 0.30), (0.48, 0.26, 0.15), (0.80, 0.54, 0.40), (0.30, 0.16, 0.09))
HAIRS: tuple[LinearRgb, ...] = (BLACK, (0.10, 0.05, 0.02), (0.35, 0.22, 0.08), (0.05, 0.04, 0.04))
