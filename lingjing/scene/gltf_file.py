"""Baking of a `.gltf` file (glTF 2.0, as text) with its buffers and textures into triangles with vertex colours.

A skinned mesh is baked in one pose of the file's first animation. The colours are the base colours of the materials:
a factor times the texel at the vertex. Metres or not, the file's unit is kept.
"""

from __future__ import annotations

import base64
import binascii
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.decoding import from_json
from lingjing.errors import UsageError

MOST_BYTES = 64 << 20
"""Largest file that belongs to a model, bytes (chosen)."""

_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_DATA = "data:"
_Array = npt.NDArray[Any]
_Moves = Mapping[int, Mapping[str, _Array]]


@dataclass(frozen=True, slots=True)
class BakedMesh:
    """Triangles in the frame of the file: y up, its own unit. Three vertices a triangle, none shared."""

    points: npt.NDArray[np.float32]
    """(3 × triangles, 3)."""
    normals: npt.NDArray[np.float32]
    """(3 × triangles, 3), of length 1."""
    colours: npt.NDArray[np.float32]
    """(3 × triangles, 3), linear red, green and blue, 0 to 1."""
    materials: tuple[tuple[str, int], ...]
    """Name of each part's material and the number of its vertices, in order."""
    roughness: npt.NDArray[np.float32]
    """(3 × triangles,), 0 to 1."""


class GltfFile:
    """A `.gltf` file with its buffers and textures."""

    def __init__(self, path: Path) -> None:
        """Read a file and its buffers. Raises `UsageError` for one that cannot be read."""
        self.path = path
        try:
            self._json: dict[str, Any] = from_json(_read(path), dict[str, Any])
            self._buffers: list[bytes] = [self._bytes(buffer["uri"]) for buffer in self._json.get("buffers", ())]
        except (msgspec.DecodeError, KeyError, TypeError, AttributeError, RecursionError):
            raise _damaged(path) from None
        self._images: dict[int, _Array] = {}

    @property
    def credits(self) -> Mapping[str, Any]:
        """The extras of the file's `asset`: `title`, `author`, `source` and `license`, if it names them."""
        asset = self._json.get("asset")
        extras = asset.get("extras") if isinstance(asset, dict) else None
        return extras if isinstance(extras, dict) else {}

    def bake(self, share: float | None = None) -> BakedMesh:
        """Return all triangles, in the pose at a share of the first animation's time, or without animation.

        Raises `UsageError` for a damaged file, and for an animation that is not there.
        """
        if share is not None and not self._json.get("animations"):
            raise UsageError(f"the model `{self.path}` has no animation to take a pose from")
        try:
            return self._baked(share)
        except UsageError:
            raise
        except (AttributeError, IndexError, KeyError, TypeError, ValueError, SyntaxError, OSError, RecursionError):
            raise _damaged(self.path) from None

    def _baked(self, share: float | None) -> BakedMesh:
        worlds = self._worlds({} if share is None else self._pose(share))
        points, normals, colours, roughness, materials = [], [], [], [], []
        for index, node in enumerate(self._json["nodes"]):
            if "mesh" not in node or index not in worlds:
                continue
            for part in self._json["meshes"][node["mesh"]]["primitives"]:
                names, material = part["attributes"], self._json["materials"][part["material"]]
                place = self._skin(node, names, worlds) if "skin" in node else worlds[index][None]
                corners = self._array(part["indices"])[:, 0]
                at = self._array(names["POSITION"])
                turned = _turned(place[:, :3, :3], self._array(names["NORMAL"]))
                points.append((_turned(place[:, :3, :3], at) + place[:, :3, 3])[corners])
                normals.append((turned / np.linalg.norm(turned, axis=1, keepdims=True).clip(1e-9))[corners])
                colours.append(self._colours(material, names, len(at))[corners])
                surface = material.get("pbrMetallicRoughness", {})
                roughness.append(np.full(len(corners), surface.get("roughnessFactor", 1.0)))
                materials.append((str(material.get("name", "")), len(corners)))
        whole = [np.concatenate(part).astype(np.float32) for part in (points, normals, colours, roughness)]
        if not np.isfinite(whole[0]).all():
            raise ValueError("a vertex has no place")
        return BakedMesh(whole[0], whole[1], whole[2], tuple(materials), whole[3])

    def _bytes(self, uri: str) -> bytes:
        """Return what a `uri` names. Nothing outside of the file's folder is read."""
        if uri.startswith(_DATA):
            try:
                return bytes(base64.b64decode(uri.split(",", 1)[1], validate=True))
            except (IndexError, binascii.Error):
                raise _damaged(self.path) from None
        file = (self.path.parent / uri).resolve()
        if not file.is_relative_to(self.path.parent.resolve()):
            raise UsageError(f"the model `{self.path}` refers to a file outside of its folder")
        return _read(file)

    def _view(self, index: int) -> bytes:
        view = self._json["bufferViews"][index]
        start, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        return self._buffers[int(view["buffer"])][start : start + length]

    def _array(self, index: int) -> _Array:
        """Return an accessor's values, (n, width)."""
        accessor = self._json["accessors"][index]
        kind, width = np.dtype(_KINDS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        count, step = int(accessor["count"]), kind.itemsize * width
        stride = int(self._json["bufferViews"][accessor["bufferView"]].get("byteStride", step))
        raw = np.frombuffer(self._view(accessor["bufferView"]), "u1")[accessor.get("byteOffset", 0) :]
        if count < 1 or stride < step or (count - 1) * stride + step > len(raw):
            raise ValueError("an accessor lies outside of its data")
        rows = np.lib.stride_tricks.as_strided(raw, (count, step), (stride, 1))
        return np.ascontiguousarray(rows).view(kind)

    def _texture(self, index: int) -> _Array:
        """Return a texture's picture in linear colours, (height, width, 3)."""
        import PIL.Image

        source = self._json["textures"][index]["source"]
        if source not in self._images:
            image = self._json["images"][source]
            raw = self._view(image["bufferView"]) if "bufferView" in image else self._bytes(image["uri"])
            picture = np.asarray(PIL.Image.open(io.BytesIO(raw)).convert("RGB"), np.float32) / 255.0
            self._images[source] = picture**2.2
        return self._images[source]

    def _colours(self, material: Mapping[str, Any], names: Mapping[str, int], count: int) -> _Array:
        """Return the linear base colour of each vertex, (n, 3)."""
        surface = material.get("pbrMetallicRoughness", {})
        out = np.tile(np.array(surface.get("baseColorFactor", (1, 1, 1, 1))[:3], np.float32), (count, 1))
        if "baseColorTexture" in surface:
            picture = self._texture(surface["baseColorTexture"]["index"])
            places = self._array(names[f"TEXCOORD_{surface['baseColorTexture'].get('texCoord', 0)}"]) % 1.0
            height, width = picture.shape[:2]
            out *= picture[(places[:, 1] * (height - 1)).astype(int), (places[:, 0] * (width - 1)).astype(int)]
        return out

    def _worlds(self, moves: _Moves) -> dict[int, _Array]:
        """Return each node's matrix to the scene; `moves` replaces translations, rotations and scales of nodes."""
        nodes, out = self._json["nodes"], {}
        stack = [(root, np.eye(4)) for root in self._json["scenes"][0]["nodes"]]
        while stack:
            index, above = stack.pop()
            if index in out:
                raise ValueError("a node has two parents")
            out[index] = above @ _local({**nodes[index], **moves.get(index, {})})
            stack += [(child, out[index]) for child in nodes[index].get("children", ())]
        return out

    def _pose(self, share: float) -> _Moves:
        """Return what the first animation moves at a share of its time."""
        animation = self._json["animations"][0]
        moved: dict[int, dict[str, _Array]] = {}
        for channel in animation["channels"]:
            sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
            times, values = self._array(sampler["input"])[:, 0], self._array(sampler["output"])
            key = int(np.searchsorted(times, share * times[-1]).clip(0, len(times) - 1))
            moved.setdefault(target["node"], {})[target["path"]] = values[key]
        return moved

    def _skin(self, node: Mapping[str, Any], names: Mapping[str, int], worlds: Mapping[int, _Array]) -> _Array:
        """Return the matrix of each vertex of a skinned mesh, (n, 4, 4)."""
        skin = self._json["skins"][node["skin"]]
        inverse = self._array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        joints = np.stack([worlds[joint] for joint in skin["joints"]]) @ inverse
        which, weights = self._array(names["JOINTS_0"]).astype(int), self._array(names["WEIGHTS_0"])
        placed: _Array = np.einsum("nk,nkij->nij", weights, joints[which])
        return placed


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise UsageError(f"`{path}` is too large", hint=f"at most {MOST_BYTES >> 20} MB are read")
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from None


def _damaged(path: Path) -> UsageError:
    return UsageError(f"the model `{path}` is damaged", hint="install its package again")


def _turned(turns: _Array, points: _Array) -> _Array:
    """Points turned by one matrix each, or all by the same."""
    out: _Array = np.einsum("nij,nj->ni", np.broadcast_to(turns, (len(points), 3, 3)), points)
    return out


def _local(node: Mapping[str, Any]) -> _Array:
    """Return a node's matrix to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = _numbers(node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    out[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return out


def _numbers(values: Sequence[float]) -> list[float]:
    return [float(value) for value in values]


__all__ = ["BakedMesh", "GltfFile"]
