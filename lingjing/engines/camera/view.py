"""The selection of one picture: tiles and their fineness, blocks, and cells of the ground.

All functions depend only on the pose, the light, the skyline and the ground, so a picture does not depend on earlier
ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.culling import (
    ShadowWindow,
    blunt_from,
    boxes_in_sight,
    casters,
    distances,
    full_reach,
    shade_window,
)
from lingjing.engines.camera.far_country import HIGH_M
from lingjing.engines.camera.light import Light
from lingjing.engines.camera.skyline import Skyline
from lingjing.engines.camera.town_ground import TownGround
from lingjing.scene.camera_geometry import focal_px
from lingjing.scene.tiles import TileKey
from lingjing.trace.records import CameraPose

FAR_REACH_M, BLOCKS_REACH_M = 14_000.0, 2600.0
"""Distances to which towers and lower blocks are drawn, metres (chosen)."""
MAPPED_FROM = 0.55
"""Share of the reach of full tiles from which the ground shows the map (chosen)."""
DETAIL_PX = 4.0
"""Pixels per metre down to which details are drawn (chosen)."""
STEEP_DEG, LEVELLED = 80.0, 2.0
"""Tilt (degrees) from which a picture has one level of detail, for tiles within so many reaches of full tiles (chosen).

Only towers of half a kilometre bring the closest tile that much closer than the others.
"""
LARGE_NEAR_M = 100.0
"""Distance from the eye within which cells of lands and ground are `close`, metres (chosen)."""


class Cells(NamedTuple):
    """Ranges of a sheet's indices that are drawn in the same way."""

    close: bool
    """True near the eye."""
    mapped: bool
    """True with the map."""
    runs: tuple[tuple[int, int], ...]
    """First index and count of each range."""


@dataclass(frozen=True, slots=True)
class TownView:
    """The selection of one picture."""

    full: tuple[TileKey, ...]
    """Full tiles, near to far."""
    shaded: frozenset[TileKey]
    """The instances within reach of the shadow map."""
    detailed: frozenset[TileKey]
    """The instances with details."""
    blunt: frozenset[TileKey]
    """The instances without grain."""
    far: tuple[tuple[int, int], ...]
    """Ranges of far blocks, near to far."""
    farther: tuple[tuple[int, int], ...]
    """Ranges of blocks without windows, near to far."""
    casters: tuple[TileKey, ...]
    """Tiles that may cast shadows into the picture."""
    ground: tuple[Cells, ...]
    """Cells of the ground."""
    lands: tuple[Cells, ...]
    """Cells of the land areas on the ground."""
    window: ShadowWindow
    """Window of the shadow map."""
    reach_m: float
    """Distance to which tiles are full, metres."""
    high: bool
    """True if the eye is high enough to see the country around the city. Its sight does not depend on the visibility at
    the ground."""

    @property
    def reaching(self) -> bool:
        """True if anything is too far away to show its grain; far blocks show none then."""
        return bool(self.blunt or self.farther)


def choose(sky: Skyline, town_ground: TownGround, pose: CameraPose, visibility_m: float, light: Light) -> TownView:
    """Return the selection of a picture."""
    eye = pose.position
    away = distances(sky.boxes, eye)
    seen = boxes_in_sight(sky.boxes, pose)
    reach = full_reach(pose, visibility_m)
    counted = _levelled(away, seen, pose, reach)
    near = seen & (counted <= reach)
    order = [k for k in np.argsort(away, kind="stable").tolist() if near[k]]
    window = shade_window(pose, light.sun)
    reached = casters(sky.boxes, window)
    cast = reached & (away <= 3.0 * reach) if light.dark < 0.95 else np.zeros(len(away), bool)
    high = eye[2] > HIGH_M
    far = seen & ~near & (high | (away < min(visibility_m, FAR_REACH_M)))
    some = far & (high | (away < BLOCKS_REACH_M))
    blocks = np.concatenate([sky.ranges[0][far], sky.ranges[1][some]])
    off = np.concatenate([away[far], away[some]])
    by_distance = np.argsort(off, kind="stable")
    blocks, off = blocks[by_distance], off[by_distance]
    blunt_m, blunt_blocks_m = blunt_from(reach)
    sharp = int(np.searchsorted(off, blunt_blocks_m))
    return TownView(
        full=tuple(sky.keys[k] for k in order),
        shaded=frozenset(sky.keys[k] for k in order if reached[k]),
        detailed=frozenset(sky.keys[k] for k in order if counted[k] <= focal_px(pose) / DETAIL_PX),
        blunt=frozenset(sky.keys[k] for k in order if counted[k] >= blunt_m),
        far=_filled(blocks[:sharp]),
        farther=_filled(blocks[sharp:]),
        casters=tuple(sky.keys[k] for k in np.flatnonzero(cast).tolist()),
        ground=_cells(town_ground.ranges, town_ground.boxes, pose, reach),
        lands=_cells(town_ground.land_ranges, town_ground.land_boxes, pose, reach),
        window=window,
        reach_m=reach,
        high=high,
    )


def _levelled(
    away: npt.NDArray[np.float64], seen: npt.NDArray[np.bool_], pose: CameraPose, reach: float
) -> npt.NDArray[np.float64]:
    """Return the distances that decide on the fineness of tiles.

    From straight above, all of a city is about equally far, and an edge between two levels would cross the middle of
    the picture. There the closest tile decides for all.
    """
    if pose.tilt_deg <= STEEP_DEG or not seen.any():
        return away
    return np.where(seen & (away <= LEVELLED * reach), away[seen].min(), away)


def _filled(ranges: npt.NDArray[np.int64]) -> tuple[tuple[int, int], ...]:
    return tuple((first, count) for first, count in ranges.tolist() if count)


def _farthest(boxes: npt.NDArray[np.float64], eye: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """Return the distance of the farthest corner of each box from a point, metres."""
    at = np.asarray(eye)
    off = np.maximum(np.abs(boxes[:, :3] - at), np.abs(boxes[:, 3:] - at))
    return np.asarray(np.linalg.norm(off, axis=1))


def _cells(
    ranges: npt.NDArray[np.int64], boxes: npt.NDArray[np.float64], pose: CameraPose, reach: float
) -> tuple[Cells, ...]:
    """Return the cells of a sheet in sight. Those completely nearer than the map are drawn without it."""
    shown = boxes_in_sight(boxes, pose)
    mapped = _farthest(boxes, pose.position) > MAPPED_FROM * reach
    close = distances(boxes, pose.position) < LARGE_NEAR_M
    kinds = [
        (near, far, _runs(ranges, shown & (close == near) & (mapped == far)))
        for near in (True, False)
        for far in (False, True)
    ]
    return tuple(Cells(near, far, tuple(runs)) for near, far, runs in kinds if runs)


def _runs(ranges: npt.NDArray[np.int64], wanted: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the selected ranges (first, count), neighbours joined."""
    runs: list[tuple[int, int]] = []
    for first, count in ranges[wanted & (ranges[:, 1] > 0)].tolist():
        if runs and sum(runs[-1]) == first:
            runs[-1] = runs[-1][0], runs[-1][1] + count
        else:
            runs.append((first, count))
    return runs


__all__ = ["MAPPED_FROM", "Cells", "TownView", "choose"]
