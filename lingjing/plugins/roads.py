"""The public roads that a policy may plan with: `read_road_map(brief.road_network)`.

Defined in `lingjing.scene.road_map`; a plug-in takes them from here.
"""

from __future__ import annotations

from lingjing.scene.road_map import RoadMap, RoadPlace, RoadSegment, RoadWay, read_road_map

__all__ = ["RoadMap", "RoadPlace", "RoadSegment", "RoadWay", "read_road_map"]
