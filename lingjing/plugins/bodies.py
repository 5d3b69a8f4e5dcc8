"""Sizes of entities, and their solid extents for collisions. Defined in `lingjing.scene.sizes`."""

from __future__ import annotations

from lingjing.mission.appearance import UNSAID_M
from lingjing.scene.sizes import entity_size, solid_size, sunk_m

__all__ = ["UNSAID_M", "entity_size", "solid_size", "sunk_m"]
