"""Models of a user's own: `look = "file.glb"`. This is the only module that imports trimesh and fast_simplification.

glTF has metres, y up and z to the front. The model is moved so that the middle of its plan and its base are at the
position of its body, and the box around it is the body's box, which others collide with. A texture is sampled at the
vertices. Coarser levels of detail are made by quadric simplification.
"""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.mission.appearance import GLB, LEAST_M, MOST_M
from lingjing.mission.instance import Entity, Instance
from lingjing.scene.glb_file import GlbFile, glb_fault, read_glb
from lingjing.scene.sizes import Size

SHA = "look_sha256"
"""Property of an entity with a model of its own: the hash of the file."""
COARSER = (0.25, 0.06)
"""Shares of the triangles at the coarser levels of detail (chosen)."""
LEAST_TRIANGLES = 60
"""A level has at least this many triangles (chosen)."""
MOST_PIXELS = 4096 * 4096
"""Most pixels of a texture (chosen)."""
KEPT = 16
"""Models in memory (chosen)."""

Rows = npt.NDArray[np.float32]
"""Triangles as the camera draws them: rows of position, normal, linear colour and gloss, three a triangle."""
_Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class OwnModel:
    """A model in its body's frame: x right, y ahead, z up, metres."""

    sha256: str
    """Hash of the file."""
    size: Size
    """The box around it."""
    levels: tuple[Rows, ...]
    """The triangles at all levels of detail, the finest first; the base is at z = 0."""


def own_look(entity: Entity) -> str:
    """Return the path of an entity's own model; empty without one."""
    look = str(entity.properties.get("look", ""))
    return look if look.endswith(GLB) else ""


def with_own_models(instance: Instance) -> Instance:
    """Return the instance with the sizes and hashes of its entities' own models.

    Raises `UsageError` for a file that cannot be used, or that is not the one with which the instance was made.
    """
    if not any(map(own_look, instance.entities)):
        return instance
    return msgspec.structs.replace(instance, entities=tuple(map(_measured, instance.entities)))


def own_model(path: str, sha256: str = "") -> OwnModel:
    """Return the model in a file. Raises `UsageError` if the file cannot be used or has another hash."""
    file = read_glb(path)
    if sha256 and file.sha256 != sha256:
        raise glb_fault(path, "is not the file that the episode was made with", "put the former file in its place")
    return _kept(file)


def _measured(entity: Entity) -> Entity:
    path = own_look(entity)
    if not path:
        return entity
    model = own_model(path, str(entity.properties.get(SHA, "")))
    size = model.size
    measures = {"length_m": size.length_m, "width_m": size.width_m, "height_m": size.height_m, SHA: model.sha256}
    return msgspec.structs.replace(entity, properties={**entity.properties, **measures})


@lru_cache(maxsize=KEPT)
def _kept(file: GlbFile) -> OwnModel:
    points, faces, colours = _surface(file)
    low, high = points.min(axis=0), points.max(axis=0)
    spans = high - low
    if not np.isfinite(points).all() or spans.max() < LEAST_M:
        raise glb_fault(file.path, "has no size", "export it in metres")
    if spans.max() > MOST_M:
        raise glb_fault(
            file.path, f"is {spans.max():g} m long, and at most {MOST_M:g} m are drawn", "export it in metres"
        )
    points = points - (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2])
    right, ahead, up = (max(float(span), LEAST_M) for span in spans)
    levels = tuple(_rows(*part) for part in _levels(points, faces, colours))
    return OwnModel(file.sha256, Size(ahead, right, up), levels)


def _surface(file: GlbFile) -> tuple[_Array, _Array, _Array]:
    """Return vertices in the body's frame, triangles and linear colours. Raises `UsageError` for a broken file."""
    trimesh = _trimesh()
    _check_textures(file)
    try:
        scene = trimesh.load_scene(io.BytesIO(file.data), file_type="glb")
        parts = []
        for node in sorted(scene.graph.nodes_geometry):
            placement, name = scene.graph[node]
            mesh = scene.geometry[name]
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                colours = _colours(mesh)
                parts.append((trimesh.transform_points(mesh.vertices, placement), mesh.faces, colours))
        starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
        whole = np.concatenate([points for points, _, _ in parts])
        faces = np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts, strict=False)])
        colours = np.concatenate([colours for _, _, colours in parts])
    except UsageError:
        raise
    except Exception as error:  # noqa: BLE001 - damaged files raise exceptions that trimesh does not document
        raise glb_fault(file.path, f"is damaged: {str(error)[:80] or type(error).__name__}") from None
    if faces.min() < 0 or faces.max() >= len(whole):
        raise glb_fault(file.path, "is damaged: a triangle has a corner that is not there")
    return np.column_stack([-whole[:, 0], whole[:, 2], whole[:, 1]]), faces, colours


def _check_textures(file: GlbFile) -> None:
    """Check that each texture is an image of a size that is read; trimesh leaves out what it cannot read."""
    import PIL.Image

    for data in file.textures:
        try:
            image = PIL.Image.open(io.BytesIO(data), formats=("PNG", "JPEG", "WEBP"))
            if image.width * image.height <= MOST_PIXELS:
                image.load()
        except (OSError, SyntaxError, ValueError, PIL.Image.DecompressionBombError):
            raise glb_fault(file.path, "has a damaged texture", "export it with PNG or JPEG textures") from None
        if image.width * image.height > MOST_PIXELS:
            why = f"has a texture of {image.width} by {image.height} pixels"
            raise glb_fault(file.path, why, "use a smaller texture")


def _trimesh() -> Any:
    try:
        import fast_simplification  # noqa: F401 - asked for here, so that both are missed before work begins
        import trimesh
    except ImportError as error:
        hint = install_line("models")
        raise UsageError(f"a look of your own needs the package `{error.name}`", hint=hint) from None
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # faults are reported here, once
    return trimesh


def _colours(mesh: Any) -> _Array:
    """Return the linear base colour of each vertex: factor times texture, or the colours of the vertices."""
    visual, count = mesh.visual, len(mesh.vertices)
    material = getattr(visual, "material", None)
    factor = getattr(material, "baseColorFactor", None)
    linear = np.ones(3) if factor is None else np.asarray(factor, np.float64)[:3] / 255.0
    image, places = getattr(material, "baseColorTexture", None), getattr(visual, "uv", None)
    if image is not None and places is not None:
        pixels = np.asarray(image.convert("RGB"), np.float64) / 255.0
        u, v = np.mod(np.nan_to_num(places[:, 0]), 1.0), np.mod(1.0 - np.nan_to_num(places[:, 1]), 1.0)
        column = np.minimum((u * image.width).astype(int), image.width - 1)
        row = np.minimum((v * image.height).astype(int), image.height - 1)
        return linear * _linear(pixels[row, column])
    if getattr(visual, "kind", None) == "vertex":
        baked: _Array = np.asarray(visual.vertex_colors, np.float64)[:, :3] / 255.0
        return baked
    return np.tile(linear, (count, 1))


def _linear(srgb: _Array) -> _Array:
    """Return linear values of sRGB ones (IEC 61966-2-1)."""
    bright: _Array = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return bright


def _levels(points: _Array, faces: _Array, colours: _Array) -> list[tuple[_Array, _Array, _Array]]:
    """Return vertices, triangles and colours of each level of detail."""
    import fast_simplification
    from scipy.spatial import KDTree

    levels = [(points, faces, colours)]
    joined, index = np.unique(points.round(6), axis=0, return_inverse=True)  # seams of textures would tear open
    shell = index.reshape(-1)[faces]
    for share in COARSER:
        wanted = int(share * len(faces))
        if wanted < LEAST_TRIANGLES:
            break
        fewer, kept = fast_simplification.simplify(
            joined.astype(np.float32), shell.astype(np.int32), target_count=wanted
        )  # fmt: skip
        if len(kept):
            _, nearest = KDTree(points).query(fewer)
            levels.append((fewer.astype(np.float64), kept, colours[nearest]))
    return levels


def _rows(points: _Array, faces: _Array, colours: _Array) -> Rows:
    """Return triangles with smooth normals, without those that have no area."""
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    some = np.linalg.norm(across, axis=1) > 1e-12
    faces, across = faces[some], across[some]
    normals = np.zeros_like(points)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.0, normals / np.maximum(length, 1e-30), (0.0, 0.0, 1.0))
    rows = np.hstack([points, normals, colours, np.zeros((len(points), 1))])
    return np.ascontiguousarray(rows[faces.reshape(-1)], np.float32)


__all__ = ["SHA", "OwnModel", "own_look", "own_model", "with_own_models"]
