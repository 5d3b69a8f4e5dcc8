"""How large an entity is, and whether one can bump into it. Defined in `lingjing.scene.sizes`."""

from __future__ import annotations

from lingjing.mission.appearance import UNSAID_M
from lingjing.scene.sizes import entity_size, solid_size, sunk_m

__all__ = ["UNSAID_M", "entity_size", "solid_size", "sunk_m"]
