"""Queries of a city: the ground and the bodies on it (`Terrain`), and the ground where legs can go (`obstacle_map`).

Both are defined in `lingjing.scene`; a plug-in takes them from here.
"""

from __future__ import annotations

from lingjing.scene.obstacles import ObstacleMap, obstacle_map
from lingjing.scene.terrain import Terrain

__all__ = ["ObstacleMap", "Terrain", "obstacle_map"]
