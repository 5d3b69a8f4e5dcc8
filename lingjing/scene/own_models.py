"""Models of a user's own: `look = "file.glb"`. This is the only module that imports trimesh and fast_simplification.

glTF has metres, y up and z to the front. The model is moved so that the middle of its plan and its base are at the
position of its body, and the box around it is the body's box, which others collide with. Nodes with the names of
`MOUNTS` are the places of cameras. A texture is sampled at the
vertices. Coarser levels of detail are made by quadric simplification.
"""

from __future__ import annotations

import io
import logging
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.mission.appearance import GLB, LEAST_M, MOST_M
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import CameraMount
from lingjing.scene.glb_file import GlbFile, glb_fault, read_glb
from lingjing.scene.sizes import Size

SHA = "look_sha256"
"""Property of an entity with a model of its own: the hash of the file."""
CREDIT = "look_credit"
"""Property of an entity with a model of its own: the credit that the file names; absent if it names none."""
MOUNTS: dict[str, Literal["front", "oblique", "nadir"]] = {
    "mount_front": "front", "mount_oblique": "oblique", "mount_nadir": "nadir"
}  # fmt: skip
"""Name of a node → the view of the cameras that are mounted there."""
COARSER = (0.25, 0.06)
"""Shares of the triangles at the coarser levels of detail (chosen)."""
ASIDE_M = 0.3
"""Farthest a node for cameras may lie beside the middle plane, metres (chosen): mounts have no place to the side."""
LEAST_TRIANGLES = 60
"""A level has at least this many triangles (chosen)."""
MOST_PIXELS = 4096 * 4096
"""Most pixels of a texture (chosen)."""
KEPT = 16
"""Number of models that are kept in memory (chosen)."""

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
    mounts: tuple[CameraMount, ...] = ()
    """The places of cameras that the file names, above its base."""
    credit: str = ""
    """The credit that the file names; "" if it names none."""


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


def model_credits(instance: Instance) -> tuple[str, ...]:
    """Return the credits of the models of its own that an instance shows, each once."""
    credits_of_entities = (str(entity.properties.get(CREDIT, "")) for entity in instance.entities)
    return tuple(dict.fromkeys(credit for credit in credits_of_entities if credit))


def _measured(entity: Entity) -> Entity:
    path = own_look(entity)
    if not path:
        return entity
    model = own_model(path, str(entity.properties.get(SHA, "")))
    size = model.size
    measures: dict[str, float | str] = {
        "length_m": size.length_m,
        "width_m": size.width_m,
        "height_m": size.height_m,
        SHA: model.sha256,
    }
    measures |= {CREDIT: model.credit} if model.credit else {}
    mounts = _mounts(entity, model)
    return msgspec.structs.replace(entity, properties={**entity.properties, **measures}, mounts=mounts)


def _mounts(entity: Entity, model: OwnModel) -> tuple[CameraMount, ...]:
    """The mounts of an entity: those of its file, and its type's for other views. Gimbals are those of the type."""
    lowered = model.size.height_m / 2.0 if entity.properties.get("origin") == "middle" else 0.0
    own = {mount.view: mount for mount in model.mounts}
    gimbals = {mount.view: mount.gimbal for mount in entity.mounts}
    made = tuple(
        msgspec.structs.replace(
            mount, above_m=round(mount.above_m - lowered, 3), gimbal=gimbals.get(view, mount.gimbal)
        )
        for view, mount in own.items()
    )
    return made + tuple(mount for mount in entity.mounts if mount.view not in own)


@lru_cache(maxsize=KEPT)
def _kept(file: GlbFile) -> OwnModel:
    points, faces, colours, nodes = _surface(file)
    low, high = points.min(axis=0), points.max(axis=0)
    spans = high - low
    if not np.isfinite(points).all():
        raise glb_fault(file.path, "has a corner without a place (no number)")
    if spans.max() < LEAST_M:
        raise glb_fault(file.path, "has no size", "export it in metres")
    if spans.max() > MOST_M:
        raise glb_fault(
            file.path, f"is {spans.max():g} m long, and at most {MOST_M:g} m are drawn", "export it in metres"
        )
    middle = np.array([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]])
    points = points - middle
    mounts = tuple(_mount(file.path, name, place - middle, front) for name, place, front in nodes)
    right, ahead, up = (max(float(span), LEAST_M) for span in spans)
    levels = tuple(_rows(*part) for part in _levels(points, faces, colours))
    return OwnModel(file.sha256, Size(ahead, right, up), levels, mounts, file.credit)


def _mount(path: str, name: str, place: _Array, front: _Array) -> CameraMount:
    """The mount at a node: its place, and its tilt by the direction of its z axis."""
    if abs(place[0]) > ASIDE_M:
        why = f"has its node `{name}` {abs(place[0]):.2f} m beside its middle, where no camera is mounted"
        raise glb_fault(path, why, "move the node into the middle plane of the model")
    view = MOUNTS[name]
    tilt = 90.0 if view == "nadir" else math.degrees(math.atan2(-front[2], math.hypot(front[0], front[1])))
    return CameraMount(
        view=view, ahead_m=round(float(place[1]), 3), above_m=round(float(place[2]), 3), tilt_deg=round(tilt, 2)
    )


def _surface(file: GlbFile) -> tuple[_Array, _Array, _Array, list[tuple[str, _Array, _Array]]]:
    """Return vertices in the body's frame, triangles, linear colours, and name, place and front of the mounts.

    Raises `UsageError` for a broken file.
    """
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
        nodes = [(name, *_node(scene.graph[name][0])) for name in MOUNTS if name in scene.graph.nodes]
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
    return _turned(whole), faces, colours, nodes


def _turned(points: _Array) -> _Array:
    """Points of glTF (y up, z to the front) in the body's frame."""
    return np.column_stack([-points[:, 0], points[:, 2], points[:, 1]])


def _node(placement: _Array) -> tuple[_Array, _Array]:
    """Place and front of a node in the body's frame."""
    place, front = _turned(np.array([placement[:3, 3], placement[:3, 2]], np.float64))
    if not np.isfinite(place).all() or not np.isfinite(front).all():
        raise ValueError("a node has no place")
    return place, front


def _check_textures(file: GlbFile) -> None:
    """Check that each texture is an image of a size that is read; trimesh leaves out what it cannot read."""
    import PIL.Image

    for data in file.textures:
        try:
            image = PIL.Image.open(io.BytesIO(data), formats=("PNG", "JPEG", "WEBP"))
            if image.width * image.height <= MOST_PIXELS:
                image.load()
        except PIL.Image.DecompressionBombError:
            raise glb_fault(file.path, "has a texture that is too large", "use a smaller texture") from None
        except (OSError, SyntaxError, ValueError):
            raise glb_fault(file.path, "has a damaged texture", "export it with PNG or JPEG textures") from None
        if image.width * image.height > MOST_PIXELS:
            why = f"has a texture of {image.width} by {image.height} pixels"
            raise glb_fault(file.path, why, "use a smaller texture")


def _trimesh() -> Any:
    try:
        import fast_simplification  # noqa: F401 - imported here to report both missing packages before work begins
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


__all__ = ["SHA", "OwnModel", "model_credits", "own_look", "own_model", "with_own_models"]
