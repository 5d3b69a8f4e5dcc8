"""A city as glTF 2.0: meshes in metres, one node for each building and one for each other kind of piece and tile.

glTF's up is +y, so the node `city` turns the frame. Below it, x is east, y north and z the elevation. Vertices are
32-bit floats relative to their node, and the places of nodes are exact. Furniture (props) and pitched roofs are left
out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.mission.geometry2d import Polygon, Vector2
from lingjing.scene.city import Building, City, Road, Tile
from lingjing.scene.shapes import Capsule, OrientedBox, Shape, bridge_shapes, pipe_shapes, slope_shape, solid_shapes
from lingjing.scene.tiles import Tiles

_COLOURS = {
    "water": (64, 110, 140), "land": (120, 140, 90), "area": (140, 150, 120), "road": (80, 80, 85),
    "junction": (75, 75, 80), "solid": (150, 150, 150), "slope": (150, 150, 150), "bridge": (140, 140, 145),
    "pipe": (160, 140, 120),
}  # fmt: skip
"""Colours of kinds without one of their own, sRGB (chosen)."""

_LIFT_M = {"land": 0.0, "area": 0.02, "junction": 0.04, "road": 0.05}
"""Height over the ground at which flat pieces lie, metres (chosen): two at one height would flicker."""

_Floats = npt.NDArray[np.float64]


def encode(city: City) -> bytes:
    """Return the file. The extras of the scene hold origin, projection and attribution.

    Raises `UsageError` if trimesh is not installed.
    """
    from lingjing.scene.exports import projection

    builder = _Builder(city)
    builder.scene.metadata.update(
        origin={"latitude": city.origin[0], "longitude": city.origin[1]},
        projection=projection(city),
        attribution=city.attribution,
    )
    for number, water in enumerate(city.waters):
        builder.flat("water", f"water/{number}", [(water.polygon, water.holes, water.level_m)])
    for number, land in enumerate(city.lands):
        builder.flat("land", f"land/{number}", [(land.polygon, (), land.top_m)])
    for tile in Tiles(city):
        builder.tile(tile)
    return bytes(builder.scene.export(file_type="glb"))


class _Builder:
    """Collects meshes in a scene of trimesh."""

    def __init__(self, city: City) -> None:
        try:
            import trimesh
        except ImportError as error:
            raise UsageError("glTF needs the package trimesh", hint=install_line("models")) from error
        self._trimesh: Any = trimesh
        self._datum_m = city.datum_m
        self.scene: Any = trimesh.Scene(base_frame="world")
        turned = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
        self.scene.graph.update(frame_from="world", frame_to="city", matrix=turned)

    def tile(self, tile: Tile) -> None:
        """Add the pieces of a tile."""
        end = f"{tile.key[0]},{tile.key[1]}"
        ground = self._datum_m
        self.flat("area", f"area/{end}", [(a.polygon, a.holes, a.top_m) for a in tile.areas])
        self.flat("junction", f"junction/{end}", [(j.polygon, (), j.elevation_m) for j in tile.junctions])
        self._shapes("solid", f"solid/{end}", [shape for piece in tile.solids for shape in solid_shapes(piece)])
        self._shapes("slope", f"slope/{end}", [slope_shape(piece) for piece in tile.slopes])
        self._shapes("bridge", f"bridge/{end}", [shape for piece in tile.bridges for shape in bridge_shapes(piece)])
        self._shapes("pipe", f"pipe/{end}", [shape for piece in tile.pipes for shape in pipe_shapes(piece)])
        self._add(f"road/{end}", [mesh for road in tile.roads for mesh in self._ribbons(road)], _COLOURS["road"])
        for building in tile.buildings:
            self._building(building, ground)

    def flat(self, kind: str, name: str, parts: Sequence[tuple[Polygon, Sequence[Polygon], float]]) -> None:
        """Add level polygons."""
        meshes = [self._level(outline, holes, at + _LIFT_M.get(kind, 0.0)) for outline, holes, at in parts]
        self._add(name, [mesh for mesh in meshes if mesh is not None], _COLOURS[kind])

    def _building(self, building: Building, ground_m: float) -> None:
        from shapely import Polygon as Outline

        base = min(building.base_m, building.top_m - 0.1)
        outline = Outline(building.polygon, building.holes)
        mesh = self._trimesh.creation.extrude_polygon(outline, building.top_m - base, engine="earcut")
        mesh.apply_translation((0.0, 0.0, base))
        self._add(f"building/{building.id}", [mesh], tuple(round(255 * part) for part in building.colour))

    def _shapes(self, kind: str, name: str, shapes: Sequence[Shape]) -> None:
        self._add(name, [self._solid(shape) for shape in shapes], _COLOURS[kind])

    def _solid(self, shape: Shape) -> Any:
        trimesh = self._trimesh
        if isinstance(shape, OrientedBox):
            place = trimesh.transformations.rotation_matrix(shape.yaw, (0.0, 0.0, 1.0))
            place[:3, 3] = shape.centre
            return trimesh.creation.box(extents=2.0 * np.asarray(shape.half), transform=place)
        if isinstance(shape, Capsule):
            return trimesh.creation.cylinder(shape.radius_m, segment=(shape.start, shape.end), sections=12)
        return trimesh.convex.convex_hull(np.asarray(shape.corners))

    def _level(self, outline: Polygon, holes: Sequence[Polygon], at_m: float) -> Any:
        """Return a polygon as triangles that face up; None for one without an area."""
        from shapely import Polygon as Outline

        shape = Outline(outline, holes)
        if shape.area == 0.0:
            return None
        points, faces = self._trimesh.creation.triangulate_polygon(shape, engine="earcut")
        return self._trimesh.Trimesh(_raised(points, at_m), _facing_up(points, faces), process=False)

    def _ribbons(self, road: Road) -> Iterator[Any]:
        """Yield each lane as a strip of two triangles for each section."""
        for lane in road.lanes:
            path = np.asarray(lane.shape, np.float64)
            if len(path) < 2:
                continue
            along = np.gradient(path[:, :2], axis=0)
            lengths = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
            aside = np.column_stack((-along[:, 1], along[:, 0])) / lengths * lane.width_m / 2.0
            height = path[:, 2] if path.shape[1] > 2 else np.zeros(len(path))
            left = np.column_stack((path[:, :2] + aside, height + _LIFT_M["road"]))
            right = np.column_stack((path[:, :2] - aside, height + _LIFT_M["road"]))
            count = len(path)
            first = np.arange(count - 1)
            faces = np.concatenate(
                [
                    np.column_stack((first, first + count, first + 1)),
                    np.column_stack((first + 1, first + count, first + count + 1)),
                ]
            )
            yield self._trimesh.Trimesh(np.concatenate((left, right)), faces, process=False)

    def _add(self, name: str, meshes: Sequence[Any], colour: Sequence[int]) -> None:
        """Add meshes as one node, placed at the middle of its bounds."""
        if not meshes:
            return
        mesh = meshes[0] if len(meshes) == 1 else self._trimesh.util.concatenate(meshes)
        middle = mesh.bounds.mean(axis=0)
        mesh.apply_translation(-middle)
        mesh.visual = self._trimesh.visual.TextureVisuals(
            material=self._trimesh.visual.material.PBRMaterial(
                name=name.partition("/")[0], baseColorFactor=[*colour, 255], metallicFactor=0.0, roughnessFactor=0.9
            )
        )
        place = np.eye(4)
        place[:3, 3] = middle
        self.scene.add_geometry(mesh, geom_name=name, node_name=name, parent_node_name="city", transform=place)


def _raised(points: Sequence[Vector2] | _Floats, at_m: float) -> _Floats:
    plane = np.asarray(points, np.float64)
    return np.column_stack((plane, np.full(len(plane), at_m)))


def _facing_up(points: _Floats, faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    first, second, third = (points[faces[:, corner]] for corner in range(3))
    (east, north), (across, along) = (second - first).T, (third - first).T
    turned = east * along - north * across < 0.0
    return np.where(turned[:, None], faces[:, ::-1], faces)


__all__ = ["encode"]
