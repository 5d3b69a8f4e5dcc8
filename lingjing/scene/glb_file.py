"""Checks of a `.glb` file (glTF 2.0, binary) before a library reads it: size, structure, textures, extensions.

A file is refused by its declared counts, before anything large is decoded.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import UsageError

MOST_BYTES = 64 << 20
"""Largest file, bytes (chosen)."""
MOST_TRIANGLES = 200_000
"""Most triangles of a model with the repetitions of its meshes (chosen: a hundred times a vehicle of the camera)."""
MOST_CREDIT = 1000
"""Most characters of a credit; the rest is cut off (chosen)."""
MOST_NODES = 10_000
"""Most nodes of a model (chosen)."""
READ = ("KHR_materials_", "KHR_texture_transform", "KHR_mesh_quantization")
"""Beginnings of the names of extensions that a file may require: colours and places stay right without them or are
read."""

_HEAD = struct.Struct("<4sII")
_CHUNK = struct.Struct("<II")
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_TRIANGLES = 4
_Part = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class GlbFile:
    """The bytes of a file that has passed the checks."""

    path: str
    data: bytes
    sha256: str
    textures: tuple[bytes, ...]
    """The image files of its base colours."""
    credit: str = ""
    """The credit that its description names, in one line; "" if it names none."""


def glb_fault(path: str, why: str, hint: str = "export it again as .glb (glTF 2.0)") -> UsageError:
    """Return the error for a model that cannot be used."""
    return UsageError(f"the model `{path}` {why}", hint=hint)


def read_glb(path: str) -> GlbFile:
    """Return a file after the checks. Raises `UsageError` with the first fault. A path begins in the working folder."""
    file = Path(path)
    if not file.is_file():
        why = "is no regular file" if file.exists() else "does not exist"
        raise glb_fault(path, why, "a path begins in the working folder")
    try:
        size = file.stat().st_size
        if size > MOST_BYTES:
            raise glb_fault(
                path, f"has {size >> 20} MB, and at most {MOST_BYTES >> 20} are read", "use fewer triangles"
            )
        data = file.read_bytes()
    except OSError as error:
        raise glb_fault(path, f"cannot be read: {error.strerror}", "check the file's permissions") from None
    document, binary = _chunks(path, data)
    textures = _checked(path, document, binary)
    return GlbFile(path, data, hashlib.sha256(data).hexdigest(), textures, _credit(document.get("asset")))


def _credit(asset: Any) -> str:
    """Return the credit in a description: its `copyright`, else title, author and licence of its extras, as model
    collections write them.
    """
    if not isinstance(asset, Mapping):
        return ""
    words, extras = asset.get("copyright"), asset.get("extras")
    if not words and isinstance(extras, Mapping) and (extras.get("author") or extras.get("license")):
        title, author, licence = (str(extras.get(key, "unnamed")) for key in ("title", "author", "license"))
        words = f"“{title}” by {author}, {licence}"
    return " ".join(str(words or "").split())[:MOST_CREDIT]


def _chunks(path: str, data: bytes) -> tuple[_Part, bytes]:
    """Return the JSON of a file and its binary part."""
    if len(data) < _HEAD.size + _CHUNK.size or data[:4] != b"glTF":
        raise glb_fault(path, "is no binary glTF file")
    _, version, length = _HEAD.unpack_from(data)
    if version != 2:
        raise glb_fault(path, f"is glTF {version}, and glTF 2 is read")
    if length > len(data):
        raise glb_fault(path, f"is cut: it has {len(data)} of {length} bytes", "copy it again")
    size, kind = _CHUNK.unpack_from(data, _HEAD.size)
    start = _HEAD.size + _CHUNK.size
    if kind != _JSON or start + size > len(data):
        raise glb_fault(path, "is cut or damaged in its description", "copy it again")
    try:
        document = from_json(data[start : start + size].rstrip(b"\0 "), dict[str, Any])
    except (msgspec.DecodeError, RecursionError):
        raise glb_fault(path, "is damaged in its description", "copy it again") from None
    return document, data[start + size + _CHUNK.size :]


def _checked(path: str, document: _Part, binary: bytes) -> tuple[bytes, ...]:
    """Return the textures of a file after the checks of its description."""
    try:
        _check_extensions(path, document.get("extensionsRequired", ()))
        _check_buffers(path, document, len(binary))
        _check_nodes(path, document)
        return tuple(_textures(path, document, binary))
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        raise glb_fault(path, "is damaged: a part of its description refers to nothing") from None


def _check_extensions(path: str, required: Sequence[str]) -> None:
    for name in required:
        if not str(name).startswith(READ):
            raise glb_fault(path, f"needs the extension {str(name)[:40]}, which is not read", "export it without it")


def _check_buffers(path: str, document: _Part, binary: int) -> None:
    for buffer in document.get("buffers", ()):
        if "uri" in buffer:
            raise glb_fault(path, "refers to data in another file", "export it as one .glb with its data inside")
        if buffer["byteLength"] > binary:
            raise glb_fault(path, f"is cut: it has {binary} of {buffer['byteLength']} bytes of data", "copy it again")
    views = document.get("bufferViews", ())
    for view in views:
        if view.get("byteOffset", 0) + view["byteLength"] > document["buffers"][view["buffer"]]["byteLength"]:
            raise glb_fault(path, "is damaged: a part of its data lies outside of the file")
    for accessor in document.get("accessors", ()):
        count = accessor["count"]
        if not 0 <= count <= 3 * MOST_TRIANGLES:
            raise glb_fault(path, f"is too large: a part of it has {count} values", "use fewer triangles")
        if (
            "bufferView" in accessor
            and accessor.get("byteOffset", 0) + count > views[accessor["bufferView"]]["byteLength"]
        ):
            raise glb_fault(path, f"is damaged: a part of it has fewer than its {count} values")  # a byte each at least


def _textures(path: str, document: _Part, binary: bytes) -> Iterator[bytes]:
    """Yield the image of every base colour's texture. It must be inside of the file."""
    images, textures = document.get("images", ()), document.get("textures", ())
    for material in document.get("materials", ()):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if texture is None:
            continue
        place = textures[texture["index"]].get("source", -1) if 0 <= texture["index"] < len(textures) else -1
        if not 0 <= place < len(images):
            raise glb_fault(path, "lacks a texture that its material names", "export it with its textures inside")
        image = images[place]
        if "bufferView" not in image:
            name = str(image.get("uri", ""))[:60]
            raise glb_fault(path, f"lacks its texture `{name}`", "export it with its textures inside")
        view = document["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        yield binary[start : start + view["byteLength"]]


def _check_nodes(path: str, document: _Part) -> None:
    """Check that the nodes are a forest, and the number of triangles that they show."""
    nodes, meshes = document.get("nodes", ()), document.get("meshes", ())
    if len(nodes) > MOST_NODES:
        raise glb_fault(path, f"has {len(nodes)} nodes, and at most {MOST_NODES} are read", "merge its parts")
    children = [child for node in nodes for child in node.get("children", ())]
    if len(children) != len(set(children)) or any(not 0 <= child < len(nodes) for child in children):
        raise glb_fault(path, "is damaged: a node has two parents or refers to nothing")
    if len(nodes) and len(children) == len(nodes):
        raise glb_fault(path, "is damaged: its nodes are a circle")
    for animation in document.get("animations", ()):
        for channel in animation["channels"]:
            if not 0 <= channel["sampler"] < len(animation["samplers"]) or channel["target"].get("node", 0) >= len(
                nodes
            ):
                raise _lost_animation(path)
        values = (sampler[end] for sampler in animation["samplers"] for end in ("input", "output"))
        if not all(0 <= value < len(document.get("accessors", ())) for value in values):
            raise _lost_animation(path)
    counts = [sum(_triangles(part, document) for part in mesh["primitives"]) for mesh in meshes]
    total = sum(counts[node["mesh"]] for node in nodes if "mesh" in node)
    if total > MOST_TRIANGLES:
        raise glb_fault(path, f"has {total} triangles, and at most {MOST_TRIANGLES} are drawn", "use fewer triangles")
    if not total:
        raise glb_fault(path, "shows no triangles, so it has no size")


def _lost_animation(path: str) -> UsageError:
    return glb_fault(path, "is damaged: an animation refers to nothing", "export it without animations")


def _triangles(primitive: _Part, document: _Part) -> int:
    if primitive.get("mode", _TRIANGLES) < _TRIANGLES:  # points and lines
        return 0
    accessor = primitive.get("indices", primitive["attributes"]["POSITION"])
    count = document["accessors"][accessor]["count"]
    return int(count) // 3 if primitive.get("mode", _TRIANGLES) == _TRIANGLES else max(0, int(count) - 2)


__all__ = ["MOST_BYTES", "MOST_TRIANGLES", "GlbFile", "glb_fault", "read_glb"]
