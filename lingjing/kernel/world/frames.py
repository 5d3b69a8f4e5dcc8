"""The conversion of a drawn picture to its stored form: validated, encoded as JPEG, its depth rounded, hashed.

It runs in the camera's process, so that an uncompressed picture never crosses a process border.
"""

from __future__ import annotations

import hashlib
from functools import cache

import msgspec
import numpy as np

from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.guarded_calls import engine_error
from lingjing.plugins.engine import CaptureRequest, Frame
from lingjing.trace.images import encode_jpeg, quantise_depth
from lingjing.trace.records import FrameInfo


def stored(engine: str, frame: Frame, request: CaptureRequest) -> StoredFrame:
    """Return `frame` in its stored form. Raises `InfrastructureError` if it does not answer `request` or has wrong
    arrays.
    """
    _check(engine, frame, request)
    jpeg = encode_jpeg(frame.rgb, frame.quality)
    info = msgspec.structs.replace(
        frame.info, sha256=hashlib.sha256(jpeg).hexdigest(), channels_sha256=_channels_sha256(frame)
    )
    depth = None if frame.depth is None else quantise_depth(frame.depth)
    return StoredFrame(info, jpeg, depth, frame.semantic, frame.instance)


def described(engine: str, frame: Frame, request: CaptureRequest) -> StoredFrame:
    """Return `without_pixels` of `frame`. Raises `InfrastructureError` under the conditions of `stored`."""
    _check(engine, frame, request)
    return without_pixels(frame.info)


def without_pixels(info: FrameInfo) -> StoredFrame:
    """Return the metadata of a picture (pose, boxes) with a single black pixel as its image."""
    return StoredFrame(info, _black())


@cache
def _black() -> bytes:
    return encode_jpeg(np.zeros((1, 1, 3), np.uint8))


def _check(engine: str, frame: Frame, request: CaptureRequest) -> None:
    _check_identity(engine, frame, request)
    _check_arrays(engine, frame)


def _channels_sha256(frame: Frame) -> str:
    """Return one hash of depth, class ids and instances, so that digests of policy inputs cover all pixels; "" without
    such channels.
    """
    layers = [layer for layer in (frame.depth, frame.semantic, frame.instance) if layer is not None]
    if not layers:
        return ""
    whole = hashlib.sha256()
    for layer in layers:
        whole.update(np.ascontiguousarray(layer).data)
    return whole.hexdigest()


def _check_identity(engine: str, frame: Frame, request: CaptureRequest) -> None:
    info = frame.info
    wanted = (request.frame, request.entity, request.camera, request.tick)
    if (info.id, info.entity, info.camera, info.tick) != wanted:
        raise engine_error(
            engine, "capture", f"it drew `{info.id}` of `{info.entity}` when asked for `{request.frame}`"
        )


def _check_arrays(engine: str, frame: Frame) -> None:
    height, width = frame.rgb.shape[:2]
    layers = (
        ("rgb", frame.rgb, np.uint8, (height, width, 3)),
        ("depth", frame.depth, np.float32, (height, width)),
        ("semantic", frame.semantic, np.uint8, (height, width)),
        ("instance", frame.instance, np.uint16, (height, width)),
    )
    for name, array, dtype, shape in layers:
        if array is not None and (array.dtype != dtype or array.shape != shape):
            actual = f"{array.dtype} {array.shape}"
            raise engine_error(engine, "capture", f"`{name}` is {actual}, not {np.dtype(dtype)} {shape}")
