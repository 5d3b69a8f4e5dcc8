"""The mesh of one tile of a city, by material, with the boxes that decide on culling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.building_meshes import building
from lingjing.engines.camera.classes import CLASSES, prop_class
from lingjing.engines.camera.mesh_rows import MeshPart, joined
from lingjing.engines.camera.road_meshes import Middles, areas, junctions, lanes, middles_of, pavements
from lingjing.engines.camera.structure_meshes import GroundBelow, bridge, pipe, slope, solid
from lingjing.mission.geometry2d import Polygon, bounds
from lingjing.scene.city import Junction, Pieces

MATERIALS = ("wall", "plain", "road", "paving", "soil")
"""Materials of a tile's parts."""

CASTERS = ("wall", "plain")
"""Materials that cast shadows."""


@dataclass(frozen=True, slots=True)
class TileMesh:
    """The mesh of one tile."""

    parts: Mapping[str, MeshPart]
    """Parts by material (`MATERIALS`)."""
    coarse: int
    """Number of the first indices of "plain" without the details that show only nearby."""
    boxes: npt.NDArray[np.float64]
    """Boxes of its buildings, (n, 6): west, south, low, east, north, high; metres."""
    low: npt.NDArray[np.float64]
    """Low corner of all vertices, (3,) metres."""
    high: npt.NDArray[np.float64]
    """High corner of all vertices, (3,) metres."""


def mesh_tile(
    pieces: Pieces,
    crossings: tuple[Polygon, ...],
    entity_buildings: Mapping[str, int],
    under: GroundBelow,
    middles: Middles | None = None,
) -> TileMesh:
    """Return the mesh of all static pieces of a tile.

    `crossings` are the outlines of junctions with pedestrian crossings in and around it. `entity_buildings` holds the
    ids of buildings that are drawn as an entity. `under` is the elevation of the ground. `middles` are the left edges
    of the roads in and around it (`road_meshes`), by default those of its own roads.
    """
    middles = middles_of(pieces.roads) if middles is None else middles
    structure, concrete = _id("structure", "concrete"), CLASSES["concrete"]
    built = [building(b, entity_buildings.get(b.id, _id("building", "structure"))) for b in pieces.buildings]
    span = _id("bridge", "structure")
    others = [roof for _, roof, _ in built]
    others += [bridge(b, span, under) for b in pieces.bridges if len(b.path) > 1]
    others += [solid(s, structure) for s in pieces.solids if len(s.polygon) > 2]
    others += [slope(s, concrete) for s in pieces.slopes if len(s.top) > 2]
    others += [pipe(p, _id("pipe", "structure")) for p in pieces.pipes]
    paved, soil = areas(pieces.areas)
    parts = {
        "wall": joined(wall for wall, _, _ in built),
        "plain": joined((*others, *(details for _, _, details in built))),
        "road": joined((lanes(pieces.roads, crossings, middles), junctions(pieces.junctions))),
        "paving": joined((pavements(pieces.roads), paved)),
        "soil": soil,
    }
    boxes = np.array([_box(b.polygon, b.base_m, b.top_m) for b in pieces.buildings]).reshape(-1, 6)
    some = [part.vertices["position"] for part in parts.values() if len(part.vertices)]
    points = np.concatenate(some) if some else np.zeros((1, 3), np.float32)
    coarse = sum(len(part.index) for part in others)
    return TileMesh(parts, coarse, boxes, points.min(axis=0).astype(float), points.max(axis=0).astype(float))


def crossings_of(crossroads: tuple[Junction, ...]) -> tuple[Polygon, ...]:
    """Return the outlines of junctions with pedestrian crossings: those with traffic lights."""
    return tuple(junction.polygon for junction in crossroads if junction.lights and len(junction.polygon) > 2)


def _id(name: str, other: str) -> int:
    return prop_class(name) if name in CLASSES else CLASSES[other]


def _box(ring: Polygon, base: float, top: float) -> tuple[float, ...]:
    west, south, east, north = bounds(ring)
    return west, south, base, east, north, top
