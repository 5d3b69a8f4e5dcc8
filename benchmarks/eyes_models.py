"""Reference models for `eyes.py`: vehicles and a pedestrian from a package, read from glTF.

The package is `metadrive-simulator`; nothing of it is part of this project. Its walking man is CC-BY-4.0
(Renderpeople). Of its vehicles only those are used for which an older package of the same project, `pgdrive`, names a
licence: light truck, Beetle and sports car, all CC-BY-4.0. They are drawn with vertex colours alone: the base colour
of the material, or the texel of its texture at the vertex.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lingjing.engines.camera.meshes import Mesh

Matrix = np.ndarray

VEHICLES = {
    "light truck": ("truck", 5.8, 0.37, 0.931, 1.726, -1.075),
    "Beetle": ("beetle", 4.25, 0.39, 0.79, 1.22, -1.28),
    "sports car": ("130", 4.4, 0.39, 0.803, 1.285, -1.203),
}
"""Folder, length (m), radius of a tyre, half track, front and rear axle of each vehicle, as its package declares."""
KINDS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Document:
    """A glTF file with its buffers."""

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self.json: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        self.buffers = [self._bytes(buffer["uri"]) for buffer in self.json["buffers"]]
        self.images: dict[int, np.ndarray] = {}

    def _bytes(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.folder / uri).read_bytes()

    def view(self, index: int) -> bytes:
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]]

    def array(self, index: int) -> np.ndarray:
        """Return an accessor's values, (n, width)."""
        accessor = self.json["accessors"][index]
        kind, width = np.dtype(KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        view = self.json["bufferViews"][accessor["bufferView"]]
        raw, step = self.view(accessor["bufferView"])[accessor.get("byteOffset", 0) :], kind.itemsize * width
        stride = view.get("byteStride", step)
        rows = np.lib.stride_tricks.as_strided(np.frombuffer(raw, "u1"), (accessor["count"], step), (stride, 1))
        return np.ascontiguousarray(rows).view(kind)

    def texture(self, index: int) -> np.ndarray:
        """Return a texture's picture in linear colours."""
        source = self.json["textures"][index]["source"]
        if source not in self.images:
            image = self.json["images"][source]
            raw = self.view(image["bufferView"]) if "bufferView" in image else self._bytes(image["uri"])
            picture = np.asarray(Image.open(io.BytesIO(raw)).convert("RGB"), np.float32) / 255.0
            self.images[source] = picture**2.2
        return self.images[source]

    def worlds(self, moved: dict[int, dict[str, np.ndarray]] | None = None) -> dict[int, Matrix]:
        """Return each node's matrix to the scene; `moved` replaces translations, rotations and scales of nodes."""
        nodes, out = self.json["nodes"], {}
        stack = [(root, np.eye(4)) for root in self.json["scenes"][0]["nodes"]]
        while stack:
            index, above = stack.pop()
            out[index] = above @ local({**nodes[index], **(moved or {}).get(index, {})})
            stack += [(child, out[index]) for child in nodes[index].get("children", ())]
        return out

    def posed(self, share: float) -> dict[int, dict[str, np.ndarray]]:
        """Return what the first animation moves at a share of its time."""
        animation = self.json["animations"][0]
        moved: dict[int, dict[str, np.ndarray]] = {}
        for channel in animation["channels"]:
            sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
            times, values = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
            key = int(np.searchsorted(times, share * times[-1]).clip(0, len(times) - 1))
            moved.setdefault(target["node"], {})[target["path"]] = values[key]
        return moved

    def colours(self, primitive: dict[str, Any], count: int) -> np.ndarray:
        """Return (red, green, blue, gloss) of each vertex."""
        material = self.json["materials"][primitive["material"]]
        surface = material.get("pbrMetallicRoughness", {})
        out = np.tile(np.array([*surface.get("baseColorFactor", (1, 1, 1, 1))[:3], 0.0], np.float32), (count, 1))
        if "baseColorTexture" in surface:
            texture = self.texture(surface["baseColorTexture"]["index"])
            channel = surface["baseColorTexture"].get("texCoord", 0)
            uv = self.array(primitive["attributes"][f"TEXCOORD_{channel}"]) % 1.0
            height, width = texture.shape[:2]
            rows, columns = (uv[:, 1] * (height - 1)).astype(int), (uv[:, 0] * (width - 1)).astype(int)
            out[:, :3] *= texture[rows, columns]
        if "glass" in material["name"]:
            out[:, :3] = (0.015, 0.02, 0.026)
        out[:, 3] = 0.5 * (1.0 - surface.get("roughnessFactor", 1.0)) + 0.2
        return out

    def mesh(self, share: float | None = None) -> Mesh:
        """Return all triangles in the scene, z up; with its skin at a share of its animation."""
        worlds = self.worlds(self.posed(share) if share is not None else None)
        parts = []
        for index, node in enumerate(self.json["nodes"]):
            for primitive in self.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
                names = primitive["attributes"]
                points, normals = self.array(names["POSITION"]), self.array(names["NORMAL"])
                to_scene = self._skin(node, names, worlds) if "skin" in node else worlds[index][None]
                turn = to_scene[:, :3, :3]
                points = (
                    np.einsum("nij,nj->ni", np.broadcast_to(turn, (len(points), 3, 3)), points) + to_scene[:, :3, 3]
                )
                normals = np.einsum("nij,nj->ni", np.broadcast_to(turn, (len(points), 3, 3)), normals)
                normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-9)
                rows = np.hstack([zup(points), zup(normals), self.colours(primitive, len(points))])
                parts.append(rows[self.array(primitive["indices"])[:, 0]])
        return np.concatenate(parts).astype(np.float32)

    def _skin(self, node: dict[str, Any], names: dict[str, int], worlds: dict[int, Matrix]) -> Matrix:
        skin = self.json["skins"][node["skin"]]
        inverse = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        joints = np.stack([worlds[joint] for joint in skin["joints"]]) @ inverse
        which, weights = self.array(names["JOINTS_0"]).astype(int), self.array(names["WEIGHTS_0"])
        return np.einsum("nk,nkij->nij", weights, joints[which])


def local(node: dict[str, Any]) -> Matrix:
    """Return a node's matrix to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    out[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return out


def zup(rows: np.ndarray) -> np.ndarray:
    """Return vectors of a frame with y up in one with z up."""
    return np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1)


def scaled(mesh: Mesh, factor: float) -> Mesh:
    out = mesh.copy()
    out[:, :3] *= factor
    return out


def grounded(mesh: Mesh) -> Mesh:
    """Return the mesh with the middle of its footprint at the origin."""
    out = mesh.copy()
    low, high = out[:, :3].min(axis=0), out[:, :3].max(axis=0)
    out[:, :3] -= [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    return out


def vehicle(folder: Path, name: str, length_m: float, radius: float, half: float, axles: Sequence[float]) -> Mesh:
    """Return a vehicle on its wheels, in metres, ahead along y."""
    body = Document(folder / "vehicle" / name / "vehicle.gltf").mesh()
    parts = [scaled(body, length_m / float(np.ptp(body[:, 1])))]
    for end, y in zip(("front", "back"), axles, strict=True):
        tyre = Document(folder / "vehicle" / name / f"right_tire_{end}.gltf").mesh()
        tyre = scaled(tyre, radius / float(np.abs(tyre[:, 2]).max()))
        other = tyre.copy()
        other[:, [0, 3]] *= -1.0
        parts += [placed(tyre, half, y, radius), placed(other, -half, y, radius)]
    return grounded(np.concatenate(parts))


def placed(mesh: Mesh, *offset: float) -> Mesh:
    out = mesh.copy()
    out[:, :3] += np.array(offset, np.float32)
    return out


def reference_models(package: Path) -> dict[str, list[Mesh]]:
    """Return the reference of each kind, from the folder in which the package was installed."""
    folder = package / "metadrive" / "assets" / "models"
    made = {name: vehicle(folder, *row[:4], row[4:]) for name, row in VEHICLES.items()}
    man = Document(folder / "pedestrian" / "scene.gltf")
    walk = [grounded(scaled(man.mesh(share), 0.01)) for share in (0.1, 0.35, 0.6, 0.85)]
    truck = [made["light truck"]]
    return {"car": [made["Beetle"], made["sports car"]], "truck": truck, "delivery_van": truck, "person": walk}
