"""Encoding and decoding of pictures: JPEG for colour, an indexed PNG for class ids, float32 metres for depth, uint16
for instances.

Pillow encodes JPEG and PNG. At 1080p it is as fast as OpenCV (5.6 ms to decode, 7 ms to encode) and has no thread
pool, so the world process may import this module before it forks. All functions are single-threaded and deterministic
for one set of library versions.

Depth is in metres, because the tools that open a trace expect metres. It is rounded to whole centimetres: the bytes
then repeat, and a chunk compresses to between a quarter and a ninth of its unrounded size. Beyond 83 km the resolution
of float32 is coarser than that. Depth is infinite where a ray hits nothing. The camera's process rounds it
(`quantise_depth`), so policies receive the stored depth, not the original.
"""

from __future__ import annotations

import io
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lingjing.errors import LingjingError

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

JPEG_QUALITY = 90
"""Pillow's quality scale, 1 to 95. Chosen."""
DEPTH_STEP_M = 0.01
"""Resolution of the stored depth. Chosen for compression, see above."""
MOST_PIXELS = 2**26
"""Limit of one decoded picture. Chosen: 8K has half as many. A small JPEG can declare gigabytes of pixels."""

RgbPixels = npt.NDArray[np.uint8]
"""(height, width, 3)."""
Depth = npt.NDArray[np.float32]
"""(height, width), metres, infinite where a ray hits nothing."""
Semantic = npt.NDArray[np.uint8]
"""(height, width), class ids."""
Instances = npt.NDArray[np.uint16]
"""(height, width), numbers of entities, 0 where there is none."""


def encode_jpeg(rgb: RgbPixels, quality: int = JPEG_QUALITY) -> bytes:
    """Return `rgb` as a baseline JPEG with 4:2:0 chroma subsampling and no metadata."""
    import PIL.Image

    out = io.BytesIO()
    PIL.Image.fromarray(rgb).save(out, "JPEG", quality=quality)
    return out.getvalue()


def decode_jpeg(data: bytes) -> RgbPixels:
    """Return the pixels, writable and contiguous. Raises `LingjingError` for a broken image."""
    image = _open(data, "JPEG")
    return np.array(image if image.mode == "RGB" else image.convert("RGB"))  # `convert` would copy it


def encode_depth(depth: Depth) -> bytes:
    """Return a depth of `quantise_depth` as little-endian float32, row by row.

    It is not compressed here, because the chunks of the trace are (0.1 to 0.5 MB for 1080p over a city).
    """
    return depth.astype("<f4", copy=False).tobytes()


def decode_depth(data: bytes, width: int, height: int) -> Depth:
    """Return the stored depth. Raises `LingjingError` if `data` has another size."""
    if len(data) != 4 * width * height:
        raise LingjingError(f"a depth image of {width} by {height} has {4 * width * height} bytes, not {len(data)}")
    return np.frombuffer(data, "<f4").reshape(height, width).astype(np.float32)


def quantise_depth(depth: Depth) -> Depth:
    """Return the depth in whole centimetres, negative values as 0 and NaN as infinity.

    `decode_depth` returns it as `encode_depth` was given it.
    """
    metres: Depth = np.rint(depth * np.float32(1.0 / DEPTH_STEP_M))
    np.maximum(metres, np.float32(0.0), out=metres)
    metres *= np.float32(DEPTH_STEP_M)
    metres[np.isnan(metres)] = np.inf
    return metres


def encode_semantic(semantic: Semantic) -> bytes:
    """Return class ids as an indexed PNG. Its palette gives neighbouring ids different colours."""
    import PIL.Image

    image = PIL.Image.fromarray(semantic)
    image.putpalette(_palette())
    out = io.BytesIO()
    image.save(out, "PNG", compress_level=2)
    return out.getvalue()


def decode_semantic(data: bytes) -> Semantic:
    """Return the class ids. Raises `LingjingError` for a broken image."""
    return np.array(_open(data, "PNG"))


def encode_instances(instances: Instances) -> bytes:
    """Return numbers of entities as little-endian uint16, row by row. The chunks of the trace compress them."""
    return instances.astype("<u2", copy=False).tobytes()


def decode_instances(data: bytes, width: int, height: int) -> Instances:
    """Return the numbers of entities. Raises `LingjingError` if `data` has another size."""
    if len(data) != 2 * width * height:
        raise LingjingError(f"an instance mask of {width} by {height} has {2 * width * height} bytes, not {len(data)}")
    return np.frombuffer(data, "<u2").reshape(height, width).astype(np.uint16)


def _open(data: bytes, kind: str) -> ImageFile:
    import PIL.Image

    try:
        image = PIL.Image.open(io.BytesIO(data), formats=(kind,))
        if image.width * image.height > MOST_PIXELS:
            raise ValueError(f"{image.width} by {image.height} pixels")
        image.load()
    except (OSError, SyntaxError, ValueError, PIL.Image.DecompressionBombError) as error:
        raise LingjingError(f"broken {kind} image of {len(data)} bytes: {error}") from error
    return image


@lru_cache(maxsize=1)
def _palette() -> bytes:
    """Return 256 RGB colours: black for id 0, then hues in golden-ratio steps, which separate consecutive ids."""
    import colorsys

    colours = [(0.0, 0.0, 0.0)] + [colorsys.hsv_to_rgb(i * 0.618034 % 1.0, 0.65, 0.95) for i in range(1, 256)]
    return bytes(round(255 * channel) for colour in colours for channel in colour)
