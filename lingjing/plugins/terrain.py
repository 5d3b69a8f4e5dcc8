"""Queries of a city: the ground and the bodies on it (`Terrain`), the ground where legs can go (`obstacle_map`), and
the buildings of a rectangle (`buildings_within`), which a city in a folder does not hold in memory.

All are defined in `lingjing.scene`; a plug-in takes them from here.
"""

from __future__ import annotations

from lingjing.scene.obstacles import ObstacleMap, obstacle_map
from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import buildings_within

__all__ = ["ObstacleMap", "Terrain", "buildings_within", "obstacle_map"]
