"""The city as one `foxglove.SceneUpdate`.

A city has a hundred thousand vertices. They are encoded in bulk, 29 bytes each; the protobuf library, which is slow per
field, encodes only the messages that enclose them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive

from lingjing.trace.surroundings import CityMesh
from lingjing.trace.wire import DOUBLE, field, tag

POINT = np.dtype(
    [("tag", "u1"), ("length", "u1"), ("x_tag", "u1"), ("x", "<f8"), ("y_tag", "u1"), ("y", "<f8"), ("z_tag", "u1"),
     ("z", "<f8")]
)  # fmt: skip
"""One element of `TriangleListPrimitive.points`: tag and length, then three fixed64 fields, each with its tag."""

_CENTIMETRE = 2
"""Decimals of a coordinate in metres. Rounded coordinates compress to a third of the size."""


def city_update(meshes: Iterable[CityMesh], frame: str) -> bytes:
    """Return the encoded update: one entity `city/<layer>/<number>` per mesh, in `frame`, without an expiry time."""
    entities = SceneUpdate.DESCRIPTOR.fields_by_name["entities"].number
    return b"".join(
        field(entities, _entity(mesh, f"city/{mesh.layer}/{number}", frame)) for number, mesh in enumerate(meshes)
    )


def _entity(mesh: CityMesh, name: str, frame: str) -> bytes:
    head = SceneEntity(id=name, frame_id=frame)
    head.timestamp.seconds = 0
    head.metadata.add(key="layer", value=mesh.layer)
    triangles = SceneEntity.DESCRIPTOR.fields_by_name["triangles"].number
    return bytes(head.SerializeToString(deterministic=True)) + field(triangles, _triangles(mesh))


def _triangles(mesh: CityMesh) -> bytes:
    head = TriangleListPrimitive()
    head.pose.orientation.w = 1.0
    head.color.r, head.color.g, head.color.b = mesh.colour
    head.color.a = 1.0
    indices = TriangleListPrimitive.DESCRIPTOR.fields_by_name["indices"].number
    return (
        bytes(head.SerializeToString(deterministic=True))
        + _points(mesh.points)
        + field(indices, mesh.triangles.astype("<u4").tobytes())  # packed fixed32
    )


def _points(points: npt.NDArray[np.float64]) -> bytes:
    encoded = np.zeros(len(points), POINT)
    encoded["tag"] = tag(TriangleListPrimitive.DESCRIPTOR.fields_by_name["points"].number, 2)
    encoded["length"] = POINT.itemsize - 2
    for number, axis in enumerate("xyz", 1):
        encoded[f"{axis}_tag"] = tag(number, DOUBLE)
        encoded[axis] = points[:, number - 1].round(_CENTIMETRE)
    return encoded.tobytes()
